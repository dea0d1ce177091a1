/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What becomes of a drop: recorded or interrupted, decided, with its results.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "tests/unit/archive_trial.h"
#include "tests/unit/near.h"

/* ---- recording ---- */

static void test_a_drop_is_partial_until_it_is_whole(void **state)
{
	struct archive *archive = trial_with_series("one"), *other = trial_open(ARCHIVE_READ);
	struct archive_recording r;

	(void)state;
	assert_int_equal(archive_begin(archive, "one", "Ann", ".log", false, &r), 0);
	assert_string_equal(trial_look(other, "one", 1, NULL).state, "recording");
	trial_write_log(&r, "abc");
	archive_abandon(&r);
	assert_string_equal(trial_look(other, "one", 1, NULL).state, "interrupted");
	assert_int_equal(trial_record(archive, "one", "abc"), 2);
	assert_string_equal(trial_look(other, "one", 2, NULL).state, "recorded");
	assert_string_equal(trial_look(other, "one", 2, NULL).hash, TRIAL_HASH_OF_ABC);
	assert_string_equal(trial_look(other, "one", 1, NULL).state, "interrupted");
	archive_close(other);
	archive_close(archive);
}

static void test_changes_by_others_are_seen(void **state)
{
	struct archive *archive = trial_with_series("one"), *other = trial_open(ARCHIVE_WRITE);
	int64_t before, after;

	(void)state;
	assert_int_equal(archive_changes(archive, &before), 0);
	trial_record(archive, "one", "abc");
	assert_int_equal(archive_changes(archive, &after), 0);
	assert_int_equal(after, before);
	assert_int_equal(archive_note(other, "one/1", "Ann", "seen"), 0);
	assert_int_equal(archive_changes(archive, &after), 0);
	assert_int_not_equal(after, before);
	archive_close(other);
	archive_close(archive);
}

static void test_nothing_stays_of_what_was_discarded(void **state)
{
	struct archive *archive = trial_with_series("one");
	struct archive_recording r;
	char path[ARCHIVE_PATH_MAX];

	(void)state;
	assert_int_equal(archive_begin(archive, "one", "Ann", ".log", false, &r), 0);
	strcpy(path, r.log);
	archive_discard(archive, &r);
	assert_int_equal(access(path, F_OK), -1);
	assert_int_equal(trial_look(archive, "one", 1, NULL).count, 0);
	assert_int_equal(trial_record(archive, "one", "abc"), 1);
	archive_close(archive);
}

static void test_a_log_that_stands_there_is_not_written_over(void **state)
{
	struct archive *archive = trial_with_series("one");
	struct archive_recording r;
	char path[ARCHIVE_PATH_MAX];
	FILE *out;

	(void)state;
	assert_int_equal(archive_begin(archive, "one", "Ann", ".log", false, &r), 0);
	strcpy(path, r.log);
	archive_discard(archive, &r);
	out = fopen(path, "w");
	assert_non_null(out);
	fputs("somebody's", out);
	fclose(out);
	assert_int_equal(trial_record(archive, "one", "abc"), 2);
	archive_close(archive);
}

static const cJSON *nth(const cJSON *root, const char *list, int number, const char *key)
{
	return cJSON_GetObjectItem(cJSON_GetArrayItem(cJSON_GetObjectItem(root, list), number), key);
}

static void test_a_simulated_drop_says_so(void **state)
{
	struct archive_filter filter = archive_filter_none();
	struct archive *archive = trial_with_series("one");
	struct archive_recording r;
	char *text;
	cJSON *root;

	(void)state;
	trial_record(archive, "one", "abc");
	assert_int_equal(archive_begin(archive, "one", "Ann", ".log", true, &r), 0);
	trial_write_log(&r, "def");
	assert_int_equal(archive_finish(archive, &r, 0, ""), 0);
	assert_false(trial_look(archive, "one", 1, NULL).simulated);
	assert_true(trial_look(archive, "one", 2, NULL).simulated);
	text = trial_printed(archive, &filter, TABLE_JSON, true);
	root = cJSON_Parse(text);
	assert_true(cJSON_IsNull(nth(root, "drops", 0, "simulated")));
	assert_true(cJSON_IsTrue(nth(root, "drops", 1, "simulated")));
	cJSON_Delete(root);
	free(text);
	text = trial_printed(archive, &filter, TABLE_TEXT, true);
	assert_non_null(strstr(text, "simulated tower"));
	assert_null(strstr(strstr(text, "simulated tower") + 1, "simulated tower"));
	free(text);
	archive_close(archive);
}

/* ---- decisions ---- */

static int count_event(void *context, const struct archive_event *event)
{
	char *all = context;

	assert_int_equal(strlen(event->time), 20);
	snprintf(all + strlen(all), 400 - strlen(all), "%s by %s: %s; ", event->what, event->operator_name,
	         event->text);
	return 0;
}

static void test_a_rejection_needs_a_reason(void **state)
{
	struct archive *archive = trial_with_series("one");
	char all[400] = "";

	(void)state;
	trial_record(archive, "one", "abc");
	assert_int_equal(archive_decide(archive, "one/1", ARCHIVE_REJECTED, "Ann", ""), DT_E_ARGUMENT);
	assert_int_equal(archive_decide(archive, "one/1", ARCHIVE_REJECTED, "Ann", "  "), DT_E_ARGUMENT);
	assert_int_equal(archive_decide(archive, "one/1", ARCHIVE_REJECTED, " ", "cable"), DT_E_ARGUMENT);
	assert_int_equal(archive_note(archive, "one/1", "", "seen"), DT_E_ARGUMENT);
	assert_string_equal(trial_look(archive, "one", 1, NULL).decision, "open");
	assert_int_equal(archive_decide(archive, "one/1", ARCHIVE_REJECTED, "Ann", "cable"), 0);
	assert_string_equal(trial_look(archive, "one", 1, NULL).decision, "rejected");
	assert_string_equal(trial_look(archive, "one", 1, NULL).reason, "cable");
	assert_int_equal(archive_decide(archive, "one/1", ARCHIVE_ACCEPTED, "Bo", ""), 0);
	assert_int_equal(archive_note(archive, "one/1", "Bo", "looked at it"), 0);
	assert_int_equal(archive_each_event(archive, "one/1", count_event, all), 0);
	assert_string_equal(all, "rejected by Ann: cable; accepted by Bo: ; note by Bo: looked at it; ");
	archive_close(archive);
}

static void test_what_is_not_whole_is_not_decided(void **state)
{
	struct archive *archive = trial_with_series("one");
	struct archive_recording r;

	(void)state;
	assert_int_equal(archive_begin(archive, "one", "Ann", ".log", false, &r), 0);
	assert_int_equal(archive_decide(archive, "one/1", ARCHIVE_ACCEPTED, "Ann", ""), DT_E_STATE);
	archive_abandon(&r);
	assert_int_equal(archive_decide(archive, "one/1", ARCHIVE_ACCEPTED, "Ann", ""), DT_E_STATE);
	assert_int_equal(archive_decide(archive, "one/2", ARCHIVE_ACCEPTED, "Ann", ""), DT_E_UNKNOWN);
	assert_int_equal(archive_decide(archive, "one", ARCHIVE_ACCEPTED, "Ann", ""), DT_E_ARGUMENT);
	archive_close(archive);
}

static void test_names_stay_inside_the_folder(void **state)
{
	static const char *const wrong[] = {
	        "",    ".",
	        "..",  "../x",
	        "a/b", ".hidden",
	        "-x",  "a b",
	        "a\n", "1234567890123456789012345678901234567890123456789012345678901"};
	struct archive *archive = trial_with_series("one");

	(void)state;
	for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++) {
		assert_int_equal(
		        archive_new_series(archive, wrong[i], "trial", TRIAL_SCENE, 25, NAN, NULL, 5),
		        DT_E_ARGUMENT);
		assert_int_equal(archive_new_series(archive, "two", wrong[i], TRIAL_SCENE, 25, NAN, NULL, 5),
		                 DT_E_ARGUMENT);
	}
	assert_int_equal(archive_new_series(archive, "one", "trial", TRIAL_SCENE, 25, NAN, NULL, 5),
	                 DT_E_STATE);
	assert_int_equal(archive_new_series(archive, "two", "trial", "README.md", 25, NAN, NULL, 5),
	                 DT_E_FORMAT);
	assert_int_equal(archive_new_series(archive, "two", "trial", TRIAL_SCENE, 95, NAN, NULL, 5),
	                 DT_E_RANGE);
	trial_record(archive, "one", "abc");
	assert_int_equal(archive_note(archive, "one/1", "Bo", "a C1 \xC2\x9B control"), DT_E_ARGUMENT);
	assert_int_equal(archive_note(archive, "one/1", "Bo", "turned \xE2\x80\xAE round"), DT_E_ARGUMENT);
	assert_int_equal(archive_note(archive, "one/1", "Bo", "Latin 1 \xFC"), DT_E_ARGUMENT);
	assert_int_equal(archive_note(archive, "one/1", "", "by nobody"), DT_E_ARGUMENT);
	assert_int_equal(archive_note(archive, "one/1", "Bo", "two\nlines"), DT_E_ARGUMENT);
	archive_close(archive);
}

/* ---- results ---- */

static void test_old_results_stay(void **state)
{
	struct archive *archive = trial_with_series("one");
	struct record record = {.channel_count = 0};
	struct analysis analysis = {.channel_count = 0};
	struct estimate_options options = {.tolerance = 0};
	struct result said;
	struct trial_seen seen;
	char *json;

	(void)state;
	trial_record(archive, "one", "abc");
	assert_string_equal(trial_look(archive, "one", 1, NULL).version, "none");
	trial_result(archive, "one/1", "v1", -300.25, 400);
	trial_result(archive, "one/1", "v2", -310.5, 410);
	seen = trial_look(archive, "one", 1, NULL);
	assert_string_equal(seen.version, "v2");
	assert_near(seen.s1x, -310.5, 0);
	assert_near(seen.sigma, 0.5, 0);
	assert_near(seen.s2r, 7.5, 0);
	assert_string_equal(seen.flags, "clipped");
	assert_int_equal(seen.not_ok >> ARCHIVE_S1_X & 1, 0);
	assert_int_equal(seen.not_ok >> ARCHIVE_S2_X & 1, 1);
	assert_near(trial_look(archive, "one", 1, "v1").s1x, -300.25, 0);
	trial_result(archive, "one/1", "v1", -301, 400);
	assert_string_equal(trial_look(archive, "one", 1, NULL).version, "v1");
	assert_near(trial_look(archive, "one", 1, "v1").s1x, -301, 0);
	assert_string_equal(trial_look(archive, "one", 1, "v3").version, "none");
	assert_int_equal(archive_json(archive, "one/1", "v2", &json), 0);
	assert_non_null(strstr(json, "-310.5"));
	free(json);
	assert_int_equal(archive_json(archive, "one/1", "v3", &json), DT_E_EMPTY);
	said = result_of(&record, &analysis, &options);
	assert_int_equal(archive_result(archive, "one/1", "../v4", &said, "{}"), DT_E_ARGUMENT);
	archive_close(archive);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        IN_A_TRIAL(test_a_drop_is_partial_until_it_is_whole),
	        IN_A_TRIAL(test_changes_by_others_are_seen),
	        IN_A_TRIAL(test_nothing_stays_of_what_was_discarded),
	        IN_A_TRIAL(test_a_log_that_stands_there_is_not_written_over),
	        IN_A_TRIAL(test_a_simulated_drop_says_so),
	        IN_A_TRIAL(test_a_rejection_needs_a_reason),
	        IN_A_TRIAL(test_what_is_not_whole_is_not_decided),
	        IN_A_TRIAL(test_names_stay_inside_the_folder),
	        IN_A_TRIAL(test_old_results_stay),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
