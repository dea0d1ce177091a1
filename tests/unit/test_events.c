/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#include "host/shock/events.h"
#include "tests/unit/near.h"
#include "tests/unit/synth.h"

#define G 9.80665

/* A half-sine of 3 ms. */
static void add(struct channel *channel, double start_s, double peak_g)
{
	for (size_t k = 0; k < channel->count; k++)
		channel->value_g[k] += peak_g * synth_pulse(SYNTH_HALF_SINE,
		                                            ((double)k / channel->rate_hz - start_s) / 0.003);
}

static struct channel *quiet(struct record *record, const char *name, double rate_hz, double seconds,
                             struct synth_random *random)
{
	struct channel *channel = record_add_channel(record, name, rate_hz, (size_t)(seconds * rate_hz));

	assert_non_null(channel);
	for (size_t k = 0; k < channel->count; k++) {
		channel->value_g[k] = -2 + synth_normal(random);
		channel->sample[k] = 0;
	}
	return channel;
}

static void find(const struct record *record, const struct events_options *options, struct events *events)
{
	struct events_options none = {0};

	assert_int_equal(events_find(record, options ? options : &none, events), 0);
	for (size_t i = 1; i < events->count; i++)
		assert_true(fabs(events->event[i - 1].peak_g) >= fabs(events->event[i].peak_g));
}

/* Three shocks on an offset of 2 g and a noise of 1 g, largest first. */
static void ordered(void **state)
{
	struct synth_random random = {21};
	struct record record;
	struct channel *channel;
	struct events events;

	(void)state;
	record_init(&record);
	channel = quiet(&record, "table", 10000, 3, &random);
	add(channel, 0.5, 60);
	add(channel, 1.2, -200);
	add(channel, 2.9, 90);
	find(&record, NULL, &events);
	assert_int_equal(events.count, 3);
	assert_int_equal(events.found, 3);
	assert_string_equal(events.event[0].name, "table");
	assert_false(events.event[0].sensor);
	assert_near(events.event[0].peak_g, -200, 3);
	assert_near(events.event[0].time_s, 1.2015, 2e-4);
	assert_near(events.event[0].duration_s, 0.003 * (1 - 2 * asin(0.1) / 3.141592653589793), 5e-5);
	assert_near(events.event[0].velocity_change_m_s, -200 * G * 0.003 * 2 / 3.141592653589793, 0.08);
	assert_near(events.event[1].peak_g, 90, 3);
	assert_near(events.event[2].peak_g, 60, 3);
	assert_near(events.event[2].time_s, 0.5015, 2e-4);
	record_free(&record);
}

/* The same events, however long the quiet goes on. */
static void length(void **state)
{
	struct events brief, lengthy;

	(void)state;
	for (int i = 0; i < 2; i++) {
		struct synth_random random = {22};
		struct record record;
		struct channel *channel;

		record_init(&record);
		channel = quiet(&record, "table", 10000, i == 0 ? 2 : 60, &random);
		add(channel, 0.5, 60);
		add(channel, 1.2, 200);
		find(&record, NULL, i == 0 ? &brief : &lengthy);
		record_free(&record);
	}
	assert_int_equal(brief.count, 2);
	assert_int_equal(lengthy.count, 2);
	for (int i = 0; i < 2; i++) {
		assert_near(brief.event[i].time_s, lengthy.event[i].time_s, 1e-9);
		assert_near(brief.event[i].peak_g, lengthy.event[i].peak_g, 0.2); /* rest */
	}
}

static void nothing(void **state)
{
	struct synth_random random = {23};
	struct record record;
	struct events events;

	(void)state;
	record_init(&record);
	(void)quiet(&record, "table", 10000, 5, &random);
	find(&record, NULL, &events);
	assert_int_equal(events.count, 0);
	memset(record.channels[0].value_g, 0, record.channels[0].count * sizeof(double));
	find(&record, NULL, &events);
	assert_int_equal(events.count, 0);
	for (size_t k = 0; k < record.channels[0].count; k++)
		record.channels[0].value_g[k] = NAN;
	find(&record, NULL, &events);
	assert_int_equal(events.count, 0);
	record_free(&record);
}

/* What rings on belongs to its shock; two shocks further apart than the hold-off are two. */
static void hold_off(void **state)
{
	struct synth_random random = {24};
	struct record record;
	struct channel *channel;
	struct events events;

	(void)state;
	record_init(&record);
	channel = quiet(&record, "plate", 10000, 1, &random);
	for (size_t k = 3000; k < channel->count; k++) {
		double t = (double)(k - 3000) / 10000;

		channel->value_g[k] += 300 * exp(-20 * t) * sin(2 * 3.141592653589793 * 129 * t);
	}
	find(&record, NULL, &events);
	assert_int_equal(events.found, 1);
	/* Above 150 g for the first 35 ms: nine half swings. */
	find(&record, &(struct events_options){.level_g = 150, .hold_off_s = 0.001}, &events);
	assert_true(events.found >= 8 && events.found <= 9);
	find(&record, &(struct events_options){.level_g = 500}, &events);
	assert_int_equal(events.found, 0);
	record_free(&record);
}

/* Two axes at two rates are one sensor: the magnitude, and the velocity change of the vector. */
static void sensors(void **state)
{
	struct synth_random random = {25};
	struct record record;
	struct events events;

	(void)state;
	record_init(&record);
	(void)quiet(&record, "S2X", 7000, 1, &random);
	(void)quiet(&record, "S2Y", 10000, 1, &random);
	(void)quiet(&record, "S2Z", 10000, 1, &random);
	(void)quiet(&record, "gate", 10000, 1, &random);
	add(&record.channels[0], 0.4, -300);
	add(&record.channels[1], 0.4, 400);
	add(&record.channels[3], 0.7, 50);
	find(&record, NULL, &events);
	assert_int_equal(events.count, 2);
	assert_string_equal(events.event[0].name, "S2");
	assert_true(events.event[0].sensor);
	assert_near(events.event[0].peak_g, 500, 5);
	assert_near(events.event[0].time_s, 0.4015, 1e-4);
	assert_near(events.event[0].velocity_change_m_s, 500 * G * 0.003 * 2 / 3.141592653589793, 0.15);
	assert_string_equal(events.event[1].name, "gate");
	assert_false(events.event[1].sensor);
	record_free(&record);
}

/* Missing samples begin and end nothing. */
static void holes(void **state)
{
	struct synth_random random = {26};
	struct record record;
	struct channel *channel;
	struct events events;

	(void)state;
	record_init(&record);
	channel = quiet(&record, "table", 10000, 2, &random);
	add(channel, 0.5, 100);
	synth_lose(channel, 5008, 4);
	synth_lose(channel, 9000, 3000);
	synth_lose(channel, 0, 100);
	synth_lose(channel, channel->count - 7, 7);
	for (size_t k = 0; k < channel->count; k++)
		if (channel->sample[k] & SAMPLE_LOST)
			channel->value_g[k] = NAN;
	find(&record, NULL, &events);
	assert_int_equal(events.count, 1);
	assert_near(events.event[0].peak_g, 100, 3);
	assert_near(events.event[0].velocity_change_m_s, 100 * G * 0.003 * 2 / 3.141592653589793, 0.3);
	record_free(&record);
}

/* More than the list holds: the largest stay, and the rest is counted. */
static void many(void **state)
{
	struct synth_random random = {27};
	struct record record;
	struct channel *channel;
	struct events events;

	(void)state;
	record_init(&record);
	channel = quiet(&record, "table", 2000, 10, &random);
	for (int i = 0; i < 60; i++)
		add(channel, 0.1 + 0.15 * i, 40 + (i * 37) % 60);
	find(&record, NULL, &events);
	assert_int_equal(events.count, EVENTS_MAX);
	assert_int_equal(events.found, 60);
	assert_true(events.event[EVENTS_MAX - 1].peak_g > 70);
	record_free(&record);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(ordered),  cmocka_unit_test(length),  cmocka_unit_test(nothing),
	        cmocka_unit_test(hold_off), cmocka_unit_test(sensors), cmocka_unit_test(holes),
	        cmocka_unit_test(many),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
