/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What a drop says of its tower, against falls worked out in floating point, and the learned drop-out.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "firmware/measure.h"
#include "tests/unit/fake_port.h"

static struct measure measure;
static struct parameters parameters;
static struct fall_plan plan;
static struct fall_times times;
static struct wire_measured measured;

static int begin(void **state)
{
	(void)state;
	parameters_init(&parameters);
	measure_init(&measure, &parameters);
	fall_plan(&plan, &parameters);
	return 0;
}

static double fall_s(double travel_m, double acceleration)
{
	return sqrt(2 * travel_m / acceleration);
}

static uint32_t whole_us(double seconds)
{
	return (uint32_t)llround(seconds * 1e6);
}

/* Released at zero_us, on its way delay_s later, off the magnet where planned with used_us, free dropout_s
 * later. */
static uint16_t drop(double acceleration, double delay_s, double dropout_s, uint32_t used_us,
                     uint32_t zero_us)
{
	double upper_m = parameters.value[WIRE_PARAMETER_gate_upper_um] / 1e6;
	double lower_m = parameters.value[WIRE_PARAMETER_gate_lower_um] / 1e6;

	times = (struct fall_times){.released_us = zero_us, .dropout_us = used_us, .gates = 2};
	times.upper_us = zero_us + whole_us(delay_s + fall_s(upper_m, acceleration));
	times.lower_us = zero_us + whole_us(delay_s + fall_s(lower_m, acceleration));
	times.magnet_off_us =
	        times.lower_us + fall_part(times.lower_us - times.upper_us, plan.separation_q24) - used_us;
	times.magnet_planned = times.keeper_fell = true;
	times.keeper_us = times.magnet_off_us + whole_us(dropout_s);
	return measure_drop(&measure, &plan, &times, &measured);
}

/* Where it really was, m; and how fast. */
static double travel_m(double acceleration, double delay_s, uint32_t zero_us)
{
	double t = (int32_t)(times.keeper_us - zero_us) * 1e-6 - delay_s;

	return acceleration * t * t / 2;
}

static void a_drop_is_measured(void **state)
{
	static const double accelerations[] = {9.81, 9.6, 9.0, 8.5};
	static const double delays[] = {0.0005, 0.012, 0.031};

	(void)state;
	for (size_t i = 0; i < 4; i++)
		for (size_t k = 0; k < 3; k++)
			for (unsigned zero = 0; zero < 2; zero++) {
				uint32_t zero_us = zero ? UINT32_MAX - 390000 : 1234567;
				double a = accelerations[i], delay = delays[k];

				begin(NULL);
				drop(a, delay, 0.0092, 8000, zero_us);
				assert_int_equal(measured.dropout_us, 9200);
				assert_int_equal(measured.dropout_used_us, 8000);
				/* the gates are whole us */
				assert_true(fabs(measured.separation_um - 1e6 * travel_m(a, delay, zero_us)) <
				            30);
				assert_true(fabs(measured.separation_mm_s -
				                 1e3 * sqrt(2 * a * travel_m(a, delay, zero_us))) < 2);
				assert_true(fabs(measured.acceleration_mm_s2 - 1e3 * a) < 1.2);
				assert_true(fabs(measured.latch_delay_us - 1e6 * delay) < 3);
			}
}

static void what_is_not_known_is_all_ones(void **state)
{
	(void)state;
	drop(9.81, 0.01, 0.008, 8000, 0);
	times.keeper_fell = false;
	assert_int_equal(measure_drop(&measure, &plan, &times, &measured), 0);
	assert_int_equal(measured.dropout_us, 0xFFFF);
	assert_int_equal(measured.separation_um, 0xFFFFFFFF);
	assert_int_equal(measured.separation_mm_s, 0xFFFF);
	assert_int_equal(measured.dropout_used_us, 8000);
	assert_in_range(measured.acceleration_mm_s2, 9809, 9811);
	times.magnet_planned = false;
	assert_int_equal(measure_drop(&measure, &plan, &times, &measured), 0);
	assert_int_equal(measured.dropout_used_us, 0xFFFF);
	assert_int_equal(measured.acceleration_mm_s2, 0xFFFF);
	assert_int_equal(measured.latch_delay_us, 0xFFFF);
	begin(NULL);
	/* 5.06 ms behind 780 mm the frame is in the dampers, and falls no more */
	assert_int_equal(drop(9.81, 0.01, 0.014, 8000, 0),
	                 WIRE_MARK_SEPARATED_LATE | WIRE_MARK_DROPOUT_CHANGED);
	assert_int_equal(measured.dropout_us, 14000);
	assert_int_equal(measured.separation_um, 0xFFFFFFFF);
	assert_int_equal(measured.separation_mm_s, 0xFFFF);
	begin(NULL);
	drop(9.81, 0.01, 0.070, 8000, 0); /* beyond 16 bits */
	assert_int_equal(measured.dropout_us, 0xFFFF);
	assert_int_equal(measure_dropout_us(&measure), 8000);
	drop(9.81, -0.002, 0.008, 8000, 1000000); /* no latch lets go before it is told */
	assert_int_equal(measured.latch_delay_us, 0xFFFF);
}

/* 2^31 us behind the gate: sqrt(um) has its place of 32 bits, 2^32 - 1, whose square is 2^64 - 2^33 + 1. */
static void a_fall_too_long_to_tell(void **state)
{
	(void)state;
	drop(9.81, 0, 0.008, 8000, 0);
	assert_int_equal(fall_at(&plan, &times, times.lower_us + INT32_MAX).travel_um, 4294967294u);
	assert_int_equal(fall_at(&plan, &times, times.lower_us - INT32_MAX).travel_um, 0);
}

static void late_separation_is_marked(void **state)
{
	(void)state;
	/* 3.912 m/s at 780 mm: 2 mm are 511 us */
	assert_false(drop(9.81, 0.01, 0.008505, 8000, 0) & WIRE_MARK_SEPARATED_LATE);
	assert_true(drop(9.81, 0.01, 0.008516, 8000, 0) & WIRE_MARK_SEPARATED_LATE);
	assert_false(drop(9.81, 0.01, 0.002, 8000, 0) & WIRE_MARK_SEPARATED_LATE);
}

static void the_edge_calibrates_itself(void **state)
{
	static const struct {
		uint32_t dropout_us, next_us;
		uint16_t marks;
	} drops[] = {
	        {9200, 9200, WIRE_MARK_DROPOUT_CHANGED}, /* the first one whole; not the parameter's */
	        {9300, 9225, WIRE_MARK_CALIBRATED},      /* a quarter of 100 */
	        {9000, 9169, WIRE_MARK_CALIBRATED},      /* of -225, towards 0 */
	        {9669, 9294, WIRE_MARK_CALIBRATED},      /* 500 is not yet a change */
	        {8794, 9169, WIRE_MARK_CALIBRATED},      /* nor is -500 */
	        {8668, 8668, WIRE_MARK_CALIBRATED | WIRE_MARK_DROPOUT_CHANGED}, /* -501 is */
	        {8000, 8000, WIRE_MARK_CALIBRATED | WIRE_MARK_DROPOUT_CHANGED},
	        {8000, 8000, 0}, /* the parameter's */
	};

	(void)state;
	parameters.value[WIRE_PARAMETER_separation_late_um] = 100000;
	assert_int_equal(measure_dropout_us(&measure), 8000);
	for (size_t i = 0; i < sizeof(drops) / sizeof(drops[0]); i++) {
		assert_int_equal(
		        drop(9.81, 0.01, drops[i].dropout_us * 1e-6, measure_dropout_us(&measure), 0),
		        drops[i].marks);
		assert_int_equal(measure_dropout_us(&measure), drops[i].next_us);
	}
	measure_forget(&measure);
	parameters.value[WIRE_PARAMETER_dropout_us] = 12000;
	assert_int_equal(measure_dropout_us(&measure), 12000);
}

static void it_stays_within_its_limits(void **state)
{
	(void)state;
	parameters.value[WIRE_PARAMETER_dropout_limit_us] = 3000;
	drop(9.81, 0.01, 0.0092, 8000, 0);
	assert_int_equal(measure_dropout_us(&measure), 9200);
	drop(9.81, 0.01, 0.030, 8000, 0);
	assert_int_equal(measure_dropout_us(&measure), 11000);
	drop(9.81, 0.01, 0.001, 8000, 0);
	assert_int_equal(measure_dropout_us(&measure), 5000);
	parameters.value[WIRE_PARAMETER_dropout_limit_us] = 15000;
	assert_int_equal(measure_dropout_us(&measure), 1000);
	drop(9.81, 0.01, 0, 8000, 0);
	assert_int_equal(measure_dropout_us(&measure), 0);
	parameters.value[WIRE_PARAMETER_dropout_limit_us] = 0;
	assert_int_equal(measure_dropout_us(&measure), 8000);
}

static void a_limit_is_still_within(void **state)
{
	uint32_t late_um = parameters.value[WIRE_PARAMETER_separation_late_um], travel_um;

	(void)state;
	assert_int_equal(measure_us(65534), 65534);
	assert_int_equal(measure_us(65535), MEASURE_NONE);
	assert_int_equal(measure_us(65536), MEASURE_NONE);
	drop(9.81, 0.01, 0.008, 8000, 0);
	travel_um = measured.separation_um;
	parameters.value[WIRE_PARAMETER_dampers_um] = travel_um;
	parameters.value[WIRE_PARAMETER_separation_um] = travel_um - late_um;
	assert_false(measure_drop(&measure, &plan, &times, &measured) & WIRE_MARK_SEPARATED_LATE);
	assert_int_equal(measured.separation_um, travel_um);
	parameters.value[WIRE_PARAMETER_dampers_um] = travel_um - 1;
	parameters.value[WIRE_PARAMETER_separation_um] = travel_um - late_um - 1;
	assert_true(measure_drop(&measure, &plan, &times, &measured) & WIRE_MARK_SEPARATED_LATE);
	assert_int_equal(measured.separation_um, UINT32_MAX);
}

/* From 8 ms planned: any magnet of 2 to 20 ms that scatters by 0.1 ms separates within 0.9 mm of 780 after
 * the first drop, and what is measured is within 0.2 mm of where it was. */
static void any_magnet_is_learned(void **state)
{
	uint32_t seed = 20261123;

	(void)state;
	for (unsigned ms = 2; ms <= 20; ms++) {
		begin(NULL);
		for (unsigned i = 0; i < 10; i++) {
			double dropout_s = ms * 1e-3 + (double)(fake_random(&seed) % 201) * 1e-6 - 1e-4;

			drop(9.7, 0.012, dropout_s, measure_dropout_us(&measure), 5000000);
			if (i == 0)
				continue;
			if (fabs(travel_m(9.7, 0.012, 5000000) - 0.780) > 0.0009)
				fail_msg("%u ms, drop %u: at %.3f mm, seed 20261123", ms, i,
				         1e3 * travel_m(9.7, 0.012, 5000000));
			assert_true(fabs(measured.separation_um * 1e-6 - travel_m(9.7, 0.012, 5000000)) <
			            0.0002);
		}
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test_setup(a_drop_is_measured, begin),
	        cmocka_unit_test_setup(what_is_not_known_is_all_ones, begin),
	        cmocka_unit_test_setup(a_fall_too_long_to_tell, begin),
	        cmocka_unit_test_setup(late_separation_is_marked, begin),
	        cmocka_unit_test_setup(the_edge_calibrates_itself, begin),
	        cmocka_unit_test_setup(it_stays_within_its_limits, begin),
	        cmocka_unit_test_setup(a_limit_is_still_within, begin),
	        cmocka_unit_test_setup(any_magnet_is_learned, begin),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
