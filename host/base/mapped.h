/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_BASE_MAPPED_H
#define DT_HOST_BASE_MAPPED_H
/*
 * Recordings that are larger than memory: files mapped to be read, and arrays that lie in a temporary file.
 * Who goes through them says how much of them was looked at (mapped_seen), and now and then all of it leaves
 * this process; what is looked at again comes back. Small ones are plain memory, and the first large ones lie
 * in MAPPED_STAY bytes that stay and are used again: pages of a file cost the system more than to go through
 * them.
 *
 * The temporary file lies in $TMPDIR, else /var/tmp, has no name and its room from the beginning on. When a
 * mapped file becomes shorter, the program ends with a message and 3: there is no way back from that.
 * Any thread.
 */
#include <stddef.h>

enum {
	MAPPED_LEAST = 1 << 21, /* bytes that are worth it */
	MAPPED_STEP = 1 << 22,  /* between two leavings */
	MAPPED_STAY = 24 << 20,
};

/* All of a regular file, never to be written to; NULL where it cannot be mapped. */
char *mapped_file(int descriptor, size_t size);

/* count elements of any value: in memory where the disk has no room. NULL without memory. */
void *mapped_array(size_t count, size_t size);

/* The same with another count than it holds; NULL leaves it as it was. */
void *mapped_array_resize(void *array, size_t held, size_t count, size_t size);

/* Memory for a while: that which stays, where there is room in it. NULL without. */
void *mapped_work(size_t bytes);

/* Any of them, or what malloc gave. */
void mapped_free(void *memory);

void mapped_seen(size_t bytes);

#endif
