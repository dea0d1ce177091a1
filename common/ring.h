/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_COMMON_RING_H
#define DT_COMMON_RING_H
/*
 * A ring of fixed-size entries between one producer and one consumer, for instance an interrupt and
 * the main loop. Lock-free: the producer writes only head, the consumer writes only tail. The storage
 * belongs to the caller. count must be a power of two; all of it can be used.
 *
 *     static struct frame storage[16];
 *     static struct ring ring = RING_OVER(storage);
 */
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"

struct ring {
	unsigned char *storage;
	uint32_t entry_size;   /* bytes */
	uint32_t count;        /* entries, a power of two */
	_Atomic uint32_t head; /* entries ever written; wraps */
	_Atomic uint32_t tail; /* entries ever read; wraps */
};

#define RING_OVER(array)                                                                         \
	{                                                                                        \
		.storage = (unsigned char *)(array), .entry_size = (uint32_t)sizeof((array)[0]), \
		.count = (uint32_t)(sizeof(array) / sizeof((array)[0]))                          \
	}

/* Producer: copies one entry in. DT_E_FULL leaves the ring as it was. */
DT_MUST_USE int ring_put(struct ring *ring, const void *entry);

/* The same without the copy: where the next entry is to be written, NULL when the ring is full, and that it
 * is. */
void *ring_room(struct ring *ring);
void ring_written(struct ring *ring);

/* Consumer: copies the oldest entry out and drops it. DT_E_EMPTY leaves *entry as it was. */
DT_MUST_USE int ring_get(struct ring *ring, void *entry);

/* Entries now in the ring; exact for the caller's own side, a bound for the other. */
uint32_t ring_fill(const struct ring *ring);

#endif
