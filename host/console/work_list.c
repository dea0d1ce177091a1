/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What the archive says of series, drops and results, in the very bytes that `droptower series` prints.
 */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/base/number.h"
#include "host/archive/print.h"
#include "host/console/work_private.h"
#include "common/base/text.h"

enum { COUNT_MAX = 1000000 };

struct wanted {
	struct archive_filter filter;
	struct archive_dates dates;
	bool undecided;
};

/* A whole number from 1, or what there is in to when it was not given. False with the job refused. */
static bool read_count(struct job *job, const char *name, unsigned *to)
{
	const char *text = job->query(job, name);
	uint64_t count = 1;

	if (text != NULL && !number_whole(text, 1, COUNT_MAX, &count)) {
		job_refuse(job, 400, "%s is '%.40s', expected a whole number from 1 to %d", name, text,
		           COUNT_MAX);
		return false;
	}
	if (text != NULL)
		*to = (unsigned)count;
	return true;
}

/* False with the job refused. */
static bool read_query(struct job *job, struct wanted *w)
{
	const char *angle = job->query(job, "angle_deg"), *date = job->query(job, "date"),
	           *undecided = job->query(job, "undecided");

	w->filter = archive_filter_none();
	w->filter.series = job->query(job, "series");
	w->filter.campaign = job->query(job, "campaign");
	w->filter.scene_name = job->query(job, "scene");
	w->filter.text = job->query(job, "text");
	w->undecided = undecided != NULL && strcmp(undecided, "1") == 0;
	if (angle != NULL && !number_read(angle, -DBL_MAX, DBL_MAX, &w->filter.angle_deg)) {
		job_refuse(job, 400, "angle_deg is '%.40s', expected a number", angle);
		return false;
	}
	if (!read_count(job, "limit", &w->filter.limit) || !read_count(job, "number", &w->filter.number))
		return false;
	if (date == NULL || archive_parse_dates(date, &w->dates, &w->filter))
		return true;
	job_refuse(job, 400, "date is '%.40s', expected YYYY, YYYY-MM, YYYY-MM-DD, or two of them with ..",
	           date);
	return false;
}

/* A list of no such series is no empty list. */
static int check_series(struct archive *archive, const struct wanted *w)
{
	struct scene scene;

	return w->filter.series != NULL ? archive_scene(archive, w->filter.series, &scene) : 0;
}

static void work_list_answer(struct job *job,
                             int (*print)(struct archive *archive, const struct wanted *wanted, FILE *out),
                             const char *type)
{
	struct archive *archive = job->console->work->archive;
	struct wanted wanted;
	struct text text = {.bytes = NULL};
	int result;

	if (!read_query(job, &wanted)) {
		job_done(job);
		return;
	}
	result = check_series(archive, &wanted);
	if (result == 0)
		result = text_open(&text);
	if (result == 0)
		result = text_close(&text, print(archive, &wanted, text.out));
	if (result != 0) {
		work_refuse(job, result);
		return;
	}
	job_answer_bytes(job, type, text.bytes, text.size);
	job_done(job);
}

static int series_json(struct archive *archive, const struct wanted *w, FILE *out)
{
	return print_series(archive, &w->filter, TABLE_JSON, out);
}

static int drops_json(struct archive *archive, const struct wanted *w, FILE *out)
{
	return print_drops(archive, &w->filter, w->undecided, TABLE_JSON, out);
}

static int drops_csv(struct archive *archive, const struct wanted *w, FILE *out)
{
	return print_drops(archive, &w->filter, w->undecided, TABLE_CSV, out);
}

static int work_list_tables_json(struct archive *archive, const struct wanted *w, FILE *out)
{
	return print_tables(archive, &w->filter, w->undecided, NULL, TABLE_JSON, out);
}

void work_series(struct job *job)
{
	work_list_answer(job, series_json, "application/json");
}

void work_drops(struct job *job)
{
	work_list_answer(job, drops_json, "application/json");
}

void work_tables(struct job *job)
{
	work_list_answer(job, work_list_tables_json, "application/json");
}

void work_csv(struct job *job)
{
	work_list_answer(job, drops_csv, "text/csv; charset=utf-8");
}

void work_result(struct job *job)
{
	struct archive *archive = job->console->work->archive;
	char *json;
	int result = archive_json(archive, job->path, NULL, &json);

	if (result != 0) {
		work_refuse(job, result);
		return;
	}
	job_answer_bytes(job, "application/json", json, strlen(json));
	job_done(job);
}
