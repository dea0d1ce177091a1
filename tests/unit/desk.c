/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/unit/desk.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "common/wire.h"
#include "host/console/work.h"
#include "tests/unit/near.h"
#include "tests/unit/scratch.h"

char desk_folder[64], desk_message[ARCHIVE_MESSAGE_MAX];
struct console desk_console;
sem_t desk_answered;
struct hand_drop desk_hand;

int desk_make_folder(void **state)
{
	(void)state;
	memset(&desk_console, 0, sizeof(desk_console));
	desk_console.at_rest = true;
	sem_init(&desk_answered, 0, 0);
	job_queue_init(&desk_console.work_queue);
	job_queue_init(&desk_console.tower_queue);
	return mkdtemp(scratch_name(desk_folder, "work")) == NULL;
}

int desk_remove_folder(void **state)
{
	char command[100];

	(void)state;
	work_stop(desk_console.work);
	job_queue_destroy(&desk_console.work_queue);
	job_queue_destroy(&desk_console.tower_queue);
	sem_destroy(&desk_answered);
	snprintf(command, sizeof(command), "rm -rf %s", desk_folder);
	return system(command);
}

void desk_start(void)
{
	static const char *const scenes[] = {DESK_SCENE, DESK_BARE, NULL};
	const struct work_options options = {desk_folder, "Ann", scenes};

	desk_console.work = work_start(&desk_console, &options, desk_message);
	if (desk_console.work == NULL)
		fail_msg("%s", desk_message);
}

void desk_stop(void)
{
	work_stop(desk_console.work);
	desk_console.work = NULL;
}

void desk_on_done(struct job *job)
{
	(void)job;
	sem_post(&desk_answered);
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

struct job desk_ask(void (*run)(struct job *job), const char *path, const char *asked, const char *body)
{
	cJSON *tree = body != NULL ? cJSON_Parse(body) : NULL;
	char words[200];
	struct job job = {.console = &desk_console,
	                  .run = run,
	                  .done = desk_on_done,
	                  .maker = words,
	                  .body = tree,
	                  .path = path,
	                  .query = query};

	assert_true(body == NULL || tree != NULL);
	snprintf(words, sizeof(words), "%s", asked != NULL ? asked : "");
	assert_int_equal(job_put(&desk_console.work_queue, &job), 0);
	while (sem_wait(&desk_answered) != 0)
		continue;
	cJSON_Delete(tree);
	return job;
}

void desk_expect(int status, void (*run)(struct job *job), const char *path, const char *asked,
                 const char *body)
{
	struct job job = desk_ask(run, path, asked, body);

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

cJSON *desk_ask_json(void (*run)(struct job *job), const char *path, const char *asked, const char *body)
{
	struct job job = desk_ask(run, path, asked, body);
	cJSON *tree = cJSON_ParseWithLength(job.answer, job.size);

	if (job.status != 200 || tree == NULL)
		fail_msg("%d: %.*s", job.status, (int)job.size, (const char *)job.answer);
	assert_string_equal(job.type, "application/json");
	free(job.answer);
	return tree;
}

const char *desk_text(const cJSON *tree, const char *key)
{
	const cJSON *item = cJSON_GetObjectItem(tree, key);

	assert_true(cJSON_IsString(item));
	return item->valuestring;
}

double desk_number(const cJSON *tree, const char *key)
{
	const cJSON *item = cJSON_GetObjectItem(tree, key);

	assert_true(cJSON_IsNumber(item));
	return item->valuedouble;
}

struct archive *desk_open_beside(enum archive_mode mode)
{
	struct archive *archive = archive_open(desk_folder, mode, desk_message);

	if (archive == NULL)
		fail_msg("%s", desk_message);
	return archive;
}

static int16_t count_of(double value_g)
{
	return (int16_t)lrint(32 * value_g);
}

static double half_sine(double time_s)
{
	double x = (time_s - DESK_TRIGGER_S) / DESK_PULSE_S;

	return x > 0 && x < 1 ? sin(M_PI * x) : 0;
}

/* S1 rings at 150 Hz. */
static double ringing(double time_s)
{
	double t = time_s - DESK_TRIGGER_S;

	return t > 0 ? exp(-90 * t) * sin(2 * M_PI * 150 * t) : 0;
}

static void fill_hand(void)
{
	uint64_t seed = 20;

	hand_fill(&desk_hand, 5000, DESK_TICKS, 1);
	desk_hand.trigger_us = (uint32_t)(DESK_TRIGGER_S * 1e6);
	desk_hand.marks = 0;
	for (uint32_t tick = 0; tick < DESK_TICKS; tick++)
		for (int k = 0; k < HAND_PER_TICK; k++) {
			bool x = k < WIRE_X_PER_TICK;
			int within = x ? k : (k - WIRE_X_PER_TICK) % WIRE_YZ_PER_TICK;
			double t = (tick + (double)within / (x ? WIRE_X_PER_TICK : WIRE_YZ_PER_TICK)) / 1e3;
			double noise = 0.25 * (hand_random(&seed) % 5 - 2.0);
			double share = x ? 1 : k < WIRE_X_PER_TICK + WIRE_YZ_PER_TICK ? 0.5 : 0.1;

			desk_hand.sample[0][tick][k] = count_of(300 * share * ringing(t) + noise);
			desk_hand.sample[1][tick][k] = count_of(DESK_S2X_G * share * half_sine(t) + noise);
		}
}

void desk_write_hand(const char *path, int lost_tick)
{
	FILE *out = fopen(path, "w");
	struct frame frame;
	char line[256];

	assert_non_null(out);
	for (uint32_t tick = 0; tick < DESK_TICKS; tick++)
		for (unsigned sensor = 1; sensor <= 2; sensor++) {
			if (sensor == 2 && (int)tick == lost_tick)
				continue;
			hand_block(&desk_hand, sensor, tick, false, &frame);
			hand_candump(&frame, 1000 * (5000 + (int64_t)tick), line);
			fputs(line, out);
		}
	hand_capture_end(&desk_hand, &frame);
	hand_candump(&frame, 1000 * (5000 + DESK_TICKS), line);
	fputs(line, out);
	assert_int_equal(fclose(out), 0);
}

static void record_hand(struct archive *archive, const char *series, int lost_tick)
{
	struct archive_recording r;

	assert_int_equal(archive_begin(archive, series, "Ann", ".log", false, &r), 0);
	desk_write_hand(r.log, lost_tick);
	assert_int_equal(archive_finish(archive, &r, 0, ""), 0);
}

void desk_start_with_drops(void)
{
	struct archive *archive = desk_open_beside(ARCHIVE_CREATE);
	struct archive_recording r;

	fill_hand();
	assert_int_equal(archive_new_series(archive, "one", "trial", DESK_SCENE, 27, NAN, NULL, 5), 0);
	record_hand(archive, "one", -1);
	record_hand(archive, "one", 200);
	assert_int_equal(archive_begin(archive, "one", "Ann", ".log", false, &r), 0);
	archive_abandon(&r);
	archive_close(archive);
	desk_start();
}

struct desk_curves desk_ask_curves(void (*run)(struct job *job), const char *path)
{
	struct desk_curves c = {.job = desk_ask(run, path, NULL, NULL)};
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
	        (size_t)desk_number(item, "count");
	assert_int_equal(c.job.size, 4 + length + 4 * total);
	return c;
}

void desk_free_curves(struct desk_curves *c)
{
	cJSON_Delete(c->head);
	free(c->job.answer);
}

struct desk_curve desk_curve(const struct desk_curves *c, const char *name)
{
	struct desk_curve curve = {.count = 0};
	const unsigned char *at = c->at;
	const cJSON *item;

	cJSON_ArrayForEach(item, cJSON_GetObjectItem(c->head, "channels"))
	{
		curve.count = (size_t)desk_number(item, "count");
		if (strcmp(desk_text(item, "name"), name) == 0) {
			curve.rate_hz = desk_number(item, "rate_hz");
			curve.start_s = desk_number(item, "start_s");
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

void desk_check_samples(const struct desk_curves *c, unsigned sensor, int axis, size_t lost_tick)
{
	static const char *const names[2][3] = {{"S1X", "S1Y", "S1Z"}, {"S2X", "S2Y", "S2Z"}};
	static const size_t first[3] = {0, WIRE_X_PER_TICK, WIRE_X_PER_TICK + WIRE_YZ_PER_TICK};
	size_t per_tick = axis == 0 ? WIRE_X_PER_TICK : WIRE_YZ_PER_TICK;
	struct desk_curve curve = desk_curve(c, names[sensor - 1][axis]);

	assert_int_equal(curve.count, per_tick * DESK_TICKS);
	assert_near(curve.rate_hz, 1000.0 * (double)per_tick, 0);
	for (size_t k = 0; k < curve.count; k++) {
		if (sensor == 2 && k / per_tick == lost_tick)
			assert_true(isnan(curve.value[k]));
		else if (32 * curve.value[k] !=
		         desk_hand.sample[sensor - 1][k / per_tick][first[axis] + k % per_tick])
			fail_msg("%s %zu is %g", names[sensor - 1][axis], k, (double)curve.value[k]);
	}
	free(curve.value);
}
