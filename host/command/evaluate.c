/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/command/evaluate.h"

#include <droptower_version.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/units.h"
#include "host/command/command.h"
#include "host/record/whole.h"
#include "host/report/report.h"

static int write_json_file(const struct report *report, const char *file, char *message, size_t size)
{
	struct whole whole;
	int result = whole_open(&whole, file, message, size);

	return result != 0 ? result : whole_close(&whole, report_json(report, whole.out), message, size);
}

static int write_out(const struct report *report, const struct evaluate_options *options)
{
	char message[512];

	if ((options->json ? report_json(report, stdout) : report_text(report, stdout)) != 0) {
		command_error("standard output: %s", strerror(errno));
		return COMMAND_INPUT;
	}
	if ((options->json_file != NULL &&
	     write_json_file(report, options->json_file, message, sizeof(message)) != 0) ||
	    (options->html != NULL && report_html(report, options->html, message, sizeof(message)) != 0)) {
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

/* What a scene knows of sensors and drop goes into the estimates. */
static struct estimate_options estimate_options_of(const struct evaluate_options *options)
{
	const struct scene *scene = options->scene;
	struct estimate_options estimate = {
	        .lowpass_hz = options->lowpass_hz,
	        .iepe_time_constant_s = options->iepe_time_constant_s,
	        .family = options->family,
	        .tolerance = options->tolerance,
	};

	if (isnan(estimate.iepe_time_constant_s))
		estimate.iepe_time_constant_s = scene ? scene->sensor_iepe_time_constant_s : 0;
	if (scene)
		estimate.impact_speed_m_s = sqrt(2 * UNITS_G_M_S2 * scene->drop_height_m);
	return estimate;
}

/* Estimates and predicts; the report points into the other two. 0 or DT_E_*. */
static int make_report(struct report *report, struct analysis *analysis, struct model_prediction *prediction,
                       const struct record *record, const struct evaluate_options *options)
{
	struct estimate_options estimate = estimate_options_of(options);
	const struct scene *scene = options->scene;
	int result = estimate_record(record, &estimate, analysis);

	if (result != 0)
		return result;
	*report = (struct report){
	        .record = record, .analysis = analysis, .scene = scene, .version = DT_VERSION};
	if (scene == NULL)
		return 0;
	result = model_predict(scene, MODEL_AUTO, prediction);
	if (result == 0)
		report->prediction = prediction;
	else
		command_error("%s: no prediction: %s", scene->name, error_text(result));
	return 0;
}

int evaluate(const struct record *record, const struct evaluate_options *options)
{
	struct model_prediction prediction;
	struct analysis analysis;
	struct report report;
	int code, result = make_report(&report, &analysis, &prediction, record, options);

	if (result != 0) {
		command_error("%s: %s", record->file,
		              result == DT_E_EMPTY ? "no good sample in any channel" : error_text(result));
		return COMMAND_INPUT;
	}
	code = write_out(&report, options);
	if (code == COMMAND_DONE && options->strict && any_flag(record, &analysis)) {
		command_error("%s: flagged, and --strict was asked for", record->file);
		code = COMMAND_INPUT;
	}
	estimate_free(&analysis);
	return code;
}

char *evaluate_json(const struct record *record, const struct scene *scene)
{
	struct evaluate_options options = {.scene = scene, .iepe_time_constant_s = NAN};
	struct model_prediction prediction;
	struct analysis analysis;
	struct report report;
	char *json = NULL;
	size_t size = 0;
	FILE *out;

	if (make_report(&report, &analysis, &prediction, record, &options) != 0)
		return NULL;
	out = open_memstream(&json, &size);
	if (out != NULL) {
		int result = report_json(&report, out);

		if (fclose(out) != 0 || result != 0) {
			free(json);
			json = NULL;
		}
	}
	estimate_free(&analysis);
	return json;
}

int evaluate_read_scene(struct scene *scene, const char *file, double angle_deg)
{
	char message[SCENE_MESSAGE_MAX];
	int result = scene_read(scene, file, message);

	if (result == 0 && !isnan(angle_deg)) {
		scene->drop_angle_deg = angle_deg;
		result = scene_check(scene, "--angle", message);
	}
	if (result == 0)
		return COMMAND_DONE;
	command_error("%s", message);
	return COMMAND_INPUT;
}
