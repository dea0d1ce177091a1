/* SPDX-License-Identifier: GPL-3.0-or-later */
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

#include <cjson/cJSON.h>
#include <sqlite3.h>

#include "host/archive/print.h"
#include "tests/unit/archive_stock.h"
#include "tests/unit/near.h"

#define SCENE "common/scenes/geometry-2A.ini"
#define BARE "common/scenes/geometry-1.ini"

/* FIPS 180-4: SHA-256 of "abc" */
#define HASH_OF_ABC "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"

static char folder[64];
static char message[ARCHIVE_MESSAGE_MAX];

static int make_folder(void **state)
{
	(void)state;
	strcpy(folder, "/tmp/droptower-archive-XXXXXX");
	return mkdtemp(folder) == NULL;
}

static int remove_folder(void **state)
{
	char command[100];

	(void)state;
	snprintf(command, sizeof(command), "rm -rf %s", folder);
	return system(command);
}

static struct archive *open_it(enum archive_mode mode)
{
	struct archive *archive = archive_open(folder, mode, message);

	if (archive == NULL)
		fail_msg("%s", message);
	return archive;
}

static struct archive *with_series(const char *name)
{
	struct archive *archive = open_it(ARCHIVE_CREATE);

	assert_int_equal(archive_new_series(archive, name, "trial", SCENE, 25, NAN, 5), 0);
	return archive;
}

static void write_log(const struct archive_recording *r, const char *text)
{
	FILE *out = fopen(r->log, "a");

	assert_non_null(out);
	fputs(text, out);
	assert_int_equal(fclose(out), 0);
}

static unsigned record_one(struct archive *archive, const char *series, const char *text)
{
	struct archive_recording r;

	assert_int_equal(archive_begin(archive, series, "Ann", ".log", false, &r), 0);
	write_log(&r, text);
	assert_int_equal(archive_finish(archive, &r, 0, ""), 0);
	return r.number;
}

/* What an analysis would say, with these peaks. */
static void give_result(struct archive *archive, const char *drop, const char *version, double s1x,
                        double s2x)
{
	char json[600];

	snprintf(json, sizeof(json),
	         "{\"flags\":[\"clipped\"],\"channels\":[{\"name\":\"S1X\",\"flags\":[],\"peak\":{\"value_"
	         "g\":%.17g,"
	         "\"sigma_g\":0.5,\"status\":\"ok\"}},{\"name\":\"S2X\",\"flags\":[\"clipped\"],\"peak\":{"
	         "\"value_g\":%.17g,\"sigma_g\":null,\"status\":\"clipped\"}}],\"resultants\":[{\"sensor\":"
	         "\"S2\","
	         "\"peak_g\":7.5,\"sigma_g\":1,\"status\":\"ok\"}],\"lag\":null,\"plate\":null}",
	         s1x, s2x);
	assert_int_equal(archive_result(archive, drop, version, json), 0);
}

/* The first drop that passes; its texts are copied. */
struct seen {
	int count;
	char state[16], decision[16], hash[72], raw[160], version[64], flags[64], reason[64];
	double s1x, s2x, s2r, sigma;
	unsigned not_ok;
	bool simulated;
};

static int see(void *context, const struct archive_drop *drop)
{
	struct seen *seen = context;

	if (seen->count++ > 0)
		return 0;
	snprintf(seen->state, sizeof(seen->state), "%s", drop->state);
	snprintf(seen->decision, sizeof(seen->decision), "%s", drop->decision);
	snprintf(seen->hash, sizeof(seen->hash), "%s", drop->sha256);
	snprintf(seen->raw, sizeof(seen->raw), "%s", drop->raw);
	snprintf(seen->flags, sizeof(seen->flags), "%s", drop->flags);
	snprintf(seen->reason, sizeof(seen->reason), "%s", drop->reason);
	snprintf(seen->version, sizeof(seen->version), "%s", drop->version != NULL ? drop->version : "none");
	seen->s1x = drop->value[ARCHIVE_S1_X];
	seen->s2x = drop->value[ARCHIVE_S2_X];
	seen->s2r = drop->value[ARCHIVE_S2_R];
	seen->sigma = drop->sigma[ARCHIVE_S1_X];
	seen->not_ok = drop->not_ok;
	seen->simulated = drop->simulated;
	return 0;
}

static struct seen look(struct archive *archive, const char *series, unsigned number, const char *version)
{
	struct archive_filter filter = archive_filter_none();
	struct seen seen = {.count = 0};

	filter.series = series;
	filter.number = number;
	filter.version = version;
	assert_int_equal(archive_each_drop(archive, &filter, see, &seen), 0);
	return seen;
}

/* ---- recording ---- */

static void test_a_drop_is_partial_until_it_is_whole(void **state)
{
	struct archive *archive = with_series("one"), *other = open_it(ARCHIVE_READ);
	struct archive_recording r;

	(void)state;
	assert_int_equal(archive_begin(archive, "one", "Ann", ".log", false, &r), 0);
	assert_string_equal(look(other, "one", 1, NULL).state, "recording");
	write_log(&r, "abc");
	archive_abandon(&r);
	assert_string_equal(look(other, "one", 1, NULL).state, "interrupted");
	assert_int_equal(record_one(archive, "one", "abc"), 2);
	assert_string_equal(look(other, "one", 2, NULL).state, "recorded");
	assert_string_equal(look(other, "one", 2, NULL).hash, HASH_OF_ABC);
	assert_string_equal(look(other, "one", 1, NULL).state, "interrupted");
	archive_close(other);
	archive_close(archive);
}

static void test_changes_by_others_are_seen(void **state)
{
	struct archive *archive = with_series("one"), *other = open_it(ARCHIVE_WRITE);
	int64_t before, after;

	(void)state;
	assert_int_equal(archive_changes(archive, &before), 0);
	record_one(archive, "one", "abc");
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
	struct archive *archive = with_series("one");
	struct archive_recording r;
	char path[ARCHIVE_PATH_MAX];

	(void)state;
	assert_int_equal(archive_begin(archive, "one", "", ".log", false, &r), 0);
	strcpy(path, r.log);
	archive_discard(archive, &r);
	assert_int_equal(access(path, F_OK), -1);
	assert_int_equal(look(archive, "one", 1, NULL).count, 0);
	assert_int_equal(record_one(archive, "one", "abc"), 1);
	archive_close(archive);
}

static void test_a_log_that_stands_there_is_not_written_over(void **state)
{
	struct archive *archive = with_series("one");
	struct archive_recording r;
	char path[ARCHIVE_PATH_MAX];
	FILE *out;

	(void)state;
	assert_int_equal(archive_begin(archive, "one", "", ".log", false, &r), 0);
	strcpy(path, r.log);
	archive_discard(archive, &r);
	out = fopen(path, "w");
	assert_non_null(out);
	fputs("somebody's", out);
	fclose(out);
	assert_int_equal(record_one(archive, "one", "abc"), 2);
	archive_close(archive);
}

static unsigned record_simulated(struct archive *archive, const char *series, const char *text)
{
	struct archive_recording r;

	assert_int_equal(archive_begin(archive, series, "Ann", ".log", true, &r), 0);
	write_log(&r, text);
	assert_int_equal(archive_finish(archive, &r, 0, ""), 0);
	return r.number;
}

/* What `series drops` prints, else `series list`; to be freed. */
static char *printed(struct archive *archive, const struct archive_filter *filter, enum print_format format,
                     bool drops)
{
	char *text = NULL;
	size_t size;
	FILE *out = open_memstream(&text, &size);

	assert_non_null(out);
	if (drops)
		assert_int_equal(print_drops(archive, filter, true, format, out), 0);
	else
		assert_int_equal(print_series(archive, filter, format, out), 0);
	fclose(out);
	return text;
}

static const cJSON *nth(const cJSON *root, const char *list, int number, const char *key)
{
	return cJSON_GetObjectItem(cJSON_GetArrayItem(cJSON_GetObjectItem(root, list), number), key);
}

static void test_a_simulated_drop_says_so(void **state)
{
	struct archive_filter filter = archive_filter_none();
	struct archive *archive = with_series("one");
	char *text;
	cJSON *root;

	(void)state;
	record_one(archive, "one", "abc");
	record_simulated(archive, "one", "def");
	assert_false(look(archive, "one", 1, NULL).simulated);
	assert_true(look(archive, "one", 2, NULL).simulated);
	text = printed(archive, &filter, PRINT_JSON, true);
	root = cJSON_Parse(text);
	assert_true(cJSON_IsNull(nth(root, "drops", 0, "simulated")));
	assert_true(cJSON_IsTrue(nth(root, "drops", 1, "simulated")));
	cJSON_Delete(root);
	free(text);
	text = printed(archive, &filter, PRINT_TEXT, true);
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
	struct archive *archive = with_series("one");
	char all[400] = "";

	(void)state;
	record_one(archive, "one", "abc");
	assert_int_equal(archive_decide(archive, "one/1", ARCHIVE_REJECTED, "Ann", ""), DT_E_ARGUMENT);
	assert_int_equal(archive_decide(archive, "one/1", ARCHIVE_REJECTED, "Ann", "  "), DT_E_ARGUMENT);
	assert_string_equal(look(archive, "one", 1, NULL).decision, "open");
	assert_int_equal(archive_decide(archive, "one/1", ARCHIVE_REJECTED, "Ann", "cable"), 0);
	assert_string_equal(look(archive, "one", 1, NULL).decision, "rejected");
	assert_string_equal(look(archive, "one", 1, NULL).reason, "cable");
	assert_int_equal(archive_decide(archive, "one/1", ARCHIVE_ACCEPTED, "Bo", ""), 0);
	assert_int_equal(archive_note(archive, "one/1", "Bo", "looked at it"), 0);
	assert_int_equal(archive_each_event(archive, "one/1", count_event, all), 0);
	assert_string_equal(all, "rejected by Ann: cable; accepted by Bo: ; note by Bo: looked at it; ");
	archive_close(archive);
}

static void test_what_is_not_whole_is_not_decided(void **state)
{
	struct archive *archive = with_series("one");
	struct archive_recording r;

	(void)state;
	assert_int_equal(archive_begin(archive, "one", "", ".log", false, &r), 0);
	assert_int_equal(archive_decide(archive, "one/1", ARCHIVE_ACCEPTED, "", ""), DT_E_STATE);
	archive_abandon(&r);
	assert_int_equal(archive_decide(archive, "one/1", ARCHIVE_ACCEPTED, "", ""), DT_E_STATE);
	assert_int_equal(archive_decide(archive, "one/2", ARCHIVE_ACCEPTED, "", ""), DT_E_UNKNOWN);
	assert_int_equal(archive_decide(archive, "one", ARCHIVE_ACCEPTED, "", ""), DT_E_ARGUMENT);
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
	struct archive *archive = with_series("one");

	(void)state;
	for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++) {
		assert_int_equal(archive_new_series(archive, wrong[i], "trial", SCENE, 25, NAN, 5),
		                 DT_E_ARGUMENT);
		assert_int_equal(archive_new_series(archive, "two", wrong[i], SCENE, 25, NAN, 5),
		                 DT_E_ARGUMENT);
	}
	assert_int_equal(archive_new_series(archive, "one", "trial", SCENE, 25, NAN, 5), DT_E_STATE);
	assert_int_equal(archive_new_series(archive, "two", "trial", "README.md", 25, NAN, 5), DT_E_FORMAT);
	assert_int_equal(archive_new_series(archive, "two", "trial", SCENE, 95, NAN, 5), DT_E_RANGE);
	record_one(archive, "one", "abc");
	assert_int_equal(archive_note(archive, "one/1", "", "two\nlines"), DT_E_ARGUMENT);
	archive_close(archive);
}

/* ---- results ---- */

static void test_old_results_stay(void **state)
{
	struct archive *archive = with_series("one");
	struct seen seen;
	char *json;

	(void)state;
	record_one(archive, "one", "abc");
	assert_string_equal(look(archive, "one", 1, NULL).version, "none");
	give_result(archive, "one/1", "v1", -300.25, 400);
	give_result(archive, "one/1", "v2", -310.5, 410);
	seen = look(archive, "one", 1, NULL);
	assert_string_equal(seen.version, "v2");
	assert_near(seen.s1x, -310.5, 0);
	assert_near(seen.sigma, 0.5, 0);
	assert_near(seen.s2r, 7.5, 0);
	assert_string_equal(seen.flags, "clipped");
	assert_int_equal(seen.not_ok >> ARCHIVE_S1_X & 1, 0);
	assert_int_equal(seen.not_ok >> ARCHIVE_S2_X & 1, 1);
	assert_near(look(archive, "one", 1, "v1").s1x, -300.25, 0);
	give_result(archive, "one/1", "v1", -301, 400);
	assert_string_equal(look(archive, "one", 1, NULL).version, "v1");
	assert_near(look(archive, "one", 1, "v1").s1x, -301, 0);
	assert_string_equal(look(archive, "one", 1, "v3").version, "none");
	json = archive_json(archive, "one/1", "v2");
	assert_non_null(strstr(json, "-310.5"));
	free(json);
	assert_null(archive_json(archive, "one/1", "v3"));
	assert_int_equal(archive_result(archive, "one/1", "v4", "{\"channels\":"), DT_E_FORMAT);
	assert_int_equal(archive_result(archive, "one/1", "../v4", "{\"channels\":[]}"), DT_E_ARGUMENT);
	archive_close(archive);
}

/* 2 4 4 4 5 5 7 9: mean 5, sum of squared deviations 32. */
static void fill_eight(struct archive *archive, const char *series, double factor)
{
	static const double values[] = {2, 4, 4, 4, 5, 5, 7, 9};

	for (unsigned i = 0; i < 8; i++) {
		char text[16], drop[64];

		snprintf(text, sizeof(text), "%s %u", series, i);
		snprintf(drop, sizeof(drop), "%s/%u", series, record_one(archive, series, text));
		give_result(archive, drop, "v1", -factor * values[i], 10 * values[i]);
		assert_int_equal(archive_decide(archive, drop, ARCHIVE_ACCEPTED, "", ""), 0);
	}
}

static void test_means_by_hand(void **state)
{
	struct archive_filter filter = archive_filter_none();
	struct archive *archive = with_series("one");
	struct archive_table table;
	const struct archive_cell *bare, *plate;

	(void)state;
	assert_int_equal(archive_new_series(archive, "flat", "trial", BARE, 25, NAN, 8), 0);
	fill_eight(archive, "one", 1);
	fill_eight(archive, "flat", 4);
	record_one(archive, "one", "undecided");
	give_result(archive, "one/9", "v1", -1000, 1);
	record_one(archive, "one", "rejected");
	give_result(archive, "one/10", "v1", -1e6, 1);
	assert_int_equal(archive_decide(archive, "one/10", ARCHIVE_REJECTED, "", "spike"), 0);
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

static void count_wrong(void *context, const char *text)
{
	(void)text;
	(*(int *)context)++;
}

/* A series whose drops the filter leaves out, and one of which it leaves out the series itself. */
static void test_json_of_nothing(void **state)
{
	struct archive_filter filter = archive_filter_none();
	struct archive *archive = with_series("one");

	(void)state;
	record_one(archive, "one", "abc");
	filter.series = "one";
	for (int i = 0; i < 3; i++) {
		char *text = NULL;
		size_t size;
		FILE *out = open_memstream(&text, &size);
		cJSON *tree;

		filter.angle_deg = i == 2 ? 80 : NAN;
		filter.number = i == 1 ? 7 : 0;
		assert_non_null(out);
		assert_int_equal(print_drops(archive, &filter, true, PRINT_JSON, out), 0);
		fclose(out);
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

/* ---- heights ---- */

static void write_scene(const char *path, const char *section, const char *key)
{
	FILE *in = fopen(SCENE, "r"), *out = fopen(path, "w");
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
	struct archive *archive = open_it(ARCHIVE_CREATE);
	struct scene scene, expected;
	char path[100], name[8];

	(void)state;
	snprintf(path, sizeof(path), "%s/scene.ini", folder);
	write_scene(path, "[drop]\n", "height_m = 0.6\n");
	assert_int_equal(scene_read(&expected, path, message), 0);
	expected.drop_angle_deg = 33;
	for (int i = 0; i < 3; i++) {
		write_scene(path, sections[i], keys[i]);
		snprintf(name, sizeof(name), "s%d", i);
		assert_int_equal(archive_new_series(archive, name, "trial", path, 33, 0.6, 5), 0);
		assert_int_equal(archive_scene(archive, name, &scene), 0);
		assert_memory_equal(&scene, &expected, sizeof(scene));
	}
	assert_int_equal(archive_new_series(archive, "low", "trial", path, NAN, 0.1, 5), DT_E_RANGE);
	assert_non_null(strstr(archive_message(archive), "is the height too small?"));
	assert_int_equal(archive_new_series(archive, "high", "trial", path, NAN, 5.5, 5), DT_E_RANGE);
	archive_close(archive);
	assert_int_equal(unlink(path), 0);
	snprintf(path, sizeof(path), "%s/index.sqlite", folder);
	assert_int_equal(unlink(path), 0);
	assert_int_equal(archive_rebuild(folder, count_wrong, &(int){0}, message), 0);
	archive = open_it(ARCHIVE_READ);
	assert_int_equal(archive_scene(archive, "s1", &scene), 0);
	assert_memory_equal(&scene, &expected, sizeof(scene));
	archive_close(archive);
}

static void test_heights_are_not_averaged(void **state)
{
	struct archive_filter filter = archive_filter_none();
	struct archive *archive = with_series("one");
	struct archive_table table;

	(void)state;
	assert_int_equal(archive_new_series(archive, "low", "trial", SCENE, 25, 0.5, 5), 0);
	assert_int_equal(archive_new_series(archive, "bare", "trial", BARE, 25, NAN, 5), 0);
	record_one(archive, "one", "abc");
	record_one(archive, "low", "abcd");
	record_one(archive, "bare", "abcde");
	give_result(archive, "one/1", "v1", -400, 500);
	give_result(archive, "low/1", "v1", -300, 400);
	give_result(archive, "bare/1", "v1", -500, 500);
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
        " 3, '" HASH_OF_ABC "', '2025-01-01T08:00:00Z');"
        "INSERT INTO versions VALUES (1, 'v0', '2025');"
        "INSERT INTO results (drop_id, version_id, time, not_ok, flags, s1_x_g)"
        " VALUES (1, 1, '2025', 0, '', -345.5);"
        "PRAGMA application_id = 1148343415; PRAGMA user_version = 1;";

static sqlite3 *open_index(void)
{
	char path[128];
	sqlite3 *index;

	snprintf(path, sizeof(path), "%s/index.sqlite", folder);
	assert_int_equal(sqlite3_open(path, &index), SQLITE_OK);
	return index;
}

static void run_sql(const char *text)
{
	sqlite3 *index = open_index();
	char *why = NULL;

	if (sqlite3_exec(index, text, NULL, NULL, &why) != SQLITE_OK)
		fail_msg("%s", why);
	sqlite3_close(index);
}

static int schema_version(void)
{
	sqlite3 *index = open_index();
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
	struct seen seen;

	(void)state;
	run_sql(version_1);
	archive = open_it(ARCHIVE_READ);
	assert_int_equal(schema_version(), 3);
	seen = look(archive, "one", 1, NULL);
	assert_string_equal(seen.decision, "accepted");
	assert_string_equal(seen.version, "v0");
	assert_near(seen.s1x, -345.5, 0);
	assert_false(seen.simulated);
	archive_close(archive);
	archive = open_it(ARCHIVE_WRITE);
	assert_int_equal(archive_note(archive, "one/1", "Ann", "still here"), 0);
	assert_int_equal(archive_calibrate(archive, "S1", 1.01, "2026-11-02", ""), 0);
	assert_int_equal(archive_calibrate(archive, "S1", 1.01, "2026-11-32", ""), DT_E_ARGUMENT);
	assert_int_equal(archive_calibrate(archive, "S1", 0, "2026-11-02", ""), DT_E_RANGE);
	archive_close(archive);
}

static void test_other_indexes_are_refused(void **state)
{
	(void)state;
	assert_null(archive_open(folder, ARCHIVE_READ, message));
	assert_non_null(strstr(message, "no archive there"));
	run_sql(version_1);
	run_sql("PRAGMA user_version = 99");
	assert_null(archive_open(folder, ARCHIVE_WRITE, message));
	assert_non_null(strstr(message, "newer"));
	run_sql("PRAGMA user_version = 1; PRAGMA application_id = 7");
	assert_null(archive_open(folder, ARCHIVE_WRITE, message));
	assert_non_null(strstr(message, "not an index of droptower"));
}

/* ---- care ---- */

static char *listing(void)
{
	struct archive_filter filter = archive_filter_none();
	struct archive *archive = open_it(ARCHIVE_READ);
	char *text = NULL;
	size_t size;
	FILE *out = open_memstream(&text, &size);

	assert_non_null(out);
	assert_int_equal(print_series(archive, &filter, PRINT_JSON, out), 0);
	assert_int_equal(print_drops(archive, &filter, true, PRINT_JSON, out), 0);
	assert_int_equal(print_drops(archive, &filter, true, PRINT_CSV, out), 0);
	assert_int_equal(print_calibrations(archive, PRINT_JSON, out), 0);
	filter.series = "one"; /* with the history of each drop */
	assert_int_equal(print_drops(archive, &filter, true, PRINT_JSON, out), 0);
	filter.version = "v1";
	assert_int_equal(print_drops(archive, &filter, true, PRINT_JSON, out), 0);
	fclose(out);
	archive_close(archive);
	return text;
}

static void make_many_things(void)
{
	struct archive *archive = with_series("one");
	struct archive_recording r;

	assert_int_equal(archive_new_series(archive, "empty", "other", BARE, 35, NAN, 3), 0);
	record_one(archive, "one", "abc");
	give_result(archive, "one/1", "v1", -1.0 / 3, 2);
	give_result(archive, "one/1", "v2", -2.0 / 3, 2);
	give_result(archive, "one/1", "v1", -4.0 / 3, 2);
	record_one(archive, "one", "def");
	assert_int_equal(archive_decide(archive, "one/2", ARCHIVE_REJECTED, "Ann", "a \"reason\", = 5; [x]"),
	                 0);
	assert_int_equal(archive_decide(archive, "one/1", ARCHIVE_ACCEPTED, "", ""), 0);
	assert_int_equal(archive_note(archive, "one/2", "J\xc3\xbcrg", "  blanks kept  "), 0);
	assert_int_equal(archive_begin(archive, "one", "Ann", ".log", true, &r), 0);
	archive_abandon(&r);
	assert_int_equal(archive_calibrate(archive, "S1", 1.0 / 0.97, "2026-11-02", "by hand"), 0);
	archive_close(archive);
}

static void test_the_index_can_be_made_again(void **state)
{
	char path[128], *before, *after;
	int wrong = 0;

	(void)state;
	make_many_things();
	before = listing();
	snprintf(path, sizeof(path), "%s/index.sqlite", folder);
	assert_int_equal(truncate(path, 5000), 0);
	assert_int_equal(archive_rebuild(folder, count_wrong, &wrong, message), 0);
	assert_int_equal(wrong, 0);
	after = listing();
	assert_string_equal(after, before);
	free(after);
	assert_int_equal(unlink(path), 0);
	assert_null(archive_open(folder, ARCHIVE_CREATE, message));
	assert_non_null(strstr(message, "--rebuild"));
	assert_int_equal(archive_rebuild(folder, count_wrong, &wrong, message), 0);
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
	archive = open_it(ARCHIVE_READ);
	strcpy(raw, look(archive, "one", 2, NULL).raw);
	archive_close(archive);
	strcpy(strrchr(raw, '.'), ".ini");
	snprintf(path, sizeof(path), "%s/%s", folder, raw);
	assert_int_equal(truncate(path, 300), 0);
	assert_int_equal(archive_rebuild(folder, count_wrong, &wrong, message), 0);
	assert_int_equal(wrong, 1);
	archive = open_it(ARCHIVE_WRITE);
	assert_int_equal(look(archive, "one", 1, NULL).count, 1);
	assert_int_equal(look(archive, "one", 2, NULL).count, 0);
	assert_null(archive_open("/", ARCHIVE_READ, message));
	assert_int_equal(archive_rebuild(folder, count_wrong, &wrong, message), DT_E_STATE);
	assert_non_null(strstr(message, "another program"));
	archive_close(archive);
}

static void test_raw_files_are_verified(void **state)
{
	struct archive *archive = with_series("one");
	char path[256];
	int wrong = 0;
	FILE *out;

	(void)state;
	record_one(archive, "one", "abc");
	record_one(archive, "one", "def");
	assert_int_equal(archive_verify(archive, count_wrong, &wrong), 0);
	snprintf(path, sizeof(path), "%s/%s", folder, look(archive, "one", 1, NULL).raw);
	out = fopen(path, "r+");
	assert_non_null(out);
	fputs("abd", out);
	fclose(out);
	assert_int_equal(archive_verify(archive, count_wrong, &wrong), 1);
	assert_string_equal(look(archive, "one", 1, NULL).state, "recorded");
	assert_int_equal(unlink(path), 0);
	assert_int_equal(archive_verify(archive, count_wrong, &wrong), 1);
	assert_int_equal(wrong, 2);
	assert_string_equal(look(archive, "one", 1, NULL).state, "missing");
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
	struct seen seen = {.count = 0};
	int count = 0;

	(void)state;
	archive_close(with_series("first"));
	assert_true(archive_stock_fill(folder, 10000, 100));
	archive = open_it(ARCHIVE_READ);
	filter.angle_deg = 20;
	assert_int_equal(archive_each_series(archive, &filter, count_series, &count), 0);
	assert_int_equal(count, 400);
	filter = archive_filter_none();
	filter.from = filter.to = "2026-03-02";
	assert_int_equal(archive_each_drop(archive, &filter, see, &seen), 0);
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

/* ---- text and limit ---- */

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
	json = printed(archive, &filter, PRINT_JSON, drops);
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
	struct archive *archive = with_series("box");

	assert_int_equal(archive_new_series(archive, "rig_b", "winter", SCENE, 25, NAN, 5), 0);
	assert_int_equal(archive_new_series(archive, "empty", "winter", BARE, 25, NAN, 5), 0);
	record_one(archive, "box", "abc");
	record_one(archive, "box", "def");
	record_one(archive, "rig_b", "ghi");
	assert_int_equal(archive_note(archive, "box/1", "", "100% of J\xc3\xbcrg's \\ load_cell"), 0);
	assert_int_equal(archive_decide(archive, "box/2", ARCHIVE_REJECTED, "", "hit the Wrong corner"), 0);
	give_result(archive, "box/1", "v1", 1, 2);
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
	struct seen seen = {.count = 0};
	char longer[62];

	(void)state;
	for (size_t i = 0; i < sizeof(rows) / sizeof(rows[0]); i++) {
		check_found(archive, rows[i].text, 0, "drops", rows[i].drops);
		check_found(archive, rows[i].text, 0, "series", rows[i].series);
	}
	filter.text = "a b c d e f g h i";
	assert_int_equal(archive_each_drop(archive, &filter, see, &seen), DT_E_ARGUMENT);
	memset(longer, 'x', 61);
	longer[61] = '\0';
	filter.text = longer;
	assert_int_equal(archive_each_drop(archive, &filter, see, &seen), DT_E_ARGUMENT);
	assert_non_null(strstr(archive_message(archive), "60 characters"));
	filter.text = longer + 1;
	assert_int_equal(archive_each_drop(archive, &filter, see, &seen), 0);
	assert_int_equal(seen.count, 0);
	archive_close(archive);
}

static void test_a_limit_takes_the_newest_and_tells_of_more(void **state)
{
	struct archive *archive = with_words();
	struct archive_filter filter = archive_filter_none();
	char *text;

	(void)state;
	run_sql("UPDATE drops SET time = '2026-01-0' || (7 - id) || 'T08:00:00Z';"
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
	run_sql("UPDATE drops SET time = '2026-01-09T08:00:00Z' WHERE id = 3");
	check_found(archive, NULL, 2, "drops", "rig_b/1 box/1 more");
	filter.limit = 2;
	text = printed(archive, &filter, PRINT_TEXT, false);
	assert_non_null(strstr(text, "there are more: these are the newest 2"));
	free(text);
	archive_close(archive);
}

#define IN_A_FOLDER(test) cmocka_unit_test_setup_teardown(test, make_folder, remove_folder)

int main(void)
{
	const struct CMUnitTest tests[] = {
	        IN_A_FOLDER(test_a_drop_is_partial_until_it_is_whole),
	        IN_A_FOLDER(test_changes_by_others_are_seen),
	        IN_A_FOLDER(test_nothing_stays_of_what_was_discarded),
	        IN_A_FOLDER(test_a_log_that_stands_there_is_not_written_over),
	        IN_A_FOLDER(test_a_simulated_drop_says_so),
	        IN_A_FOLDER(test_a_rejection_needs_a_reason),
	        IN_A_FOLDER(test_what_is_not_whole_is_not_decided),
	        IN_A_FOLDER(test_names_stay_inside_the_folder),
	        IN_A_FOLDER(test_old_results_stay),
	        IN_A_FOLDER(test_means_by_hand),
	        IN_A_FOLDER(test_json_of_nothing),
	        IN_A_FOLDER(test_a_series_from_another_height),
	        IN_A_FOLDER(test_heights_are_not_averaged),
	        IN_A_FOLDER(test_a_version_1_index_is_migrated),
	        IN_A_FOLDER(test_other_indexes_are_refused),
	        IN_A_FOLDER(test_the_index_can_be_made_again),
	        IN_A_FOLDER(test_a_damaged_sidecar_is_left_out_and_told),
	        IN_A_FOLDER(test_raw_files_are_verified),
	        IN_A_FOLDER(test_ten_thousand_drops),
	        IN_A_FOLDER(test_words_find_drops),
	        IN_A_FOLDER(test_a_limit_takes_the_newest_and_tells_of_more),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
