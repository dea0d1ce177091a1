/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * One table as text, JSON, CSV and HTML, against what each should be, written out by hand.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <cmocka.h>

#include "host/base/table.h"

struct row {
	const char *name;
	struct table_value speed;
	double mean, sd;
	unsigned count;
	bool simulated;
	cJSON *list;
};
#define COLUMN(KIND, member, ...) TABLE_COLUMN(KIND, struct row, member, __VA_ARGS__)
static const struct table_column columns[] = {
        COLUMN(WORDS, name, .key = "name", .csv = "drop", .title = "drop", .width = -6, .digits = 6),
        COLUMN(VALUE, speed, .key = "speed_m_s", .sigma = "sigma_m_s", .title = "speed", .unit = "mm/s",
               .gap = "", .width = 9, .digits = 1, .scale = 1e3),
        COLUMN(NUMBER, mean, .key = "mean", .group = "x"),
        COLUMN(NUMBER, sd, .key = "sd", .group = "x"),
        COLUMN(WHOLE, count, .key = "n", .title = "n", .width = 3),
        COLUMN(KNOWN, simulated, .key = "simulated"),
        COLUMN(ITEM, list, .key = "list"),
};

static char *printed(enum table_format format, size_t limit, enum table_of of)
{
	struct row rows[] = {
	        {"a, \"b\" <c>", {0.0125, 0.001, true}, 0.1, (double)NAN, 3, true, NULL},
	        {NULL, {(double)NAN, (double)NAN, true}, (double)NAN, (double)NAN, 0, false, NULL},
	};
	struct table table = {.format = format, .limit = limit, .of = of};
	char *text = NULL;
	size_t size;

	table.out = open_memstream(&text, &size);
	assert_non_null(table.out);
	if (format == TABLE_JSON)
		rows[0].list = cJSON_CreateArray();
	table_begin(&table, columns, TABLE_COUNT(columns));
	table_row(&table, &rows[0]);
	table_row(&table, &rows[1]);
	assert_int_equal(table_end(&table), 0);
	assert_int_equal(table.more, limit == 1);
	assert_int_equal(table.rows, limit == 1 ? 1 : 2);
	fclose(table.out);
	return text;
}

static void is(enum table_format format, size_t limit, enum table_of of, const char *expected)
{
	char *text = printed(format, limit, of);

	assert_string_equal(text, expected);
	free(text);
}

static void test_text_has_its_head_with_the_first_row(void **state)
{
	(void)state;
	is(TABLE_TEXT, 0, TABLE_VALUES,
	   "drop  speed mm/s    n\n"
	   "a, \"b\"     12.5*   3\n"
	   "              -    0\n");
	is(TABLE_TEXT, 1, TABLE_SDS, "drop  speed mm/s    n\na, \"b\"    12.50* 3.0\n");
	is(TABLE_TEXT, 1, TABLE_COUNTS, "drop  speed mm/s    n\na, \"b\"        0*   3\n");
}

static void test_json_has_groups_and_null_for_what_is_not_known(void **state)
{
	(void)state;
	is(TABLE_JSON, 0, TABLE_VALUES,
	   "[{\"name\":\"a, \\\"b\\\" <c>\",\"speed_m_s\":0.0125,\"sigma_m_s\":0.001,"
	   "\"x\":{\"mean\":0.1,\"sd\":null},\"n\":3,\"simulated\":true,\"list\":[]},"
	   "{\"name\":null,\"speed_m_s\":null,\"sigma_m_s\":null,\"x\":null,\"n\":0,\"simulated\":null}]");
	is(TABLE_JSON, 1, TABLE_VALUES,
	   "[{\"name\":\"a, \\\"b\\\" <c>\",\"speed_m_s\":0.0125,\"sigma_m_s\":0.001,"
	   "\"x\":{\"mean\":0.1,\"sd\":null},\"n\":3,\"simulated\":true,\"list\":[]}]");
}

static void test_csv_quotes_and_leaves_empty(void **state)
{
	(void)state;
	is(TABLE_CSV, 0, TABLE_VALUES,
	   "drop,speed_m_s,sigma_m_s,x_mean,x_sd,n,simulated\n"
	   "\"a, \"\"b\"\" <c>\",0.0125,0.001,0.1,,3,yes\n"
	   ",,,,,0,\n");
}

static void test_csv_has_no_formulas(void **state)
{
	static const char *const words[] = {"=1+1", "+1", "-1", "@sum", "a=1", "=\"b\""};
	struct row row = {.name = NULL};
	struct table table = {.format = TABLE_CSV};
	char *text = NULL;
	size_t size;

	(void)state;
	table.out = open_memstream(&text, &size);
	assert_non_null(table.out);
	table_begin(&table, columns, 1);
	for (size_t i = 0; i < TABLE_COUNT(words); i++) {
		row.name = words[i];
		table_row(&table, &row);
	}
	assert_int_equal(table_end(&table), 0);
	fclose(table.out);
	assert_string_equal(text, "drop\n'=1+1\n'+1\n'-1\n'@sum\na=1\n\"'=\"\"b\"\"\"\n");
	free(text);
}

static void test_html_escapes(void **state)
{
	(void)state;
	is(TABLE_HTML, 0, TABLE_VALUES,
	   "<div class=\"scroll\" tabindex=\"0\"><table><thead><tr><th class=\"text\">drop</th><th>speed, "
	   "mm/s</th><th>n</th></tr>"
	   "</thead><tbody>\n"
	   "<tr><td class=\"text\">a, &quot;b&quot; &lt;c&gt;</td><td>12.5 &plusmn; "
	   "1.0*</td><td>3</td></tr>\n"
	   "<tr><td class=\"text\"></td><td>&ndash;</td><td>0</td></tr>\n"
	   "</tbody></table></div>\n");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(test_text_has_its_head_with_the_first_row),
	        cmocka_unit_test(test_json_has_groups_and_null_for_what_is_not_known),
	        cmocka_unit_test(test_csv_quotes_and_leaves_empty),
	        cmocka_unit_test(test_csv_has_no_formulas),
	        cmocka_unit_test(test_html_escapes),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
