/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * What the page asks of the archive: lists, series, decisions, reports.
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

#include <sqlite3.h>

#include "host/archive/print.h"
#include "host/console/work.h"
#include "host/model/model.h"
#include "tests/unit/desk.h"
#include "tests/unit/near.h"

static void check_list(void (*run)(struct job *job), const char *asked, const char *type,
                       const struct archive_filter *filter, bool undecided, int what)
{
	struct archive *archive = desk_open_beside(ARCHIVE_READ);
	struct job job = desk_ask(run, NULL, asked, NULL);
	char *text = NULL;
	size_t size = 0;
	FILE *out = open_memstream(&text, &size);

	assert_non_null(out);
	assert_int_equal(what == 0   ? print_series(archive, filter, TABLE_JSON, out)
	                 : what == 1 ? print_drops(archive, filter, undecided, TABLE_JSON, out)
	                 : what == 2 ? print_tables(archive, filter, undecided, NULL, TABLE_JSON, out)
	                             : print_drops(archive, filter, undecided, TABLE_CSV, out),
	                 0);
	fclose(out);
	assert_int_equal(job.status, 200);
	assert_string_equal(job.type, type);
	assert_int_equal(job.size, size);
	assert_memory_equal(job.answer, text, size);
	free(job.answer);
	free(text);
	archive_close(archive);
}

static void test_lists_are_those_of_the_command(void **state)
{
	struct archive_filter all = archive_filter_none(), some = all, none = all, words = all, second = all;

	(void)state;
	desk_start_with_drops();
	some.series = "one";
	some.campaign = "trial";
	some.angle_deg = 27;
	some.scene_name = "geometry-2A";
	none.from = none.to = "2001-02";
	check_list(work_series, NULL, "application/json", &all, false, 0);
	check_list(work_series, "date=2001-02", "application/json", &none, false, 0);
	check_list(work_drops, "series=one&campaign=trial&angle_deg=27&scene=geometry-2A&undecided=1",
	           "application/json", &some, true, 1);
	words.text = "geometry trial";
	words.limit = 2;
	check_list(work_drops, "text=geometry trial&limit=2", "application/json", &words, false, 1);
	check_list(work_series, "text=geometry trial&limit=2", "application/json", &words, false, 0);
	second.number = 2;
	check_list(work_drops, "number=2", "application/json", &second, false, 1);
	check_list(work_tables, "campaign=trial&undecided=1", "application/json",
	           &(struct archive_filter){.campaign = "trial", .angle_deg = NAN}, true, 2);
	check_list(work_csv, NULL, "text/csv; charset=utf-8", &all, false, 3);
	desk_expect(400, work_drops, NULL, "angle_deg=flat", NULL);
	desk_expect(400, work_drops, NULL, "angle_deg=nan", NULL);
	desk_expect(400, work_drops, NULL, "date=2026-13", NULL);
	desk_expect(400, work_drops, NULL, "limit=0", NULL);
	desk_expect(400, work_drops, NULL, "limit=-1", NULL);
	desk_expect(400, work_drops, NULL, "limit=5 OR 1", NULL);
	desk_expect(400, work_drops, NULL, "limit=99999999999999999999", NULL);
	desk_expect(400, work_drops, NULL, "text=a b c d e f g h i", NULL);
	desk_expect(404, work_drops, NULL, "series=two", NULL);
	desk_expect(404, work_drops, NULL, "series=' OR 1", NULL);
}

static void run_sql(const char *text)
{
	char path[128], *why = NULL;
	sqlite3 *index;

	snprintf(path, sizeof(path), "%s/index.sqlite", desk_folder);
	assert_int_equal(sqlite3_open(path, &index), SQLITE_OK);
	if (sqlite3_exec(index, text, NULL, NULL, &why) != SQLITE_OK)
		fail_msg("%s", why);
	sqlite3_close(index);
}

static void test_a_series_from_another_height(void **state)
{
	struct archive *archive;
	struct scene scene, bare;
	cJSON *tree;

	(void)state;
	desk_start();
	tree = desk_ask_json(
	        work_new_series, NULL, NULL,
	        "{\"name\":\"low\",\"campaign\":\"trial\",\"scene\":\"geometry-1\",\"angle_deg\":40,"
	        "\"height_m\":0.5,\"planned\":3}");
	assert_string_equal(desk_text(tree, "series"), "low");
	cJSON_Delete(tree);
	archive = desk_open_beside(ARCHIVE_READ);
	assert_int_equal(archive_scene(archive, "low", &scene), 0);
	assert_int_equal(scene_read(&bare, DESK_BARE, desk_message), 0);
	assert_near(scene.drop_height_m, 0.5, 0);
	assert_near(scene.drop_angle_deg, 40, 0);
	assert_near(scene.tower_separation_m, bare.tower_separation_m + 0.5 - bare.drop_height_m, 1e-12);
	archive_close(archive);
	desk_expect(409, work_new_series, NULL, NULL, "{\"name\":\"low\",\"scene\":\"geometry-1\"}");
	desk_expect(400, work_new_series, NULL, NULL, "{\"name\":\"../low\",\"scene\":\"geometry-1\"}");
	desk_expect(400, work_new_series, NULL, NULL, "{\"name\":\"a\",\"scene\":\"README.md\"}");
	desk_expect(400, work_new_series, NULL, NULL, "{\"name\":\"a\",\"scene\":\"" DESK_BARE "\"}");
	desk_expect(400, work_new_series, NULL, NULL, "{\"scene\":\"geometry-1\"}");
	desk_expect(400, work_new_series, NULL, NULL, "{\"name\":5,\"scene\":\"geometry-1\"}");
	desk_expect(400, work_new_series, NULL, NULL,
	            "{\"name\":\"a\",\"scene\":\"geometry-1\",\"angle_deg\":85}");
	desk_expect(400, work_new_series, NULL, NULL,
	            "{\"name\":\"a\",\"scene\":\"geometry-1\",\"height_m\":0.04}");
	desk_expect(400, work_new_series, NULL, NULL,
	            "{\"name\":\"a\",\"scene\":\"geometry-1\",\"height_m\":\"1\"}");
	desk_expect(400, work_new_series, NULL, NULL,
	            "{\"name\":\"a\",\"scene\":\"geometry-1\",\"planned\":2.5}");
	desk_expect(400, work_new_series, NULL, NULL,
	            "{\"name\":\"a\",\"scene\":\"geometry-1\",\"planned\":0}");
	desk_expect(200, work_new_series, NULL, NULL, "{\"name\":\"a\",\"scene\":\"geometry-1\"}");
}

static const char make_presets[] =
        "UPDATE series SET created = '2026-01-01T00:00:00Z';"
        "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < 60)"
        " INSERT INTO series (name, campaign_id, scene_name, scene, angle_deg, height_m, plate_mass_kg,"
        " planned, created) SELECT 's' || i, campaign_id, CASE WHEN i % 7 = 0 THEN 'gone' ELSE scene_name "
        "END,"
        " scene, 20 + i % 30, height_m, plate_mass_kg, 5,"
        " printf('2026-02-%02dT00:00:00Z', 1 + (i * 37) % 28) FROM n, series WHERE series.name = 'one'";

static void test_presets_are_earlier_series(void **state)
{
	cJSON *tree, *presets, *item, *scenes;
	double angle[64];
	int count = 0, before = 99;

	(void)state;
	archive_close(desk_open_beside(ARCHIVE_CREATE));
	desk_start();
	tree = desk_ask_json(work_setup, NULL, NULL, NULL);
	assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(tree, "presets")), 0);
	scenes = cJSON_GetObjectItem(tree, "scenes");
	assert_int_equal(cJSON_GetArraySize(scenes), 2);
	assert_string_equal(desk_text(cJSON_GetArrayItem(scenes, 0), "name"), "geometry-2A");
	assert_near(desk_number(cJSON_GetArrayItem(scenes, 0), "height_m"), 0.894, 0);
	assert_true(desk_number(cJSON_GetArrayItem(scenes, 0), "plate_mass_kg") > 0);
	assert_near(desk_number(cJSON_GetArrayItem(scenes, 1), "plate_mass_kg"), 0, 0);
	assert_string_equal(desk_text(tree, "operator"), "Ann");
	cJSON_Delete(tree);
	desk_expect(200, work_new_series, NULL, NULL, "{\"name\":\"one\",\"scene\":\"geometry-2A\"}");
	desk_stop();
	run_sql(make_presets);
	job_queue_init(&desk_console.work_queue);
	desk_start();
	tree = desk_ask_json(work_setup, NULL, NULL, NULL);
	presets = cJSON_GetObjectItem(tree, "presets");
	assert_int_equal(cJSON_GetArraySize(presets), 20);
	cJSON_ArrayForEach(item, presets)
	{
		int i = atoi(desk_text(item, "series") + 1), day = 1 + (i * 37) % 28;

		assert_string_equal(desk_text(item, "scene"), "geometry-2A");
		assert_true(day <= before);
		before = day;
		angle[count] = desk_number(item, "angle_deg");
		assert_near(angle[count], 20 + i % 30, 0);
		for (int k = 0; k < count; k++)
			assert_true(fabs(angle[k] - angle[count]) > 0.5);
		count++;
	}
	cJSON_Delete(tree);
}

static void test_decisions_and_notes(void **state)
{
	struct work_view view;
	uint64_t revision;
	cJSON *tree, *drop;

	(void)state;
	desk_start_with_drops();
	work_look(desk_console.work, &view);
	revision = view.revision;
	desk_expect(200, work_decide, NULL, NULL, "{\"drop\":\"one/1\",\"decision\":\"accepted\"}");
	desk_expect(200, work_decide, NULL, NULL,
	            "{\"drop\":\"one/2\",\"decision\":\"rejected\",\"reason\":\"slipped\"}");
	desk_expect(200, work_note, NULL, NULL, "{\"drop\":\"one/1\",\"text\":\"J\\u00fcrg held it\"}");
	work_look(desk_console.work, &view);
	assert_int_equal(view.revision, revision + 3);
	desk_expect(400, work_decide, NULL, NULL, "{\"drop\":\"one/1\",\"decision\":\"rejected\"}");
	desk_expect(400, work_decide, NULL, NULL, "{\"drop\":\"one/1\",\"decision\":\"maybe\"}");
	desk_expect(400, work_decide, NULL, NULL, "{\"drop\":\"one\",\"decision\":\"accepted\"}");
	desk_expect(400, work_decide, NULL, NULL, "{\"decision\":\"accepted\"}");
	desk_expect(404, work_decide, NULL, NULL, "{\"drop\":\"one/9\",\"decision\":\"accepted\"}");
	desk_expect(409, work_decide, NULL, NULL, "{\"drop\":\"one/3\",\"decision\":\"accepted\"}");
	desk_expect(400, work_note, NULL, NULL, "{\"drop\":\"one/1\"}");
	desk_expect(400, work_note, NULL, NULL, "{\"drop\":\"one/1\",\"text\":\"two\\nlines\"}");
	work_look(desk_console.work, &view);
	assert_int_equal(view.revision, revision + 3);
	tree = desk_ask_json(work_drops, NULL, "series=one", NULL);
	drop = cJSON_GetArrayItem(cJSON_GetObjectItem(tree, "drops"), 0);
	assert_string_equal(desk_text(drop, "decision"), "accepted");
	assert_string_equal(desk_text(drop, "note"), "J\xc3\xbcrg held it");
	drop = cJSON_GetArrayItem(cJSON_GetObjectItem(tree, "drops"), 1);
	assert_string_equal(desk_text(drop, "reason"), "slipped");
	cJSON_Delete(tree);
}

static void test_no_report_while_a_drop_is_under_way(void **state)
{
	(void)state;
	desk_start_with_drops();
	desk_expect(404, work_report, "two", NULL, NULL);
	desk_console.at_rest = false;
	desk_expect(409, work_report, "one", NULL, NULL);
	desk_console.at_rest = true;
	desk_expect(500, work_report, "one", NULL, NULL); /* there is no droptower beside the test */
}

static void test_an_archive_that_cannot_be(void **state)
{
	static const char *const none[] = {NULL}, *const wrong[] = {"README.md", NULL};
	struct work_options options = {"/dev/null/archive", "", none};

	(void)state;
	assert_null(work_start(&desk_console, &options, desk_message));
	assert_non_null(strstr(desk_message, "/dev/null/archive"));
	options = (struct work_options){desk_folder, "", wrong};
	assert_null(work_start(&desk_console, &options, desk_message));
	assert_non_null(strstr(desk_message, "README.md"));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        AT_THE_DESK(test_lists_are_those_of_the_command),
	        AT_THE_DESK(test_a_series_from_another_height),
	        AT_THE_DESK(test_presets_are_earlier_series),
	        AT_THE_DESK(test_decisions_and_notes),
	        AT_THE_DESK(test_no_report_while_a_drop_is_under_way),
	        AT_THE_DESK(test_an_archive_that_cannot_be),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
