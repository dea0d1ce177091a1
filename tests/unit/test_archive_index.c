/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The index: of an older version, of another program, made again from what stands beside the raw files.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <cmocka.h>

#include "host/model/corner.h"
#include "tests/unit/archive_trial.h"
#include "tests/unit/near.h"

/* ---- schema ---- */

/* The tables as version 1 had them. */
static const char version_1[] =
        "CREATE TABLE campaigns (id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE, created TEXT NOT NULL);"
        "CREATE TABLE series (id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE, campaign_id INTEGER NOT NULL"
        " REFERENCES campaigns(id), scene_name TEXT NOT NULL, scene TEXT NOT NULL, angle_deg REAL NOT NULL,"
        " height_m REAL NOT NULL, plate_mass_kg REAL NOT NULL, planned INTEGER NOT NULL,"
        " created TEXT NOT NULL);"
        "CREATE TABLE drops (id INTEGER PRIMARY KEY, series_id INTEGER NOT NULL REFERENCES series(id),"
        " number INTEGER NOT NULL, state TEXT NOT NULL, decision TEXT NOT NULL DEFAULT 'open',"
        " reason TEXT NOT NULL DEFAULT '', operator TEXT NOT NULL DEFAULT '', note TEXT NOT NULL DEFAULT '',"
        " raw TEXT NOT NULL UNIQUE, bytes INTEGER, sha256 TEXT, time TEXT NOT NULL,"
        " UNIQUE (series_id, number));"
        "CREATE TABLE versions (id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE, first_used TEXT NOT NULL);"
        "CREATE TABLE results (id INTEGER PRIMARY KEY, drop_id INTEGER NOT NULL REFERENCES drops(id),"
        " version_id INTEGER NOT NULL REFERENCES versions(id), time TEXT NOT NULL, not_ok INTEGER NOT NULL,"
        " flags TEXT NOT NULL, s1_x_g REAL, s1_x_sigma_g REAL, s1_y_g REAL, s1_y_sigma_g REAL, s1_r_g REAL,"
        " s1_r_sigma_g REAL, s1_z_g REAL, s1_z_sigma_g REAL, s2_x_g REAL, s2_x_sigma_g REAL, s2_y_g REAL,"
        " s2_y_sigma_g REAL, s2_r_g REAL, s2_r_sigma_g REAL, s2_z_g REAL, s2_z_sigma_g REAL,"
        " lag_largest_peak_s REAL, lag_largest_peak_sigma_s REAL, lag_first_peak_s REAL,"
        " lag_first_peak_sigma_s REAL, lag_driven_s REAL, lag_driven_sigma_s REAL, frequency_hz REAL,"
        " frequency_sigma_hz REAL, three_cycle_frequency_hz REAL, three_cycle_frequency_sigma_hz REAL,"
        " damping_ratio REAL, damping_sigma_ratio REAL);"
        "CREATE TABLE texts (result_id INTEGER PRIMARY KEY REFERENCES results(id), json TEXT NOT NULL);"
        "CREATE TABLE flags (result_id INTEGER NOT NULL REFERENCES results(id), channel TEXT NOT NULL,"
        " flag TEXT NOT NULL, PRIMARY KEY (result_id, channel, flag)) WITHOUT ROWID;"
        "INSERT INTO campaigns VALUES (1, 'old', '2025-01-01T00:00:00Z');"
        "INSERT INTO series VALUES (1, 'one', 1, 'geometry-2A', 'name = x', 25, 0.894, 0.014, 5, '2025');"
        "INSERT INTO drops VALUES (1, 1, 1, 'recorded', 'accepted', '', 'Ann', '', 'raw/2025/one/0001.log',"
        " 3, '" TRIAL_HASH_OF_ABC "', '2025-01-01T08:00:00Z');"
        "INSERT INTO versions VALUES (1, 'v0', '2025');"
        "INSERT INTO results (drop_id, version_id, time, not_ok, flags, s1_x_g)"
        " VALUES (1, 1, '2025', 0, '', -345.5);"
        "PRAGMA application_id = 1148343415; PRAGMA user_version = 1;";

static int schema_version(void)
{
	sqlite3 *index = trial_index();
	sqlite3_stmt *s;
	int version;

	assert_int_equal(sqlite3_prepare_v2(index, "PRAGMA user_version", -1, &s, NULL), SQLITE_OK);
	assert_int_equal(sqlite3_step(s), SQLITE_ROW);
	version = sqlite3_column_int(s, 0);
	sqlite3_finalize(s);
	sqlite3_close(index);
	return version;
}

static void test_a_version_1_index_is_migrated(void **state)
{
	struct archive *archive;
	struct trial_seen seen;

	(void)state;
	trial_sql(version_1);
	archive = trial_open(ARCHIVE_READ);
	assert_int_equal(schema_version(), 7);
	seen = trial_look(archive, "one", 1, NULL);
	assert_string_equal(seen.decision, "accepted");
	assert_string_equal(seen.version, "v0");
	assert_near(seen.s1x, -345.5, 0);
	assert_false(seen.simulated);
	archive_close(archive);
	archive = trial_open(ARCHIVE_WRITE);
	assert_int_equal(archive_note(archive, "one/1", "Ann", "still here"), 0);
	archive_close(archive);
}

static void test_other_indexes_are_refused(void **state)
{
	(void)state;
	assert_null(archive_open(trial_folder, ARCHIVE_READ, trial_message));
	assert_non_null(strstr(trial_message, "no archive there"));
	trial_sql(version_1);
	trial_sql("PRAGMA user_version = 99");
	assert_null(archive_open(trial_folder, ARCHIVE_WRITE, trial_message));
	assert_non_null(strstr(trial_message, "newer"));
	trial_sql("PRAGMA user_version = 1; PRAGMA application_id = 7");
	assert_null(archive_open(trial_folder, ARCHIVE_WRITE, trial_message));
	assert_non_null(strstr(trial_message, "not an index of droptower"));
}

/* ---- care ---- */

static char *listing(void)
{
	struct archive_filter filter = archive_filter_none();
	struct archive *archive = trial_open(ARCHIVE_READ);
	char *text = NULL;
	size_t size;
	FILE *out = open_memstream(&text, &size);

	assert_non_null(out);
	assert_int_equal(print_series(archive, &filter, TABLE_JSON, out), 0);
	assert_int_equal(print_drops(archive, &filter, true, TABLE_JSON, out), 0);
	assert_int_equal(print_drops(archive, &filter, true, TABLE_CSV, out), 0);
	filter.series = "one"; /* with the history of each drop */
	assert_int_equal(print_drops(archive, &filter, true, TABLE_JSON, out), 0);
	filter.version = "v1";
	assert_int_equal(print_drops(archive, &filter, true, TABLE_JSON, out), 0);
	fclose(out);
	archive_close(archive);
	return text;
}

static void make_many_things(void)
{
	struct archive *archive = trial_with_series("one");
	struct archive_recording r;

	assert_int_equal(archive_new_series(archive, "empty", "other", TRIAL_BARE, 35, NAN, NULL, 3), 0);
	trial_record(archive, "one", "abc");
	trial_result(archive, "one/1", "v1", -1.0 / 3, 2);
	trial_result(archive, "one/1", "v2", -2.0 / 3, 2);
	trial_result(archive, "one/1", "v1", -4.0 / 3, 2);
	trial_record(archive, "one", "def");
	assert_int_equal(archive_decide(archive, "one/2", ARCHIVE_REJECTED, "Ann", "a \"reason\", = 5; [x]"),
	                 0);
	assert_int_equal(archive_decide(archive, "one/1", ARCHIVE_ACCEPTED, "Ann", ""), 0);
	assert_int_equal(archive_note(archive, "one/2", "J\xc3\xbcrg", "  blanks kept  "), 0);
	assert_int_equal(archive_begin(archive, "one", "Ann", ".log", true, &r), 0);
	archive_abandon(&r);
	archive_close(archive);
}

static void test_the_index_can_be_made_again(void **state)
{
	char path[128], *before, *after;
	int wrong = 0;

	(void)state;
	make_many_things();
	before = listing();
	snprintf(path, sizeof(path), "%s/index.sqlite", trial_folder);
	assert_int_equal(truncate(path, 5000), 0);
	assert_int_equal(archive_rebuild(trial_folder, false, trial_count, &wrong, trial_message), 0);
	assert_int_equal(wrong, 0);
	after = listing();
	assert_string_equal(after, before);
	free(after);
	assert_int_equal(unlink(path), 0);
	assert_null(archive_open(trial_folder, ARCHIVE_CREATE, trial_message));
	assert_non_null(strstr(trial_message, "--rebuild"));
	assert_int_equal(archive_rebuild(trial_folder, false, trial_count, &wrong, trial_message), 0);
	after = listing();
	assert_string_equal(after, before);
	free(after);
	free(before);
}

static void test_a_damaged_sidecar_is_left_out_and_told(void **state)
{
	struct archive *archive;
	char path[256], raw[160];
	int wrong = 0;

	(void)state;
	make_many_things();
	archive = trial_open(ARCHIVE_READ);
	strcpy(raw, trial_look(archive, "one", 2, NULL).raw);
	archive_close(archive);
	strcpy(strrchr(raw, '.'), ".ini");
	snprintf(path, sizeof(path), "%s/%s", trial_folder, raw);
	assert_int_equal(truncate(path, 300), 0);
	assert_int_equal(archive_rebuild(trial_folder, false, trial_count, &wrong, trial_message),
	                 DT_E_STATE);
	assert_non_null(strstr(trial_message, "2 drops in the raw files, expected the 3 known"));
	wrong = 0;
	assert_int_equal(archive_rebuild(trial_folder, true, trial_count, &wrong, trial_message), 0);
	assert_int_equal(wrong, 1);
	archive = trial_open(ARCHIVE_WRITE);
	assert_int_equal(trial_look(archive, "one", 1, NULL).count, 1);
	assert_int_equal(trial_look(archive, "one", 2, NULL).count, 0);
	assert_null(archive_open("/", ARCHIVE_READ, trial_message));
	assert_int_equal(archive_rebuild(trial_folder, true, trial_count, &wrong, trial_message), DT_E_STATE);
	assert_non_null(strstr(trial_message, "another program"));
	archive_close(archive);
}

static int copy_series(void *context, const struct archive_series *series)
{
	*(struct archive_series *)context = *series;
	return 0;
}

static struct archive_series the_series(struct archive *archive)
{
	struct archive_filter filter = archive_filter_none();
	struct archive_series series = {0};

	assert_int_equal(archive_each_series(archive, &filter, copy_series, &series), 0);
	return series;
}

static void test_raw_files_are_verified(void **state)
{
	struct archive *archive = trial_with_series("one");
	char path[256];
	int wrong = 0;
	FILE *out;

	(void)state;
	trial_record(archive, "one", "abc");
	trial_record(archive, "one", "def");
	assert_int_equal(archive_verify(archive, NULL, 0, trial_count, &wrong), 0);
	assert_int_equal(archive_decide(archive, "one/1", ARCHIVE_ACCEPTED, "Ann", ""), 0);
	assert_int_equal(archive_decide(archive, "one/2", ARCHIVE_REJECTED, "Ann", "cable"), 0);
	assert_int_equal(the_series(archive).accepted, 1);
	snprintf(path, sizeof(path), "%s/%s", trial_folder, trial_look(archive, "one", 1, NULL).raw);
	out = fopen(path, "r+");
	assert_non_null(out);
	fputs("abd", out);
	fclose(out);
	assert_int_equal(archive_verify(archive, NULL, 0, trial_count, &wrong), 1);
	assert_string_equal(trial_look(archive, "one", 1, NULL).state, "altered");
	assert_int_equal(the_series(archive).accepted, 0); /* as it is in no mean */
	assert_int_equal(the_series(archive).rejected, 1);
	assert_int_equal(the_series(archive).faulty, 1);
	assert_int_equal(archive_decide(archive, "one/1", ARCHIVE_ACCEPTED, "Ann", ""), DT_E_CORRUPT);
	assert_int_equal(unlink(path), 0);
	assert_int_equal(archive_verify(archive, NULL, 0, trial_count, &wrong), 1);
	assert_int_equal(wrong, 2);
	assert_string_equal(trial_look(archive, "one", 1, NULL).state, "missing");
	archive_close(archive);
}

/* It may be what was recorded: nothing is said of it, nothing done to it, and the index keeps what it knew.
 */
static void test_a_file_that_cannot_be_read(void **state)
{
	struct archive *archive = trial_with_series("one");
	char path[256];
	int wrong = 0;

	(void)state;
	trial_record(archive, "one", "abc");
	assert_string_equal(archive_unread(archive), "");
	snprintf(path, sizeof(path), "%s/%s", trial_folder, trial_look(archive, "one", 1, NULL).raw);
	assert_int_equal(unlink(path), 0);
	assert_int_equal(mkdir(path, 0777), 0);
	assert_int_equal(archive_verify(archive, NULL, 0, trial_count, &wrong), 1);
	assert_non_null(strstr(archive_unread(archive), "0001.log: cannot be read: Is a directory"));
	assert_string_equal(trial_look(archive, "one", 1, NULL).state, "altered");
	assert_int_equal(archive_note(archive, "one/1", "Ann", "why"), DT_E_SYSTEM);
	archive_close(archive);
	archive = trial_open(ARCHIVE_READ);
	assert_string_equal(trial_look(archive, "one", 1, NULL).state, "recorded");
	archive_close(archive);
}

/* Its writer ended between the chain's entry and the sidecar's place: whole all the same. */
static void test_a_series_staged_but_not_in_its_place(void **state)
{
	struct archive *archive = trial_with_series("one");
	char path[256], part[264], *end;
	int wrong = 0;

	(void)state;
	trial_record(archive, "one", "abc");
	snprintf(path, sizeof(path), "%s/%s", trial_folder, trial_look(archive, "one", 1, NULL).raw);
	end = strrchr(path, '/');
	assert_non_null(end);
	strcpy(end, "/series.ini");
	snprintf(part, sizeof(part), "%s.part", path);
	assert_int_equal(rename(path, part), 0);
	assert_int_equal(archive_verify(archive, NULL, 0, trial_count, &wrong), 0);
	assert_int_equal(unlink(part), 0);
	assert_int_equal(archive_verify(archive, NULL, 0, trial_count, &wrong), 1);
	archive_close(archive);
}

/* The same of a drop, when the index is made again before anybody else writes. */
static void test_a_drop_staged_but_not_in_its_place_is_rebuilt(void **state)
{
	struct archive *archive = trial_with_series("one");
	char path[256], part[264], hash[72];
	int wrong = 0;

	(void)state;
	trial_record(archive, "one", "abc");
	trial_record(archive, "one", "def");
	snprintf(path, sizeof(path), "%s/%s", trial_folder, trial_look(archive, "one", 2, NULL).raw);
	snprintf(hash, sizeof(hash), "%s", trial_look(archive, "one", 2, NULL).hash);
	archive_close(archive);
	strcpy(strrchr(path, '.'), ".ini");
	snprintf(part, sizeof(part), "%s.part", path);
	assert_int_equal(rename(path, part), 0);
	assert_int_equal(archive_rebuild(trial_folder, false, trial_count, &wrong, trial_message), 0);
	assert_int_equal(wrong, 0);
	assert_int_equal(access(part, F_OK), -1);
	archive = trial_open(ARCHIVE_READ);
	assert_string_equal(trial_look(archive, "one", 2, NULL).state, "recorded");
	assert_string_equal(trial_look(archive, "one", 2, NULL).hash, hash);
	archive_close(archive);
}

/* ---- heights ---- */

static void write_scene(const char *path, const char *section, const char *key)
{
	FILE *in = fopen(TRIAL_SCENE, "r"), *out = fopen(path, "w");
	char line[300];

	assert_non_null(in);
	assert_non_null(out);
	while (fgets(line, sizeof(line), in) != NULL)
		fputs(strcmp(line, "[drop]\n") == 0                ? section
		      : strncmp(line, "height_m = 0.894", 16) == 0 ? key
		                                                   : line,
		      out);
	fclose(in);
	assert_int_equal(fclose(out), 0);
}

/* Gates and separation go with the height, as if the file had said so. */
static void test_a_series_from_another_height(void **state)
{
	static const char *const sections[] = {"[drop]\n", "[drop] ; height_m = 7\n", "[drop]  \n"};
	static const char *const keys[] = {"height_m = 0.894\n", "  height_m:0.894 ; as the study\n",
	                                   "height_m\t=\t0.894\n"};
	struct archive *archive = trial_open(ARCHIVE_CREATE);
	struct scene scene, expected;
	char path[100], name[8];

	(void)state;
	snprintf(path, sizeof(path), "%s/scene.ini", trial_folder);
	write_scene(path, "[drop]\n", "height_m = 0.6\n");
	assert_int_equal(scene_read(&expected, path, trial_message), 0);
	expected.drop_angle_deg = 33;
	for (int i = 0; i < 3; i++) {
		write_scene(path, sections[i], keys[i]);
		snprintf(name, sizeof(name), "s%d", i);
		assert_int_equal(archive_new_series(archive, name, "trial", path, 33, 0.6, NULL, 5), 0);
		assert_int_equal(archive_scene(archive, name, &scene), 0);
		assert_memory_equal(&scene, &expected, sizeof(scene));
	}
	assert_int_equal(archive_new_series(archive, "flat", "trial", path, NAN, 0.04, NULL, 5), DT_E_RANGE);
	assert_int_equal(archive_new_series(archive, "low", "trial", path, NAN, 0.1, NULL, 5), 0);
	assert_int_equal(archive_scene(archive, "low", &scene), 0);
	assert_int_equal(scene_check_tower(&scene, "low", trial_message), DT_E_RANGE);
	assert_non_null(strstr(trial_message, "is the height too small?"));
	assert_int_equal(archive_new_series(archive, "high", "trial", path, NAN, 5.5, NULL, 5), DT_E_RANGE);
	archive_close(archive);
	assert_int_equal(unlink(path), 0);
	snprintf(path, sizeof(path), "%s/index.sqlite", trial_folder);
	assert_int_equal(unlink(path), 0);
	assert_int_equal(archive_rebuild(trial_folder, false, trial_count, &(int){0}, trial_message), 0);
	archive = trial_open(ARCHIVE_READ);
	assert_int_equal(archive_scene(archive, "s1", &scene), 0);
	assert_memory_equal(&scene, &expected, sizeof(scene));
	archive_close(archive);
}

static void write_whole_scene(const char *path, const struct scene *scene)
{
	FILE *out = fopen(path, "w");

	assert_non_null(out);
	scene_write(scene, out);
	assert_int_equal(fclose(out), 0);
}

/* A contact that was left to be predicted: its numbers at the series' angle and height, and their bar. */
static void test_a_series_keeps_what_was_predicted(void **state)
{
	struct archive *archive = trial_open(ARCHIVE_CREATE);
	struct scene scene, expected;
	char path[100];

	(void)state;
	snprintf(path, sizeof(path), "%s/scene.ini", trial_folder);
	assert_int_equal(scene_read(&expected, TRIAL_SCENE, trial_message), 0);
	expected.contact_stiffness_n_m15 = expected.contact_duration_s = (double)NAN;
	write_whole_scene(path, &expected);
	assert_int_equal(archive_new_series(archive, "s", "trial", path, 33, 0.7, NULL, 5), 0);
	expected.drop_angle_deg = 33;
	expected.drop_height_m = 0.7;
	assert_int_equal(corner_fill(&expected, trial_message), 0);
	for (int again = 0; again < 2; again++) {
		assert_int_equal(archive_scene(archive, "s", &scene), 0);
		assert_near_part(scene.contact_stiffness_n_m15, expected.contact_stiffness_n_m15, 1e-14);
		assert_near_part(scene.contact_duration_s, expected.contact_duration_s, 1e-14);
		assert_near(scene.contact_duration_height_m, 0.894, 0);
		assert_near_part(scene.fitted_u[0], expected.fitted_u[0], 1e-5);
		assert_true(scene.fitted_u[0] > 0.5 && corner_predicted(&scene));
		archive_close(archive);
		assert_int_equal(archive_rebuild(trial_folder, false, trial_count, &(int){0}, trial_message),
		                 0);
		archive = trial_open(ARCHIVE_WRITE);
	}
	expected.contact_stiffness_n_m15 = expected.contact_duration_s = (double)NAN;
	expected.contact_corner_radius_m = 0.001;
	expected.fitted_u[0] = 0.0;
	write_whole_scene(path, &expected);
	assert_int_equal(archive_new_series(archive, "t", "trial", path, 33, 0.7, NULL, 5), DT_E_RANGE);
	assert_non_null(strstr(archive_message(archive), "corner_radius_m"));
	assert_int_equal(archive_scene(archive, "t", &scene), DT_E_UNKNOWN);
	archive_close(archive);
	assert_int_equal(unlink(path), 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        IN_A_TRIAL(test_a_version_1_index_is_migrated),
	        IN_A_TRIAL(test_other_indexes_are_refused),
	        IN_A_TRIAL(test_the_index_can_be_made_again),
	        IN_A_TRIAL(test_a_damaged_sidecar_is_left_out_and_told),
	        IN_A_TRIAL(test_raw_files_are_verified),
	        IN_A_TRIAL(test_a_file_that_cannot_be_read),
	        IN_A_TRIAL(test_a_series_staged_but_not_in_its_place),
	        IN_A_TRIAL(test_a_drop_staged_but_not_in_its_place_is_rebuilt),
	        IN_A_TRIAL(test_a_series_from_another_height),
	        IN_A_TRIAL(test_a_series_keeps_what_was_predicted),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
