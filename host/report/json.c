/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "host/estimate/cfc.h"
#include "host/report/facts.h"
#include "host/report/measured.h"
#include "host/report/put.h"
#include "host/report/shock.h"

static void put_status(struct builder *b, cJSON *object, enum estimate_status status)
{
	put_text(b, object, "status", estimate_status_name(status));
}

/* How a value was got, into the value's own object. */
static void put_how(struct builder *b, cJSON *object, const struct estimate_how *how)
{
	cJSON *path;

	put_text(b, object, "method", how->method ? how->method : "");
	path = put_array(b, object, "path");
	for (unsigned i = 0; i < ESTIMATE_PATH_MAX && how->path[i]; i++) {
		cJSON *name = cJSON_CreateString(how->path[i]);

		if (!name || !cJSON_AddItemToArray(path, name)) {
			cJSON_Delete(name);
			b->failed = true;
		}
	}
	put_number(b, object, "chi_square", how->chi_square);
	put_flags(b, object, how->flags, estimate_flag_name);
	put_status(b, object, how->status);
}

static void put_ringdown(struct builder *b, cJSON *object, const char *key, const struct estimate_ringdown *r)
{
	cJSON *item = put_object(b, object, key);

	put_number(b, item, "frequency_hz", r->frequency_hz);
	put_number(b, item, "sigma_hz", r->sigma_hz);
	put_number(b, item, "natural_frequency_hz", r->natural_frequency_hz);
	put_number(b, item, "sigma_natural_hz", r->sigma_natural_hz);
	put_number(b, item, "three_cycle_frequency_hz", r->three_cycle_frequency_hz);
	put_number(b, item, "damping_ratio", r->damping_ratio);
	put_number(b, item, "sigma_damping", r->sigma_damping);
	put_number(b, item, "small_swing_hz", r->small_swing_hz);
	put_number(b, item, "amplitude_g", r->amplitude_g);
	put_number(b, item, "second_frequency_hz", r->second_frequency_hz);
	put_number(b, item, "second_damping_ratio", r->second_damping_ratio);
	put_how(b, item, &r->how);
}

static void put_peak(struct builder *b, cJSON *object, const struct estimate_peak *peak)
{
	cJSON *item = put_object(b, object, "peak");

	put_number(b, item, "value_g", peak->value_g);
	put_number(b, item, "sigma_g", peak->sigma_g);
	put_number(b, item, "time_s", peak->time_s);
	put_number(b, item, "sigma_time_s", peak->sigma_time_s);
	put_how(b, item, &peak->how);
}

/* The family-free pulse, and the contact of a named family that fits it. */
static void put_pulse(struct builder *b, cJSON *object, const struct estimate_pulse *pulse)
{
	cJSON *item = put_object(b, object, "pulse"), *contact;

	put_number(b, item, "duration_s", pulse->duration_s);
	put_number(b, item, "sigma_duration_s", pulse->sigma_duration_s);
	put_number(b, item, "velocity_change_m_s", pulse->velocity_change_m_s);
	put_number(b, item, "sigma_velocity_m_s", pulse->sigma_velocity_m_s);
	put_number(b, item, "start_s", pulse->start_s);
	put_number(b, item, "end_s", pulse->end_s);
	put_flags(b, item, pulse->flags, estimate_flag_name);
	put_status(b, item, pulse->status);
	contact = put_object(b, item, "contact");
	put_text(b, contact, "family", estimate_family_name(pulse->family));
	put_number(b, contact, "duration_s", pulse->contact_time_s);
	put_number(b, contact, "sigma_duration_s", pulse->sigma_contact_s);
	put_number(b, contact, "start_s", pulse->contact_start_s);
	put_number(b, contact, "velocity_change_m_s", pulse->fitted_velocity_m_s);
	put_number(b, contact, "sigma_velocity_m_s", pulse->sigma_fitted_velocity_m_s);
	put_how(b, contact, &pulse->contact);
}

static void put_baseline(struct builder *b, cJSON *object, const struct estimate_baseline *baseline)
{
	cJSON *item = put_object(b, object, "baseline");

	put_number(b, item, "offset_g", baseline->offset_g);
	put_number(b, item, "noise_g", baseline->noise_g);
	put_number(b, item, "deviation_g", baseline->deviation_g);
	put_number(b, item, "drift_g_s", baseline->drift_g_s);
	put_number(b, item, "hum_g", baseline->hum_g);
	put_number(b, item, "hum_hz", baseline->hum_hz);
	put_number(b, item, "samples", (double)baseline->samples);
}

static void put_channel(struct builder *b, cJSON *array, const struct channel *channel,
                        const struct estimate_channel *e)
{
	cJSON *item = put_append(b, array);

	put_text(b, item, "name", channel->name);
	put_number(b, item, "rate_hz", channel->rate_hz);
	put_number(b, item, "start_s", channel->start_s);
	put_number(b, item, "count", (double)channel->count);
	put_number(b, item, "range_g", channel->range_g > 0.0 ? channel->range_g : (double)NAN);
	put_flags(b, item, e->flags, record_flag_name);
	put_baseline(b, item, &e->baseline);
	put_peak(b, item, &e->peak);
	put_pulse(b, item, &e->pulse);
	put_ringdown(b, item, "ringdown", &e->ringdown);
}

/* The corner of two filters is at most the lower of theirs. */
static void put_processing(struct builder *b, cJSON *root, const struct report *report)
{
	const struct estimate_options *done = &report->options;
	double class_hz = done->cfc > 0 ? CFC_CORNER * done->cfc : (double)INFINITY;
	double corner_hz = done->lowpass_hz > 0.0 ? done->lowpass_hz : (double)INFINITY;
	cJSON *item = put_object(b, root, "processing");
	double undone_s = done->iepe_time_constant_s;
	char filter[48];

	report_filter(report, filter, sizeof(filter));
	if (filter[0])
		put_text(b, item, "filter", filter);
	else
		put_item(b, item, "filter", cJSON_CreateNull());
	put_number(b, item, "cutoff_hz", fmin(class_hz, corner_hz));
	put_number(b, item, "highpass_undone_s", undone_s > 0.0 ? undone_s : (double)NAN);
}

static void put_drop(struct builder *b, cJSON *root, const struct record *r, bool unattended)
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
	put_number(b, drop, "first_tick_ms", r->first_tick_ms);
	put_number(b, drop, "last_tick_ms", r->last_tick_ms);
	put_number(b, drop, "trigger_s", r->trigger_s);
	put_number(b, drop, "frame_speed_m_s", r->frame_speed_m_s);
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
		put_number(b, item, "peak_g", a->resultants[i].peak_g);
		put_number(b, item, "sigma_g", a->resultants[i].sigma_g);
		put_number(b, item, "time_s", a->resultants[i].time_s);
		put_bool(b, item, "axes_coincide", a->resultants[i].axes_coincide);
		put_number(b, item, "axes_apart_s", a->resultants[i].axes_apart_s);
		put_number(b, item, "sigma_time_s", a->resultants[i].sigma_time_s);
		put_how(b, item, &a->resultants[i].how);
	}
}

static void put_lag(struct builder *b, cJSON *root, const struct analysis *a)
{
	cJSON *item, *driven;

	if (!a->has_lag) {
		put_item(b, root, "lag", cJSON_CreateNull());
		return;
	}
	item = put_object(b, root, "lag");
	put_number(b, item, "first_peak_s", a->lag.first_peak_s);
	put_number(b, item, "largest_peak_s", a->lag.largest_peak_s);
	put_number(b, item, "cross_correlation_s", a->lag.cross_correlation_s);
	put_number(b, item, "spread_s", a->lag.spread_s);
	put_number(b, item, "sigma_s", a->lag.sigma_s);
	put_status(b, item, a->lag.status);
	driven = put_object(b, item, "driven");
	put_number(b, driven, "lag_s", a->lag.driven_s);
	put_number(b, driven, "sigma_s", a->lag.sigma_driven_s);
	put_number(b, driven, "x_lag_s", a->lag.driven_axis_s[0]);
	put_number(b, driven, "sigma_x_s", a->lag.sigma_driven_axis_s[0]);
	put_number(b, driven, "y_lag_s", a->lag.driven_axis_s[1]);
	put_number(b, driven, "sigma_y_s", a->lag.sigma_driven_axis_s[1]);
	put_how(b, driven, &a->lag.driven);
}

static void put_rebound(struct builder *b, cJSON *root, const struct analysis *a)
{
	cJSON *item;

	if (!a->has_rebound) {
		put_item(b, root, "rebound", cJSON_CreateNull());
		return;
	}
	item = put_object(b, root, "rebound");
	put_number(b, item, "velocity_ratio", a->rebound.velocity_ratio);
	put_number(b, item, "sigma_velocity_ratio", a->rebound.sigma_velocity_ratio);
	put_number(b, item, "flight_ratio", a->rebound.flight_ratio);
	put_number(b, item, "sigma_flight_ratio", a->rebound.sigma_flight_ratio);
	put_number(b, item, "second_impact_s", a->rebound.second_impact_s);
	put_status(b, item, a->rebound.status);
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
	if (!report->below)
		return;
	put_text(b, model, "rung_below", report->below->fidelity);
	apart = put_object(b, model, "rung_below_percent");
	for (size_t i = 0; i < count; i++)
		put_number(b, apart, rows[i].key, 100.0 * rows[i].rungs_apart / fabs(rows[i].predicted));
}

static cJSON *build(struct builder *b, const struct report *report)
{
	const struct record *r = report->record;
	const struct analysis *a = report->analysis;
	cJSON *root = cJSON_CreateObject(), *channels;

	b->failed = !root;
	put_text(b, root, "file", r->file);
	put_text(b, root, "format", r->format);
	if (record_lacks_seal(r)) /* by an older version or another program */
		put_item(b, root, "sealed", cJSON_CreateFalse());
	put_flags(b, root, report_flags(report), record_flag_name);
	put_number(b, root, "lost_samples", (double)r->lost_samples);
	put_processing(b, root, report);
	put_drop(b, root, r, report->unattended);
	measured_put(b, root, r);
	put_scene(b, root, report->scene);
	channels = put_array(b, root, "channels");
	for (size_t i = 0; i < a->channel_count; i++)
		put_channel(b, channels, &r->channels[i], &a->channels[i]);
	put_resultants(b, root, a);
	put_lag(b, root, a);
	if (a->has_plate)
		put_ringdown(b, root, "plate", &a->plate);
	else
		put_item(b, root, "plate", cJSON_CreateNull());
	put_rebound(b, root, a);
	put_model(b, root, report);
	shock_put(b, root, report);
	return root;
}

int report_json(const struct report *report, FILE *out)
{
	struct builder b;

	return put_out(&b, build(&b, report), out);
}
