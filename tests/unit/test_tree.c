/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "host/record/tree.h"
#include "tests/unit/near.h"

/* Named arrays as a helper tells them: a record that is right, flagged, or a refusal with both readings. */

enum { N = 600, RATE = 10000 };

static double t[N], a[N], b[N];
static char bytes[1 << 17];
static size_t used;
static char message[READ_MESSAGE_MAX];

static void put(const char *path, struct tree_entry entry, const void *data)
{
	FILE *out = fmemopen(bytes + used, sizeof(bytes) - used, "w");

	assert_non_null(out);
	assert_int_equal(tree_put(out, path, entry, data), 0);
	used += (size_t)ftell(out);
	fclose(out);
}

static void put_text(const char *path, const char *text)
{
	put(path, (struct tree_entry){.bytes = strlen(text), .kind = TREE_TEXT}, text);
}

static void put_matrix(const char *path, const double *value, size_t rows, size_t columns, bool by_rows)
{
	put(path,
	    (struct tree_entry){.rows = rows,
	                        .columns = columns,
	                        .bytes = rows * columns * sizeof(double),
	                        .by_rows = by_rows},
	    value);
}

static void put_vector(const char *path, const double *value)
{
	put_matrix(path, value, N, 1, false);
}

static void put_number(const char *path, double value)
{
	put_matrix(path, &value, 1, 1, false);
}

static void begin(void)
{
	memcpy(bytes, TREE_HEAD, strlen(TREE_HEAD));
	used = strlen(TREE_HEAD);
}

static int read_bytes(const char *columns, struct record *record, size_t size)
{
	struct source source = {.file = "x"};
	struct table_data table = {.format = NULL};
	int error = read_tree(&table, "mat", bytes, size, &source, message);

	if (!error)
		error = table_data_record(&table, record, &source, columns, message);
	table_data_free(&table);
	return error;
}

static struct record good(const char *columns)
{
	struct record record;

	if (read_bytes(columns, &record, used) != 0)
		fail_msg("%s", message);
	return record;
}

/* Channel i is value at RATE. */
static void check(const struct record *record, size_t i, const char *name, const double *value, double factor)
{
	const struct channel *channel = &record->channels[i];

	assert_true(i < record->channel_count);
	assert_string_equal(channel->name, name);
	assert_near_part(channel->rate_hz, (double)RATE, 1e-6);
	assert_int_equal(channel->count, N);
	for (size_t k = 0; k < N; k++)
		assert_near(channel->value_g[k], value[k] * factor, 1e-9);
}

static void refuse(const char *why)
{
	struct record record;

	assert_true(read_bytes(NULL, &record, used) < 0);
	if (strstr(message, why) == NULL)
		fail_msg("\"%s\", expected \"%s\"", message, why);
}

static void times_and_rates(void **state)
{
	static const struct {
		const char *path;
		double value;
		bool assumed;
	} rates[] = {{"fs", RATE, true},
	             {"Fs", RATE / 1e3, true},
	             {"fs_hz", RATE, false},
	             {"rate_khz", RATE / 1e3, false},
	             {"dt", 1.0 / RATE, true},
	             {"dt_us", 1e6 / RATE, false},
	             {"acc/sample_rate_hz", RATE, false},
	             {"acc_fs_hz", RATE, false},
	             {"wf_increment", 1.0 / RATE, true}};
	struct record record;

	(void)state;
	for (size_t i = 0; i < sizeof(rates) / sizeof(rates[0]); i++) {
		begin();
		put_vector("acc", a);
		put_text("acc/units", "g");
		put_number(rates[i].path, rates[i].value);
		record = good(NULL);
		check(&record, 0, "acc", a, 1);
		assert_int_equal((record.flags & RECORD_FLAG_ASSUMED) != 0, rates[i].assumed);
		record_free(&record);
	}
	for (int told = 0; told < 3;
	     told++) { /* a time, without a unit, with one, beside a rate that tells it */
		begin();
		put_vector("rec/time", t);
		put_vector("rec/acc", a);
		put_text("rec/acc_units", "g");
		if (told == 1)
			put_text("rec/time/units", "seconds since 2026-01-01");
		if (told == 2)
			put_number("fs_hz", RATE);
		record = good(NULL);
		check(&record, 0, "acc", a, 1);
		assert_int_equal((record.flags & RECORD_FLAG_ASSUMED) != 0, told == 0);
		record_free(&record);
	}
	put_number("rec/fs_hz", 2 * RATE); /* nearer than the other */
	refuse("tells a rate of 20000 Hz, but its time column steps by 0.0001 s");
	put_number("rec/dt_s", 1.0 / RATE);
	refuse("fs_hz tells 20000 Hz, but rec/dt_s 10000 Hz, expected one");
}

static void rates_refused(void **state)
{
	(void)state;
	begin();
	put_vector("acc_g", a);
	refuse("no column is named as time and no rate is told");
	put_number("fs", -5);
	refuse("fs: no rate and no time step");
	begin();
	put_vector("acc_g", b); /* noise alone: no unit is more plausible than another */
	for (size_t k = 0; k < N; k++)
		b[k] /= 1e6;
	begin();
	put_vector("acc_g", b);
	put_number("fs", RATE);
	refuse("the rate tells no unit: in Hz the rate is 10000 Hz");
	for (size_t k = 0; k < N; k++)
		b[k] *= 1e6;
	begin();
	put_vector("acc_g", a);
	put_number("fs", RATE);
	put_text("fs/units", "furlong");
	refuse("its unit is none of a rate or a time");
}

static void units(void **state)
{
	struct record record;

	(void)state;
	begin();
	put_number("fs_hz", RATE);
	put_vector("acc", a);
	put_vector("gauge", b);
	put_text("units", "m/s^2"); /* of a folder: not of what is named as something else */
	record = good(NULL);
	assert_int_equal(record.channel_count, 1);
	check(&record, 0, "acc", a, 1 / 9.80665);
	assert_non_null(strstr(record.read_as, "left out gauge"));
	record_free(&record);
	begin();
	put_number("fs_hz", RATE);
	put_vector("x", a); /* its only array */
	put_text("units", "g");
	record = good(NULL);
	check(&record, 0, "x", a, 1);
	record_free(&record);
	begin();
	put_number("fs_hz", RATE);
	put_vector("acc_g", a);
	put_number("scale_factor", 2);
	refuse("scale_factor 2 may be in the numbers or not, expected --columns, as \"acc:g@10000\"");
	record = good("acc:g*2");
	check(&record, 0, "acc", a, 2);
	record_free(&record);
}

static void matrices(void **state)
{
	static double both[2 * N], by_rows[2 * N], with_time[2 * N];
	struct record record;

	(void)state;
	memcpy(both, a, sizeof(a));
	memcpy(both + N, b, sizeof(b));
	memcpy(with_time, t, sizeof(t));
	memcpy(with_time + N, a, sizeof(a));
	for (size_t k = 0; k < N; k++) {
		by_rows[2 * k] = a[k];
		by_rows[2 * k + 1] = b[k];
	}
	for (int way = 0; way < 4; way++) { /* both orders, both ways round */
		begin();
		put_matrix("m", way % 2 == 0 ? both : by_rows, way < 2 ? N : 2, way < 2 ? 2 : N,
		           way == 1 || way == 2);
		put_text("names", "one\ntwo");
		put_text("units", "g\ng");
		put_number("fs_hz", RATE);
		record = good(NULL);
		check(&record, 0, "one", a, 1);
		check(&record, 1, "two", b, 1);
		record_free(&record);
	}
	begin();
	put_matrix("m", with_time, N, 2, false);
	put_text("m/units", "g");
	put_number("fs_hz", RATE);
	refuse("m(1): only increases: the time, or a channel");
	put_text("m/names", "time\nacc");
	record = good(NULL);
	assert_int_equal(record.channel_count, 1);
	check(&record, 0, "acc", a, 1);
	record_free(&record);
	begin();
	put_matrix("m", a, 20, 30, false);
	refuse("no array of numbers whose samples go one way, but m (20 by 30: samples down or across?)");
}

static void folders(void **state)
{
	struct record record;

	(void)state;
	begin();
	put_number("fs_hz", RATE);
	put_vector("one/data", a);
	put_text("one/units", "g");
	put_vector("two/data", b);
	put_text("two/units", "g");
	record = good(NULL);
	check(&record, 0, "one.data", a, 1);
	check(&record, 1, "two.data", b, 1);
	record_free(&record);
	begin();
	put_number("fs_hz", RATE);
	put_vector("rec(1)/acc_g", a);
	put_vector("rec(2)/acc_g", b);
	refuse("element of an array: a channel of one recording, or a recording of several");
	put_text("rec(1)/name", "board");
	put_text("rec(2)/name", "table");
	record = good(NULL);
	assert_string_equal(record.channels[1].name, "table");
	record_free(&record);
	begin();
	put_text("x", "y");
	put("o", (struct tree_entry){.bytes = 9, .kind = TREE_OTHER}, "an object");
	refuse("no array of numbers whose samples go one way, but o (an object)");
}

/* Cut anywhere, and each bit of its heads changed: one line or a record. */
static void damage(void **state)
{
	struct record record;
	size_t size;

	(void)state;
	begin();
	put_matrix("rec/time", t, 12, 1, false);
	put_matrix("rec/acc", a, 12, 1, false);
	put_text("rec/acc/units", "g");
	put_number("fs_hz", RATE);
	size = used;
	for (size_t cut = 0; cut < size; cut++)
		if (read_bytes(NULL, &record, cut) == 0)
			record_free(&record);
	for (size_t bit = 0; bit < 8 * size; bit++) {
		bytes[bit / 8] = (char)(bytes[bit / 8] ^ 1 << bit % 8);
		message[0] = '\0';
		if (read_bytes(NULL, &record, size) == 0)
			record_free(&record);
		else
			assert_true(message[0] != '\0' && strchr(message, '\n') == NULL);
		bytes[bit / 8] = (char)(bytes[bit / 8] ^ 1 << bit % 8);
	}
}

static int make(void **state)
{
	uint64_t random = 7;

	(void)state;
	for (size_t k = 0; k < N; k++) {
		double far = fabs((double)k - 300);

		random = random * 6364136223846793005u + 1442695040888963407u;
		t[k] = (double)k / RATE;
		b[k] = (double)(random >> 40) / 16777216.0 - 0.5;
		a[k] = b[k] + (far < 20 ? 200 * (1 - far / 20) : 0);
	}
	return 0;
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(times_and_rates), cmocka_unit_test(rates_refused), cmocka_unit_test(units),
	        cmocka_unit_test(matrices),        cmocka_unit_test(folders),       cmocka_unit_test(damage),
	};

	return cmocka_run_group_tests(tests, make, NULL);
}
