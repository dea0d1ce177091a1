/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What is said of many drops: means, lists, words that find them.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "tests/unit/archive_stock.h"
#include "tests/unit/archive_trial.h"
#include "tests/unit/near.h"

/* ---- means ---- */

/* 2 4 4 4 5 5 7 9: mean 5, sum of squared deviations 32. */
static void fill_eight(struct archive *archive, const char *series, double factor)
{
	static const double values[] = {2, 4, 4, 4, 5, 5, 7, 9};

	for (unsigned i = 0; i < 8; i++) {
		char text[16], drop[64];

		snprintf(text, sizeof(text), "%s %u", series, i);
		snprintf(drop, sizeof(drop), "%s/%u", series, trial_record(archive, series, text));
		trial_result(archive, drop, "v1", -factor * values[i], 10 * values[i]);
		assert_int_equal(archive_decide(archive, drop, ARCHIVE_ACCEPTED, "Ann", ""), 0);
	}
}

static void test_means_by_hand(void **state)
{
	struct archive_filter filter = archive_filter_none();
	struct archive *archive = trial_with_series("one");
	struct archive_table table;
	const struct archive_cell *bare, *plate;

	(void)state;
	assert_int_equal(archive_new_series(archive, "flat", "trial", TRIAL_BARE, 25, NAN, NULL, 8), 0);
	fill_eight(archive, "one", 1);
	fill_eight(archive, "flat", 4);
	trial_record(archive, "one", "undecided");
	trial_result(archive, "one/9", "v1", -1000, 1);
	trial_record(archive, "one", "rejected");
	trial_result(archive, "one/10", "v1", -1e6, 1);
	assert_int_equal(archive_decide(archive, "one/10", ARCHIVE_REJECTED, "Ann", "spike"), 0);
	assert_int_equal(archive_table(archive, &filter, false, &table), 0);
	assert_int_equal(table.count, 2);
	bare = &table.cell[0];
	plate = &table.cell[1];
	assert_string_equal(plate->scene_name, "geometry-2A");
	assert_int_equal(plate->drops, 8);
	assert_near(plate->value[ARCHIVE_S1_X].mean, -5, 1e-12);
	assert_near(plate->value[ARCHIVE_S1_X].sd, 2.138089935299395, 1e-12);
	assert_near(plate->value[ARCHIVE_S2_X].mean, 50, 1e-12);
	assert_int_equal(plate->value[ARCHIVE_S2_X].not_ok, 8);
	assert_int_equal(plate->value[ARCHIVE_S1_Y].n, 0);
	assert_true(isnan(plate->value[ARCHIVE_S1_Y].mean));
	assert_ptr_equal(archive_table_reference(&table, plate), bare);
	assert_null(archive_table_reference(&table, bare));
	assert_near(plate->value[ARCHIVE_S1_X].mean / bare->value[ARCHIVE_S1_X].mean, 0.25, 1e-12);
	archive_table_free(&table);
	filter.series = "one";
	assert_int_equal(archive_table(archive, &filter, true, &table), 0);
	assert_int_equal(table.cell[0].drops, 9);
	assert_near(table.cell[0].value[ARCHIVE_S1_X].mean, -1040.0 / 9, 1e-9);
	archive_table_free(&table);
	archive_close(archive);
}

static void test_heights_are_not_averaged(void **state)
{
	struct archive_filter filter = archive_filter_none();
	struct archive *archive = trial_with_series("one");
	struct archive_table table;

	(void)state;
	assert_int_equal(archive_new_series(archive, "low", "trial", TRIAL_SCENE, 25, 0.5, NULL, 5), 0);
	assert_int_equal(archive_new_series(archive, "bare", "trial", TRIAL_BARE, 25, NAN, NULL, 5), 0);
	trial_record(archive, "one", "abc");
	trial_record(archive, "low", "abcd");
	trial_record(archive, "bare", "abcde");
	trial_result(archive, "one/1", "v1", -400, 500);
	trial_result(archive, "low/1", "v1", -300, 400);
	trial_result(archive, "bare/1", "v1", -500, 500);
	assert_int_equal(archive_table(archive, &filter, true, &table), 0);
	assert_int_equal(table.count, 3);
	assert_near(table.cell[1].height_m, 0.5, 0);
	assert_near(table.cell[1].value[ARCHIVE_S1_X].mean, -300, 0);
	assert_near(table.cell[2].height_m, 0.894, 0);
	assert_null(archive_table_reference(&table, &table.cell[1]));
	assert_ptr_equal(archive_table_reference(&table, &table.cell[2]), &table.cell[0]);
	archive_table_free(&table);
	archive_close(archive);
}

static int count_series(void *context, const struct archive_series *series)
{
	assert_int_equal(series->recorded, 5);
	assert_int_equal(series->accepted, 4);
	assert_int_equal(series->rejected, 1);
	(*(int *)context)++;
	return 0;
}

static void test_ten_thousand_drops(void **state)
{
	struct archive_filter filter = archive_filter_none();
	struct archive *archive;
	struct archive_table table;
	struct trial_seen seen = {.count = 0};
	int count = 0;

	(void)state;
	archive_close(trial_with_series("first"));
	assert_true(archive_stock_fill(trial_folder, 10000, 100));
	archive = trial_open(ARCHIVE_READ);
	filter.angle_deg = 20;
	assert_int_equal(archive_each_series(archive, &filter, count_series, &count), 0);
	assert_int_equal(count, 400);
	filter = archive_filter_none();
	filter.from = filter.to = "2026-03-02";
	assert_int_equal(archive_each_drop(archive, &filter, trial_see, &seen), 0);
	assert_in_range(seen.count, 166, 167); /* a twelfth of 2 000 series, the first drop of each */
	filter = archive_filter_none();
	assert_int_equal(archive_table(archive, &filter, false, &table), 0);
	assert_int_equal(table.count, 5);
	for (size_t i = 0; i < table.count; i++) {
		assert_near(table.cell[i].angle_deg, 15 + 5.0 * (double)i, 0);
		assert_int_equal(table.cell[i].value[ARCHIVE_S1_X].n, 1600);
		/* 300, 310, 320, 330, each 400 times */
		assert_near(table.cell[i].value[ARCHIVE_S1_X].mean, 315, 1e-9);
		assert_near(table.cell[i].value[ARCHIVE_S1_X].sd, sqrt(400 * 500.0 / 1599), 1e-9);
	}
	archive_table_free(&table);
	archive_close(archive);
}

/* ---- lists ---- */

/* A series whose drops the filter leaves out, and one of which it leaves out the series itself. */
static void test_json_of_nothing(void **state)
{
	struct archive_filter filter = archive_filter_none();
	struct archive *archive = trial_with_series("one");

	(void)state;
	trial_record(archive, "one", "abc");
	filter.series = "one";
	for (int i = 0; i < 3; i++) {
		char *text;
		cJSON *tree;

		filter.angle_deg = i == 2 ? 80 : NAN;
		filter.number = i == 1 ? 7 : 0;
		text = trial_printed(archive, &filter, TABLE_JSON, true);
		tree = cJSON_Parse(text);
		assert_non_null(tree);
		assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(tree, "drops")), i == 0);
		assert_int_equal(cJSON_HasObjectItem(cJSON_GetObjectItem(tree, "series"), "name"), i == 0);
		assert_true(cJSON_IsObject(cJSON_GetObjectItem(tree, "means")));
		cJSON_Delete(tree);
		free(text);
	}
	archive_close(archive);
}

/* The names of the drops or series of a list, in its order. */
static void check_found(struct archive *archive, const char *text, unsigned limit, const char *list,
                        const char *expected)
{
	bool drops = strcmp(list, "drops") == 0;
	struct archive_filter filter = archive_filter_none();
	char names[200] = "", *json;
	const cJSON *item;
	cJSON *root;

	filter.text = text;
	filter.limit = limit;
	json = trial_printed(archive, &filter, TABLE_JSON, drops);
	root = cJSON_Parse(json);
	assert_non_null(root);
	cJSON_ArrayForEach(item, cJSON_GetObjectItem(root, list))
	{
		size_t at = strlen(names);
		const char *name = cJSON_GetStringValue(cJSON_GetObjectItem(item, drops ? "series" : "name"));

		if (drops)
			snprintf(names + at, sizeof(names) - at, "%s/%g ", name,
			         cJSON_GetNumberValue(cJSON_GetObjectItem(item, "number")));
		else
			snprintf(names + at, sizeof(names) - at, "%s ", name);
	}
	if (cJSON_IsTrue(cJSON_GetObjectItem(root, "more")))
		strcat(names, "more");
	else
		assert_true(cJSON_IsFalse(cJSON_GetObjectItem(root, "more")));
	if (strcmp(names, expected) != 0)
		fail_msg("text '%s', limit %u: %s: '%s', expected '%s'", text != NULL ? text : "", limit,
		         list, names, expected);
	cJSON_Delete(root);
	free(json);
}

/* box/1: Ann, a note, clipped; box/2: rejected; rig_b/1: nothing; empty: no drops. */
static struct archive *with_words(void)
{
	struct archive *archive = trial_with_series("box");

	assert_int_equal(archive_new_series(archive, "rig_b", "winter", TRIAL_SCENE, 25, NAN, NULL, 5), 0);
	assert_int_equal(archive_new_series(archive, "empty", "winter", TRIAL_BARE, 25, NAN, NULL, 5), 0);
	trial_record(archive, "box", "abc");
	trial_record(archive, "box", "def");
	trial_record(archive, "rig_b", "ghi");
	assert_int_equal(archive_note(archive, "box/1", "Ann", "100% of J\xc3\xbcrg's \\ load_cell"), 0);
	assert_int_equal(archive_decide(archive, "box/2", ARCHIVE_REJECTED, "Ann", "hit the Wrong corner"),
	                 0);
	trial_result(archive, "box/1", "v1", 1, 2);
	return archive;
}

static void test_words_find_drops(void **state)
{
	static const struct {
		const char *text, *drops, *series;
	} rows[] = {
	        {"", "box/1 box/2 rig_b/1 ", "box empty rig_b "},
	        {"wrong CORNER", "box/2 ", "box "},
	        {"  corner\twrong ", "box/2 ", "box "},
	        {"corner load_cell", "", ""}, /* not of one drop */
	        {"box J\xc3\xbcrg", "box/1 ", "box "},
	        {"WINTER", "rig_b/1 ", "empty rig_b "},
	        {"empty", "", "empty "},
	        {"geometry-2a ann", "box/1 box/2 rig_b/1 ", "box rig_b "},
	        {"clipped", "box/1 ", "box "},
	        {"100%", "box/1 ", "box "},
	        {"%", "box/1 ", "box "},
	        {"_", "box/1 rig_b/1 ", "box rig_b "},
	        {"\\", "box/1 ", "box "},
	        {"ad_ce", "box/1 ", "box "},
	        {"loadXcell", "", ""},
	        {"' OR 1 --", "", ""},
	        {"a b c d e f g h", "", ""},
	};
	struct archive_filter filter = archive_filter_none();
	struct archive *archive = with_words();
	struct trial_seen seen = {.count = 0};
	char longer[62];

	(void)state;
	for (size_t i = 0; i < sizeof(rows) / sizeof(rows[0]); i++) {
		check_found(archive, rows[i].text, 0, "drops", rows[i].drops);
		check_found(archive, rows[i].text, 0, "series", rows[i].series);
	}
	filter.text = "a b c d e f g h i";
	assert_int_equal(archive_each_drop(archive, &filter, trial_see, &seen), DT_E_ARGUMENT);
	memset(longer, 'x', 61);
	longer[61] = '\0';
	filter.text = longer;
	assert_int_equal(archive_each_drop(archive, &filter, trial_see, &seen), DT_E_ARGUMENT);
	assert_non_null(strstr(archive_message(archive), "60 characters"));
	filter.text = longer + 1;
	assert_int_equal(archive_each_drop(archive, &filter, trial_see, &seen), 0);
	assert_int_equal(seen.count, 0);
	archive_close(archive);
}

static void test_a_limit_takes_the_newest_and_tells_of_more(void **state)
{
	struct archive *archive = with_words();
	struct archive_filter filter = archive_filter_none();
	char *text;

	(void)state;
	trial_sql("UPDATE drops SET time = '2026-01-0' || (7 - id) || 'T08:00:00Z';"
	          "UPDATE series SET created = '2026-01-05T09:00:00Z' WHERE name = 'empty'");
	check_found(archive, NULL, 0, "drops", "box/1 box/2 rig_b/1 ");
	check_found(archive, NULL, 1, "drops", "box/1 more");
	check_found(archive, NULL, 2, "drops", "box/1 box/2 more");
	check_found(archive, NULL, 3, "drops", "box/1 box/2 rig_b/1 ");
	check_found(archive, NULL, 4, "drops", "box/1 box/2 rig_b/1 ");
	check_found(archive, NULL, 1, "series", "box more");
	check_found(archive, NULL, 2, "series", "box empty more");
	check_found(archive, NULL, 3, "series", "box empty rig_b ");
	check_found(archive, "winter", 1, "series", "empty more");
	trial_sql("UPDATE drops SET time = '2026-01-09T08:00:00Z' WHERE id = 3");
	check_found(archive, NULL, 2, "drops", "rig_b/1 box/1 more");
	filter.limit = 2;
	text = trial_printed(archive, &filter, TABLE_TEXT, false);
	assert_non_null(strstr(text, "there are more: these are the newest 2"));
	free(text);
	archive_close(archive);
}

/* Drops in the minutes 23:00 and 23:01, and the next day 22:59. */
static void test_minutes_are_a_filter(void **state)
{
	static const struct {
		const char *text;
		int count;
		const char *first; /* its log */
	} cases[] = {
	        {"2026-01-01T23:00..2026-01-02T22:59", 3, "box/"},
	        {"2026-01-01T23:01..2026-01-02T22:58", 1, "box/"},
	        {"2026-01-01T23:00", 1, "box/"},
	        {"2026-01-01", 2, "box/"},
	        {"2026-01-01T23:02..2026-01-02", 1, "rig_b/"},
	};
	static const char *const none[] = {"2026-01-01T24:00", "2026-01-01T23:60",     "2026-01-01T23",
	                                   "2026-02-29T08:00", "2026-01-01 23:00",     "2026-01-01T23:0",
	                                   "2026-01T23:00",    "2026-01-01T23:00:00Z", "2026-01-01T23:00Z"};
	struct archive *archive = with_words();
	struct archive_dates dates;
	struct archive_filter filter = archive_filter_none();

	(void)state;
	trial_sql("UPDATE drops SET time = '2026-01-01T23:00:59Z' WHERE id = 1;"
	          "UPDATE drops SET time = '2026-01-01T23:01:00Z' WHERE id = 2;"
	          "UPDATE drops SET time = '2026-01-02T22:59:59Z' WHERE id = 3");
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct trial_seen seen = {.count = 0};

		assert_true(archive_parse_dates(cases[i].text, &dates, &filter));
		assert_int_equal(archive_each_drop(archive, &filter, trial_see, &seen), 0);
		assert_int_equal(seen.count, cases[i].count);
		assert_non_null(strstr(seen.raw, cases[i].first));
	}
	for (size_t i = 0; i < sizeof(none) / sizeof(none[0]); i++)
		assert_false(archive_parse_dates(none[i], &dates, &filter));
	archive_close(archive);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        IN_A_TRIAL(test_means_by_hand),
	        IN_A_TRIAL(test_heights_are_not_averaged),
	        IN_A_TRIAL(test_ten_thousand_drops),
	        IN_A_TRIAL(test_json_of_nothing),
	        IN_A_TRIAL(test_words_find_drops),
	        IN_A_TRIAL(test_minutes_are_a_filter),
	        IN_A_TRIAL(test_a_limit_takes_the_newest_and_tells_of_more),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
