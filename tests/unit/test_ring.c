/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The single-producer ring: full, empty, wrapped, past the wrap of its counters, and between two threads.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <pthread.h>
#include <sched.h>

#include "common/ring.h"

static void holds_all_it_has_room_for(void **state)
{
	static uint32_t storage[4];
	struct ring ring = RING_OVER(storage);
	uint32_t value = 77;

	(void)state;
	atomic_store(&ring.head, 0xFFFFFFFEu); /* the counters wrap inside this test */
	atomic_store(&ring.tail, 0xFFFFFFFEu);
	assert_int_equal(ring_get(&ring, &value), DT_E_EMPTY);
	assert_int_equal(value, 77);
	for (uint32_t round = 0; round < 3; round++) {
		for (uint32_t i = 0; i < 4; i++) {
			value = 10 * round + i;
			if (round == 1) {
				*(uint32_t *)ring_room(&ring) = value;
				assert_int_equal(ring_fill(&ring), i); /* not there yet */
				ring_written(&ring);
			} else {
				assert_int_equal(ring_put(&ring, &value), 0);
			}
		}
		assert_null(ring_room(&ring));
		assert_int_equal(ring_put(&ring, &value), DT_E_FULL);
		assert_int_equal(ring_fill(&ring), 4);
		for (uint32_t i = 0; i < 4; i++) {
			assert_int_equal(ring_get(&ring, &value), 0);
			assert_int_equal(value, 10 * round + i);
		}
	}
	assert_int_equal(ring_fill(&ring), 0);
}

enum { ENTRIES = 200000 };
static uint64_t shared_storage[64];
static struct ring shared = RING_OVER(shared_storage);

static void *produce(void *unused)
{
	(void)unused;
	for (uint64_t i = 0; i < ENTRIES; i++)
		while (ring_put(&shared, &i) != 0)
			sched_yield();
	return NULL;
}

static void keeps_order_between_threads(void **state)
{
	pthread_t producer;
	uint64_t value;

	(void)state;
	assert_int_equal(pthread_create(&producer, NULL, produce, NULL), 0);
	for (uint64_t expected = 0; expected < ENTRIES; expected++) {
		while (ring_get(&shared, &value) != 0)
			sched_yield();
		assert_int_equal(value, expected);
	}
	pthread_join(producer, NULL);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(holds_all_it_has_room_for),
	        cmocka_unit_test(keeps_order_between_threads),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
