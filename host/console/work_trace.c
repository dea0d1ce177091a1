/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * One drop for the page's charts: its samples, the model beside them, its shock response spectra.
 */
#include <cjson/cJSON.h>
#include <endian.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/command/archived.h"
#include "host/command/evaluate.h"
#include "host/console/work_private.h"
#include "host/report/curves.h"
#include "host/report/facts.h"
#include "host/base/put.h"
#include "host/shock/spectrum.h"

/* ---- a drop from its log ---- */

struct drop {
	struct scene scene;
	struct record record;
};

/* False with the job answered. */
static bool open_drop(struct job *job, struct drop *drop)
{
	struct archive *archive = job->console->work->archive;
	char series[ARCHIVE_NAME_MAX + 1], message[ARCHIVE_MESSAGE_MAX];
	int result = archived_read(archive, job->path, &drop->record, NULL, message);

	if (result != 0) {
		job_refuse(job, work_status(result == DT_E_FORMAT ? DT_E_CORRUPT : result), "%s", message);
		job_done(job);
		return false;
	}
	snprintf(series, sizeof(series), "%.*s", (int)(strrchr(job->path, '/') - job->path), job->path);
	result = archive_scene(archive, series, &drop->scene);
	if (result == 0)
		return true;
	record_free(&drop->record);
	work_refuse(job, result);
	return false;
}

/* With what answer makes of the drop's analysis. */
static void answer_drop(struct job *job, void (*answer)(struct job *job, const struct report *report))
{
	struct evaluate_options options = {.iepe_time_constant_s = NAN};
	struct evaluated e;
	struct drop drop;
	int result;

	if (!open_drop(job, &drop))
		return;
	options.scene = &drop.scene;
	result = evaluate_open(&e, &drop.record, &options);
	if (result == 0) {
		answer(job, &e.report);
		evaluate_close(&e);
	} else {
		job_refuse(job, work_status(result), "%s: %s", job->path, error_text(result));
	}
	record_free(&drop.record);
	job_done(job);
}

/* ---- samples as bytes ---- */

struct curves {
	cJSON *head, *channels;
	uint32_t *value; /* float32, little endian */
	size_t count, room;
	bool failed;
};

static bool curves_open(struct curves *c, const struct report_zero *zero)
{
	*c = (struct curves){.head = cJSON_CreateObject()};
	cJSON_AddStringToObject(c->head, "zero", zero->name);
	c->channels = cJSON_AddArrayToObject(c->head, "channels");
	return c->channels != NULL;
}

/* Room for count samples of one more channel; NULL without memory. */
static uint32_t *curves_add(struct curves *c, const char *name, const struct channel *times, double zero_s)
{
	cJSON *item = cJSON_CreateObject();
	size_t wanted = c->count + times->count;
	uint32_t *value = wanted > c->room ? realloc(c->value, 2 * wanted * sizeof(*value)) : c->value;

	cJSON_AddStringToObject(item, "name", name);
	cJSON_AddNumberToObject(item, "rate_hz", times->rate_hz);
	cJSON_AddNumberToObject(item, "start_s", times->start_s - zero_s);
	cJSON_AddNumberToObject(item, "count", (double)times->count);
	cJSON_AddItemToArray(c->channels, item);
	if (value == NULL) {
		c->failed = true;
		return NULL;
	}
	if (wanted > c->room)
		c->room = 2 * wanted;
	c->value = value;
	value += c->count;
	c->count = wanted;
	return value;
}

static uint32_t sample_bits(double value_g)
{
	float value = (float)value_g;
	uint32_t bits;

	memcpy(&bits, &value, sizeof(bits));
	return htole32(bits);
}

/* The header's length, the header padded to a multiple of 4, the samples. */
static void answer_curves(struct job *job, struct curves *c)
{
	char *head = c->failed ? NULL : cJSON_PrintUnformatted(c->head), *bytes = NULL;
	size_t length = head != NULL ? strlen(head) : 0, padded = (length + 3) / 4 * 4;
	size_t size = 4 + padded + 4 * c->count;
	uint32_t told = htole32((uint32_t)padded);

	if (head != NULL)
		bytes = malloc(size);
	if (bytes != NULL) {
		memcpy(bytes, &told, 4);
		memcpy(bytes + 4, head, length);
		memset(bytes + 4 + length, ' ', padded - length);
		if (c->count > 0)
			memcpy(bytes + 4 + padded, c->value, 4 * c->count);
	}
	job_answer_bytes(job, "application/octet-stream", bytes, size);
	free(head);
	cJSON_Delete(c->head);
	free(c->value);
}

/* ---- the trace ---- */

static void add_channel(struct curves *c, const struct channel *channel, double zero_s)
{
	uint32_t *to = curves_add(c, channel->name, channel, zero_s);

	for (size_t k = 0; to != NULL && k < channel->count; k++)
		to[k] = sample_bits(channel->value_g[k]);
}

static void work_trace_add_resultant(struct curves *c, const struct report *report, const char *sensor,
                                     double zero_s)
{
	struct curves_axes axes;
	uint32_t *to;
	char name[8];

	if (!curves_axes(report, sensor, &axes))
		return;
	snprintf(name, sizeof(name), "%sR", sensor);
	to = curves_add(c, name, axes.y, zero_s);
	for (size_t k = 0; to != NULL && k < axes.y->count; k++)
		to[k] = sample_bits(curves_resultant(&axes, k));
}

static void answer_trace(struct job *job, const struct report *report)
{
	struct report_zero zero = report_zero(report);
	struct curves c;

	c.failed = !curves_open(&c, &zero);
	for (size_t i = 0; i < report->record->channel_count; i++)
		add_channel(&c, &report->record->channels[i], zero.time_s);
	work_trace_add_resultant(&c, report, "S1", zero.time_s);
	work_trace_add_resultant(&c, report, "S2", zero.time_s);
	answer_curves(job, &c);
}

void work_trace(struct job *job)
{
	answer_drop(job, answer_trace);
}

/* ---- the model ---- */

static void answer_histories(struct job *job, const struct report *report, const struct channel *times,
                             double (*value_g)[MODEL_AXES])
{
	static const char *const names[MODEL_AXES + 2] = {"S1X", "S1Y", "S2X", "S2Y", "S1R", "S2R"};
	struct report_zero zero = report_zero(report);
	struct curves c;

	c.failed = !curves_open(&c, &zero);
	for (int i = 0; i < MODEL_AXES + 2; i++) {
		uint32_t *to = curves_add(&c, names[i], times, zero.time_s);
		enum model_axis x = i == MODEL_AXES ? MODEL_S1X : MODEL_S2X;

		for (size_t k = 0; to != NULL && k < times->count; k++)
			to[k] = sample_bits(i < MODEL_AXES ? value_g[k][i]
			                                   : hypot(value_g[k][x], value_g[k][x + 1]));
	}
	answer_curves(job, &c);
}

/* At the instants of the drop's fastest channel. */
static void answer_model(struct job *job, const struct report *report)
{
	const struct channel *times = record_axis(report->record, "S2Y");
	char message[MODEL_MESSAGE_MAX] = "no model of this drop";
	double start_s, (*value_g)[MODEL_AXES];
	int result = DT_E_EMPTY;

	if (times == NULL || !curves_model_start(report, &start_s)) {
		job_refuse(job, 404, "%s: %s", job->path, message);
		return;
	}
	value_g = malloc((times->count + 1) * sizeof(*value_g));
	if (value_g != NULL)
		result = model_histories(report->scene, report->prediction->rung, NULL,
		                         times->start_s - start_s, 1 / times->rate_hz, value_g, times->count,
		                         message);
	if (result == 0)
		answer_histories(job, report, times, value_g);
	else
		job_refuse(job, 404, "%s: %s", job->path, message);
	free(value_g);
}

void work_model(struct job *job)
{
	answer_drop(job, answer_model);
}

/* ---- spectra ---- */

static const struct {
	const char *name, *unit;
} kinds[SRS_QUANTITIES] = {
        [SRS_ACCELERATION] = {"absolute-acceleration", "g"},
        [SRS_VELOCITY] = {"pseudo-velocity", "m/s"},
        [SRS_DISPLACEMENT] = {"relative-displacement", "m"},
};

/* False with the job refused; the first when none is asked for. */
static bool find_kind(struct job *job, enum srs_quantity *kind)
{
	const char *name = job->query(job, "kind");

	for (int i = 0; i < SRS_QUANTITIES; i++) {
		if (name != NULL && strcmp(name, kinds[i].name) != 0)
			continue;
		*kind = (enum srs_quantity)i;
		return true;
	}
	job_refuse(job, 400, "kind is '%.40s', expected %s, %s or %s", name, kinds[0].name, kinds[1].name,
	           kinds[2].name);
	return false;
}

static void answer_spectrum(struct job *job, const struct spectrum *s, const struct spectrum_options *options)
{
	cJSON *root = cJSON_CreateObject(), *channels;
	struct builder b = {false};

	put_text(&b, root, "kind", kinds[options->srs.quantity].name);
	put_text(&b, root, "unit", kinds[options->srs.quantity].unit);
	put_number(&b, root, "q", 0.5 / options->srs.damping);
	put_numbers(&b, root, "frequency_hz", s->frequency_hz, s->count);
	channels = put_array(&b, root, "channels");
	for (size_t i = 0; i < s->channel_count; i++) {
		cJSON *item = put_append(&b, channels);

		put_text(&b, item, "name", s->channel[i].name);
		put_numbers(&b, item, "value", s->channel[i].side[options->side], s->count);
	}
	job_answer_json(job, root);
}

void work_spectrum(struct job *job)
{
	struct spectrum_options options = {
	        .srs = {.damping = 0.05}, .side = SRS_MAXIMAX, .part = SRS_TOTAL, .per_octave = 12};
	struct spectrum spectrum;
	struct drop drop;
	int result;

	if (!find_kind(job, &options.srs.quantity)) {
		job_done(job);
		return;
	}
	if (!open_drop(job, &drop))
		return;
	result = spectrum_compute(&drop.record, &options, &spectrum);
	if (result == 0) {
		answer_spectrum(job, &spectrum, &options);
		spectrum_free(&spectrum);
	} else {
		job_refuse(job, work_status(result), "%s: %s", job->path,
		           result == DT_E_EMPTY ? "too many samples are missing in every channel"
		                                : error_text(result));
	}
	record_free(&drop.record);
	job_done(job);
}
