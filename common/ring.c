/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "common/ring.h"

#include "common/assert.h"
#include "common/memory.h"

static unsigned char *slot(const struct ring *ring, uint32_t index)
{
	return ring->storage + (size_t)(index & (ring->count - 1u)) * ring->entry_size;
}

void *ring_room(struct ring *ring)
{
	uint32_t head = atomic_load_explicit(&ring->head, memory_order_relaxed);
	uint32_t tail = atomic_load_explicit(&ring->tail, memory_order_acquire);

	DT_ASSERT(head - tail <= ring->count);
	return head - tail == ring->count ? NULL : slot(ring, head);
}

void ring_written(struct ring *ring)
{
	uint32_t head = atomic_load_explicit(&ring->head, memory_order_relaxed);

	atomic_store_explicit(&ring->head, head + 1u, memory_order_release);
}

int ring_put(struct ring *ring, const void *entry)
{
	void *room = ring_room(ring);

	if (room == NULL)
		return DT_E_FULL;
	memcpy(room, entry, ring->entry_size);
	ring_written(ring);
	return 0;
}

int ring_get(struct ring *ring, void *entry)
{
	uint32_t tail = atomic_load_explicit(&ring->tail, memory_order_relaxed);
	uint32_t head = atomic_load_explicit(&ring->head, memory_order_acquire);

	if (head == tail)
		return DT_E_EMPTY;
	memcpy(entry, slot(ring, tail), ring->entry_size);
	atomic_store_explicit(&ring->tail, tail + 1u, memory_order_release);
	return 0;
}

uint32_t ring_fill(const struct ring *ring)
{
	return atomic_load_explicit(&ring->head, memory_order_acquire) -
	       atomic_load_explicit(&ring->tail, memory_order_acquire);
}
