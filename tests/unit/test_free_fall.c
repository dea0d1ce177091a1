/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "host/record/read.h"
#include "host/shock/free_fall.h"
#include "tests/unit/near.h"
#include "tests/unit/synth.h"

/* A box that lies, falls from fall_s for duration_s, and lands: three axes, tilted, with noise. */
struct scene {
	double fall_s, duration_s;
	double rest_g;     /* 1, or 0 behind a high-pass */
	double release_s;  /* how long the hand takes to open */
	double landing_g;  /* 0: it never lands */
	double residual_g; /* what the sensor reads while falling */
	double noise_g;
};

static const struct scene usual = {1.2, 0.4, 1, 0.005, 60, 0.1, 0.01};

static double reading(const struct scene *s, double t)
{
	if (t < s->fall_s - s->release_s / 2)
		return s->rest_g;
	if (t < s->fall_s + s->release_s / 2)
		return s->rest_g + (s->residual_g - s->rest_g) * ((t - s->fall_s) / s->release_s + 0.5);
	if (t < s->fall_s + s->duration_s)
		return s->residual_g;
	return s->rest_g +
	       s->landing_g * synth_pulse(SYNTH_HALF_SINE, (t - s->fall_s - s->duration_s) / 0.02);
}

static struct record made(const struct scene *s, const char *names[3])
{
	static const double direction[3] = {0.48, -0.6, 0.64};
	struct synth_random random = {31};
	struct record record;

	record_init(&record);
	for (int axis = 0; axis < 3; axis++) {
		struct channel *channel = record_add_channel(&record, names[axis], 1000, 2500);

		assert_non_null(channel);
		for (size_t k = 0; k < channel->count; k++) {
			channel->value_g[k] = direction[axis] * reading(s, (double)k / 1000) +
			                      s->noise_g * synth_normal(&random);
			channel->sample[k] = 0;
		}
	}
	return record;
}

static size_t count_falls(const struct scene *s, struct free_fall *fall)
{
	static const char *names[3] = {"S1X", "S1Y", "S1Z"};
	struct record record = made(s, names);
	struct free_falls falls;

	assert_int_equal(free_fall_find(&record, 9.80665, &falls), 0);
	if (falls.count > 0 && fall)
		*fall = falls.fall[0];
	record_free(&record);
	return falls.count;
}

static void height(void **state)
{
	struct free_fall fall;

	(void)state;
	for (double duration = 0.1; duration < 1.1; duration += 0.3) {
		struct scene s = usual;

		s.duration_s = duration;
		assert_int_equal(count_falls(&s, &fall), 1);
		assert_string_equal(fall.name, "S1");
		assert_near(fall.start_s, 1.2, 0.002);
		assert_near(fall.end_s, 1.2 + duration, 0.002);
		assert_near(fall.duration_s, duration, 0.002);
		assert_near(fall.height_m, 9.80665 * duration * duration / 2, 2 * fall.sigma_height_m);
		assert_near_part(fall.sigma_height_m, 9.80665 * duration * fall.sigma_duration_s, 0.02);
		assert_true(fall.sigma_duration_s > 2e-4 && fall.sigma_duration_s < 3e-3);
	}
}

/* A slow release is less certain. */
static void release(void **state)
{
	struct scene s = usual;
	struct free_fall fast, slow;

	(void)state;
	assert_int_equal(count_falls(&s, &fast), 1);
	s.release_s = 0.05;
	assert_int_equal(count_falls(&s, &slow), 1);
	assert_true(slow.sigma_duration_s > 4 * fast.sigma_duration_s);
	assert_near(slow.duration_s, 0.4, 2 * slow.sigma_duration_s);
}

static void not_a_fall(void **state)
{
	struct scene s = usual;

	(void)state;
	s.rest_g = 0; /* a sensor behind a high-pass reads 0 at rest as in the fall */
	s.residual_g = 0;
	assert_int_equal(count_falls(&s, NULL), 0);
	s = usual;
	s.landing_g = 0; /* put on its side: nothing ends it */
	assert_int_equal(count_falls(&s, NULL), 0);
	s = usual;
	s.duration_s = 0.03;
	assert_int_equal(count_falls(&s, NULL), 0);
	s = usual;
	s.residual_g = 0.5;
	assert_int_equal(count_falls(&s, NULL), 0);
	s = usual;
	s.noise_g = 1; /* nothing rests */
	assert_int_equal(count_falls(&s, NULL), 0);
	s = usual;
	s.fall_s = 0.05; /* nothing was seen of the rest before */
	assert_int_equal(count_falls(&s, NULL), 0);
	s = usual;
	s.fall_s = 2.4; /* the record ends in the fall */
	assert_int_equal(count_falls(&s, NULL), 0);
}

/* A channel with the magnitude tells the same fall; it is told once. */
static void channels(void **state)
{
	static const char *names[3] = {"a x", "a y", "a z"};
	struct record record = made(&usual, names);
	struct channel *total = record_add_channel(&record, "total", 1000, 2500);
	struct free_falls falls;

	(void)state;
	assert_non_null(total);
	for (size_t k = 0; k < total->count; k++) {
		total->value_g[k] = reading(&usual, (double)k / 1000);
		total->sample[k] = 0;
	}
	record.channels[1].value_g[1400] = NAN; /* holes in the fall do not end it */
	record.channels[2].value_g[1300] = NAN;
	assert_int_equal(free_fall_find(&record, 9.80665, &falls), 0);
	assert_int_equal(falls.count, 1);
	assert_string_equal(falls.fall[0].name, "a");
	assert_true(falls.fall[0].sensor);
	strcpy(record.channels[0].name, "p");
	strcpy(record.channels[1].name, "q");
	strcpy(record.channels[2].name, "r");
	assert_int_equal(free_fall_find(&record, 9.80665, &falls), 0);
	assert_int_equal(falls.count, 1);
	assert_string_equal(falls.fall[0].name, "total");
	assert_false(falls.fall[0].sensor);
	record_free(&record);
}

/* Two falls that somebody else has measured: at least this long, and the larger half of it seen from
 * the impact, which is the largest reading. */
static void phones(void **state)
{
	static const struct {
		const char *file;
		double window_s, impact_s; /* the impact's time in the file less that of the first row */
	} table[] = {{"../shared/data/phone_fall/fall_1.csv", 0.579, 4.660675 - 0.023723},
	             {"../shared/data/phone_fall/fall_2.csv", 0.464, 3.657675 - 0.033163}};

	(void)state;
	for (int i = 0; i < 2; i++) {
		char message[READ_MESSAGE_MAX];
		struct record record;
		struct free_falls falls;

		if (access(table[i].file, R_OK) != 0)
			skip();
		assert_int_equal(
		        read_record(&record, table[i].file, "time:s,x:m/s2,y:m/s2,z:m/s2,-", message), 0);
		assert_int_equal(free_fall_find(&record, 9.80665, &falls), 0);
		assert_int_equal(falls.count, 1);
		assert_true(falls.fall[0].duration_s > table[i].window_s && falls.fall[0].duration_s < 0.7);
		assert_true(falls.fall[0].end_s < table[i].impact_s &&
		            falls.fall[0].end_s > table[i].impact_s - 0.03);
		record_free(&record);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(height),   cmocka_unit_test(release), cmocka_unit_test(not_a_fall),
	        cmocka_unit_test(channels), cmocka_unit_test(phones),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
