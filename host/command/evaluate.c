/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/command/evaluate.h"

#include <droptower_version.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>

#include "common/units.h"
#include "host/base/installed.h"
#include "host/command/command.h"
#include "host/estimate/cfc.h"
#include "host/estimate/filter.h"
#include "host/model/corner.h"
#include "host/record/drop.h"
#include "host/record/metadata.h"
#include "common/base/text.h"
#include "host/base/atomic_file.h"
#include "host/model/ensemble.h"
#include "host/report/report.h"
#include "host/result/quantity.h"
#include "host/shock/free_fall.h"

static int write_json_file(const struct report *report, const char *file, char *message, size_t size)
{
	struct atomic_file atomic;
	int result = atomic_file_open(&atomic, file, message, size);

	return result != 0 ? result
	                   : atomic_file_close(&atomic, report_json(report, atomic.out), message, size);
}

static int evaluate_write_out(const struct report *report, const struct evaluate_options *options)
{
	const struct translation translation = {options->language, command_untranslated, NULL};
	struct report page = *report;
	char message[512];

	page.translation = &translation;
	if ((options->json ? report_json(report, stdout) : report_text(report, stdout)) != 0 &&
	    command_output_failed(strerror(errno)) != COMMAND_DONE)
		return COMMAND_INPUT;
	if ((options->json_file != NULL &&
	     write_json_file(report, options->json_file, message, sizeof(message)) != 0) ||
	    (options->html != NULL && report_html(&page, options->html, message, sizeof(message)) != 0)) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	return COMMAND_DONE;
}

static bool any_flag(const struct record *record, const struct analysis *analysis)
{
	bool flagged = record->flags != 0;

	for (size_t i = 0; i < analysis->channel_count; i++)
		flagged |= analysis->channels[i].flags != 0;
	return flagged;
}

/* What a scene knows of sensors and drop goes into the estimates. Its sensors are the tower's: of a foreign
 * record's it knows nothing. */
static struct estimate_options estimate_options_of(const struct record *record,
                                                   const struct evaluate_options *options)
{
	const struct scene *scene = options->scene;
	struct estimate_options estimate = {
	        .lowpass_hz = options->lowpass_hz,
	        .cfc = options->cfc,
	        .iepe_time_constant_s = options->iepe_time_constant_s,
	        .family = options->family,
	        .tolerance = options->tolerance,
	};

	if (isnan(estimate.iepe_time_constant_s))
		estimate.iepe_time_constant_s =
		        scene && drop_has_channel(record) ? scene->sensor_iepe_time_constant_s : 0;
	if (scene) {
		estimate.gravity_m_s2 = scene->drop_gravity_m_s2;
		estimate.impact_speed_m_s = sqrt(2 * scene->drop_gravity_m_s2 * scene->drop_height_m);
	}
	return estimate;
}

/* Shocks, free falls and the band, when there is one. */
static int find_shocks(struct evaluated *e, const struct evaluate_options *options,
                       const struct estimate_options *estimate)
{
	struct report *report = &e->report;
	int result = events_find(report->record, &options->events, &e->events);

	if (result == 0)
		result = free_fall_find(report->record,
		                        options->scene ? options->scene->drop_gravity_m_s2 : UNITS_G_M_S2,
		                        &e->falls);
	if (result != 0)
		return result;
	report->events = &e->events;
	report->falls = &e->falls;
	report->show_events = options->show_events;
	if (options->band.curve == NULL)
		return 0;
	result = band_check(report->record, report->analysis, estimate, &options->band, &e->band);
	if (result == 0) {
		report->band = &e->band;
		return 0;
	}
	if (result == DT_E_UNKNOWN)
		command_error("%s: no channel '%s' to lay the band on", report->record->file,
		              options->band.channel);
	else
		command_error("%s: no pulse to lay the band on: %s", report->record->file,
		              error_text(result));
	return EVALUATE_TOLD;
}

const char *evaluate_fit_drop(const struct record *record, double angle_deg, double height_m,
                              struct fit_drop *drop)
{
	for (unsigned a = 0; a < MOTION_AXES; a++) {
		const struct channel *c = record_axis(record, fit_axis_names[a]);

		if (c == NULL || c->count == 0)
			return fit_axis_names[a];
		drop->axis[a] = (struct fit_channel){c->value_g, c->sample, c->count, c->rate_hz, c->start_s};
	}
	drop->angle_deg = angle_deg;
	drop->height_m = height_m;
	return NULL;
}

static struct estimate_motion motion_of_later(const struct fit_later *later)
{
	const double *value = later->drop.derived, *sd = later->drop.derived_sd, *own = later->drop.own;
	double speed = exp(own[FIT_LN_SPEED]);

	return (struct estimate_motion){.contact_time_s = value[MOTION_CONTACT_S],
	                                .sigma_contact_time_s = sd[MOTION_CONTACT_S],
	                                .restitution = value[MOTION_RESTITUTION],
	                                .sigma_restitution = sd[MOTION_RESTITUTION],
	                                .spin_rad_s = value[MOTION_SPIN_RAD_S],
	                                .sigma_spin_rad_s = sd[MOTION_SPIN_RAD_S],
	                                .lag_s = value[MOTION_LAG_S],
	                                .sigma_lag_s = sd[MOTION_LAG_S],
	                                .lag_x_s = value[MOTION_LAG_X_S],
	                                .sigma_lag_x_s = sd[MOTION_LAG_X_S],
	                                .angle_deg = own[FIT_GAMMA_DEG],
	                                .sigma_angle_deg = later->drop.sd[FIT_GAMMA_DEG],
	                                .speed_m_s = speed,
	                                .sigma_speed_m_s = speed * later->drop.sd[FIT_LN_SPEED],
	                                .chi_square = later->doubt.chi2 / (double)later->doubt.samples,
	                                .refused = "",
	                                .status = ESTIMATE_OK};
}

/* The body of a fitted scene laid over the drop. 0 or DT_E_MEMORY. */
static int find_motion(struct evaluated *e, const struct scene *scene)
{
	struct estimate_motion *motion = &e->analysis.motion;
	struct fit_options options = fit_options_usual(scene);
	struct fit_drop drop;
	struct fit_later later;
	int result;

	e->analysis.has_motion = ensemble_fitted(scene) && !corner_predicted(scene) &&
	                         evaluate_fit_drop(e->report.record, scene->drop_angle_deg,
	                                           scene->drop_height_m, &drop) == NULL;
	if (!e->analysis.has_motion)
		return 0;
	result = fit_later_drop(scene, &drop, &options, &later, e->refused);
	if (result == DT_E_MEMORY)
		return result;
	if (result == 0)
		snprintf(e->refused, sizeof(e->refused), "%s", later.doubt.words);
	if (e->refused[0] == '\0') {
		*motion = motion_of_later(&later);
		return 0;
	}
	quantity_clear(QUANTITY_MOTION, motion);
	motion->refused = e->refused;
	motion->status = ESTIMATE_NOT_CONVERGED;
	return 0;
}

bool evaluate_is_list(const char *limits)
{
	return limits != NULL && strcmp(limits, "list") == 0;
}

int evaluate_take_limits(const struct option_table *table, const char *name, const char *text, void *field)
{
	if (plan_preset_find(text) == NULL && !evaluate_is_list(text))
		return option_wrong(table, "--%s is '%s', expected a preset, or list", name, text);
	*(const char **)field = text;
	return OPTIONS_READ;
}

/* Against the scene's limits, or a preset's. */
static int judge_limits(struct evaluated *e, const struct evaluate_options *options)
{
	const char *file = options->limits != NULL ? "--limits" : options->scene ? options->scene->name : "";
	const char *limits = options->scene ? options->scene->limits : "";
	struct result said = evaluate_said(e);
	char message[SCENE_MESSAGE_MAX], named[160];
	struct plan plan;
	int result;

	if (options->limits != NULL) {
		bool channel = options->band.channel != NULL;

		snprintf(named, sizeof(named), "0:preset=%.60s\n%s%.31s%s", options->limits,
		         channel ? "0:channel=" : "", channel ? options->band.channel : "",
		         channel ? "\n" : "");
		limits = named;
	}
	if (limits[0] == '\0')
		return 0;
	result = plan_read(&plan, limits, file, message);
	if (result != 0) {
		command_error("%s", message);
		return EVALUATE_TOLD;
	}
	result = verdict_judge(&e->verdict, &plan, &said);
	e->report.verdict = result == 0 ? &e->verdict : NULL;
	return result;
}

/* The first channel that is too slow for the class; false when there is none. */
static bool refuses_cfc(const struct record *record, unsigned cfc)
{
	for (size_t i = 0; cfc > 0 && i < record->channel_count; i++) {
		const struct channel *c = &record->channels[i];

		if (cfc_check(cfc, c->rate_hz) == 0)
			continue;
		command_error("%s: %s at %g Hz: CFC%u needs %u Hz or more, expected CFC%u at most",
		              record->file, c->name, c->rate_hz, cfc, 10 * cfc, cfc_highest(c->rate_hz));
		return true;
	}
	return false;
}

/* A corner too high for one channel is flagged; for all of them it is a slip. */
static bool refuses_lowpass(const struct record *record, double lowpass_hz)
{
	double most = 0;

	for (size_t i = 0; i < record->channel_count; i++)
		most = fmax(most, record->channels[i].rate_hz);
	if (lowpass_hz < FILTER_CORNER_MAX * most || !(lowpass_hz > 0))
		return false;
	command_error("%s: --lowpass %g Hz is too high for every channel, expected less than %g Hz",
	              record->file, lowpass_hz, FILTER_CORNER_MAX * most);
	return true;
}

/* ---- the sensors' files ---- */

/* Days after 1970: as the record knows it, else its file; what has neither is made now. */
static double day_of(const struct record *record)
{
	struct stat status;
	time_t made = record->time_s != 0 ? (time_t)record->time_s : time(NULL);

	if (record->time_s == 0 && stat(record->file, &status) == 0 && S_ISREG(status.st_mode))
		made = status.st_mtime;
	return (double)made / 86400.0;
}

/* The record as the files that list names put it right, instead of *record. */
static int apply_chain(struct evaluated *e, const char *list, const struct record **record)
{
	char message[SETTINGS_MESSAGE_MAX];
	int result = sensors_read(&e->sensors, list, day_of(*record), message);

	if (result == 0 && e->sensors.count > 0)
		result = sensors_correct(&e->sensors, *record, &e->corrected, message);
	if (result != 0) {
		command_error("%s", message);
		e->sensors.count = 0;
		return EVALUATE_TOLD;
	}
	if (e->sensors.count > 0)
		*record = &e->corrected;
	return 0;
}

/* The supply's high-pass that the estimates undo: the sensors' own where their files give one; then a channel
 * without a file is left as told, by told_s. asked: of all by told_s, whatever the files say. */
static double highpass_of(struct record *corrected, double told_s, bool asked)
{
	double of_files_s = 0.0;

	for (size_t i = 0; i < corrected->channel_count && asked; i++)
		corrected->channels[i].highpass_s = 0.0;
	if (asked || told_s > 0.0)
		return told_s;
	for (size_t i = 0; i < corrected->channel_count; i++)
		of_files_s = fmax(of_files_s, corrected->channels[i].highpass_s);
	for (size_t i = 0; i < corrected->channel_count; i++)
		if (!(corrected->channels[i].highpass_s > 0.0))
			corrected->channels[i].highpass_s = (double)INFINITY; /* no high-pass at all */
	return of_files_s;
}

int evaluate_put_right(struct record *record, const char *chain)
{
	char message[SETTINGS_MESSAGE_MAX];
	struct sensors sensors;
	struct record corrected;

	if (chain == NULL || chain[0] == '\0')
		return COMMAND_DONE;
	if (sensors_read(&sensors, chain, day_of(record), message) != 0 ||
	    sensors_correct(&sensors, record, &corrected, message) != 0) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	record_free(record);
	*record = corrected;
	return COMMAND_DONE;
}

const char *evaluate_chain(const struct evaluate_options *options)
{
	if (options->chain != NULL)
		return options->chain;
	return options->scene != NULL ? options->scene->chain : "";
}

int evaluate_check_chain(const char *list)
{
	char message[SETTINGS_MESSAGE_MAX];
	struct sensors sensors;

	if (sensors_read(&sensors, list, 0.0, message) != 0)
		command_error("%s", message);
	else if (list[0] != '\0' && sensors.count == 0)
		command_error("chain is '%s', expected names of sensor files", list);
	else
		return COMMAND_DONE;
	return COMMAND_INPUT;
}

int evaluate_sign(struct record *record, const struct evaluate_options *options, const char *operator_name)
{
	char message[SETTINGS_MESSAGE_MAX], serials[METADATA_TEXT_MAX];
	struct sensors sensors;

	record->time_s = time(NULL);
	record->simulated = options->simulated;
	metadata_take_words(record->operator_name, operator_name);
	metadata_take_words(record->scene, options->scene != NULL ? options->scene->name : "");
	if (sensors_read(&sensors, evaluate_chain(options), 0.0, message) != 0) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	sensors_serials(&sensors, serials, sizeof(serials));
	metadata_take_words(record->sensors, serials);
	return COMMAND_DONE;
}

struct result evaluate_said(struct evaluated *e)
{
	bool chained = e->sensors.count > 0;

	return (struct result){.record = (struct record *)(uintptr_t)e->report.record,
	                       .analysis = &e->analysis,
	                       .options = &e->report.options,
	                       .measured = measured_of(e->report.record),
	                       .verdict = e->report.verdict != NULL ? &e->verdict : NULL,
	                       .sensors = chained ? &e->sensors : NULL,
	                       .budget = chained ? &e->budget : NULL};
}

/* ---- all of it ---- */

/* What follows from the estimates. */
static int evaluate_on(struct evaluated *e, const struct evaluate_options *options)
{
	int result = 0;

	if (e->sensors.count > 0) {
		result = budget_make(&e->budget, &e->sensors, e->report.record, &e->analysis);
		e->report.sensors = &e->sensors;
		e->report.budget = &e->budget;
	}
	if (result == 0)
		result = find_shocks(e, options, &e->report.options);
	if (result == 0 && options->scene != NULL)
		result = find_motion(e, options->scene);
	return result == 0 ? judge_limits(e, options) : result;
}

int evaluate_open(struct evaluated *e, const struct record *record, const struct evaluate_options *options)
{
	struct estimate_options estimate = estimate_options_of(record, options);
	const struct scene *scene = options->scene;
	char message[MODEL_MESSAGE_MAX];
	int result;

	e->sensors.count = 0;
	e->budget = (struct budget){.count = 0};
	record_init(&e->corrected);
	if (refuses_cfc(record, options->cfc) || refuses_lowpass(record, options->lowpass_hz) ||
	    apply_chain(e, evaluate_chain(options), &record) != 0)
		return EVALUATE_TOLD;
	if (e->sensors.count > 0)
		estimate.iepe_time_constant_s = highpass_of(&e->corrected, estimate.iepe_time_constant_s,
		                                            !isnan(options->iepe_time_constant_s));
	result = estimate_record(record, &estimate, &e->analysis);
	if (result != 0) {
		record_free(&e->corrected);
		return result;
	}
	e->report = (struct report){.record = record,
	                            .analysis = &e->analysis,
	                            .options = estimate,
	                            .scene = scene,
	                            .version = DT_VERSION,
	                            .simulated = options->simulated,
	                            .unattended = options->unattended,
	                            .tolerance_asked = options->tolerance > 0};
	result = evaluate_on(e, options);
	if (result != 0) {
		evaluate_close(e);
		return result;
	}
	if (scene == NULL)
		return 0;
	result = model_solve(scene, MODEL_AUTO, NULL, &e->prediction, message);
	if (result != 0 && result != DT_E_MEMORY) {
		command_error("%s: no prediction: %s", scene->name, message);
		return 0;
	}
	if (result == 0) {
		e->report.prediction = &e->prediction;
		result = model_below(scene, &e->prediction, &e->below);
		e->report.below = result == 0 ? &e->below : NULL;
	}
	if (result != DT_E_MEMORY)
		return 0;
	evaluate_close(e);
	return result;
}

void evaluate_close(struct evaluated *e)
{
	estimate_free(&e->analysis);
	budget_free(&e->budget);
	record_free(&e->corrected);
}

static int evaluate_repeat(struct evaluated *e, const struct evaluate_options *options)
{
	struct result said = evaluate_said(e);

	if (repeats_add(options->repeats, &said) == 0)
		return COMMAND_DONE;
	command_error("%s: %s", e->report.record->file, error_text(DT_E_MEMORY));
	return COMMAND_INPUT;
}

int evaluate(struct record *record, const struct evaluate_options *options)
{
	struct evaluated e;
	int code, result = evaluate_open(&e, record, options);

	if (result == EVALUATE_TOLD)
		return COMMAND_INPUT;
	if (result != 0) {
		command_error("%s: %s", record->file,
		              result == DT_E_EMPTY ? "no good sample in any channel" : error_text(result));
		return COMMAND_INPUT;
	}
	code = options->repeats != NULL ? evaluate_repeat(&e, options)
	                                : evaluate_write_out(&e.report, options);
	if (code == COMMAND_DONE && options->strict && e.report.band != NULL && !e.band.verdict.pass) {
		command_error("%s: outside its band, and --strict was asked for", record->file);
		code = COMMAND_INPUT;
	}
	if (code == COMMAND_DONE && options->strict && any_flag(e.report.record, &e.analysis)) {
		command_error("%s: flagged, and --strict was asked for", record->file);
		code = COMMAND_INPUT;
	}
	if (code == COMMAND_DONE && e.report.verdict != NULL &&
	    !(decide_meets(e.verdict.decision) && (e.verdict.decision == DECIDE_PASS || !options->strict)))
		code = COMMAND_LIMIT; /* the table says which */
	evaluate_close(&e);
	return code;
}

char *evaluate_json(struct evaluated *e, const struct record *record, const struct scene *scene,
                    const char *chain)
{
	struct evaluate_options options = {.scene = scene, .chain = chain, .iepe_time_constant_s = NAN};
	struct text json;
	int result;

	if (evaluate_open(e, record, &options) != 0)
		return NULL;
	result = text_open(&json);
	if (result == 0)
		result = text_close(&json, report_json(&e->report, json.out));
	if (result == 0)
		return json.bytes;
	evaluate_close(e);
	return NULL;
}

int evaluate_read_scene(struct scene *scene, const char *file, double angle_deg)
{
	char message[SCENE_MESSAGE_MAX], reason[MODEL_MESSAGE_MAX], path[PATH_MAX];
	int result = scene_read(scene, installed_scene_file(file, path), message);
	struct plan plan;

	if (result == 0)
		result = plan_read(&plan, scene->limits, installed_scene_file(file, path), message);
	if (result == 0 && !isnan(angle_deg)) {
		scene->drop_angle_deg = angle_deg;
		result = scene_check(scene, "--angle", message);
	}
	if (result == 0 && corner_fill(scene, reason) != 0) {
		command_error("%s: %s", file, reason);
		return COMMAND_INPUT;
	}
	if (result == 0)
		return evaluate_check_chain(scene->chain);
	command_error("%s", message);
	return COMMAND_INPUT;
}

int evaluate_check_tower(const struct scene *scene, const char *where)
{
	char message[SCENE_MESSAGE_MAX];

	if (scene_check_tower(scene, where, message) == 0)
		return COMMAND_DONE;
	command_error("%s", message);
	return COMMAND_INPUT;
}
