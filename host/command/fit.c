/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <errno.h>
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/base/number.h"
#include "host/base/table.h"
#include "host/base/whole.h"
#include "host/command/archived.h"
#include "host/command/command.h"
#include "host/command/evaluate.h"
#include "host/fit/fit.h"
#include "host/record/read.h"

struct arguments {
	const char *scene_file, *output, *archive;
	double angle_sd_deg, speed_sd, gain_sd, common_gain_sd;
	bool json;
};

static const struct option_row rows[] = {
        OPTION_TEXT("scene", "FILE", struct arguments, scene_file,
                    "masses, sizes and sensors, and where to start: a factor of three off is near enough"),
        OPTION_TEXT("output", "NEW.ini", struct arguments, output,
                    "write the scene with what was found, its standard uncertainties and their correlations"),
        OPTION_TEXT("archive", "DIR", struct arguments, archive,
                    "the archive of a SERIES (default $DROPTOWER_ARCHIVE or ./archive)"),
        OPTION_NUMBER("angle-sd", "DEG", struct arguments, angle_sd_deg, 0.01, 10,
                      "how far a drop's angle may be from the one set (1)"),
        OPTION_PERCENT("speed-sd", struct arguments, speed_sd, "the same of its speed (0.3)"),
        OPTION_PERCENT("gain-sd", struct arguments, gain_sd,
                       "gain and cross-axis of a sensor, new in each drop (1; of a sensor on a plate 2)"),
        OPTION_PERCENT("common-gain", struct arguments, common_gain_sd,
                       "a channel's gain, the same in all drops, as its certificate tells it (0.3)"),
        OPTION_FLAG("json", struct arguments, json, "one JSON object on standard output instead of tables"),
};

static const struct option_table fit_options_known = {
        .program = "droptower",
        .command = "fit",
        .head = "usage: droptower fit SERIES|FILE[@DEG]... --scene START.ini [OPTIONS]\n"
                "\n"
                "What a product is, from the whole histories of its drops: stiffness and restitution of the "
                "contact,\n"
                "balance angle, grip, mounts, yaw, each with its uncertainty. FILE@DEG gives a file's angle "
                "where "
                "it\n"
                "is not the scene's; a SERIES of the archive has its own, and rejected drops are left out. "
                "What "
                "the\n"
                "model cannot explain ends in exit 3 and one line, and no scene is written.\n"
                "\n",
        OPTION_ROWS(rows),
        .words = true,
};

struct fitting {
	const struct arguments *a;
	struct scene scene;
	struct record record[FIT_DROPS_MAX];
	char name[FIT_DROPS_MAX][128];
	struct fit_drop drop[FIT_DROPS_MAX];
	unsigned count;
	struct fit fit;
};

/* ---- drops ---- */

/* The record, which it takes over. */
static int fit_add(struct fitting *f, struct record *record, const char *name, double angle_deg,
                   double height_m)
{
	const char *missing = evaluate_fit_drop(record, angle_deg, height_m, &f->drop[f->count]);

	if (missing != NULL) {
		command_error("%s: no channel %s, expected a drop of the tower with S1X, S1Y, S2X and S2Y",
		              name, missing);
		record_free(record);
		return COMMAND_INPUT;
	}
	snprintf(f->name[f->count], sizeof(f->name[0]), "%.127s", name);
	f->record[f->count++] = *record;
	return COMMAND_DONE;
}

static int fit_full(const char *name)
{
	command_error("%s: more than %d drops, expected no more in one fit", name, FIT_DROPS_MAX);
	return COMMAND_INPUT;
}

struct fit_file {
	struct fitting *f;
	const char *name;
	double angle_deg;
	int code;
};

static int fit_each(void *context, const struct log_capture *capture, struct record *record)
{
	struct fit_file *file = context;
	char name[128];

	(void)capture;
	if (record == NULL)
		return 0;
	if (file->f->count == FIT_DROPS_MAX) {
		record_free(record);
		return file->code = fit_full(file->name);
	}
	snprintf(name, sizeof(name), record->log_number ? "%.100s, drop %u" : "%.100s", file->name,
	         record->log_number);
	file->code = fit_add(file->f, record, name, file->angle_deg, file->f->scene.drop_height_m);
	return file->code;
}

/* FILE or FILE@DEG. */
static int fit_add_file(struct fitting *f, const char *word)
{
	const char *at = strrchr(word, '@');
	char name[4096], message[READ_MESSAGE_MAX];
	double angle = f->scene.drop_angle_deg;
	struct fit_file file = {.f = f, .name = name};

	snprintf(name, sizeof(name), "%s", word);
	if (at != NULL && access(word, F_OK) != 0) {
		if (!number_read(at + 1, 1, 89, &angle))
			return command_usage("fit", "'%s': expected an angle of 1 to 89 deg behind the @",
			                     word);
		name[at - word] = '\0';
	}
	file.angle_deg = angle;
	if (read_each(name, NULL, fit_each, &file, message) != 0 && file.code == COMMAND_DONE) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	return file.code;
}

static int fit_add_archived(void *context, const struct archive_drop *drop)
{
	struct fitting *f = ((void **)context)[0];
	struct archive *archive = ((void **)context)[1];
	char name[ARCHIVE_NAME_MAX + 16], fault[ARCHIVE_MESSAGE_MAX], message[ARCHIVE_MESSAGE_MAX];
	double angle = drop->series.angle_deg, height = drop->series.height_m;
	struct record record;

	if (strcmp(drop->state, "recorded") != 0 || strcmp(drop->decision, "rejected") == 0)
		return 0;
	snprintf(name, sizeof(name), "%.60s/%u", drop->series.name, drop->number);
	if (f->count == FIT_DROPS_MAX)
		return fit_full(name);
	if (archived_read(archive, name, &record, fault, message) != 0) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	return fit_add(f, &record, name, angle, height);
}

static int fit_add_series(struct fitting *f, const char *series)
{
	char message[ARCHIVE_MESSAGE_MAX];
	struct archive *archive = archive_open(archived_folder(f->a->archive), ARCHIVE_READ, message);
	struct archive_filter filter = archive_filter_none();
	void *context[] = {f, archive};
	unsigned before = f->count;
	int result;

	if (archive == NULL) {
		command_error("%s: no such file, and no series: %s", series, message);
		return COMMAND_INPUT;
	}
	filter.series = series;
	result = archive_each_drop(archive, &filter, fit_add_archived, context);
	if (result < 0)
		archived_failed(archive);
	else if (result == 0 && f->count == before)
		command_error("%s: neither a file nor a series with a drop in %s", series,
		              archived_folder(f->a->archive));
	archive_close(archive);
	return result == 0 && f->count > before ? COMMAND_DONE : COMMAND_INPUT;
}

static int fit_add_word(struct fitting *f, const char *word)
{
	return access(word, F_OK) == 0 || strpbrk(word, "@/.") != NULL ? fit_add_file(f, word)
	                                                               : fit_add_series(f, word);
}

/* ---- output ---- */

struct parameter_row {
	const char *name, *status;
	struct table_value value;
};

static const struct table_column parameter_columns[] = {
        TABLE_COLUMN(WORDS, struct parameter_row, name, .key = "name", .title = "parameter", .width = -18),
        TABLE_COLUMN(VALUE, struct parameter_row, value, .key = "value", .sigma = "u", .title = "value",
                     .width = 12, .digits = TABLE_DIGITS_G),
        TABLE_COLUMN(NUMBER, struct parameter_row, value.sigma, .title = "+-", .width = 11, .digits = -3),
        TABLE_COLUMN(WORDS, struct parameter_row, status, .key = "status", .title = "", .width = -16,
                     .gap = " "),
};

struct drop_row {
	const char *name;
	struct table_value angle, contact, restitution, spin, lag, s1, s2;
	double pull;
};

static const struct table_column drop_columns[] = {
        TABLE_COLUMN(WORDS, struct drop_row, name, .key = "drop", .title = "drop", .width = -16),
        TABLE_COLUMN(VALUE, struct drop_row, angle, .key = "angle_deg", .sigma = "sigma_angle_deg",
                     .title = "angle", .unit = "deg", .width = 7, .digits = 2),
        TABLE_COLUMN(VALUE, struct drop_row, contact, .key = "contact_time_s",
                     .sigma = "sigma_contact_time_s", .title = "contact", .unit = "ms", .width = 7,
                     .digits = 3, .scale = 1e3),
        TABLE_COLUMN(NUMBER, struct drop_row, contact.sigma, .title = "+-", .width = 7, .digits = 3,
                     .scale = 1e3),
        TABLE_COLUMN(VALUE, struct drop_row, restitution, .key = "restitution_of_centre",
                     .sigma = "sigma_restitution_of_centre", .title = "e of c.o.g.", .width = 7, .digits = 4),
        TABLE_COLUMN(NUMBER, struct drop_row, restitution.sigma, .title = "+-", .width = 7, .digits = 4),
        TABLE_COLUMN(VALUE, struct drop_row, spin, .key = "spin_rad_s", .sigma = "sigma_spin_rad_s",
                     .title = "spin", .unit = "rad/s", .width = 7, .digits = 2),
        TABLE_COLUMN(VALUE, struct drop_row, lag, .key = "lag_s", .sigma = "sigma_lag_s", .title = "lag",
                     .unit = "ms", .width = 7, .digits = 4, .scale = 1e3),
        TABLE_COLUMN(NUMBER, struct drop_row, lag.sigma, .title = "+-", .width = 7, .digits = 4,
                     .scale = 1e3),
        TABLE_COLUMN(VALUE, struct drop_row, s1, .key = "s1_resultant_g", .sigma = "sigma_s1_resultant_g",
                     .title = "S1", .unit = "g", .width = 7, .digits = 1),
        TABLE_COLUMN(VALUE, struct drop_row, s2, .key = "s2_resultant_g", .sigma = "sigma_s2_resultant_g",
                     .title = "S2", .unit = "g", .width = 7, .digits = 1),
        TABLE_COLUMN(NUMBER, struct drop_row, pull, .key = "pull"),
};

static bool fit_holds(const struct fit *fit)
{
	bool holds = fit->doubt.words[0] == '\0';

	for (size_t i = 0; i < MOTION_SHARED; i++)
		holds = holds && fit->status[i] != FIT_BEYOND;
	return holds;
}

/* Where the model does not hold, no bar does. */
static double fit_bar(const struct fit *fit, double sd)
{
	return fit_holds(fit) ? sd : (double)NAN;
}

static void fit_parameters(const struct fit *fit, enum table_format format)
{
	static const char *const status[] = {"identified", "not identified", "beyond what is allowed",
	                                     "no plate"};
	struct table table = {.out = stdout, .format = format};

	table_begin(&table, parameter_columns, TABLE_COUNT(parameter_columns));
	for (size_t i = 0; i < MOTION_SHARED; i++) {
		double slope, value = motion_value((enum motion_shared)i, fit->common[i], &slope);
		struct parameter_row row = {
		        scene_fitted[i],
		        fit_holds(fit) || fit->status[i] == FIT_BEYOND ? status[fit->status[i]] : "doubtful",
		        {value, 0, false}};

		row.value.sigma = fit_bar(fit, slope * fit->sd[i]);
		if (fit->status[i] != FIT_ABSENT)
			table_row(&table, &row);
	}
	(void)table_end(&table);
}

static struct table_value fit_derived(const struct fit *fit, unsigned k, enum motion_derived d)
{
	return (struct table_value){fit->drop[k].derived[d], fit_bar(fit, fit->drop[k].derived_sd[d]), false};
}

static void fit_drops_table(const struct fitting *f, enum table_format format)
{
	struct table table = {.out = stdout, .format = format};

	table_begin(&table, drop_columns, TABLE_COUNT(drop_columns));
	for (unsigned k = 0; k < f->count; k++) {
		const struct fit_drop_result *r = &f->fit.drop[k];
		struct drop_row row = {f->name[k],
		                       {r->own[FIT_GAMMA_DEG], fit_bar(&f->fit, r->sd[FIT_GAMMA_DEG]), false},
		                       fit_derived(&f->fit, k, MOTION_CONTACT_S),
		                       fit_derived(&f->fit, k, MOTION_RESTITUTION),
		                       fit_derived(&f->fit, k, MOTION_SPIN_RAD_S),
		                       fit_derived(&f->fit, k, MOTION_LAG_S),
		                       fit_derived(&f->fit, k, MOTION_S1R_G),
		                       fit_derived(&f->fit, k, MOTION_S2R_G),
		                       r->pull};

		table_row(&table, &row);
	}
	(void)table_end(&table);
}

struct prediction_row {
	double angle_deg;
	struct table_value contact, restitution, lag, s1, s2;
};

static const struct table_column prediction_columns[] = {
        TABLE_COLUMN(NUMBER, struct prediction_row, angle_deg, .key = "angle_deg", .title = "predicted",
                     .unit = "deg", .width = 13),
        TABLE_COLUMN(VALUE, struct prediction_row, contact, .key = "contact_time_s",
                     .sigma = "sigma_contact_time_s", .title = "contact", .unit = "ms", .width = 8,
                     .digits = 3, .scale = 1e3),
        TABLE_COLUMN(NUMBER, struct prediction_row, contact.sigma, .title = "+-", .width = 7, .digits = 3,
                     .scale = 1e3),
        TABLE_COLUMN(VALUE, struct prediction_row, restitution, .key = "restitution_of_centre",
                     .sigma = "sigma_restitution_of_centre", .title = "e of c.o.g.", .width = 8, .digits = 4),
        TABLE_COLUMN(NUMBER, struct prediction_row, restitution.sigma, .title = "+-", .width = 7,
                     .digits = 4),
        TABLE_COLUMN(VALUE, struct prediction_row, lag, .key = "lag_s", .sigma = "sigma_lag_s",
                     .title = "lag", .unit = "ms", .width = 8, .digits = 4, .scale = 1e3),
        TABLE_COLUMN(NUMBER, struct prediction_row, lag.sigma, .title = "+-", .width = 7, .digits = 4,
                     .scale = 1e3),
        TABLE_COLUMN(VALUE, struct prediction_row, s1, .key = "s1_resultant_g",
                     .sigma = "sigma_s1_resultant_g", .title = "S1", .unit = "g", .width = 8, .digits = 1),
        TABLE_COLUMN(NUMBER, struct prediction_row, s1.sigma, .title = "+-", .width = 7, .digits = 2),
        TABLE_COLUMN(VALUE, struct prediction_row, s2, .key = "s2_resultant_g",
                     .sigma = "sigma_s2_resultant_g", .title = "S2", .unit = "g", .width = 8, .digits = 1),
        TABLE_COLUMN(NUMBER, struct prediction_row, s2.sigma, .title = "+-", .width = 7, .digits = 2),
};

enum { PREDICT_FROM_DEG = 15, PREDICT_TO_DEG = 45, PREDICT_STEP_DEG = 5 };

static void fit_predictions(const struct fit *fit, enum table_format format)
{
	struct table table = {.out = stdout, .format = format};
	struct scene at = fit->scene;

	table_begin(&table, prediction_columns, TABLE_COUNT(prediction_columns));
	for (int angle = PREDICT_FROM_DEG; angle <= PREDICT_TO_DEG && fit_holds(fit);
	     angle += PREDICT_STEP_DEG) {
		double value[MOTION_DERIVED], sd[MOTION_DERIVED];
		struct prediction_row row;

		at.drop_angle_deg = angle;
		if (fit_predict(&at, value, sd) != 0)
			continue;
		row = (struct prediction_row){angle,
		                              {value[MOTION_CONTACT_S], sd[MOTION_CONTACT_S], false},
		                              {value[MOTION_RESTITUTION], sd[MOTION_RESTITUTION], false},
		                              {value[MOTION_LAG_S], sd[MOTION_LAG_S], false},
		                              {value[MOTION_S1R_G], sd[MOTION_S1R_G], false},
		                              {value[MOTION_S2R_G], sd[MOTION_S2R_G], false}};
		table_row(&table, &row);
	}
	(void)table_end(&table);
}

static void fit_json(const struct fitting *f)
{
	const struct fit *fit = &f->fit;

	printf("{\"holds\":%s,\"parameters\":", fit_holds(fit) ? "true" : "false");
	fit_parameters(fit, TABLE_JSON);
	printf(",\"drops\":");
	fit_drops_table(f, TABLE_JSON);
	printf(",\"predicted\":");
	fit_predictions(fit, TABLE_JSON);
	printf(",\"covariance\":");
	for (size_t i = 0; i < MOTION_SHARED; i++)
		for (size_t j = 0; j < MOTION_SHARED; j++)
			printf("%s%.9g", j > 0 ? "," : i > 0 ? "],[" : "[[", fit->covariance[i][j]);
	printf("]]");
	printf(",\"chi2\":%.9g,\"samples\":%zu,\"starts\":%u,\"agreed\":%u,\"windows\":{", fit->doubt.chi2,
	       fit->doubt.samples, fit->starts, fit->agreed);
	for (size_t a = 0; a < MOTION_AXES; a++) {
		printf("%s\"%s\":", a > 0 ? "," : "", fit_axis_names[a]);
		for (size_t w = 0; w < FIT_WINDOWS; w++)
			printf("%s%.4g", w > 0 ? "," : "[", fit->doubt.window_z[a][w]);
		printf("]");
	}
	printf("},\"widened\":%.4g", fit->widened);
	printf(",\"periodogram\":%.6g,\"periodogram_hz\":%.6g,\"pull\":%.6g,\"group\":%.6g",
	       fit->doubt.periodogram, fit->doubt.periodogram_hz, fit->doubt.pull, fit->doubt.group);
	printf(",\"next\":{\"angle_deg\":%.4g,\"height_m\":%.6g,\"gain\":%.4g,\"largest\":\"%s\",\"u\":%.4g}}"
	       "\n",
	       fit->next.angle_deg, fit->next.height_m, fit->next.d_gain,
	       fit->next.largest >= 0 ? scene_fitted[fit->next.largest] : "", fit->next.largest_sd);
}

static void fit_text(const struct fitting *f)
{
	const struct fit *fit = &f->fit;

	fit_parameters(fit, TABLE_TEXT);
	printf("\n");
	fit_drops_table(f, TABLE_TEXT);
	printf("\n");
	fit_predictions(fit, TABLE_TEXT);
	printf("\nresiduals: %.3f of the noise's squares over %zu samples; largest oscillation left %.1f at "
	       "%.0f Hz; "
	       "drops pull %.1f, gains together %.1f\n",
	       fit->doubt.chi2 / (double)fit->doubt.samples, fit->doubt.samples, fit->doubt.periodogram,
	       fit->doubt.periodogram_hz, fit->doubt.pull, fit->doubt.group);
	if (fit->widened > 1.0)
		printf("gains scatter more than --gain-sd says: all variances are taken %.1f times\n",
		       fit->widened);
	printf("starts: %u of %u came to the same\n", fit->agreed, fit->starts);
	if (fit->next.largest >= 0 && fit_holds(fit))
		printf("next drop: %.0f deg from %.3f m tells most of %d to %d deg (%.1f in the log of the "
		       "information); the weakest is then %s\n",
		       fit->next.angle_deg, fit->next.height_m, FIT_JUDGED_FROM_DEG, FIT_JUDGED_TO_DEG,
		       fit->next.d_gain, scene_fitted[fit->next.largest]);
}

static int fit_write(const struct fitting *f)
{
	char message[READ_MESSAGE_MAX];
	struct whole whole;

	if (whole_open(&whole, f->a->output, message, sizeof(message)) == 0) {
		scene_write(&f->fit.scene, whole.out);
		if (whole_close(&whole, 0, message, sizeof(message)) == 0)
			return COMMAND_DONE;
	}
	command_error("%s", message);
	return COMMAND_INPUT;
}

static int fit_told(const struct fitting *f)
{
	const struct fit *fit = &f->fit;

	if (f->a->json)
		fit_json(f);
	else
		fit_text(f);
	if (fit->doubt.words[0] != '\0') {
		command_error("these drops are not the model's: %s; no uncertainty holds", fit->doubt.words);
		return COMMAND_INPUT;
	}
	for (size_t i = 0; i < MOTION_SHARED; i++)
		if (fit->status[i] == FIT_BEYOND) {
			command_error("%s came out as %g, beyond what --scene allows: a wrong scene, or "
			              "another product",
			              scene_fitted[i],
			              motion_value((enum motion_shared)i, fit->common[i], NULL));
			return COMMAND_INPUT;
		}
	return f->a->output ? fit_write(f) : COMMAND_DONE;
}

/* ---- work ---- */

static int fit_work(struct fitting *f)
{
	struct fit_options options = fit_options_usual(&f->scene);
	char message[FIT_MESSAGE_MAX];

	if (f->a->angle_sd_deg > 0)
		options.angle_sd_deg = f->a->angle_sd_deg;
	if (f->a->speed_sd > 0)
		options.speed_sd = f->a->speed_sd;
	if (f->a->common_gain_sd > 0)
		options.common_gain_sd = f->a->common_gain_sd;
	if (f->a->gain_sd > 0)
		options.gain_sd[0] = options.gain_sd[1] = f->a->gain_sd;
	if (fit_drops(&f->scene, f->drop, f->count, &options, &f->fit, message) == 0)
		return fit_told(f);
	command_error("%s", message);
	return COMMAND_INPUT;
}

int command_fit(int argc, char **argv)
{
	struct arguments arguments = {.json = false};
	int code = option_read(&fit_options_known, &arguments, argc, argv);
	struct fitting *f;

	if (code != OPTIONS_READ)
		return code;
	if (optind >= argc)
		return command_usage("fit", "expected a SERIES or a FILE");
	if (arguments.scene_file == NULL)
		return command_usage("fit", "expected --scene: 'droptower scene' makes a first one");
	f = calloc(1, sizeof(*f));
	if (f == NULL) {
		command_error("no memory");
		return COMMAND_INPUT;
	}
	f->a = &arguments;
	code = evaluate_read_scene(&f->scene, arguments.scene_file, (double)NAN);
	for (int i = optind; i < argc && code == COMMAND_DONE; i++)
		code = command_is_input("fit", arguments.output, argv[i]) ? COMMAND_USAGE
		                                                          : fit_add_word(f, argv[i]);
	if (code == COMMAND_DONE)
		code = fit_work(f);
	for (unsigned k = 0; k < f->count; k++)
		record_free(&f->record[k]);
	free(f);
	return code;
}
