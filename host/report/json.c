/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "host/model/ensemble.h"
#include "common/base/text.h"
#include "host/estimate/cfc.h"
#include "host/record/metadata.h"
#include "host/report/facts.h"
#include "host/base/put.h"
#include "host/report/shock.h"

#include "host/result/quantity.h"

static void put_names(struct builder *b, cJSON *object, const char *key, const char *const *names)
{
	cJSON *array = put_array(b, object, key);

	for (unsigned i = 0; i < ESTIMATE_PATH_MAX && names[i]; i++) {
		cJSON *name = cJSON_CreateString(names[i]);

		if (!name || !cJSON_AddItemToArray(array, name)) {
			cJSON_Delete(name);
			b->failed = true;
		}
	}
}

static void put_quantity(struct builder *b, cJSON *json, const struct quantity *q, const void *object)
{
	const void *at = (const char *)object + q->offset;
	const char *name;

	switch (q->kind) {
	case QUANTITY_YES:
		put_bool(b, json, q->key, *(const bool *)at);
		break;
	case QUANTITY_NAME:
		name = *(const char *const *)at;
		put_text(b, json, q->key, name ? name : "");
		break;
	case QUANTITY_NAMES:
		put_names(b, json, q->key, at);
		break;
	case QUANTITY_FLAGS:
		put_flags(b, json, *(const unsigned *)at, estimate_flag_name);
		break;
	case QUANTITY_STATUS:
		put_text(b, json, q->key, estimate_status_name(*(const enum estimate_status *)at));
		break;
	case QUANTITY_FAMILY:
		put_text(b, json, q->key, estimate_family_name(*(const enum estimate_family *)at));
		break;
	default:
		put_number(b, json, q->key, quantity_number(q, object));
	}
}

/* All that the table has of an object. */
static cJSON *put_all(struct builder *b, cJSON *json, enum quantity_object which, const void *object)
{
	const struct quantity *q = NULL;

	while ((q = quantity_next(which, q)))
		put_quantity(b, json, q, object);
	return json;
}

static void json_put_channel(struct builder *b, cJSON *array, const struct channel *channel,
                             const struct estimate_channel *e)
{
	cJSON *item = put_append(b, array), *pulse;

	put_text(b, item, "name", channel->name);
	put_all(b, item, QUANTITY_SAMPLES, channel);
	put_flags(b, item, e->flags, record_flag_name);
	put_all(b, put_object(b, item, "baseline"), QUANTITY_BASELINE, &e->baseline);
	put_all(b, put_object(b, item, "peak"), QUANTITY_PEAK, &e->peak);
	pulse = put_all(b, put_object(b, item, "pulse"), QUANTITY_PULSE, &e->pulse);
	put_all(b, put_object(b, pulse, "contact"), QUANTITY_CONTACT, &e->pulse);
	put_all(b, put_object(b, item, "ringdown"), QUANTITY_RINGDOWN, &e->ringdown);
}

/* The corner of two filters is at most the lower of theirs. */
static void put_processing(struct builder *b, cJSON *root, const struct report *report)
{
	const struct estimate_options *done = &report->options;
	double class_hz = done->cfc > 0 ? CFC_CORNER * done->cfc : (double)INFINITY;
	double corner_hz = done->lowpass_hz > 0.0 ? done->lowpass_hz : (double)INFINITY;
	cJSON *item = put_object(b, root, "processing");
	char filter[48];

	report_filter(report, filter, sizeof(filter));
	if (filter[0])
		put_text(b, item, "filter", filter);
	else
		put_item(b, item, "filter", cJSON_CreateNull());
	put_number(b, item, "cutoff_hz", fmin(class_hz, corner_hz));
	put_all(b, item, QUANTITY_PROCESSING, done);
}

static void json_put_drop(struct builder *b, cJSON *root, const struct record *r, bool unattended)
{
	cJSON *drop, *counters, *gaps;

	if (!r->is_drop) {
		put_item(b, root, "drop", cJSON_CreateNull());
		return;
	}
	drop = put_object(b, root, "drop");
	put_number(b, drop, "drop_id", r->drop_id);
	if (r->log_number > 0)
		put_number(b, drop, "log_number", r->log_number);
	put_all(b, drop, QUANTITY_DROP, r);
	put_number(b, drop, "crc32", r->crc_known ? (double)r->crc32 : (double)NAN);
	put_bool(b, drop, "crc_agrees", r->crc_known && r->crc_agrees);
	put_number(b, drop, "camera_frame", r->crc_known ? r->camera_frame : (double)NAN);
	if (unattended)
		put_bool(b, drop, "unattended", true);
	counters = put_object(b, drop, "counters");
	put_number(b, counters, "blocks", (double)r->counters.blocks);
	put_number(b, counters, "repeated", (double)r->counters.repeated);
	put_number(b, counters, "reordered", (double)r->counters.reordered);
	put_number(b, counters, "corrupt", (double)r->counters.corrupt);
	put_number(b, counters, "gaps", (double)r->counters.gaps);
	put_number(b, counters, "resent", (double)r->counters.resent);
	put_number(b, counters, "conflicting", (double)r->counters.conflicting);
	gaps = put_array(b, drop, "gaps");
	for (size_t i = 0; i < r->gap_count; i++) {
		cJSON *gap = put_append(b, gaps);

		put_number(b, gap, "sensor", r->gaps[i].sensor);
		put_number(b, gap, "first_tick_ms", r->gaps[i].first_tick_ms);
		put_number(b, gap, "last_tick_ms", r->gaps[i].last_tick_ms);
	}
}

static void put_resultants(struct builder *b, cJSON *root, const struct analysis *a)
{
	cJSON *array = put_array(b, root, "resultants");

	for (size_t i = 0; i < a->resultant_count; i++) {
		cJSON *item = put_append(b, array);

		put_text(b, item, "sensor", a->resultants[i].sensor);
		put_all(b, item, QUANTITY_RESULTANT, &a->resultants[i]);
	}
}

static void put_tower(struct builder *b, cJSON *root, const struct record *r)
{
	struct measured measured = measured_of(r);

	if (r->is_drop)
		put_all(b, put_object(b, root, "tower"), QUANTITY_TOWER, &measured);
	else
		put_item(b, root, "tower", cJSON_CreateNull());
}

/* Null when there is none. */
static cJSON *put_if(struct builder *b, cJSON *root, const char *key, bool there, enum quantity_object which,
                     const void *object)
{
	if (there)
		return put_all(b, put_object(b, root, key), which, object);
	put_item(b, root, key, cJSON_CreateNull());
	return NULL;
}

static void put_scene(struct builder *b, cJSON *root, const struct scene *scene)
{
	cJSON *item;

	if (!scene) {
		put_item(b, root, "scene", cJSON_CreateNull());
		return;
	}
	item = put_object(b, root, "scene");
	put_text(b, item, "name", scene->name);
	put_text(b, item, "title", scene->title);
	put_number(b, item, "angle_deg", scene->drop_angle_deg);
	put_number(b, item, "height_m", scene->drop_height_m);
}

static void put_model(struct builder *b, cJSON *root, const struct report *report)
{
	static const char *const times[MODEL_AXES] = {"s1x_time_s", "s1y_time_s", "s2x_time_s", "s2y_time_s"};
	const struct model_prediction *p = report->prediction;
	struct report_row rows[REPORT_ROWS_MAX];
	size_t count = report_compare(report, rows);
	cJSON *model, *cost, *predicted, *difference, *apart;

	if (!p) {
		put_item(b, root, "model", cJSON_CreateNull());
		return;
	}
	model = put_object(b, root, "model");
	put_text(b, model, "fidelity", p->fidelity);
	put_text(b, model, "reason", p->reason);
	cost = put_object(b, model, "cost");
	put_number(b, cost, "evaluations", p->evaluations);
	if (p->next != MODEL_AUTO)
		put_text(b, model, "next_rung", model_fidelity_name(p->next));
	else
		put_item(b, model, "next_rung", cJSON_CreateNull());
	predicted = put_object(b, model, "predicted");
	put_number(b, predicted, "impact_speed_m_s", p->impact_speed_m_s);
	put_number(b, predicted, "velocity_change_m_s", p->velocity_change_m_s);
	put_number(b, predicted, "contact_time_s", p->contact_time_s);
	for (size_t i = 0; i < count; i++)
		put_number(b, predicted, rows[i].key, rows[i].predicted);
	for (enum model_axis axis = 0; axis < MODEL_AXES; axis++)
		put_number(b, predicted, times[axis], p->peak[axis].time_s);
	difference = put_object(b, model, "difference_percent");
	for (size_t i = 0; i < count; i++)
		put_number(b, difference, rows[i].key, rows[i].difference_percent);
	if (ensemble_fitted(report->scene)) {
		cJSON *u = put_object(b, model, "standard_uncertainty"),
		      *verdict = put_object(b, model, "verdict");

		for (size_t i = 0; i < count; i++) {
			put_number(b, u, rows[i].key, rows[i].predicted_u);
			put_text(b, verdict, rows[i].key, rows[i].verdict);
		}
	}
	if (!report->below)
		return;
	put_text(b, model, "rung_below", report->below->fidelity);
	apart = put_object(b, model, "rung_below_percent");
	for (size_t i = 0; i < count; i++)
		put_number(b, apart, rows[i].key, 100.0 * rows[i].rungs_apart / fabs(rows[i].predicted));
}

static void put_verdict(struct builder *b, cJSON *root, const struct verdict *verdict)
{
	cJSON *json = put_if(b, root, "verdict", verdict != NULL, QUANTITY_VERDICT, verdict);
	struct text items;

	if (json == NULL)
		return;
	if (text_open(&items) != 0) {
		b->failed = true;
		return;
	}
	if (text_close(&items, verdict_table(verdict, TABLE_JSON, items.out)) != 0) {
		b->failed = true;
		return;
	}
	put_item(b, json, "items", cJSON_CreateRaw(items.bytes));
	free(items.bytes);
}

/* Of sensors with files; both empty: the uncertainties are noise only. */
static void put_chain(struct builder *b, cJSON *root, const struct report *report)
{
	cJSON *sensors = put_array(b, root, "sensors"), *budget = put_array(b, root, "budget");

	for (size_t i = 0; report->sensors && i < report->sensors->count; i++) {
		cJSON *item = put_append(b, sensors);

		put_text(b, item, "sensor", report->sensors->used[i].name);
		put_all(b, item, QUANTITY_SENSOR, &report->sensors->used[i]);
	}
	for (size_t i = 0; report->budget && i < report->budget->count; i++) {
		cJSON *item = put_append(b, budget);

		put_text(b, item, "what", report->budget->item[i].what);
		put_all(b, item, QUANTITY_BUDGET, &report->budget->item[i]);
	}
}

/* When, by whom, of what, measured by which sensors, on a simulated tower: null is not known. */
static void json_put_origin(struct builder *b, cJSON *root, const struct report *report)
{
	struct record known = {.time_s = report->record->time_s,
	                       .simulated = report->simulated || report->record->simulated != 0};
	cJSON *origin = put_object(b, root, "origin");
	const struct metadata_entry *entry;
	char text[METADATA_TEXT_MAX];

	strcpy(known.operator_name, report->record->operator_name);
	strcpy(known.scene, report->record->scene);
	strcpy(known.sensors, report->record->sensors);
	if (report->scene != NULL)
		metadata_take_words(known.scene, report->scene->name);
	if (report->sensors != NULL)
		sensors_serials(report->sensors, known.sensors, sizeof(known.sensors));
	for (size_t i = 0; (entry = metadata_entry(i)) != NULL && !entry->of_drop; i++) {
		metadata_format(&known, entry, text);
		if (entry->kind == METADATA_U16)
			put_bool(b, origin, entry->name, known.simulated != 0);
		else if (metadata_known(&known, entry))
			put_text(b, origin, entry->name, text);
		else
			put_item(b, origin, entry->name, cJSON_CreateNull());
	}
}

static cJSON *build(struct builder *b, const struct report *report)
{
	const struct record *r = report->record;
	const struct analysis *a = report->analysis;
	cJSON *root = cJSON_CreateObject(), *channels, *lag;

	b->failed = !root;
	put_text(b, root, "file", r->file);
	put_text(b, root, "format", r->format);
	if (r->read_as[0] != '\0')
		put_text(b, root, "read_as", r->read_as);
	json_put_origin(b, root, report);
	if (r->shock > 0) {
		cJSON *shock = put_object(b, root, "shock");

		put_number(b, shock, "number", r->shock);
		put_number(b, shock, "of", r->shocks);
	}
	put_text(b, root, "quantities", quantity_version());
	if (record_lacks_seal(r)) /* by an older version or another program */
		put_item(b, root, "sealed", cJSON_CreateFalse());
	put_flags(b, root, report_flags(report), record_flag_name);
	put_all(b, root, QUANTITY_RECORD, r);
	put_processing(b, root, report);
	json_put_drop(b, root, r, report->unattended);
	put_tower(b, root, r);
	put_scene(b, root, report->scene);
	channels = put_array(b, root, "channels");
	for (size_t i = 0; i < a->channel_count; i++)
		json_put_channel(b, channels, &r->channels[i], &a->channels[i]);
	put_resultants(b, root, a);
	lag = put_if(b, root, "lag", a->has_lag, QUANTITY_LAG, &a->lag);
	if (lag)
		put_all(b, put_object(b, lag, "driven"), QUANTITY_DRIVEN, &a->lag);
	put_if(b, root, "plate", a->has_plate, QUANTITY_RINGDOWN, &a->plate);
	put_if(b, root, "rebound", a->has_rebound, QUANTITY_REBOUND, &a->rebound);
	put_if(b, root, "motion", a->has_motion, QUANTITY_MOTION, &a->motion);
	put_chain(b, root, report);
	put_model(b, root, report);
	put_verdict(b, root, report->verdict);
	shock_put(b, root, report);
	return root;
}

int report_json(const struct report *report, FILE *out)
{
	struct builder b;

	return put_out(&b, build(&b, report), out);
}
