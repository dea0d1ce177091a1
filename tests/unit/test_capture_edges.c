/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The capture ring at its limits: the time of every sample, what a lost tick looks like to the last bit, the
 * longest gap, and a second window that owes nothing to the first.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <string.h>

#include "common/crc.h"
#include "firmware/capture.h"

enum { LEVEL = 960, POST_MS = 30, PRE_MS = 10 };

static struct capture capture;
static struct parameters parameters;

static int begin(void **state)
{
	(void)state;
	parameters_init(&parameters);
	parameters.value[WIRE_PARAMETER_pre_trigger_ms] = PRE_MS;
	parameters.value[WIRE_PARAMETER_post_trigger_ms] = POST_MS;
	capture_init(&capture, &parameters);
	return 0;
}

static void fill(struct acquire_samples *samples, int16_t code)
{
	for (unsigned k = 0; k < WIRE_X_PER_TICK; k++)
		samples->x[k] = code;
	for (unsigned k = 0; k < WIRE_YZ_PER_TICK; k++)
		samples->y[k] = samples->z[k] = code;
}

static struct acquire_tick make(uint32_t tick_ms, int16_t code)
{
	struct acquire_tick tick = {
	        .tick_ms = tick_ms, .io = 0x0042, .status = {WIRE_STATE_SEPARATED, WIRE_STATE_SEPARATED}};

	for (unsigned s = 0; s < WIRE_SENSORS; s++)
		fill(&tick.sensor[s], code);
	return tick;
}

static void put(uint32_t tick_ms, int16_t code)
{
	struct acquire_tick tick = make(tick_ms, code);

	capture_put(&capture, &tick);
}

static void time_of_every_sample(void **state)
{
	static const uint32_t x_us[] = {0, 143, 286, 429, 571, 714, 857}; /* k / 7 ms, to the nearest */
	struct acquire_samples samples;

	(void)state;
	fill(&samples, LEVEL);
	assert_int_equal(capture_impact_us(&samples, LEVEL), 1000);
	for (unsigned k = 0; k < WIRE_X_PER_TICK; k++) {
		fill(&samples, -LEVEL);
		samples.x[k] = LEVEL + 1;
		assert_int_equal(capture_impact_us(&samples, LEVEL), x_us[k]);
	}
	for (unsigned k = 0; k < WIRE_YZ_PER_TICK; k++) {
		fill(&samples, 0);
		samples.y[k] = -LEVEL - 1;
		assert_int_equal(capture_impact_us(&samples, LEVEL), 100 * k);
		samples.z[0] = 32767; /* Z does not trigger */
		assert_int_equal(capture_impact_us(&samples, LEVEL), 100 * k);
	}
}

/* Any other mark is no reason to open a window. */
static void only_its_own_mark_triggers(void **state)
{
	struct acquire_tick tick;

	(void)state;
	for (unsigned bit = 0; bit < 16; bit++) {
		begin(state);
		put(99, 0);
		tick = make(100, 0);
		tick.marks = (uint16_t)(1u << bit);
		capture_put(&capture, &tick);
		assert_int_equal(capture.phase,
		                 tick.marks == WIRE_MARK_NO_IMPACT ? CAPTURE_TRIGGERED : CAPTURE_ROLLING);
	}
}

static void check_lost(uint32_t tick_ms, uint8_t status)
{
	const struct acquire_tick *lost = capture_find(&capture, tick_ms);

	assert_non_null(lost);
	assert_int_equal(lost->tick_ms, tick_ms);
	assert_int_equal(lost->io, 0x0042);
	assert_int_equal(lost->marks, WIRE_MARK_OVERRUN);
	for (unsigned s = 0; s < WIRE_SENSORS; s++) {
		assert_int_equal(lost->status[s], status);
		for (unsigned k = 0; k < WIRE_X_PER_TICK; k++)
			assert_int_equal(lost->sensor[s].x[k], -32768);
		for (unsigned k = 0; k < WIRE_YZ_PER_TICK; k++) {
			assert_int_equal(lost->sensor[s].y[k], -32768);
			assert_int_equal(lost->sensor[s].z[k], -32768);
		}
	}
}

static void lost_ticks_to_the_last_bit(void **state)
{
	struct acquire_tick tick;

	(void)state;
	put(1000, 1);
	tick = make(1003, 2);
	tick.status[0] |= WIRE_STATUS_CLIP_X | WIRE_STATUS_CLIP_Z; /* of 1003 alone */
	tick.status[1] |= WIRE_STATUS_CLIP_Y;
	tick.marks = WIRE_MARK_CLIPPED;
	capture_put(&capture, &tick);
	assert_int_equal(capture.count, 4);
	check_lost(1001, WIRE_STATE_SEPARATED);
	check_lost(1002, WIRE_STATE_SEPARATED);
	put(1004, LEVEL + 1);
	tick = make(1007, 3);
	capture_put(&capture, &tick);
	check_lost(1005, WIRE_STATE_SEPARATED | WIRE_STATUS_TRIGGERED);
	check_lost(1006, WIRE_STATE_SEPARATED | WIRE_STATUS_TRIGGERED);
	for (unsigned s = 0; s < WIRE_SENSORS; s++)
		assert_int_equal(tick.status[s], WIRE_STATE_SEPARATED | WIRE_STATUS_TRIGGERED);
	tick = make(1008, 3);
	tick.status[0] = tick.status[1] = WIRE_STATE_BRAKED;
	capture_put(&capture, &tick);
	for (unsigned s = 0; s < WIRE_SENSORS; s++)
		assert_int_equal(tick.status[s], WIRE_STATE_BRAKED | WIRE_STATUS_TRIGGERED);
}

/* What is missing for as long as the ring is filled up with lost ticks; a tick more and it begins anew. */
static void the_longest_gap(void **state)
{
	(void)state;
	for (uint32_t gap = CAPTURE_TICKS; gap <= CAPTURE_TICKS + 1; gap++) {
		begin(state);
		for (uint32_t t = 1000; t < 1005; t++)
			put(t, 1);
		put(1004 + gap, 1);
		assert_int_equal(capture.count, gap == CAPTURE_TICKS ? CAPTURE_TICKS : 1);
		assert_int_equal(capture.newest_ms, 1004 + gap);
		assert_int_equal(capture_find(&capture, 1003 + gap) != NULL, gap == CAPTURE_TICKS);
	}
}

static uint32_t crc_of(uint32_t crc, const struct acquire_tick *tick)
{
	struct frame frame;

	for (unsigned s = 0; s < WIRE_SENSORS; s++) {
		acquire_pack(tick, s, WIRE_ID_BLOCK_S1, &frame);
		crc = crc32(crc, frame.data + 10, 54);
	}
	return crc;
}

/* A window around an impact at first_ms + PRE_MS, of one value, checked; what came before must not show. */
static void check_window(uint32_t first_ms, int16_t code, uint16_t marks)
{
	uint32_t crc = CRC32_INIT;

	for (uint32_t t = first_ms; t < first_ms + PRE_MS + POST_MS; t++) {
		struct acquire_tick tick = make(t, code);

		if (t == first_ms + PRE_MS)
			tick.sensor[1].x[0] = LEVEL + 1;
		if (t == first_ms + PRE_MS + 1)
			tick.marks = marks;
		crc = crc_of(crc, &tick);
		capture_put(&capture, &tick);
	}
	assert_int_equal(capture.phase, CAPTURE_FULL);
	for (unsigned i = 1; i < PRE_MS + POST_MS; i++)
		assert_false(capture_work(&capture));
	assert_true(capture_work(&capture));
	assert_int_equal(capture.first_ms, first_ms);
	assert_int_equal(capture.crc32, crc);
	assert_int_equal(capture.marks, marks);
	assert_int_equal(capture.trigger_us, PRE_MS * 1000);
}

static void the_second_window_owes_nothing_to_the_first(void **state)
{
	int16_t zero[ACQUIRE_CHANNELS];

	(void)state;
	check_window(1000, 100, WIRE_MARK_CLIPPED);
	capture_release(&capture);
	check_window(5000, 20, WIRE_MARK_OVERRUN);
	parameters.value[WIRE_PARAMETER_post_trigger_ms] =
	        CAPTURE_ZERO_AFTER_TICKS; /* long enough to judge */
	for (unsigned i = 0; i < ACQUIRE_CHANNELS; i++)
		zero[i] = 20;
	zero[3] = 45; /* S2 X holds the impact: (279 x 20 + 961) / 280 = 23 */
	assert_false(capture_zero_shift(&capture, zero, 22));
	assert_true(capture_zero_shift(&capture, zero, 21));
}

static void no_work_without_a_window(void **state)
{
	(void)state;
	for (uint32_t t = 0; t < 5; t++) /* holds tick 0, where an unused window would begin */
		put(t, 1);
	for (unsigned i = 0; i < 5; i++)
		assert_false(capture_work(&capture));
	assert_int_equal(capture.crc32, 0);
	assert_int_equal(capture.crc_ms, 0);
	begin(state);
	check_window(1000, 1, 0);
	assert_false(capture_work(&capture));
	assert_int_equal(capture.crc_ms, 1000 + PRE_MS + POST_MS);
}

static void zero_of_few_samples(void **state)
{
	static const int16_t before[ACQUIRE_CHANNELS];

	(void)state;
	parameters.value[WIRE_PARAMETER_post_trigger_ms] = CAPTURE_ZERO_AFTER_TICKS;
	assert_false(capture_zero_shift(&capture, before, 0)); /* none at all tell nothing */
	capture.zero[4].count = 1;
	capture.zero[4].sum = 1;
	assert_true(capture_zero_shift(&capture, before, 0));
	assert_false(capture_zero_shift(&capture, before, 1));
	capture.zero[4].sum = -2;
	assert_true(capture_zero_shift(&capture, before, 1));
	assert_false(capture_zero_shift(&capture, before, 2));
}

#define TEST(name) cmocka_unit_test_setup(name, begin)

int main(void)
{
	const struct CMUnitTest tests[] = {
	        TEST(time_of_every_sample),
	        TEST(only_its_own_mark_triggers),
	        TEST(lost_ticks_to_the_last_bit),
	        TEST(the_longest_gap),
	        TEST(the_second_window_owes_nothing_to_the_first),
	        TEST(no_work_without_a_window),
	        TEST(zero_of_few_samples),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
