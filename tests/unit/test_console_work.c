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

#include <semaphore.h>
#include <sqlite3.h>

#include "common/units.h"
#include "common/wire.h"
#include "host/archive/print.h"
#include "host/console/job.h"
#include "host/console/handover.h"
#include "host/console/work.h"
#include "host/model/model.h"
#include "host/record/read.h"
#include "tests/unit/archive_stock.h"
#include "tests/unit/drop_by_hand.h"
#include "tests/unit/near.h"
#include "tests/unit/scratch.h"

#define SCENE "common/scenes/geometry-2A.ini"
#define BARE "common/scenes/geometry-1.ini"

/* ---- a console without the rest ---- */

static char folder[64], message[ARCHIVE_MESSAGE_MAX];
static struct console console;
static sem_t answered;
static char saved_trouble[ARCHIVE_MESSAGE_MAX];
static bool saved_on_disk;

static int make_folder(void **state)
{
	(void)state;
	memset(&console, 0, sizeof(console));
	console.at_rest = true;
	sem_init(&answered, 0, 0);
	job_queue_init(&console.work_queue);
	job_queue_init(&console.tower_queue);
	return mkdtemp(scratch_name(folder, "work")) == NULL;
}

static int remove_folder(void **state)
{
	char command[100];

	(void)state;
	work_stop(console.work);
	job_queue_destroy(&console.work_queue);
	job_queue_destroy(&console.tower_queue);
	sem_destroy(&answered);
	snprintf(command, sizeof(command), "rm -rf %s", folder);
	return system(command);
}

static void start(void)
{
	static const char *const scenes[] = {SCENE, BARE, NULL};
	const struct work_options options = {folder, "Ann", scenes};

	console.work = work_start(&console, &options, message);
	if (console.work == NULL)
		fail_msg("%s", message);
}

static void stop(void)
{
	work_stop(console.work);
	console.work = NULL;
}

static void on_done(struct job *job)
{
	(void)job;
	sem_post(&answered);
}

/* "series=one&undecided=1" */
static const char *query(const struct job *job, const char *name)
{
	static char values[8][100]; /* more than one job asks for */
	static unsigned next;
	char *value = values[next++ % 8];
	const char *at = job->maker;
	size_t length = strlen(name);

	while (at != NULL && *at != '\0') {
		size_t whole = strcspn(at, "&");

		if (strncmp(at, name, length) == 0 && at[length] == '=') {
			snprintf(value, sizeof(values[0]), "%.*s", (int)(whole - length - 1),
			         at + length + 1);
			return value;
		}
		at += whole + (at[whole] == '&');
	}
	return NULL;
}

/* Does one job of the page; what it answers is to be freed. */
static struct job ask(void (*run)(struct job *job), const char *path, const char *asked, const char *body)
{
	cJSON *tree = body != NULL ? cJSON_Parse(body) : NULL;
	char words[200];
	struct job job = {.console = &console,
	                  .run = run,
	                  .done = on_done,
	                  .maker = words,
	                  .body = tree,
	                  .path = path,
	                  .query = query};

	assert_true(body == NULL || tree != NULL);
	snprintf(words, sizeof(words), "%s", asked != NULL ? asked : "");
	assert_int_equal(job_put(&console.work_queue, &job), 0);
	while (sem_wait(&answered) != 0)
		continue;
	cJSON_Delete(tree);
	return job;
}

static void expect(int status, void (*run)(struct job *job), const char *path, const char *asked,
                   const char *body)
{
	struct job job = ask(run, path, asked, body);

	if (job.status != status)
		fail_msg("%d, expected %d: %.*s", job.status, status, (int)job.size,
		         (const char *)job.answer);
	if (status >= 400) {
		cJSON *tree = cJSON_ParseWithLength(job.answer, job.size);

		assert_non_null(cJSON_GetObjectItem(tree, "error"));
		cJSON_Delete(tree);
	}
	free(job.answer);
}

static cJSON *ask_json(void (*run)(struct job *job), const char *path, const char *asked, const char *body)
{
	struct job job = ask(run, path, asked, body);
	cJSON *tree = cJSON_ParseWithLength(job.answer, job.size);

	if (job.status != 200 || tree == NULL)
		fail_msg("%d: %.*s", job.status, (int)job.size, (const char *)job.answer);
	assert_string_equal(job.type, "application/json");
	free(job.answer);
	return tree;
}

static const char *text_of(const cJSON *tree, const char *key)
{
	const cJSON *item = cJSON_GetObjectItem(tree, key);

	assert_true(cJSON_IsString(item));
	return item->valuestring;
}

static double number_of(const cJSON *tree, const char *key)
{
	const cJSON *item = cJSON_GetObjectItem(tree, key);

	assert_true(cJSON_IsNumber(item));
	return item->valuedouble;
}

static struct archive *open_beside(enum archive_mode mode)
{
	struct archive *archive = archive_open(folder, mode, message);

	if (archive == NULL)
		fail_msg("%s", message);
	return archive;
}

/* ---- a drop ---- */

#define TRIGGER_S 0.1
#define PULSE_S 0.003
#define S2X_G 400.0
#define S2Y_G 200.0
enum { TICKS = 300 };

static struct hand_drop hand;

static int16_t count_of(double value_g)
{
	return (int16_t)lrint(32 * value_g);
}

static double half_sine(double time_s)
{
	double x = (time_s - TRIGGER_S) / PULSE_S;

	return x > 0 && x < 1 ? sin(M_PI * x) : 0;
}

/* S1 rings at 150 Hz. */
static double ringing(double time_s)
{
	double t = time_s - TRIGGER_S;

	return t > 0 ? exp(-90 * t) * sin(2 * M_PI * 150 * t) : 0;
}

static void fill_hand(void)
{
	uint64_t seed = 20;

	hand_fill(&hand, 5000, TICKS, 1);
	hand.trigger_us = (uint32_t)(TRIGGER_S * 1e6);
	hand.marks = 0;
	for (uint32_t tick = 0; tick < TICKS; tick++)
		for (int k = 0; k < HAND_PER_TICK; k++) {
			bool x = k < WIRE_X_PER_TICK;
			int within = x ? k : (k - WIRE_X_PER_TICK) % WIRE_YZ_PER_TICK;
			double t = (tick + (double)within / (x ? WIRE_X_PER_TICK : WIRE_YZ_PER_TICK)) / 1e3;
			double noise = 0.25 * (hand_random(&seed) % 5 - 2.0);
			double share = x ? 1 : k < WIRE_X_PER_TICK + WIRE_YZ_PER_TICK ? 0.5 : 0.1;

			hand.sample[0][tick][k] = count_of(300 * share * ringing(t) + noise);
			hand.sample[1][tick][k] = count_of(S2X_G * share * half_sine(t) + noise);
		}
}

/* Its frames as a log; the block of that tick of S2 is left out (negative: none). */
static void write_hand(const char *path, int lost_tick)
{
	FILE *out = fopen(path, "w");
	struct frame frame;
	char line[256];

	assert_non_null(out);
	for (uint32_t tick = 0; tick < TICKS; tick++)
		for (unsigned sensor = 1; sensor <= 2; sensor++) {
			if (sensor == 2 && (int)tick == lost_tick)
				continue;
			hand_block(&hand, sensor, tick, false, &frame);
			hand_candump(&frame, 1000 * (5000 + (int64_t)tick), line);
			fputs(line, out);
		}
	hand_capture_end(&hand, &frame);
	hand_candump(&frame, 1000 * (5000 + TICKS), line);
	fputs(line, out);
	assert_int_equal(fclose(out), 0);
}

static void record_hand(struct archive *archive, const char *series, int lost_tick)
{
	struct archive_recording r;

	assert_int_equal(archive_begin(archive, series, "Ann", ".log", false, &r), 0);
	write_hand(r.log, lost_tick);
	assert_int_equal(archive_finish(archive, &r, 0, ""), 0);
}

/* An archive with series "one": drop 1 whole, drop 2 without one block, drop 3 interrupted. */
static void start_with_drops(void)
{
	struct archive *archive = open_beside(ARCHIVE_CREATE);
	struct archive_recording r;

	fill_hand();
	assert_int_equal(archive_new_series(archive, "one", "trial", SCENE, 27, NAN, NULL, 5), 0);
	record_hand(archive, "one", -1);
	record_hand(archive, "one", 200);
	assert_int_equal(archive_begin(archive, "one", "Ann", ".log", false, &r), 0);
	archive_abandon(&r);
	archive_close(archive);
	start();
}

/* ---- curves, taken apart by the README ---- */

struct curves {
	struct job job;
	cJSON *head;
	const unsigned char *at; /* the first channel's samples */
};

static struct curves ask_curves(void (*run)(struct job *job), const char *path)
{
	struct curves c = {.job = ask(run, path, NULL, NULL)};
	const unsigned char *b = c.job.answer;
	size_t length, total = 0;
	const cJSON *item;

	if (c.job.status != 200)
		fail_msg("%d: %.*s", c.job.status, (int)c.job.size, (const char *)c.job.answer);
	assert_string_equal(c.job.type, "application/octet-stream");
	length = (size_t)b[0] | (size_t)b[1] << 8 | (size_t)b[2] << 16 | (size_t)b[3] << 24;
	assert_int_equal(length % 4, 0);
	c.head = cJSON_ParseWithLength((const char *)b + 4, length);
	assert_non_null(c.head);
	c.at = b + 4 + length;
	cJSON_ArrayForEach(item, cJSON_GetObjectItem(c.head, "channels")) total +=
	        (size_t)number_of(item, "count");
	assert_int_equal(c.job.size, 4 + length + 4 * total);
	return c;
}

static void free_curves(struct curves *c)
{
	cJSON_Delete(c->head);
	free(c->job.answer);
}

struct curve {
	double rate_hz, start_s;
	size_t count;
	float *value; /* to be freed */
};

static struct curve curve_of(const struct curves *c, const char *name)
{
	struct curve curve = {.count = 0};
	const unsigned char *at = c->at;
	const cJSON *item;

	cJSON_ArrayForEach(item, cJSON_GetObjectItem(c->head, "channels"))
	{
		curve.count = (size_t)number_of(item, "count");
		if (strcmp(text_of(item, "name"), name) == 0) {
			curve.rate_hz = number_of(item, "rate_hz");
			curve.start_s = number_of(item, "start_s");
			curve.value = malloc(4 * curve.count);
			assert_non_null(curve.value);
			memcpy(curve.value, at, 4 * curve.count);
			return curve;
		}
		at += 4 * curve.count;
	}
	fail_msg("no curve %s", name);
	return curve;
}

static size_t largest(const struct curve *c)
{
	size_t best = 0;

	for (size_t k = 1; k < c->count; k++)
		if (c->value[k] > c->value[best])
			best = k;
	return best;
}

static double time_of(const struct curve *c, size_t k)
{
	return c->start_s + (double)k / c->rate_hz;
}

static void check_samples(const struct curves *c, unsigned sensor, int axis, size_t lost_tick)
{
	static const char *const names[2][3] = {{"S1X", "S1Y", "S1Z"}, {"S2X", "S2Y", "S2Z"}};
	static const size_t first[3] = {0, WIRE_X_PER_TICK, WIRE_X_PER_TICK + WIRE_YZ_PER_TICK};
	size_t per_tick = axis == 0 ? WIRE_X_PER_TICK : WIRE_YZ_PER_TICK;
	struct curve curve = curve_of(c, names[sensor - 1][axis]);

	assert_int_equal(curve.count, per_tick * TICKS);
	assert_near(curve.rate_hz, 1000.0 * (double)per_tick, 0);
	for (size_t k = 0; k < curve.count; k++) {
		if (sensor == 2 && k / per_tick == lost_tick)
			assert_true(isnan(curve.value[k]));
		else if (32 * curve.value[k] !=
		         hand.sample[sensor - 1][k / per_tick][first[axis] + k % per_tick])
			fail_msg("%s %zu is %g", names[sensor - 1][axis], k, (double)curve.value[k]);
	}
	free(curve.value);
}

/* Samples come exactly; 0 is where a half-sine crosses a tenth of itself. */
static void test_a_trace_is_the_log(void **state)
{
	const double tenth_s = PULSE_S * asin(0.1) / M_PI;
	struct curves c;
	struct curve x, r;

	(void)state;
	start_with_drops();
	c = ask_curves(work_trace, "one/1");
	assert_string_equal(text_of(c.head, "zero"), "S2X leaves 10 % of its peak");
	assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(c.head, "channels")), 8);
	for (unsigned sensor = 1; sensor <= 2; sensor++)
		for (int axis = 0; axis < 3; axis++)
			check_samples(&c, sensor, axis, TICKS);
	x = curve_of(&c, "S2X");
	assert_near(x.start_s, -TRIGGER_S - tenth_s, 5e-5);
	r = curve_of(&c, "S2R");
	assert_near(r.rate_hz, 10000, 0);
	assert_near((double)r.value[largest(&r)], hypot(S2X_G, S2Y_G), 2.5);
	assert_near(time_of(&r, largest(&r)), PULSE_S / 2 - tenth_s, 2e-4);
	assert_true(isnan(r.value[r.count - 1])); /* X ends before Y */
	free(x.value);
	free(r.value);
	free_curves(&c);
	c = ask_curves(work_trace, "one/2");
	check_samples(&c, 1, 0, TICKS);
	check_samples(&c, 2, 0, 200);
	check_samples(&c, 2, 1, 200);
	free_curves(&c);
}

static void test_the_model_lies_on_the_trace(void **state)
{
	static const char *const names[] = {"S1X", "S1Y", "S2X", "S2Y", "S1R", "S2R"};
	struct model_prediction prediction;
	struct scene scene;
	struct curves c, t;
	struct curve model, trace;

	(void)state;
	start_with_drops();
	assert_int_equal(scene_read(&scene, SCENE, message), 0);
	scene.drop_angle_deg = 27;
	assert_int_equal(model_solve(&scene, MODEL_AUTO, NULL, &prediction, NULL), 0);
	c = ask_curves(work_model, "one/1");
	t = ask_curves(work_trace, "one/1");
	assert_string_equal(text_of(c.head, "zero"), text_of(t.head, "zero"));
	assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(c.head, "channels")), 6);
	trace = curve_of(&t, "S2R");
	for (size_t i = 0; i < 6; i++) {
		model = curve_of(&c, names[i]);
		assert_int_equal(model.count, trace.count);
		assert_near(model.start_s, trace.start_s, 1e-9);
		assert_near(model.rate_hz, trace.rate_hz, 0);
		assert_true(model.value[0] == 0.0f); /* falls freely */
		free(model.value);
	}
	model = curve_of(&c, "S2R");
	assert_near(time_of(&model, largest(&model)), time_of(&trace, largest(&trace)), 2.5e-4);
	assert_near((double)model.value[largest(&model)], prediction.resultant[1].value_g,
	            0.005 * prediction.resultant[1].value_g);
	free(model.value);
	model = curve_of(&c, "S1R");
	assert_near((double)model.value[largest(&model)], prediction.resultant[0].value_g,
	            0.005 * prediction.resultant[0].value_g);
	free(model.value);
	free(trace.value);
	free_curves(&c);
	free_curves(&t);
}

static double spectrum_at(const cJSON *tree, const char *channel, int i)
{
	const cJSON *item;

	cJSON_ArrayForEach(
	        item,
	        cJSON_GetObjectItem(
	                tree,
	                "channels")) if (strcmp(text_of(item, "name"), channel) ==
	                                 0) return cJSON_GetArrayItem(cJSON_GetObjectItem(item, "value"), i)
	        ->valuedouble;
	fail_msg("no channel %s", channel);
	return 0;
}

static void test_spectra(void **state)
{
	static const char *const kinds[] = {"kind=absolute-acceleration", "kind=pseudo-velocity",
	                                    "kind=relative-displacement"};
	static const char *const units[] = {"g", "m/s", "m"};
	cJSON *tree[3], *frequency;
	int count;

	(void)state;
	start_with_drops();
	for (int i = 0; i < 3; i++) {
		tree[i] = ask_json(work_spectrum, "one/1", kinds[i], NULL);
		assert_string_equal(text_of(tree[i], "kind"), kinds[i] + 5);
		assert_string_equal(text_of(tree[i], "unit"), units[i]);
		assert_near(number_of(tree[i], "q"), 10, 1e-12);
		assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(tree[i], "channels")), 6);
	}
	frequency = cJSON_GetObjectItem(tree[0], "frequency_hz");
	count = cJSON_GetArraySize(frequency);
	for (int i = 0; i + 1 < count; i++) {
		double f = cJSON_GetArrayItem(frequency, i)->valuedouble, w = 2 * M_PI * f;
		double g = spectrum_at(tree[0], "S2X", i), v = spectrum_at(tree[1], "S2X", i);

		assert_near(cJSON_GetArrayItem(frequency, i + 1)->valuedouble / f, pow(2, 1.0 / 12), 1e-9);
		assert_near(w * spectrum_at(tree[2], "S2X", i), v, 1e-9 * v);
		assert_near(w * v / UNITS_G_M_S2, g, 0.03 * g); /* but for the damper's force */
	}
	/* slow: the velocity change, 2 A T/pi; of a half-sine 1.65 A at most with this damping */
	assert_near(spectrum_at(tree[1], "S2X", 0), 2 * S2X_G * UNITS_G_M_S2 * PULSE_S / M_PI, 0.7);
	assert_in_range(spectrum_at(tree[0], "S2X", count - 20), S2X_G, 1.7 * S2X_G);
	for (int i = 0; i < 3; i++)
		cJSON_Delete(tree[i]);
	expect(400, work_spectrum, "one/1", "kind=loudness", NULL);
}

static void test_names_that_are_none(void **state)
{
	static void (*const runs[])(struct job *) = {work_trace, work_model, work_spectrum, work_result};
	static const struct {
		const char *name;
		int status;
	} wrong[] = {{"one/4", 404},    {"two/1", 404},    {"one", 400},
	             {"one/x", 400},    {"", 400},         {"../../etc/1", 404},
	             {"one/-1", 400},   {"one/1/..", 400}, {"one/99999999999", 400},
	             {"one/1%2f", 400}, {"/1", 404}};

	(void)state;
	start_with_drops();
	for (size_t i = 0; i < 4; i++)
		for (size_t k = 0; k < sizeof(wrong) / sizeof(wrong[0]); k++)
			expect(wrong[k].status, runs[i], wrong[k].name, NULL, NULL);
	for (size_t i = 0; i < 3; i++)
		expect(409, runs[i], "one/3", NULL, NULL);
	expect(404, work_result, "one/1", NULL, NULL); /* nobody analysed it */
}

/* ---- lists ---- */

static void check_list(void (*run)(struct job *job), const char *asked, const char *type,
                       const struct archive_filter *filter, bool undecided, int what)
{
	struct archive *archive = open_beside(ARCHIVE_READ);
	struct job job = ask(run, NULL, asked, NULL);
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
	start_with_drops();
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
	expect(400, work_drops, NULL, "angle_deg=flat", NULL);
	expect(400, work_drops, NULL, "angle_deg=nan", NULL);
	expect(400, work_drops, NULL, "date=2026-13", NULL);
	expect(400, work_drops, NULL, "limit=0", NULL);
	expect(400, work_drops, NULL, "limit=-1", NULL);
	expect(400, work_drops, NULL, "limit=5 OR 1", NULL);
	expect(400, work_drops, NULL, "limit=99999999999999999999", NULL);
	expect(400, work_drops, NULL, "text=a b c d e f g h i", NULL);
	expect(404, work_drops, NULL, "series=two", NULL);
	expect(404, work_drops, NULL, "series=' OR 1", NULL);
}

/* ---- set-up ---- */

static void run_sql(const char *text)
{
	char path[128], *why = NULL;
	sqlite3 *index;

	snprintf(path, sizeof(path), "%s/index.sqlite", folder);
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
	start();
	tree = ask_json(work_new_series, NULL, NULL,
	                "{\"name\":\"low\",\"campaign\":\"trial\",\"scene\":\"geometry-1\",\"angle_deg\":40,"
	                "\"height_m\":0.5,\"planned\":3}");
	assert_string_equal(text_of(tree, "series"), "low");
	cJSON_Delete(tree);
	archive = open_beside(ARCHIVE_READ);
	assert_int_equal(archive_scene(archive, "low", &scene), 0);
	assert_int_equal(scene_read(&bare, BARE, message), 0);
	assert_near(scene.drop_height_m, 0.5, 0);
	assert_near(scene.drop_angle_deg, 40, 0);
	assert_near(scene.tower_separation_m, bare.tower_separation_m + 0.5 - bare.drop_height_m, 1e-12);
	archive_close(archive);
	expect(409, work_new_series, NULL, NULL, "{\"name\":\"low\",\"scene\":\"geometry-1\"}");
	expect(400, work_new_series, NULL, NULL, "{\"name\":\"../low\",\"scene\":\"geometry-1\"}");
	expect(400, work_new_series, NULL, NULL, "{\"name\":\"a\",\"scene\":\"README.md\"}");
	expect(400, work_new_series, NULL, NULL, "{\"name\":\"a\",\"scene\":\"" BARE "\"}");
	expect(400, work_new_series, NULL, NULL, "{\"scene\":\"geometry-1\"}");
	expect(400, work_new_series, NULL, NULL, "{\"name\":5,\"scene\":\"geometry-1\"}");
	expect(400, work_new_series, NULL, NULL,
	       "{\"name\":\"a\",\"scene\":\"geometry-1\",\"angle_deg\":85}");
	expect(400, work_new_series, NULL, NULL,
	       "{\"name\":\"a\",\"scene\":\"geometry-1\",\"height_m\":0.04}");
	expect(400, work_new_series, NULL, NULL,
	       "{\"name\":\"a\",\"scene\":\"geometry-1\",\"height_m\":\"1\"}");
	expect(400, work_new_series, NULL, NULL, "{\"name\":\"a\",\"scene\":\"geometry-1\",\"planned\":2.5}");
	expect(400, work_new_series, NULL, NULL, "{\"name\":\"a\",\"scene\":\"geometry-1\",\"planned\":0}");
	expect(200, work_new_series, NULL, NULL, "{\"name\":\"a\",\"scene\":\"geometry-1\"}");
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
	archive_close(open_beside(ARCHIVE_CREATE));
	start();
	tree = ask_json(work_setup, NULL, NULL, NULL);
	assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(tree, "presets")), 0);
	scenes = cJSON_GetObjectItem(tree, "scenes");
	assert_int_equal(cJSON_GetArraySize(scenes), 2);
	assert_string_equal(text_of(cJSON_GetArrayItem(scenes, 0), "name"), "geometry-2A");
	assert_near(number_of(cJSON_GetArrayItem(scenes, 0), "height_m"), 0.894, 0);
	assert_true(number_of(cJSON_GetArrayItem(scenes, 0), "plate_mass_kg") > 0);
	assert_near(number_of(cJSON_GetArrayItem(scenes, 1), "plate_mass_kg"), 0, 0);
	assert_string_equal(text_of(tree, "operator"), "Ann");
	cJSON_Delete(tree);
	expect(200, work_new_series, NULL, NULL, "{\"name\":\"one\",\"scene\":\"geometry-2A\"}");
	stop();
	run_sql(make_presets);
	job_queue_init(&console.work_queue);
	start();
	tree = ask_json(work_setup, NULL, NULL, NULL);
	presets = cJSON_GetObjectItem(tree, "presets");
	assert_int_equal(cJSON_GetArraySize(presets), 20);
	cJSON_ArrayForEach(item, presets)
	{
		int i = atoi(text_of(item, "series") + 1), day = 1 + (i * 37) % 28;

		assert_string_equal(text_of(item, "scene"), "geometry-2A");
		assert_true(day <= before);
		before = day;
		angle[count] = number_of(item, "angle_deg");
		assert_near(angle[count], 20 + i % 30, 0);
		for (int k = 0; k < count; k++)
			assert_true(fabs(angle[k] - angle[count]) > 0.5);
		count++;
	}
	cJSON_Delete(tree);
}

/* ---- decisions ---- */

static void test_decisions_and_notes(void **state)
{
	struct work_view view;
	uint64_t revision;
	cJSON *tree, *drop;

	(void)state;
	start_with_drops();
	work_look(console.work, &view);
	revision = view.revision;
	expect(200, work_decide, NULL, NULL, "{\"drop\":\"one/1\",\"decision\":\"accepted\"}");
	expect(200, work_decide, NULL, NULL,
	       "{\"drop\":\"one/2\",\"decision\":\"rejected\",\"reason\":\"slipped\"}");
	expect(200, work_note, NULL, NULL, "{\"drop\":\"one/1\",\"text\":\"J\\u00fcrg held it\"}");
	work_look(console.work, &view);
	assert_int_equal(view.revision, revision + 3);
	expect(400, work_decide, NULL, NULL, "{\"drop\":\"one/1\",\"decision\":\"rejected\"}");
	expect(400, work_decide, NULL, NULL, "{\"drop\":\"one/1\",\"decision\":\"maybe\"}");
	expect(400, work_decide, NULL, NULL, "{\"drop\":\"one\",\"decision\":\"accepted\"}");
	expect(400, work_decide, NULL, NULL, "{\"decision\":\"accepted\"}");
	expect(404, work_decide, NULL, NULL, "{\"drop\":\"one/9\",\"decision\":\"accepted\"}");
	expect(409, work_decide, NULL, NULL, "{\"drop\":\"one/3\",\"decision\":\"accepted\"}");
	expect(400, work_note, NULL, NULL, "{\"drop\":\"one/1\"}");
	expect(400, work_note, NULL, NULL, "{\"drop\":\"one/1\",\"text\":\"two\\nlines\"}");
	work_look(console.work, &view);
	assert_int_equal(view.revision, revision + 3);
	tree = ask_json(work_drops, NULL, "series=one", NULL);
	drop = cJSON_GetArrayItem(cJSON_GetObjectItem(tree, "drops"), 0);
	assert_string_equal(text_of(drop, "decision"), "accepted");
	assert_string_equal(text_of(drop, "note"), "J\xc3\xbcrg held it");
	drop = cJSON_GetArrayItem(cJSON_GetObjectItem(tree, "drops"), 1);
	assert_string_equal(text_of(drop, "reason"), "slipped");
	cJSON_Delete(tree);
}

/* ---- the tower's ---- */

static struct handover_drop *new_drop(const char *series)
{
	struct handover_drop *drop = calloc(1, sizeof(*drop));

	assert_non_null(drop);
	record_init(&drop->record);
	drop->recording.lock = -1;
	drop->simulated = true;
	snprintf(drop->series, sizeof(drop->series), "%s", series);
	return drop;
}

static void and_then(struct job *job)
{
	job_answer_json(job, cJSON_CreateObject());
	job_done(job);
}

/* The job as it comes to the tower; NULL when it was answered with that status instead. */
static struct job *hand_over(struct job *job, int status)
{
	job->console = &console;
	job->done = on_done;
	assert_int_equal(job_put(&console.work_queue, job), 0);
	if (status == 0) {
		struct job *come = job_take(&console.tower_queue, 5000);

		assert_ptr_equal(come, job);
		assert_int_equal(come->message, JOB_RUN);
		return come;
	}
	while (sem_wait(&answered) != 0)
		continue;
	assert_int_equal(job->status, status);
	free(job->answer);
	return NULL;
}

static struct handover_drop *begin(const char *series)
{
	struct job job = {.run = and_then, .message = JOB_BEGIN, .luggage = new_drop(series)};

	return hand_over(&job, 0)->luggage;
}

static void read_hand(struct record *record, int lost_tick)
{
	char path[100];

	snprintf(path, sizeof(path), "%s/by-hand.log", folder);
	write_hand(path, lost_tick);
	assert_int_equal(read_record(record, path, NULL, message), 0);
	assert_int_equal(unlink(path), 0);
}

/* What the tower's thread sends of a drop. */
static void give(struct handover_drop *drop, enum job_message sent)
{
	drop->way = (struct job){.console = &console, .message = sent, .maker = drop};
	assert_int_equal(job_put_first(&console.work_queue, &drop->way), 0);
}

static void select_series(const char *series)
{
	struct handover_scene *scene = calloc(1, sizeof(*scene));

	assert_non_null(scene);
	strcpy(scene->series, series);
	scene->way = (struct job){.console = &console, .message = JOB_SELECTED, .maker = scene};
	assert_int_equal(job_put_first(&console.work_queue, &scene->way), 0);
}

static void wait_saved(const char *drop)
{
	struct job *come = job_take(&console.tower_queue, 5000);
	struct handover_drop *saved;
	char name[128] = "";

	assert_non_null(come);
	assert_int_equal(come->message, JOB_SAVED);
	saved = come->maker;
	strcpy(saved_trouble, saved->trouble);
	saved_on_disk = saved->on_disk;
	if (saved->trouble[0] == '\0')
		snprintf(name, sizeof(name), "%s/%u", saved->recording.series, saved->recording.number);
	free(saved);
	assert_string_equal(name, drop);
}

static bool is_simulated(const char *series, int number)
{
	char words[64];
	cJSON *tree;
	bool yes;

	snprintf(words, sizeof(words), "series=%s&number=%d", series, number);
	tree = ask_json(work_drops, NULL, words, NULL);
	assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(tree, "drops")), 1);
	yes = cJSON_IsTrue(
	        cJSON_GetObjectItem(cJSON_GetArrayItem(cJSON_GetObjectItem(tree, "drops"), 0), "simulated"));
	cJSON_Delete(tree);
	return yes;
}

static void test_a_drop_is_kept_and_analysed(void **state)
{
	struct handover_drop *drop;
	struct work_view view;
	cJSON *tree;

	(void)state;
	start_with_drops();
	select_series("one");
	drop = begin("one");
	assert_int_equal(drop->recording.number, 4);
	write_hand(drop->recording.log, -1);
	read_hand(&drop->record, -1);
	strcpy(drop->note, "a note");
	give(drop, JOB_KEEP);
	wait_saved("one/4");
	assert_string_equal(saved_trouble, "");
	tree = ask_json(work_result, "one/4", NULL, NULL);
	cJSON_Delete(tree);
	tree = ask_json(work_drops, NULL, "series=one", NULL);
	assert_string_equal(text_of(cJSON_GetArrayItem(cJSON_GetObjectItem(tree, "drops"), 3), "note"),
	                    "a note");
	assert_near(number_of(cJSON_GetArrayItem(cJSON_GetObjectItem(tree, "drops"), 3), "s2_x_g"), S2X_G, 2);
	cJSON_Delete(tree);
	assert_false(is_simulated("one", 1));
	assert_true(is_simulated("one", 4));
	work_look(console.work, &view);
	assert_string_equal(view.result, "one/4");
	assert_string_equal(view.trouble, "");
	assert_string_equal(view.series.name, "one");
	assert_string_equal(view.series.campaign, "trial");
	assert_int_equal(view.series.recorded, 3);
	assert_int_equal(view.series.partial, 1);
	assert_true(view.disk_free_bytes > 0);
}

static void wait_for_all(struct job *job)
{
	while (sem_wait(job->maker) != 0)
		continue;
	job_done(job);
}

static unsigned counted;
static bool saved_first; /* before the first that was counted */

static void count(struct job *job)
{
	if (counted++ == 0) {
		pthread_mutex_lock(&console.tower_queue.lock);
		saved_first = console.tower_queue.count == 1;
		pthread_mutex_unlock(&console.tower_queue.lock);
	}
	job_done(job);
}

/* Whatever the page has asked for, and however much. */
static void test_a_drop_goes_first(void **state)
{
	static struct job waiting[1000];
	struct handover_drop *drop = new_drop("one");
	sem_t all;
	struct job first = {.console = &console, .run = wait_for_all, .done = on_done, .maker = &all};
	unsigned put = 0;

	(void)state;
	start_with_drops();
	sem_init(&all, 0, 0);
	counted = 0;
	assert_int_equal(job_put(&console.work_queue, &first), 0);
	do
		waiting[put] = (struct job){.console = &console, .run = count, .done = on_done};
	while (job_put(&console.work_queue, &waiting[put]) == 0 && ++put < 1000);
	assert_in_range(put, 10, 999);
	read_hand(&drop->record, -1);
	give(drop, JOB_KEEP);
	sem_post(&all);
	for (unsigned i = 0; i <= put; i++)
		while (sem_wait(&answered) != 0)
			continue;
	wait_saved("one/4");
	assert_true(saved_first);
	assert_int_equal(counted, put);
	sem_destroy(&all);
}

static unsigned frames_in(const char *log)
{
	FILE *in = fopen(log, "r");
	unsigned count = 0;
	int c;

	assert_non_null(in);
	while ((c = fgetc(in)) != EOF)
		count += c == '\n';
	fclose(in);
	return count;
}

/* A drop from a tower that fell behind, and a log that a full disk has left with holes. */
static void test_a_log_that_lacks_frames_is_written_again(void **state)
{
	char log[ARCHIVE_PATH_MAX];
	struct handover_drop *drop;
	struct curves c;

	(void)state;
	start_with_drops();
	drop = new_drop("one");
	read_hand(&drop->record, -1);
	give(drop, JOB_KEEP);
	wait_saved("one/4");
	assert_true(is_simulated("one", 4));
	drop = begin("one");
	strcpy(log, drop->recording.log);
	write_hand(log, 150);
	assert_int_equal(frames_in(log), 2 * TICKS);
	read_hand(&drop->record, -1);
	give(drop, JOB_KEEP);
	wait_saved("one/5");
	assert_int_equal(frames_in(log), 2 * TICKS + 1); /* nothing is left of what was there */
	drop = begin("one");
	write_hand(drop->recording.log, 150);
	read_hand(&drop->record, 150);
	give(drop, JOB_KEEP);
	wait_saved("one/6");
	for (int i = 4; i <= 6; i++) {
		char name[16];

		snprintf(name, sizeof(name), "one/%d", i);
		c = ask_curves(work_trace, name);
		check_samples(&c, 2, 0, i == 6 ? 150 : TICKS);
		free_curves(&c);
	}
}

static void test_what_the_archive_does_not_take_is_not_lost(void **state)
{
	struct handover_drop *drop;
	struct work_view view;
	struct record record, expected;
	char path[200] = "", *at;

	(void)state;
	start_with_drops();
	drop = new_drop("nowhere");
	read_hand(&drop->record, -1);
	read_hand(&expected, -1);
	give(drop, JOB_KEEP);
	wait_saved("");
	work_look(console.work, &view);
	assert_string_equal(view.trouble, saved_trouble);
	assert_non_null(strstr(saved_trouble, "no series 'nowhere'"));
	assert_true(saved_on_disk);
	at = strstr(saved_trouble, "the drop is in ");
	assert_non_null(at);
	snprintf(path, sizeof(path), "%.*s", (int)strcspn(at + 15, ","), at + 15);
	assert_non_null(strstr(path, folder));
	assert_int_equal(read_record(&record, path, NULL, message), 0);
	hand_check_equal(&record, &expected);
	record_free(&record);
	record_free(&expected);
	drop = begin("one");
	read_hand(&drop->record, -1);
	give(drop, JOB_KEEP);
	wait_saved("one/4");
	work_look(console.work, &view);
	assert_string_equal(view.trouble, "");
}

static void test_a_drop_that_did_not_come(void **state)
{
	struct job refused = {.run = and_then, .message = JOB_BEGIN};
	struct handover_drop *drop;
	cJSON *tree, *drops;

	(void)state;
	start_with_drops();
	give(begin("one"), JOB_DISCARD);
	drop = begin("one");
	assert_int_equal(drop->recording.number, 4);
	drop->released = true;
	strcpy(drop->note, "nothing was heard of it");
	give(drop, JOB_DISCARD);
	give(new_drop("one"), JOB_DISCARD);
	tree = ask_json(work_drops, NULL, "series=one", NULL);
	drops = cJSON_GetObjectItem(tree, "drops");
	assert_int_equal(cJSON_GetArraySize(drops), 4);
	assert_string_equal(text_of(cJSON_GetArrayItem(drops, 3), "state"), "interrupted");
	assert_string_equal(text_of(cJSON_GetArrayItem(drops, 3), "note"), "nothing was heard of it");
	cJSON_Delete(tree);
	refused.luggage = new_drop("two");
	assert_null(hand_over(&refused, 404));
}

static void test_the_scene_for_the_tower(void **state)
{
	struct handover_scene *wanted = calloc(1, sizeof(*wanted));
	struct job job = {.run = and_then, .message = JOB_SCENE, .luggage = wanted};

	(void)state;
	start_with_drops();
	assert_non_null(wanted);
	strcpy(wanted->series, "one");
	hand_over(&job, 0);
	assert_string_equal(wanted->scene.name, "geometry-2A");
	assert_near(wanted->scene.drop_angle_deg, 27, 0);
	assert_non_null(strstr(wanted->text, "height_m = 0.894"));
	free(wanted->text);
	strcpy(wanted->series, "two");
	job.message = JOB_SCENE;
	assert_null(hand_over(&job, 404));
}

static void test_no_report_while_a_drop_is_under_way(void **state)
{
	(void)state;
	start_with_drops();
	expect(404, work_report, "two", NULL, NULL);
	console.at_rest = false;
	expect(409, work_report, "one", NULL, NULL);
	console.at_rest = true;
	expect(500, work_report, "one", NULL, NULL); /* there is no droptower beside the test */
}

static void test_an_archive_that_cannot_be(void **state)
{
	static const char *const none[] = {NULL}, *const wrong[] = {"README.md", NULL};
	struct work_options options = {"/dev/null/archive", "", none};

	(void)state;
	assert_null(work_start(&console, &options, message));
	assert_non_null(strstr(message, "/dev/null/archive"));
	options = (struct work_options){folder, "", wrong};
	assert_null(work_start(&console, &options, message));
	assert_non_null(strstr(message, "README.md"));
}

#define IN_A_FOLDER(test) cmocka_unit_test_setup_teardown(test, make_folder, remove_folder)

int main(void)
{
	const struct CMUnitTest tests[] = {
	        IN_A_FOLDER(test_a_trace_is_the_log),
	        IN_A_FOLDER(test_the_model_lies_on_the_trace),
	        IN_A_FOLDER(test_spectra),
	        IN_A_FOLDER(test_names_that_are_none),
	        IN_A_FOLDER(test_lists_are_those_of_the_command),
	        IN_A_FOLDER(test_a_series_from_another_height),
	        IN_A_FOLDER(test_presets_are_earlier_series),
	        IN_A_FOLDER(test_decisions_and_notes),
	        IN_A_FOLDER(test_a_drop_is_kept_and_analysed),
	        IN_A_FOLDER(test_a_drop_goes_first),
	        IN_A_FOLDER(test_a_log_that_lacks_frames_is_written_again),
	        IN_A_FOLDER(test_what_the_archive_does_not_take_is_not_lost),
	        IN_A_FOLDER(test_a_drop_that_did_not_come),
	        IN_A_FOLDER(test_the_scene_for_the_tower),
	        IN_A_FOLDER(test_no_report_while_a_drop_is_under_way),
	        IN_A_FOLDER(test_an_archive_that_cannot_be),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
