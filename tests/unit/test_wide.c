/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What is done several at a time, and what is left over one by one, is what a plain loop gives.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "common/wire.h"
#include "host/record/drop.h"
#include "host/shock/events.h"

/* 1/32 g a count, -32768 not taken, beyond the range clipped. */
static void check_sample(const struct channel *channel, size_t at, int16_t count)
{
	const double value_g = count / 32.0;

	if (count == -32768) {
		assert_true(isnan(channel->value_g[at]));
		assert_int_equal(channel->sample[at], SAMPLE_BAD);
		return;
	}
	assert_true(channel->value_g[at] == value_g);
	assert_int_equal(channel->sample[at], fabs(value_g) > channel->range_g ? SAMPLE_CLIPPED : 0);
}

/* Every count on every axis, in 1 to 12 ticks at a time: 7 to 84 samples of X, 10 to 120 of Y and Z. */
static void every_count_of_a_drop(void **state)
{
	static const double range_g[] = {500, 10.02, 0, 1023.96875, 1024, 1e9, (double)INFINITY};
	enum { TICKS = 12, OFFSET = 2 };
	struct record record;

	(void)state;
	assert_int_equal(drop_open(&record, 100, 100 + OFFSET + TICKS - 1), 0);
	for (unsigned r = 0; r < sizeof(range_g) / sizeof(range_g[0]); r++) {
		struct channel *axis = &record.channels[3 * (r % 2)];
		uint16_t next = 0;
		unsigned ticks = 1;

		for (int i = 0; i < 3; i++)
			axis[i].range_g = range_g[r];
		for (unsigned seen = 0; seen <= UINT16_MAX; seen += 7 * ticks, ticks = ticks % TICKS + 1) {
			int16_t x[7 * TICKS], y[10 * TICKS], z[10 * TICKS];

			for (unsigned k = 0; k < 10 * ticks; k++) {
				if (k < 7 * ticks)
					x[k] = (int16_t)(uint16_t)(next + k);
				y[k] = (int16_t)(uint16_t)(next - k);
				z[k] = (int16_t)(uint16_t)(next + 5 + k);
			}
			drop_put(&record, 1 + r % 2, OFFSET, ticks, x, y, z);
			for (unsigned k = 0; k < 10 * ticks; k++) {
				if (k < 7 * ticks)
					check_sample(&axis[0], 7 * OFFSET + k, x[k]);
				check_sample(&axis[1], 10 * OFFSET + k, y[k]);
				check_sample(&axis[2], 10 * OFFSET + k, z[k]);
			}
			next = (uint16_t)(next + 7 * ticks);
		}
	}
	record_free(&record);
}

/* One sample of 100 g in a record of so many, one of 1 g where the level is a fiftieth, holes about it. */
static void check_shock(struct record *record, size_t at, double peak_g, bool holes, double level_g)
{
	const struct events_options options = {.level_g = level_g};
	struct channel *channel = &record->channels[0];
	struct events events;

	for (size_t k = 0; k < channel->count; k++) {
		const bool hole = holes && (k == at + 1 || k + 1 == at || k + 4 == at || k == at + 4);

		channel->value_g[k] = hole ? (double)NAN : 0;
		channel->sample[k] = hole ? SAMPLE_BAD : 0;
	}
	channel->value_g[(at + channel->count / 2) % channel->count] = 1;
	channel->sample[(at + channel->count / 2) % channel->count] = 0;
	channel->value_g[at] = peak_g;
	assert_int_equal(events_find(record, &options, &events), 0);
	assert_int_equal(events.found, 1);
	assert_true(events.event[0].peak_g == peak_g);
	assert_true(fabs(events.event[0].time_s - (double)at / channel->rate_hz) < 1e-9);
}

/* Wherever it stands, in whatever is left over. */
static void every_place_of_a_shock(void **state)
{
	(void)state;
	for (size_t count = 8; count < 150; count++) {
		struct record record;

		record_init(&record);
		assert_non_null(record_add_channel(&record, "table", 1000, count));
		for (size_t at = 0; at < count; at++)
			for (int i = 0; i < 8; i++)
				check_shock(&record, at, i & 1 ? -100 : 100, i & 2, i & 4 ? 50 : 0);
		record_free(&record);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(every_count_of_a_drop),
	        cmocka_unit_test(every_place_of_a_shock),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
