/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Lines read in one pass against the same lines cut into cells, each read by itself: random ones, of usual
 * numbers and of what only looks like some.
 */
#include <math.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <setjmp.h>
#include <cmocka.h>

#include "host/record/row.h"
#include "tests/unit/synth.h"

enum { LINES = 60000, COLUMNS = 3 };

static unsigned below(struct synth_random *random, unsigned end)
{
	return (unsigned)(synth_uniform(random) * end) % end;
}

static const char *one_of(struct synth_random *random, const char *const *words, unsigned count)
{
	return words[below(random, count)];
}

/* A number as programs write them; now and then something else. */
static int put_number(struct synth_random *random, char decimal, char *text, size_t size)
{
	static const char *const formats[] = {"%.17g", "%.6f", "%.3f",  "%g",
	                                      "%.9e",  "%.0f", "%+.4f", "%.20f"};
	static const char *const others[] = {"",      "-",    "nan", "\"1.5\"", "1.5 g",
	                                     "1'000", "0x10", "1e",  "1e1234",  "--2"};
	double value = ldexp(synth_uniform(random) - 0.5, (int)below(random, 40) - 20);
	int length;

	if (below(random, 40) == 0)
		return snprintf(text, size, "%s", one_of(random, others, sizeof(others) / sizeof(others[0])));
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral"
	length = snprintf(text, size, one_of(random, formats, sizeof(formats) / sizeof(formats[0])), value);
#pragma GCC diagnostic pop
	for (char *at = text; *at != '\0'; at++)
		if (*at == '.')
			*at = decimal;
	return length;
}

static size_t put_line(struct synth_random *random, struct cells_style style, char *text, size_t size)
{
	static const char *const any[] = {",", ";", "\t", " ", ", ", " ;"}, *const ends[] = {"\n", "\r\n",
	                                                                                     " \n", ",\n",
	                                                                                     ""};
	const char own[2] = {style.separator, '\0'};
	unsigned count = below(random, 30) == 0 ? below(random, 5) : COLUMNS;
	const char *usual = one_of(random, any, 6);
	size_t length = 0;

	for (unsigned i = 0; i < count; i++) {
		const char *separator = style.separator != 0 ? own : usual;

		if (below(random, 50) == 0)
			separator = one_of(random, any, 6);
		length += (size_t)snprintf(text + length, size - length, "%s%s", i > 0 ? separator : "",
		                           below(random, 20) == 0 ? " " : "");
		length += (size_t)put_number(random, style.decimal == ',' ? ',' : '.', text + length,
		                             size - length);
	}
	return length + (size_t)snprintf(text + length, size - length, "%s",
	                                 one_of(random, ends, below(random, 10) == 0 ? 5 : 1));
}

/* All that a plain line says of its numbers. */
static void check_cells(const struct row *row, const struct cells *cells, const char *text)
{
	for (size_t i = 0; i < COLUMNS; i++) {
		double value = 7;
		int digits, count = 0;

		assert_true(cells_number(cells, i, &value));
		if (memcmp(&value, &row->number[i].value, sizeof(value)) != 0)
			fail_msg("%a, expected %a, in %s", row->number[i].value, value, text);
		assert_ptr_equal(row->cell[i].text, cells->cell[i].text);
		assert_int_equal(row->cell[i].length, cells->cell[i].length);
		assert_true(pow(10, row->number[i].exponent) == cells_last_digit(cells, i, &digits));
		for (uint64_t rest = row->number[i].digits; rest > 0; rest /= 10)
			count++;
		assert_int_equal(count, digits);
	}
}

static unsigned check_style(struct cells_style style, unsigned seed)
{
	struct columns columns = {.count = COLUMNS};
	struct synth_random random = {seed};
	struct cells first, cells;
	struct row_shape shape = {0};
	struct row row;
	char line[512], text[512];
	unsigned taken = 0;

	for (size_t i = 0; i < COLUMNS; i++)
		columns.column[i].kind = COLUMN_CHANNEL;
	for (unsigned i = 0; i < LINES; i++) {
		size_t length = put_line(&random, style, text, sizeof(text));

		if (i % 8 == 0) {
			size_t end = put_line(&random, style, line, sizeof(line));

			cells_split(style, line, strcspn(line, "\r\n"), &first);
			row_learn(&shape, style, &first, &columns);
			assert_true(end < sizeof(line));
		}
		if (!row_read(&shape, text, text + length, &row))
			continue;
		taken++;
		cells_split(style, text, strcspn(text, "\r\n"), &cells);
		assert_int_equal(cells.count, COLUMNS);
		assert_int_equal(cells.decimal, shape.decimal);
		assert_ptr_equal(row.next, text + length);
		check_cells(&row, &cells, text);
	}
	return taken;
}

static void as_cells_are(void **state)
{
	static const struct cells_style styles[] = {{0, 0},      {',', '.'}, {';', ','},
	                                            {'\t', '.'}, {' ', '.'}, {';', 0}};

	(void)state;
	for (unsigned i = 0; i < sizeof(styles) / sizeof(styles[0]); i++) {
		unsigned taken = check_style(styles[i], i + 1);

		print_message("'%c' '%c': %u of %d\n", styles[i].separator ? styles[i].separator : '?',
		              styles[i].decimal ? styles[i].decimal : '?', taken, LINES);
		assert_in_range(taken, LINES / 12, LINES);
	}
}

/* Cells that nobody wants may be words. */
static void words(void **state)
{
	static const char plain[] = "run 1,x,2.5\n", taken[] = "ok,y,3\n", bad[] = "\"a,b\",y,3\n";
	struct columns columns = {.count = 3};
	struct row_shape shape;
	struct cells cells;
	struct row row;

	(void)state;
	columns.column[0].kind = columns.column[1].kind = COLUMN_SKIP;
	columns.column[2].kind = COLUMN_CHANNEL;
	cells_split((struct cells_style){',', '.'}, plain, strlen(plain) - 1, &cells);
	row_learn(&shape, (struct cells_style){',', '.'}, &cells, &columns);
	assert_false(
	        row_read(&shape, plain, plain + strlen(plain), &row)); /* a blank: cells_split has to say */
	assert_true(row_read(&shape, taken, taken + strlen(taken), &row));
	assert_true(row.number[2].value == 3);
	assert_false(row_read(&shape, bad, bad + strlen(bad), &row));
	assert_false(row_read(&shape, taken, taken + strlen(taken) - 1, &row)); /* no line end */
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(as_cells_are),
	        cmocka_unit_test(words),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
