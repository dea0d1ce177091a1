/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <errno.h>
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <droptower_version.h>

#include "common/base/number.h"
#include "common/base/text.h"
#include "host/base/atomic_file.h"
#include "host/command/archived.h"
#include "host/command/command.h"
#include "host/command/evaluate.h"
#include "host/fit/fit.h"
#include "host/record/read.h"
#include "host/report/fitted.h"

struct arguments {
	const char *scene_file, *output, *html, *archive;
	const struct language *language;
	double angle_sd_deg, speed_sd, gain_sd, common_gain_sd;
	bool json;
};

static const struct option_row rows[] = {
        OPTION_TEXT("scene", "FILE", struct arguments, scene_file,
                    "masses, sizes and sensors, and where to start: a factor of three off is near enough"),
        OPTION_TEXT("output", "NEW.ini", struct arguments, output,
                    "write the scene with what was found, its standard uncertainties and their correlations"),
        OPTION_TEXT("html", "PAGE", struct arguments, html,
                    "write a page: tables, residuals, and what is predicted over the angle"),
        COMMAND_LANGUAGE_ROW(struct arguments, language),
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
	struct fit_options options;
	struct fit fit;
};

/* ---- drops ---- */

/* The record, which it takes over. */
static int fit_add(struct fitting *f, struct record *record, const char *name, double angle_deg,
                   double height_m)
{
	const char *missing;
	int code = evaluate_put_right(record, f->scene.chain);

	if (code != COMMAND_DONE) {
		record_free(record);
		return code;
	}
	missing = evaluate_fit_drop(record, angle_deg, height_m, &f->drop[f->count]);
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

static int fit_write(const struct fitting *f)
{
	char message[READ_MESSAGE_MAX];
	struct atomic_file atomic;

	if (atomic_file_open(&atomic, f->a->output, message, sizeof(message)) == 0) {
		scene_write(&f->fit.scene, atomic.out);
		if (atomic_file_close(&atomic, 0, message, sizeof(message)) == 0)
			return COMMAND_DONE;
	}
	command_error("%s", message);
	return COMMAND_INPUT;
}

static int fit_page(const struct fitted *fitted, const char *file)
{
	char message[READ_MESSAGE_MAX] = "no memory";
	struct text text;
	int code, error = text_open(&text);

	if (error == 0)
		error = text_close(&text, fitted_page(fitted, text.out, message, sizeof(message)));
	if (error != 0) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	code = command_write(file, text.bytes, text.size);
	free(text.bytes);
	return code;
}

static int fit_told(const struct fitting *f)
{
	const struct fit *fit = &f->fit;
	const struct translation translation = {f->a->language, command_untranslated, NULL};
	const struct fitted fitted = {fit,         f->name,    &f->scene,   f->drop,
	                              &f->options, DT_VERSION, &translation};

	(f->a->json ? fitted_json : fitted_text)(&fitted, stdout);
	if (f->a->html != NULL && fit_page(&fitted, f->a->html) != COMMAND_DONE)
		return COMMAND_INPUT;
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
	char message[FIT_MESSAGE_MAX];

	f->options = fit_options_usual(&f->scene);
	if (f->a->angle_sd_deg > 0)
		f->options.angle_sd_deg = f->a->angle_sd_deg;
	if (f->a->speed_sd > 0)
		f->options.speed_sd = f->a->speed_sd;
	if (f->a->common_gain_sd > 0)
		f->options.common_gain_sd = f->a->common_gain_sd;
	if (f->a->gain_sd > 0)
		f->options.gain_sd[0] = f->options.gain_sd[1] = f->a->gain_sd;
	if (fit_drops(&f->scene, f->drop, f->count, &f->options, &f->fit, message) == 0)
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
		code = command_is_input("fit", arguments.output, argv[i]) ||
		                       command_is_input("fit", arguments.html, argv[i])
		               ? COMMAND_USAGE
		               : fit_add_word(f, argv[i]);
	if (code == COMMAND_DONE)
		code = fit_work(f);
	for (unsigned k = 0; k < f->count; k++)
		record_free(&f->record[k]);
	free(f);
	return code;
}
