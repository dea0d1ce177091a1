/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The checks: each input, the host, offset and noise of each axis on both sides of the limit, stuck channels.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <string.h>

#include "firmware/health.h"
#include "tests/unit/fake_port.h"

static struct health health;
static struct parameters parameters;
static uint32_t counters[WIRE_COUNTERS];

static int begin(void **state)
{
	(void)state;
	memset(counters, 0, sizeof(counters));
	parameters_init(&parameters);
	memset(&health, 0xA5, sizeof(health));
	health_init(&health, &parameters, counters);
	return 0;
}

static int16_t *at(struct acquire_tick *tick, unsigned channel, unsigned k)
{
	struct acquire_samples *samples = &tick->sensor[channel / 3];

	return channel % 3 == 0 ? &samples->x[k] : channel % 3 == 1 ? &samples->y[k] : &samples->z[k];
}

static void samples(struct acquire_tick *tick)
{
	for (unsigned sensor = 0; sensor < WIRE_SENSORS; sensor++)
		health_samples(&health, tick, sensor);
}

static struct health_view seen = {.host_good = true, .clocks_good = true, .brown_out_set = true};

static uint32_t checks_of(unsigned io, unsigned bias_high)
{
	seen.io = (uint16_t)io;
	seen.bias_high = (uint16_t)bias_high;
	return health_checks(&health, &seen);
}

/* 100 ms in which all is 0 but one channel, which alternates offset +- swing. */
static uint32_t after_window(unsigned channel, int offset, int swing)
{
	unsigned per_tick = channel % 3 == 0 ? 7 : 10;
	unsigned n = 0;

	for (unsigned t = 0; t < 100; t++) {
		struct acquire_tick tick = {.status = {WIRE_STATE_SAFE, WIRE_STATE_SAFE}};

		for (unsigned k = 0; k < per_tick; k++)
			*at(&tick, channel, k) = (int16_t)(offset + (n++ % 2 ? swing : -swing));
		samples(&tick);
	}
	return checks_of(FAKE_ALL_GOOD, 0) & (WIRE_CHECK_SENSOR_S1 | WIRE_CHECK_SENSOR_S2);
}

static void sensors_are_red_until_seen(void **state)
{
	struct acquire_tick tick = {0};

	(void)state;
	for (unsigned t = 0; t < 99; t++)
		samples(&tick);
	assert_int_equal(checks_of(FAKE_ALL_GOOD, 0), WIRE_CHECK_SENSOR_S1 | WIRE_CHECK_SENSOR_S2);
	samples(&tick);
	assert_int_equal(checks_of(FAKE_ALL_GOOD, 0), 0);
}

static void offset_and_noise_of_each_axis(void **state)
{
	(void)state;
	for (unsigned channel = 0; channel < 6; channel++) {
		uint32_t red = channel < 3 ? WIRE_CHECK_SENSOR_S1 : WIRE_CHECK_SENSOR_S2;

		assert_int_equal(after_window(channel, 320, 0), 0);
		assert_int_equal(after_window(channel, 321, 0), red);
		assert_int_equal(after_window(channel, -320, 0), 0);
		assert_int_equal(after_window(channel, -321, 0), red);
		assert_int_equal(after_window(channel, 0, 320), 0);
		assert_int_equal(after_window(channel, 0, 321), red);
		assert_int_equal(after_window(channel, 200, 300), 0);
		assert_int_equal(after_window(channel, 0, 32767), red);
	}
	assert_int_equal(after_window(0, 0, 0), 0);
}

static void absent_samples_make_a_sensor_red(void **state)
{
	(void)state;
	for (unsigned missing = 0; missing <= 10; missing++) {
		for (unsigned t = 0; t < 100; t++) {
			struct acquire_tick tick = {0};

			for (unsigned k = 0; k < missing; k++)
				*at(&tick, 5, k) = WIRE_SAMPLE_NOT_TAKEN;
			samples(&tick);
		}
		assert_int_equal((checks_of(FAKE_ALL_GOOD, 0) & WIRE_CHECK_SENSOR_S2) != 0, missing > 5);
	}
}

/* Half of them at least, of each channel: 350 of an X, 500 of a Y or Z. */
static void half_of_the_samples_are_enough(void **state)
{
	(void)state;
	for (unsigned channel = 0; channel < 6; channel++)
		for (unsigned short_of = 0; short_of < 2; short_of++) {
			unsigned per_tick = channel % 3 == 0 ? 7 : 10, left = 50 * per_tick - short_of;

			for (unsigned t = 0; t < 100; t++) {
				struct acquire_tick tick = {0};

				for (unsigned k = 0; k < per_tick; k++)
					if (left > 0)
						left--;
					else
						*at(&tick, channel, k) = WIRE_SAMPLE_NOT_TAKEN;
				samples(&tick);
			}
			assert_int_equal(checks_of(FAKE_ALL_GOOD, 0), short_of == 0 ? 0
			                                              : channel < 3 ? WIRE_CHECK_SENSOR_S1
			                                                            : WIRE_CHECK_SENSOR_S2);
		}
}

static void each_input_has_its_check(void **state)
{
	static const struct {
		uint16_t input;
		uint32_t check;
	} pairs[] = {
	        {WIRE_IO_LATCH_CLOSED, WIRE_CHECK_LATCH},      {WIRE_IO_PRODUCT_HELD, WIRE_CHECK_PRODUCT},
	        {WIRE_IO_DAMPERS_ENGAGED, WIRE_CHECK_DAMPERS}, {WIRE_IO_DOOR_CLOSED, WIRE_CHECK_DOOR},
	        {WIRE_IO_ESTOP_CLEAR, WIRE_CHECK_ESTOP},       {WIRE_IO_SUPPLY_GOOD, WIRE_CHECK_SUPPLY},
	        {WIRE_IO_IEPE_S1, WIRE_CHECK_SHORT_S1},        {WIRE_IO_IEPE_S2, WIRE_CHECK_SHORT_S2},
	        {WIRE_IO_GATE_UPPER, WIRE_CHECK_GATES},        {WIRE_IO_GATE_LOWER, WIRE_CHECK_GATES},
	        {WIRE_IO_FRAME_DOWN, WIRE_CHECK_LATCH},
	};

	(void)state;
	assert_int_equal(after_window(0, 0, 0), 0);
	assert_int_equal(checks_of(FAKE_ALL_GOOD, 0), 0);
	for (size_t i = 0; i < sizeof(pairs) / sizeof(pairs[0]); i++)
		for (unsigned outputs = 0; outputs < 2; outputs++) /* which are no inputs */
			assert_int_equal(checks_of(((FAKE_ALL_GOOD ^ pairs[i].input) & ~1u) | outputs, 0),
			                 pairs[i].check);
	assert_int_equal(checks_of(FAKE_ALL_GOOD | 1, 0), 0);
}

/* Which sensor by the input, which fault by the level. */
static void open_and_short_are_told_apart(void **state)
{
	const uint16_t s1 = WIRE_IO_IEPE_S1, s2 = WIRE_IO_IEPE_S2;
	const struct {
		uint16_t lost, high;
		uint32_t checks;
	} cables[] = {
	        {0, 0, 0},
	        {0, s1 | s2, 0}, /* in their windows again */
	        {s1, 0, WIRE_CHECK_SHORT_S1},
	        {s1, s2, WIRE_CHECK_SHORT_S1},
	        {s1, s2 | 1, WIRE_CHECK_SHORT_S1},
	        {s2, s1 | 1, WIRE_CHECK_SHORT_S2},
	        {s1, s1, WIRE_CHECK_OPEN_S1},
	        {s2, 0, WIRE_CHECK_SHORT_S2},
	        {s2, s2, WIRE_CHECK_OPEN_S2},
	        {s1 | s2, s1, WIRE_CHECK_OPEN_S1 | WIRE_CHECK_SHORT_S2},
	        {s1 | s2, s2, WIRE_CHECK_SHORT_S1 | WIRE_CHECK_OPEN_S2},
	};

	(void)state;
	assert_int_equal(after_window(0, 0, 0), 0);
	for (size_t i = 0; i < sizeof(cables) / sizeof(cables[0]); i++)
		assert_int_equal(checks_of((uint16_t)(FAKE_ALL_GOOD & ~cables[i].lost), cables[i].high),
		                 cables[i].checks);
}

static void host_clocks_and_brown_out_level(void **state)
{
	(void)state;
	assert_int_equal(after_window(0, 0, 0), 0);
	seen.host_good = false;
	assert_int_equal(checks_of(FAKE_ALL_GOOD, 0), WIRE_CHECK_HOST);
	seen.clocks_good = false;
	assert_int_equal(checks_of(FAKE_ALL_GOOD, 0), WIRE_CHECK_HOST | WIRE_CHECK_CLOCKS);
	seen.brown_out_set = false;
	seen.host_good = seen.clocks_good = true;
	assert_int_equal(checks_of(FAKE_ALL_GOOD, 0), WIRE_CHECK_BROWN_OUT_LEVEL);
	seen.brown_out_set = true;
	assert_int_equal(checks_of(FAKE_ALL_GOOD, 0), 0);
}

/* 100 ticks at rest with one S2 sample of a code. */
static bool trigger_is_red(unsigned channel, unsigned k, int16_t code, unsigned state)
{
	for (unsigned t = 0; t < 100; t++) {
		struct acquire_tick tick = {.status = {(uint8_t)state, (uint8_t)state}};

		if (t == 37)
			*at(&tick, channel, k) = code;
		samples(&tick);
	}
	return (checks_of(FAKE_ALL_GOOD, 0) & WIRE_CHECK_TRIGGER) != 0;
}

static void trigger_must_be_quiet_at_rest(void **state)
{
	(void)state;
	assert_false(trigger_is_red(3, 0, 960, WIRE_STATE_READY)); /* the level itself does not trigger */
	assert_true(trigger_is_red(3, 6, 961, WIRE_STATE_READY));
	assert_true(trigger_is_red(4, 9, -961, WIRE_STATE_SAFE));
	assert_false(trigger_is_red(0, 0, 5000, WIRE_STATE_READY)); /* S1 and Z do not trigger */
	assert_false(trigger_is_red(5, 0, 5000, WIRE_STATE_READY));
	assert_false(trigger_is_red(3, 0, WIRE_SAMPLE_NOT_TAKEN, WIRE_STATE_READY));
	assert_false(trigger_is_red(3, 0, 5000, WIRE_STATE_BRAKED)); /* there it is the impact */
	assert_true(trigger_is_red(4, 9, 961, WIRE_STATE_READY));
	assert_int_equal(checks_of(FAKE_ALL_GOOD, 0), WIRE_CHECK_TRIGGER);
	parameters.value[WIRE_PARAMETER_trigger_counts] = 160;
	assert_true(trigger_is_red(4, 0, 161, WIRE_STATE_SAFE));
}

static void zero_is_the_offset_of_the_last_window_at_rest(void **state)
{
	(void)state;
	after_window(4, -100, 50);
	assert_int_equal(health.zero[4], -100);
	assert_int_equal(health.zero[3], 0);
	for (unsigned t = 0; t < 100; t++) { /* one tick in motion spoils the window */
		struct acquire_tick tick = {.status = {t == 50 ? WIRE_STATE_FALLING : WIRE_STATE_ARMED}};

		for (unsigned k = 0; k < 10; k++)
			tick.sensor[1].y[k] = 300;
		samples(&tick);
	}
	assert_int_equal(health.zero[4], -100);
	for (unsigned t = 0; t < 100; t++) { /* no sample, no news */
		struct acquire_tick tick = {0};

		for (unsigned k = 0; k < 10; k++)
			tick.sensor[1].y[k] = WIRE_SAMPLE_NOT_TAKEN;
		samples(&tick);
	}
	assert_int_equal(health.zero[4], -100);
}

/* One with a drop in it tells nothing; the next does, by one sample if there are no more. */
static void zero_is_told_again_after_a_drop(void **state)
{
	(void)state;
	for (unsigned t = 0; t < 200; t++) {
		struct acquire_tick tick = {.status = {t == 50 ? WIRE_STATE_FALLING : WIRE_STATE_READY}};

		for (unsigned k = 0; k < 10; k++)
			tick.sensor[1].y[k] = t == 150 && k == 5 ? 77 : WIRE_SAMPLE_NOT_TAKEN;
		samples(&tick);
		assert_int_equal(health.zero[4], t < 199 ? 0 : 77);
	}
}

static uint16_t stuck_marks;

static void run_stuck(unsigned ticks, unsigned state, int16_t other)
{
	for (unsigned t = 0; t < ticks; t++) {
		struct acquire_tick tick = {.status = {(uint8_t)state, (uint8_t)state}};

		for (unsigned channel = 0; channel < 6; channel++)
			for (unsigned k = 0; k < (channel % 3 ? 10u : 7u); k++)
				*at(&tick, channel, k) = channel == 4 ? 123 : (int16_t)((int)k + other);
		samples(&tick);
		stuck_marks = tick.marks;
	}
}

static void stuck_channel_in_motion_is_counted_once(void **state)
{
	(void)state;
	run_stuck(200, WIRE_STATE_SAFE, 0);
	assert_int_equal(counters[WIRE_COUNTER_samples_stuck], 0);
	assert_int_equal(stuck_marks, 0);
	run_stuck(19, WIRE_STATE_FALLING, 0);
	assert_int_equal(counters[WIRE_COUNTER_samples_stuck], 0);
	assert_int_equal(stuck_marks, 0);
	run_stuck(1, WIRE_STATE_SEPARATED, 0);
	assert_int_equal(stuck_marks, WIRE_MARK_STUCK);
	run_stuck(100, WIRE_STATE_SEPARATED, 0);
	assert_int_equal(counters[WIRE_COUNTER_samples_stuck], 1);
	assert_int_equal(stuck_marks, WIRE_MARK_STUCK); /* as long as it lasts */
	run_stuck(1, WIRE_STATE_CAPTURED, 0);
	assert_int_equal(stuck_marks, 0);
	run_stuck(30, WIRE_STATE_FALLING, 0); /* the next drop */
	assert_int_equal(counters[WIRE_COUNTER_samples_stuck], 2);
}

/* An X is stuck when all of its 7 samples are; a channel whose last two are alike is not. */
static void all_samples_of_a_tick_are_alike_when_it_is_stuck(void **state)
{
	(void)state;
	for (unsigned t = 0; t < 100; t++) {
		struct acquire_tick tick = {.status = {WIRE_STATE_FALLING, WIRE_STATE_FALLING}};

		for (unsigned channel = 0; channel < 6; channel++)
			for (unsigned k = 0; k < (channel % 3 ? 10u : 7u); k++)
				*at(&tick, channel, k) = channel == 3 ? 123 : (int16_t)(k / 2);
		samples(&tick);
		assert_int_equal(counters[WIRE_COUNTER_samples_stuck], t >= 20);
	}
}

static void a_look_has_the_inputs_that_are_known(void **state)
{
	struct input input = {.agreed = FAKE_ALL_GOOD & ~WIRE_IO_OUTPUTS, .known = 0x7FE3};
	struct acquire acquire = {.clocks_good = true};

	(void)state;
	assert_int_equal(health_look(&health, &input, 0, &acquire, true).known, 0x7FE3);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test_setup(sensors_are_red_until_seen, begin),
	        cmocka_unit_test_setup(offset_and_noise_of_each_axis, begin),
	        cmocka_unit_test_setup(absent_samples_make_a_sensor_red, begin),
	        cmocka_unit_test_setup(half_of_the_samples_are_enough, begin),
	        cmocka_unit_test_setup(each_input_has_its_check, begin),
	        cmocka_unit_test_setup(open_and_short_are_told_apart, begin),
	        cmocka_unit_test_setup(host_clocks_and_brown_out_level, begin),
	        cmocka_unit_test_setup(trigger_must_be_quiet_at_rest, begin),
	        cmocka_unit_test_setup(zero_is_the_offset_of_the_last_window_at_rest, begin),
	        cmocka_unit_test_setup(stuck_channel_in_motion_is_counted_once, begin),
	        cmocka_unit_test_setup(zero_is_told_again_after_a_drop, begin),
	        cmocka_unit_test_setup(all_samples_of_a_tick_are_alike_when_it_is_stuck, begin),
	        cmocka_unit_test_setup(a_look_has_the_inputs_that_are_known, begin),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
