/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The capture ring: the window around a trigger, its time to the sample, its CRC-32 against one computed bit
 * by bit from the samples as the test made them, lost ticks, and what the ring holds.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <string.h>

#include "firmware/capture.h"

enum { LEVEL = 960 };

static struct capture capture;
static struct parameters parameters;

static int begin(void **state)
{
	(void)state;
	parameters_init(&parameters);
	capture_init(&capture, &parameters);
	return 0;
}

/* Any function of tick, sensor, axis and sample that stays below the trigger level. */
static int16_t sample(uint32_t tick_ms, unsigned sensor, unsigned axis, unsigned k)
{
	return (int16_t)((tick_ms * 31 + sensor * 7 + axis * 131 + k * 17) % 1801) - 900;
}

static struct acquire_tick make(uint32_t tick_ms, unsigned state)
{
	struct acquire_tick tick = {.tick_ms = tick_ms, .drop_id = 1, .io = 0x0042};

	for (unsigned s = 0; s < 2; s++) {
		tick.status[s] = (uint8_t)state;
		for (unsigned k = 0; k < 7; k++)
			tick.sensor[s].x[k] = sample(tick_ms, s, 0, k);
		for (unsigned k = 0; k < 10; k++) {
			tick.sensor[s].y[k] = sample(tick_ms, s, 1, k);
			tick.sensor[s].z[k] = sample(tick_ms, s, 2, k);
		}
	}
	return tick;
}

static struct acquire_tick put(uint32_t tick_ms, unsigned state)
{
	struct acquire_tick tick = make(tick_ms, state);

	capture_put(&capture, &tick);
	return tick;
}

/* IEEE 802.3, one bit at a time. */
static uint32_t crc_byte(uint32_t crc, uint8_t byte)
{
	crc ^= byte;
	for (int i = 0; i < 8; i++)
		crc = crc >> 1 ^ (crc & 1 ? 0xEDB88320u : 0);
	return crc;
}

static uint32_t crc_sample(uint32_t crc, int16_t code)
{
	return crc_byte(crc_byte(crc, (uint8_t)((uint16_t)code & 0xFF)), (uint8_t)((uint16_t)code >> 8));
}

static uint32_t crc_block(uint32_t crc, const struct acquire_samples *samples)
{
	for (unsigned k = 0; k < 7; k++)
		crc = crc_sample(crc, samples->x[k]);
	for (unsigned k = 0; k < 10; k++)
		crc = crc_sample(crc, samples->y[k]);
	for (unsigned k = 0; k < 10; k++)
		crc = crc_sample(crc, samples->z[k]);
	return crc;
}

static void finish_crc(void)
{
	unsigned steps = 0;

	while (!capture_work(&capture))
		if (++steps > CAPTURE_TICKS)
			fail_msg("the CRC is not done after %u steps", steps);
	assert_int_equal(capture.phase, CAPTURE_COMPLETE);
}

static void window_and_crc(void **state)
{
	struct acquire_tick tick;
	uint32_t crc = 0xFFFFFFFFu;

	(void)state;
	for (uint32_t t = 0; t < 1000; t++)
		put(t, WIRE_STATE_SEPARATED);
	assert_int_equal(capture.phase, CAPTURE_ROLLING);
	tick = make(1000, WIRE_STATE_SEPARATED);
	tick.sensor[1].x[3] = -LEVEL - 1;
	tick.sensor[1].y[7] = 5000;
	capture_put(&capture, &tick);
	assert_int_equal(capture.phase, CAPTURE_TRIGGERED);
	assert_int_equal(tick.status[0], WIRE_STATE_SEPARATED | WIRE_STATUS_TRIGGERED);
	for (uint32_t t = 1001; t <= 1399; t++) {
		assert_int_equal(capture.phase, CAPTURE_TRIGGERED);
		assert_false(capture_work(&capture));
		put(t, WIRE_STATE_BRAKED);
	}
	assert_int_equal(capture.phase, CAPTURE_FULL);
	assert_int_equal(capture.first_ms, 900);
	assert_int_equal(capture.last_ms, 1399);
	assert_int_equal(capture.trigger_us, 100 * 1000 + 429); /* 3/7 ms */
	for (uint32_t t = 1400; t < 3000; t++)
		put(t, WIRE_STATE_CAPTURED); /* stands still */
	finish_crc();
	for (uint32_t t = 900; t < 1400; t++) {
		tick = make(t, 0);
		if (t == 1000) {
			tick.sensor[1].x[3] = -LEVEL - 1;
			tick.sensor[1].y[7] = 5000;
		}
		crc = crc_block(crc_block(crc, &tick.sensor[0]), &tick.sensor[1]);
	}
	assert_int_equal(capture.crc32, ~crc);
	assert_false(capture_work(&capture));
	assert_non_null(capture_find(&capture, 900));
	assert_non_null(capture_find(&capture, 1399));
	assert_null(capture_find(&capture, 1400));
	assert_null(capture_find(&capture, 1399 - CAPTURE_TICKS));
	capture_release(&capture);
	assert_null(capture_find(&capture, 1399));
	put(3000, WIRE_STATE_UPLOADED);
	assert_non_null(capture_find(&capture, 3000));
	assert_null(capture_find(&capture, 2999));
}

static void trigger_time_is_the_first_sample_beyond(void **state)
{
	/* axis 0 X, 1 Y; X sample k at k/7 ms, Y at k/10 ms, in whole us */
	static const struct {
		unsigned axis, k;
		int16_t code;
		uint32_t us;
	} hits[] = {
	        {0, 0, 961, 0}, {0, 1, 961, 143},  {0, 2, -961, 286},   {0, 6, 32767, 857},
	        {1, 0, 961, 0}, {1, 1, -961, 100}, {1, 9, -32767, 900}, {1, 5, 961, 500},
	};

	(void)state;
	for (size_t i = 0; i < sizeof(hits) / sizeof(hits[0]); i++) {
		struct acquire_tick tick;

		begin(NULL);
		for (uint32_t t = 0; t < 200; t++)
			put(t, WIRE_STATE_BRAKED);
		tick = make(200, WIRE_STATE_BRAKED);
		*(hits[i].axis ? &tick.sensor[1].y[hits[i].k] : &tick.sensor[1].x[hits[i].k]) = hits[i].code;
		capture_put(&capture, &tick);
		assert_int_equal(capture.phase, CAPTURE_TRIGGERED);
		assert_int_equal(capture.trigger_us, 100000 + hits[i].us);
	}
}

static void what_does_not_trigger(void **state)
{
	static const uint8_t off[] = {WIRE_STATE_SAFE, WIRE_STATE_READY, WIRE_STATE_ARMED, WIRE_STATE_FALLING,
	                              WIRE_STATE_FAULT_HELD};
	struct acquire_tick tick = make(1, WIRE_STATE_SEPARATED);

	(void)state;
	tick.sensor[0].x[0] = 20000; /* S1 */
	tick.sensor[1].z[0] = 20000; /* Z */
	tick.sensor[1].x[0] = 960;   /* the level itself */
	tick.sensor[1].y[0] = -960;
	tick.sensor[1].x[1] = WIRE_SAMPLE_NOT_TAKEN;
	capture_put(&capture, &tick);
	assert_int_equal(capture.phase, CAPTURE_ROLLING);
	assert_int_equal(tick.status[1] & WIRE_STATUS_TRIGGERED, 0);
	for (size_t i = 0; i < sizeof(off); i++) {
		tick = make(2 + (uint32_t)i, off[i]);
		tick.sensor[1].x[0] = 20000;
		capture_put(&capture, &tick);
		assert_int_equal(capture.phase, CAPTURE_ROLLING);
	}
	tick = make(50, WIRE_STATE_FAULT_MOVING);
	tick.sensor[1].x[0] = 20000;
	capture_put(&capture, &tick);
	assert_int_equal(capture.phase, CAPTURE_TRIGGERED);
}

static void forced_trigger_and_marks(void **state)
{
	struct acquire_tick tick;

	(void)state;
	for (uint32_t t = 0; t < 60; t++)
		put(t, WIRE_STATE_FAULT_MOVING);
	tick = make(60, WIRE_STATE_FAULT_MOVING);
	tick.marks = WIRE_MARK_NO_IMPACT;
	capture_put(&capture, &tick);
	assert_int_equal(capture.phase, CAPTURE_TRIGGERED);
	assert_int_equal(capture.first_ms, 0); /* there was no more before */
	assert_int_equal(capture.trigger_us, 60000);
	tick = make(61, WIRE_STATE_FAULT_MOVING);
	tick.marks = WIRE_MARK_CLIPPED;
	capture_put(&capture, &tick);
	for (uint32_t t = 62; t < 460; t++)
		put(t, WIRE_STATE_FAULT_MOVING);
	finish_crc();
	assert_int_equal(capture.last_ms, 459);
	assert_int_equal(capture.marks, WIRE_MARK_NO_IMPACT | WIRE_MARK_CLIPPED);
}

/* A window with one channel off by so much in its last `shifted` ticks. */
static void capture_with_offset(unsigned channel, int offset, unsigned shifted, bool taken)
{
	uint32_t post = parameters.value[WIRE_PARAMETER_post_trigger_ms];

	capture_init(&capture, &parameters);
	for (uint32_t t = 0; t < 100 + post; t++) {
		struct acquire_tick tick = {.tick_ms = t, .status = {WIRE_STATE_BRAKED, WIRE_STATE_BRAKED}};

		for (unsigned k = 0; k < (channel % 3 ? 10u : 7u); k++) {
			struct acquire_samples *samples = &tick.sensor[channel / 3];
			int16_t *at = channel % 3 == 0   ? &samples->x[k]
			              : channel % 3 == 1 ? &samples->y[k]
			                                 : &samples->z[k];

			if (t >= 100 + post - shifted)
				*at = taken ? (int16_t)(offset + (k < 6 ? k % 2 ? 20 : -20 : 0))
				            : WIRE_SAMPLE_NOT_TAKEN;
		}
		if (t == 100)
			tick.sensor[1].x[0] = 9000;
		capture_put(&capture, &tick);
	}
	finish_crc();
}

static void zero_is_compared_with_the_one_before(void **state)
{
	int16_t before[6] = {0};

	(void)state;
	for (unsigned channel = 0; channel < 6; channel++) {
		capture_with_offset(channel, 300, 50, true);
		assert_true(capture_zero_shift(&capture, before, 299));
		assert_false(capture_zero_shift(&capture, before, 300));
		before[channel] = -1;
		assert_true(capture_zero_shift(&capture, before, 300));
		before[channel] = 250;
		assert_false(capture_zero_shift(&capture, before, 50));
		assert_true(capture_zero_shift(&capture, before, 49));
		before[channel] = 0;
		capture_with_offset(channel, -300, 50, true);
		assert_true(capture_zero_shift(&capture, before, 299));
		assert_false(capture_zero_shift(&capture, before, 300));
	}
	capture_with_offset(1, 300, 25, true); /* over the last 50 ms */
	assert_true(capture_zero_shift(&capture, before, 149));
	assert_false(capture_zero_shift(&capture, before, 150));
	capture_with_offset(1, 0, 50, false);
	before[1] = 1000;
	assert_false(capture_zero_shift(&capture, before, 100)); /* nothing to compare */
	parameters.value[WIRE_PARAMETER_post_trigger_ms] = 199;
	capture_with_offset(1, 300, 50, true);
	assert_false(capture_zero_shift(&capture, before, 100)); /* no time to ring down */
	parameters.value[WIRE_PARAMETER_post_trigger_ms] = 200;
	capture_with_offset(1, 300, 50, true);
	assert_true(capture_zero_shift(&capture, before, 100));
}

static void lost_ticks_keep_their_places(void **state)
{
	const struct acquire_tick *held;
	struct acquire_tick tick;

	(void)state;
	for (uint32_t t = 0; t < 150; t++)
		put(t, WIRE_STATE_SEPARATED);
	tick = make(153, WIRE_STATE_SEPARATED); /* 150 to 152 lost */
	tick.sensor[1].y[0] = 9000;
	capture_put(&capture, &tick);
	assert_int_equal(capture.first_ms, 53);
	held = capture_find(&capture, 151);
	assert_non_null(held);
	assert_int_equal(held->tick_ms, 151);
	for (unsigned s = 0; s < 2; s++)
		for (unsigned k = 0; k < 10; k++)
			assert_int_equal(held->sensor[s].y[k], WIRE_SAMPLE_NOT_TAKEN);
	assert_int_equal(capture_find(&capture, 149)->sensor[0].x[0], sample(149, 0, 0, 0));
	assert_int_equal(capture_find(&capture, 153)->sensor[1].y[0], 9000);
	put(2000, WIRE_STATE_BRAKED); /* the rest of the window lost */
	assert_int_equal(capture.phase, CAPTURE_FULL);
	finish_crc();
	assert_int_equal(capture.marks, WIRE_MARK_OVERRUN);
	assert_int_equal(capture.newest_ms, 552);
}

static void largest_window_fits(void **state)
{
	struct acquire_tick tick;

	(void)state;
	parameters.value[WIRE_PARAMETER_pre_trigger_ms] = 400;
	parameters.value[WIRE_PARAMETER_post_trigger_ms] = 112;
	for (uint32_t t = 0; t < 700; t++)
		put(t, WIRE_STATE_BRAKED);
	tick = make(700, WIRE_STATE_BRAKED);
	tick.sensor[1].x[0] = 9000;
	capture_put(&capture, &tick);
	for (uint32_t t = 701; t < 900; t++)
		put(t, WIRE_STATE_BRAKED);
	finish_crc();
	for (uint32_t t = 300; t <= 811; t++)
		assert_int_equal(capture_find(&capture, t)->tick_ms, t);
}

static void ticks_wrap(void **state)
{
	struct acquire_tick tick;

	(void)state;
	for (uint32_t t = 0xFFFFFF00u; t != 0x40u; t++)
		put(t, WIRE_STATE_SEPARATED);
	assert_non_null(capture_find(&capture, 0xFFFFFFF0u));
	tick = make(0x40, WIRE_STATE_SEPARATED);
	tick.sensor[1].x[0] = 9000;
	capture_put(&capture, &tick);
	assert_int_equal(capture.first_ms, 0xFFFFFFDCu);
	for (uint32_t t = 0x41; t < 0x300; t++)
		put(t, WIRE_STATE_BRAKED);
	finish_crc();
	assert_int_equal(capture.last_ms, 0x40 + 399);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test_setup(window_and_crc, begin),
	        cmocka_unit_test_setup(trigger_time_is_the_first_sample_beyond, begin),
	        cmocka_unit_test_setup(what_does_not_trigger, begin),
	        cmocka_unit_test_setup(forced_trigger_and_marks, begin),
	        cmocka_unit_test_setup(zero_is_compared_with_the_one_before, begin),
	        cmocka_unit_test_setup(lost_ticks_keep_their_places, begin),
	        cmocka_unit_test_setup(largest_window_fits, begin),
	        cmocka_unit_test_setup(ticks_wrap, begin),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
