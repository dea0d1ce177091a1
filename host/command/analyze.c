/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/base/number.h"
#include "host/command/analyze.h"
#include "host/command/command.h"
#include "host/command/files.h"
#include "host/command/list.h"
#include "host/estimate/cfc.h"
#include "host/record/log_capture.h"
#include "host/record/profile.h"
#include "host/record/read.h"

static int take_class(const struct option_table *table, const char *name, const char *text, void *class)
{
	double value;

	if (!number_read(text, 60, 1000, &value) || cfc_check((unsigned)value, INFINITY) != 0 ||
	    value > floor(value))
		return option_wrong(table, "--%s is '%s', expected 60, 180, 600 or 1000", name, text);
	*(unsigned *)class = (unsigned)value;
	return OPTIONS_READ;
}

static int take_family(const struct option_table *table, const char *name, const char *text, void *family)
{
	if (estimate_family_parse(text, family) == 0)
		return OPTIONS_READ;
	return option_wrong(table, "--%s is '%s', expected auto, half-sine, haversine or sine-power", name,
	                    text);
}

static const struct option_row rows[] = {
        OPTION_FLAG("list", struct analyze_arguments, list,
                    "what drops a log holds, without analysing them; of a large log an index is kept as "
                    "FILE.index"),
        OPTION_UNSIGNED("drop", "N", struct analyze_arguments, drop, 1, 1e9,
                        "only the N-th drop of the log, counted from 1 (one FILE only)"),
        STRETCH_ROWS(struct analyze_arguments, stretch),
        OPTION_FLAG("repeats", struct analyze_arguments, repeats,
                    "instead of a result each: one table over all FILEs, drops or shocks as repeats of one "
                    "thing, "
                    "with mean, SD, trend and change"),
        OPTION_TEXT(
                "columns", "SPEC", struct analyze_arguments, columns,
                "what the columns of foreign text are, where it does not tell or tells wrong: one name:unit "
                "per column, '-' before the unit flips the sign, a lone '-' skips, e.g. "
                "\"time:ms,fixture:g,board:-g,-\"; units s ms us ns clock, g m/s2 ft/s2 kg (kilo-g), "
                "g*FACTOR, mV/(10.2mV/g); without a time column say name:unit@RATE_HZ"),
        OPTION_TEXT(
                "profile", "NAME", struct analyze_arguments, profile,
                "read foreign files as this profile says; without it, as import.ini in their folder says"),
        OPTION_TEXT("save-profile", "NAME", struct analyze_arguments, save_profile,
                    "keep how the first FILE was read as a profile, which may be edited"),
        OPTION_TEXT("scene", "FILE", struct analyze_arguments, scene_file,
                    "compare with the model's prediction for this scene"),
        OPTION_TEXT("chain", "FILE,...", struct analyze_arguments, evaluate.chain,
                    "the sensors' files: what their certificates say is applied, and each number has its "
                    "expanded uncertainty; in place of the scene's"),
        OPTION_TAKEN("angle", "DEG", struct analyze_arguments, angle_deg, command_angle,
                     "contact angle, instead of the scene's"),
        OPTION_NUMBER("lowpass", "HZ", struct analyze_arguments, evaluate.lowpass_hz, 1e-3, 1e9,
                      "zero-phase low-pass before everything else"),
        OPTION_TAKEN("cfc", "CLASS", struct analyze_arguments, evaluate.cfc, take_class,
                     "channel frequency class 60, 180, 600 or 1000 (SAE J211, ISO 6487), zero-phase"),
        OPTION_NUMBER("iepe", "S", struct analyze_arguments, evaluate.iepe_time_constant_s, 0, 1e3,
                      "undo the sensor supply's high-pass of this time constant (0: leave it); without it, "
                      "the scene's where channels are the tower's"),
        OPTION_TAKEN("family", "NAME", struct analyze_arguments, evaluate.family, take_family,
                     "the contact pulse is a half-sine, haversine or sine-power (auto)"),
        OPTION_PERCENT("tolerance", struct analyze_arguments, evaluate.tolerance,
                       "standard uncertainty asked for, of the value (0.5); what it takes is done"),
        OPTION_FLAG("events", struct analyze_arguments, evaluate.show_events,
                    "list shocks, largest first, and free falls in the table too"),
        OPTION_NUMBER("event-level", "G", struct analyze_arguments, evaluate.events.level_g, 1e-6, 1e9,
                      "what leaves its rest by more than this is a shock; without it, 8 sigma of the noise"),
        OPTION_NUMBER("hold-off", "S", struct analyze_arguments, evaluate.events.hold_off_s, 1e-9, 1e3,
                      "a shock is over when nothing has left that level for so long (0.02)"),
        OPTION_TEXT("band", "CSV", struct analyze_arguments, band_file,
                    "hold a pulse against time_s,lower_g,upper_g; time 0 is where it leaves 10 %"),
        OPTION_FLAG("band-at-peak", struct analyze_arguments, evaluate.band.at_peak,
                    "time 0 of the band is the pulse's peak"),
        EVALUATE_LIMITS_ROW(struct analyze_arguments, evaluate.limits),
        OPTION_TEXT("channel", "NAME", struct analyze_arguments, evaluate.band.channel,
                    "the channel of --band and --limits; without it, the one with the largest peak"),
        OPTION_FLAG("json", struct analyze_arguments, evaluate.json,
                    "one JSON object per drop on standard output"),
        OPTION_TEXT("html", "PAGE", struct analyze_arguments, evaluate.html,
                    "write a page (one FILE of one drop, or --drop N)"),
        COMMAND_LANGUAGE_ROW(struct analyze_arguments, evaluate.language),
        OPTION_FLAG("strict", struct analyze_arguments, evaluate.strict,
                    "a flagged record or channel is a failure (exit 3)"),
};

static const struct option_table known_options = {
        .program = "droptower",
        .command = "analyze",
        .head = "usage: droptower analyze FILE|FOLDER|PATTERN... [OPTIONS]\n"
                "\n"
                "Analyses logged drops (candump text, Vector ASC, pcapng, LCM event log, our CSV), UFF58, "
                "ISO "
                "13499, HDF5 and LabVIEW .lvm files,\n"
                "and any delimited text, compressed or not. The format is found from the content, and so are "
                "columns,\n"
                "units and rate of text; what can be read in two ways is refused. A log of several drops "
                "gives one "
                "result\n"
                "for each.\n"
                "\n",
        OPTION_ROWS(rows),
        .words = true,
};

/* ---- one record ---- */

static int analyze_stretch(struct record *cut, void *context)
{
	const struct analyze_arguments *arguments = context;
	const struct evaluate_options *options = &arguments->evaluate;

	if (cut->shock > 1 && arguments->stretch.shock == 0 && !options->json && options->repeats == NULL)
		putchar('\n');
	return evaluate(cut, options);
}

static int analyze_record(struct record *record, const struct analyze_arguments *arguments)
{
	return stretch_each(record, &arguments->stretch, &arguments->evaluate.events, analyze_stretch,
	                    (struct analyze_arguments *)(uintptr_t)arguments);
}

static int analyze_one(const char *file, const struct analyze_arguments *arguments)
{
	struct record record;
	int code = files_read(&record, file, arguments->columns, arguments->drop);

	if (code != COMMAND_DONE)
		return code;
	code = analyze_record(&record, arguments);
	record_free(&record);
	return code;
}

struct analysing {
	const char *file;
	const struct analyze_arguments *arguments;
	unsigned count;
	int code;
};

static int analyze_drop(void *context, const struct log_capture *capture, struct record *record)
{
	struct analysing *analysing = context;
	const struct evaluate_options *options = &analysing->arguments->evaluate;
	int code = COMMAND_INPUT;

	if (record == NULL) {
		command_error("%s: drop %u of the log: no block of it", analysing->file, capture->number);
	} else {
		if (analysing->count++ > 0 && !options->json && options->repeats == NULL)
			putchar('\n');
		code = analyze_record(record, analysing->arguments);
		record_free(record);
	}
	if (code != COMMAND_DONE)
		analysing->code = code; /* the others are still analysed */
	return 0;
}

static int analyze_each(const char *file, const struct analyze_arguments *arguments)
{
	struct analysing analysing = {.file = file, .arguments = arguments, .code = COMMAND_DONE};
	char message[READ_MESSAGE_MAX];

	if (read_each(file, arguments->columns, analyze_drop, &analysing, message) == 0)
		return analysing.code;
	command_error("%s", message);
	return COMMAND_INPUT;
}

int analyze_file(const char *file, const struct analyze_arguments *arguments)
{
	if (arguments->list)
		return list_drops(file, arguments->evaluate.json);
	return arguments->drop != 0 || arguments->evaluate.html != NULL ? analyze_one(file, arguments)
	                                                                : analyze_each(file, arguments);
}

/* What concerns words, and what is shown. */
static int analyze_check(const struct analyze_arguments *arguments, int argc, char **argv)
{
	if (optind == argc)
		return command_usage("analyze", "no FILE given");
	if (arguments->evaluate.html != NULL && optind + 1 != argc)
		return command_usage("analyze", "--html takes one FILE, %d are given", argc - optind);
	if (arguments->drop != 0 && optind + 1 != argc)
		return command_usage("analyze", "--drop takes one FILE, %d are given", argc - optind);
	if (arguments->evaluate.html != NULL && (arguments->stretch.every_shock || arguments->repeats))
		return command_usage("analyze", "--html goes without --every-shock and --repeats");
	if (arguments->profile != NULL && arguments->save_profile != NULL)
		return command_usage("analyze", "--profile goes without --save-profile");
	if (arguments->list && (arguments->drop != 0 || arguments->evaluate.html != NULL))
		return command_usage("analyze", "--list goes without --drop and --html");
	if (command_is_input("analyze", arguments->evaluate.html, argv[optind]))
		return COMMAND_USAGE;
	return COMMAND_DONE;
}

static int analyze_agree(const struct analyze_arguments *arguments, const char *command)
{
	if (stretch_is_twofold(&arguments->stretch))
		return command_usage(command, "expected one of --shock, --every-shock and --window");
	if (arguments->profile != NULL && arguments->columns != NULL)
		return command_usage(command, "--profile goes without --columns");
	if (!isnan(arguments->angle_deg) && arguments->scene_file == NULL)
		return command_usage(command, "--angle needs a --scene to lay it over");
	if (arguments->band_file == NULL && arguments->evaluate.limits == NULL &&
	    arguments->evaluate.band.channel != NULL)
		return command_usage(command, "--channel needs a --band or --limits");
	if (arguments->band_file == NULL && arguments->evaluate.band.at_peak)
		return command_usage(command, "--band-at-peak needs a --band");
	return COMMAND_DONE;
}

static int read_band(struct limit_curve *curve, const char *file)
{
	char message[READ_MESSAGE_MAX];

	if (limit_read(curve, file, LIMIT_BAND, message) == 0)
		return COMMAND_DONE;
	command_error("%s", message);
	return COMMAND_INPUT;
}

void analyze_begin(struct analyze_arguments *arguments)
{
	*arguments = (struct analyze_arguments){
	        .angle_deg = NAN, .stretch = STRETCH_ALL, .evaluate = {.iepe_time_constant_s = NAN}};
}

int analyze_rows(struct option_row into[OPTION_ROWS_MAX])
{
	static const char *const shows[] = {"list", "drop", "repeats", "save-profile",
	                                    "json", "html", "events",  NULL};
	int count = 0;

	for (size_t i = 0; i < sizeof(rows) / sizeof(rows[0]); i++) {
		const char *const *name = shows;

		while (*name != NULL && strcmp(*name, rows[i].name) != 0)
			name++;
		if (*name == NULL)
			into[count++] = rows[i];
	}
	return count;
}

int analyze_ready(struct analyze_arguments *arguments, const char *command)
{
	int code = analyze_agree(arguments, command);

	arguments->stretch.whole = arguments->evaluate.html != NULL;
	if (arguments->profile != NULL) {
		snprintf(arguments->profile_as_columns, sizeof(arguments->profile_as_columns), "@%s",
		         arguments->profile);
		arguments->columns = arguments->profile_as_columns;
	}
	if (code == COMMAND_DONE && arguments->scene_file != NULL) {
		code = evaluate_read_scene(&arguments->scene, arguments->scene_file, arguments->angle_deg);
		arguments->evaluate.scene = &arguments->scene;
	}
	if (code == COMMAND_DONE && arguments->evaluate.chain != NULL)
		code = evaluate_check_chain(arguments->evaluate.chain);
	if (code == COMMAND_DONE && arguments->band_file != NULL) {
		code = read_band(&arguments->band, arguments->band_file);
		arguments->evaluate.band.curve = &arguments->band;
	}
	return code;
}

void analyze_end(struct analyze_arguments *arguments)
{
	limit_free(&arguments->band);
}

static int analyze_files(const struct files *files, const struct analyze_arguments *arguments)
{
	int code = COMMAND_DONE;
	size_t failed = 0;

	for (size_t i = 0; i < files->count; i++) {
		int one = analyze_file(files->file[i], arguments);

		if (one != COMMAND_DONE)
			code = one; /* the other files are still analysed */
		failed += one != COMMAND_DONE;
	}
	if (files->count > (size_t)files->named)
		fprintf(stderr, "droptower: %zu files, %zu without a result or with a failure\n",
		        files->count, failed);
	return code;
}

/* 0, DT_E_SYSTEM or DT_E_MEMORY. */
static int analyze_print_repeats(const struct repeats *repeats, bool json)
{
	int result;

	if (json)
		printf("{\"repeats\":%zu,\"quantities\":\"%s\",\"rows\":", repeats->repeats,
		       quantity_version());
	else
		printf("%zu repeats; values whose status is not ok are left out; first to last by a straight "
		       "line, +- one standard uncertainty\n",
		       repeats->repeats);
	result = repeats_table(repeats, json ? TABLE_JSON : TABLE_TEXT, stdout);
	puts(json ? "}" : REPEATS_NOTE);
	if (result == 0 && (fflush(stdout) != 0 || ferror(stdout)))
		result = DT_E_SYSTEM;
	return result;
}

static int analyze_words(char **words, int count, const struct analyze_arguments *arguments)
{
	char message[READ_MESSAGE_MAX];
	struct files files;
	int code = files_expand(&files, words, count);

	if (code != COMMAND_DONE)
		return code;
	code = analyze_files(&files, arguments);
	if (arguments->evaluate.repeats != NULL) {
		repeats_close(arguments->evaluate.repeats);
		if (analyze_print_repeats(arguments->evaluate.repeats, arguments->evaluate.json) != 0)
			code = COMMAND_INPUT;
	}
	if (arguments->save_profile != NULL &&
	    profile_save(arguments->save_profile, files.file[0],
	                 arguments->profile == NULL ? arguments->columns : NULL, message) != 0) {
		command_error("%s", message);
		code = COMMAND_INPUT;
	}
	files_free(&files);
	return code;
}

struct preset_row {
	struct plan_preset preset;
	double velocity_m_s, height_m;
};

static const struct table_column preset_columns[] = {
        TABLE_COLUMN(WORDS, struct preset_row, preset.name, .key = "preset", .title = "preset", .width = -26),
        TABLE_COLUMN(NUMBER, struct preset_row, preset.peak_g, .key = "peak_g", .title = "peak", .unit = "g",
                     .width = 7, .digits = -6),
        TABLE_COLUMN(NUMBER, struct preset_row, preset.duration_ms, .key = "duration_ms", .title = "ms",
                     .width = 5, .digits = -6),
        TABLE_COLUMN(NUMBER, struct preset_row, velocity_m_s, .key = "velocity_change_m_s", .title = "dv m/s",
                     .width = 7, .digits = 2),
        TABLE_COLUMN(NUMBER, struct preset_row, height_m, .key = "height_m", .title = "fall m", .width = 7,
                     .digits = 2),
        TABLE_COLUMN(NUMBER, struct preset_row, preset.peak_percent, .key = "peak_percent", .title = "peak %",
                     .width = 6, .digits = -3),
        TABLE_COLUMN(NUMBER, struct preset_row, preset.velocity_percent, .key = "velocity_percent",
                     .title = "dv %", .width = 5, .digits = -3),
        TABLE_COLUMN(NUMBER, struct preset_row, preset.band_percent, .key = "band_percent", .title = "band %",
                     .width = 6, .digits = -3),
        TABLE_COLUMN(NUMBER, struct preset_row, preset.transverse_percent, .key = "transverse_percent",
                     .title = "transverse %", .width = 12, .digits = -3),
        TABLE_COLUMN(YES, struct preset_row, preset.verified, .key = "verified", .title = "verified",
                     .width = -8),
        TABLE_COLUMN(WORDS, struct preset_row, preset.source, .key = "source", .title = "source"),
};

static int analyze_presets(bool json)
{
	struct table table = {.out = stdout, .format = json ? TABLE_JSON : TABLE_TEXT};

	table_begin(&table, preset_columns, TABLE_COUNT(preset_columns));
	for (size_t i = 0; plan_preset(i) != NULL; i++) {
		struct preset_row row = {.preset = *plan_preset(i)};

		row.velocity_m_s =
		        plan_velocity_m_s(row.preset.shape, row.preset.peak_g, row.preset.duration_ms * 1e-3);
		row.height_m = plan_height_m(row.velocity_m_s);
		table_row(&table, &row);
	}
	if (json)
		fputc('\n', stdout);
	return table_end(&table) == 0 ? COMMAND_DONE : COMMAND_INPUT;
}

int command_analyze(int argc, char **argv)
{
	struct analyze_arguments arguments;
	struct repeats repeats = {.row = NULL};
	int code;

	analyze_begin(&arguments);
	code = option_read(&known_options, &arguments, argc, argv);
	if (code != OPTIONS_READ)
		return code;
	if (evaluate_is_list(arguments.evaluate.limits))
		return analyze_presets(arguments.evaluate.json);
	code = analyze_check(&arguments, argc, argv);
	if (arguments.repeats)
		arguments.evaluate.repeats = &repeats;
	if (code == COMMAND_DONE)
		code = analyze_ready(&arguments, "analyze");
	if (code == COMMAND_DONE)
		code = analyze_words(argv + optind, argc - optind, &arguments);
	repeats_free(&repeats);
	analyze_end(&arguments);
	return code;
}
