/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <errno.h>
#include <getopt.h>
#include <stdio.h>
#include <string.h>

#include "common/base/number.h"
#include "host/command/command.h"
#include "host/command/evaluate.h"
#include "host/command/files.h"
#include "host/command/stretch.h"
#include "host/record/read.h"
#include "host/base/atomic_file.h"
#include "host/report/spectrum.h"
#include "host/shock/signal.h"

enum { FREQUENCIES_MOST = 1000 };

struct arguments {
	const char *columns, *chain, *limit_file, *csv, *svg;
	double frequency_hz[FREQUENCIES_MOST]; /* asked for one by one */
	unsigned drop;                         /* of a log of several; 0: the only one */
	struct stretch stretch;
	struct events_options events;
	double q;
	struct spectrum_options spectrum;
	bool json, strict;
};

/* Options that choose one of three. */
static int srs_take_choice(const struct option_table *table, const char *name, const char *text, void *into)
{
	struct spectrum_options *spectrum = &((struct arguments *)into)->spectrum;
	int chosen;

	if (strcmp(name, "quantity") == 0) {
		chosen = option_choose(table, name, text, srs_quantity_names, SRS_QUANTITIES);
		spectrum->srs.quantity = (enum srs_quantity)chosen;
	} else if (strcmp(name, "side") == 0) {
		chosen = option_choose(table, name, text, srs_side_names, SRS_SIDES);
		spectrum->side = (enum srs_side)chosen;
	} else {
		chosen = option_choose(table, name, text, srs_part_names, SRS_PARTS);
		spectrum->part = (enum srs_part)chosen;
	}
	return chosen < 0 ? OPTIONS_WRONG : OPTIONS_READ;
}

static int take_offset(const struct option_table *table, const char *name, const char *text, void *keep)
{
	*(bool *)keep = true;
	return strcmp(text, "keep") == 0 ? OPTIONS_READ
	                                 : option_wrong(table, "--%s is '%s', expected keep", name, text);
}

/* "10,20,50.5", rising. */
static int take_frequencies(const struct option_table *table, const char *name, const char *text, void *into)
{
	struct arguments *arguments = into;
	size_t count = 0;

	for (const char *at = text; at != NULL && count < FREQUENCIES_MOST; count++) {
		const char *end = strchr(at, ',');
		size_t length = end != NULL ? (size_t)(end - at) : strlen(at);
		double value;

		if (!number_parse(at, length, '.', &value) || value < 1e-6 || value > 1e9 ||
		    (count > 0 && value <= arguments->frequency_hz[count - 1]))
			return option_wrong(table,
			                    "--%s is '%s', expected rising frequencies in Hz between commas",
			                    name, text);
		arguments->frequency_hz[count] = value;
		at = end != NULL ? end + 1 : NULL;
		if (at != NULL && count + 1 == FREQUENCIES_MOST)
			return option_wrong(table, "--%s has more than %d frequencies", name,
			                    FREQUENCIES_MOST);
	}
	arguments->spectrum.frequency_hz = arguments->frequency_hz;
	arguments->spectrum.frequencies = count;
	return OPTIONS_READ;
}

static const struct option_row rows[] = {
        OPTION_TEXT("columns", "SPEC", struct arguments, columns,
                    "for foreign text, e.g. \"time:ms,fixture:g,board:-g,-\""),
        OPTION_TEXT("chain", "FILE,...", struct arguments, chain,
                    "the sensors' files: what their certificates say is applied"),
        OPTION_UNSIGNED("drop", "N", struct arguments, drop, 1, 1e9,
                        "the N-th drop of a log of several, counted from 1"),
        STRETCH_ROWS(struct arguments, stretch),
        OPTION_NUMBER("event-level", "G", struct arguments, events.level_g, 1e-6, 1e9,
                      "what leaves its rest by more than this is a shock; without it, 8 sigma of the noise"),
        OPTION_NUMBER("hold-off", "S", struct arguments, events.hold_off_s, 1e-9, 1e3,
                      "a shock is over when nothing has left that level for so long (0.02)"),
        OPTION_NUMBER("q", "Q", struct arguments, q, 0.500001, 1e6, "quality factor (10)"),
        OPTION_NUMBER("damping", "RATIO", struct arguments, spectrum.srs.damping, 0, 0.999999,
                      "damping ratio instead, 0 to below 1"),
        OPTION_NUMBER("per-octave", "N", struct arguments, spectrum.per_octave, 0.1, 1000,
                      "frequencies in an octave (12)"),
        OPTION_NUMBER("from", "HZ", struct arguments, spectrum.from_hz, 1e-6, 1e9, "lowest frequency (5)"),
        OPTION_NUMBER("to", "HZ", struct arguments, spectrum.to_hz, 1e-6, 1e9,
                      "highest (2000, or a quarter of the slowest rate); none above half a channel's rate"),
        OPTION_TAKEN_BY("frequencies", "LIST", take_frequencies,
                        "these frequencies, Hz between commas, instead of --per-octave, --from and --to"),
        OPTION_TAKEN_BY("quantity", "NAME", srs_take_choice,
                        "acceleration (absolute, g), velocity (pseudo, m/s) or displacement (relative, m)"),
        OPTION_TAKEN_BY("side", "NAME", srs_take_choice, "positive, negative or maximax (maximax)"),
        OPTION_TAKEN_BY("part", "NAME", srs_take_choice, "primary, residual or total (total)"),
        OPTION_TAKEN("offset", "keep", struct arguments, spectrum.keep_offset, take_offset,
                     "leave the offset before the shock in"),
        OPTION_FLAG("no-upsampling", struct arguments, spectrum.srs.keep_rate,
                    "take extremes from the samples as they are, above a tenth of the rate too"),
        OPTION_TEXT("limit", "CSV", struct arguments, limit_file,
                    "hold the spectrum against the curve frequency_hz,limit"),
        OPTION_TEXT("csv", "FILE", struct arguments, csv, "write the table"),
        OPTION_TEXT("svg", "FILE", struct arguments, svg, "write a picture"),
        OPTION_FLAG("json", struct arguments, json,
                    "one JSON object on standard output instead of the table"),
        OPTION_FLAG("strict", struct arguments, strict, "a flag, or a failed limit, is a failure (exit 3)"),
};

static const struct option_table known_options = {
        .program = "droptower",
        .command = "srs",
        .head = "usage: droptower srs FILE|FOLDER|PATTERN... [OPTIONS]\n"
                "\n"
                "Shock response spectrum of every channel (ramp-invariant, ISO 18431-4), one table on "
                "standard "
                "output.\n"
                "Files and --columns are those of 'droptower analyze'; a sensor's high-pass is not undone.\n"
                "\n",
        OPTION_ROWS(rows),
        .words = true,
};

static int srs_check(struct arguments *arguments, int argc, char **argv)
{
	if (optind == argc)
		return command_usage("srs", "no FILE given");
	if ((arguments->csv != NULL || arguments->svg != NULL || arguments->drop > 0) && optind + 1 != argc)
		return command_usage("srs", "--csv, --svg and --drop take one FILE, %d are given",
		                     argc - optind);
	if (stretch_is_twofold(&arguments->stretch))
		return command_usage("srs", "expected one of --shock, --every-shock and --window");
	if (arguments->stretch.every_shock && (arguments->csv != NULL || arguments->svg != NULL))
		return command_usage("srs", "--csv and --svg go without --every-shock, --shock N takes one");
	if (arguments->spectrum.frequency_hz != NULL &&
	    (arguments->spectrum.from_hz > 0 || arguments->spectrum.to_hz > 0))
		return command_usage("srs", "--frequencies goes without --from and --to");
	if (command_is_input("srs", arguments->csv, argv[optind]) ||
	    command_is_input("srs", arguments->svg, argv[optind]))
		return COMMAND_USAGE;
	if (arguments->q > 0 && arguments->spectrum.srs.damping >= 0)
		return command_usage("srs", "--q and --damping say the same, expected one of them");
	if (arguments->spectrum.srs.damping < 0)
		arguments->spectrum.srs.damping = 0.5 / (arguments->q > 0 ? arguments->q : 10);
	return COMMAND_DONE;
}

/* ---- output ---- */

static int srs_write_csv(const struct spectrum_report *report, const char *file, char *message, size_t size)
{
	struct atomic_file atomic;
	int result = atomic_file_open(&atomic, file, message, size);

	return result != 0 ? result
	                   : atomic_file_close(&atomic, spectrum_csv(report, atomic.out), message, size);
}

static int write_svg(const struct spectrum_report *report, const char *file, char *message, size_t size)
{
	char why[READ_MESSAGE_MAX] = "";
	struct atomic_file atomic;
	int result = atomic_file_open(&atomic, file, message, size);

	if (result != 0)
		return result;
	result =
	        atomic_file_close(&atomic, spectrum_svg(report, atomic.out, why, sizeof(why)), message, size);
	if (result != 0 && why[0] != '\0')
		snprintf(message, size, "%s: %s", file, why);
	return result;
}

static int srs_write_out(const struct spectrum_report *report, const struct arguments *arguments)
{
	char message[2 * READ_MESSAGE_MAX];

	if ((arguments->json ? spectrum_json(report, stdout) : spectrum_text(report, stdout)) != 0 &&
	    command_output_failed(strerror(errno)) != COMMAND_DONE)
		return COMMAND_INPUT;
	if ((arguments->csv && srs_write_csv(report, arguments->csv, message, sizeof(message)) != 0) ||
	    (arguments->svg && write_svg(report, arguments->svg, message, sizeof(message)) != 0)) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	return COMMAND_DONE;
}

static int srs_judge(const struct spectrum_report *report)
{
	const struct spectrum *s = report->spectrum;
	bool flagged = false;

	for (size_t c = 0; c < s->channel_count; c++)
		flagged |= s->channel[c].flags != 0 || s->channel[c].data_flags != 0;
	if (report->options->limit && !spectrum_passes(s))
		command_error("%s: above its limit, and --strict was asked for", report->file);
	else if (flagged)
		command_error("%s: flagged, and --strict was asked for", report->file);
	else
		return COMMAND_DONE;
	return COMMAND_INPUT;
}

/* ---- work ---- */

static int srs_refuse(const char *file, int result, const struct spectrum_options *options)
{
	if (result == DT_E_ARGUMENT)
		command_error(
		        "%s: no frequencies from %g Hz to %g Hz, expected an interval of at most %d of them",
		        file, options->from_hz, options->to_hz, SPECTRUM_FREQUENCIES_MAX);
	else if (result == DT_E_EMPTY)
		command_error("%s: too many samples are missing in every channel", file);
	else
		command_error("%s: %s", file, error_text(result));
	return COMMAND_INPUT;
}

/* No channel reaches so high: the user should know before a table of nothing. */
static int check_reach(const struct record *record, const struct spectrum_options *options)
{
	double most = 0;

	for (size_t i = 0; i < record->channel_count; i++)
		if (record->channels[i].rate_hz > most)
			most = record->channels[i].rate_hz;
	if (options->frequencies > 0 && options->frequency_hz[0] > most / 2) {
		command_error("%s: all --frequencies are above half of every rate, expected %g Hz at most",
		              record->file, most / 2);
		return COMMAND_INPUT;
	}
	if (!(options->to_hz > most / 2))
		return COMMAND_DONE;
	command_error("%s: --to %g Hz is above half of every rate, expected %g Hz at most", record->file,
	              options->to_hz, most / 2);
	return COMMAND_INPUT;
}

static int spectrum_of(struct record *record, void *context)
{
	const struct arguments *arguments = context;
	struct spectrum spectrum;
	struct spectrum_report report = {record->file, &arguments->spectrum, &spectrum, record->shock,
	                                 record->shocks};
	int code = check_reach(record, &arguments->spectrum), result;

	if (code != COMMAND_DONE)
		return code;
	if (record->shock > 0 && !arguments->json)
		printf("%sshock %u of %u\n", record->shock > 1 && arguments->stretch.shock == 0 ? "\n" : "",
		       record->shock, record->shocks);
	result = spectrum_compute(record, &arguments->spectrum, &spectrum);
	if (result != 0)
		return srs_refuse(record->file, result, &arguments->spectrum);
	code = srs_write_out(&report, arguments);
	if (code == COMMAND_DONE && arguments->strict)
		code = srs_judge(&report);
	spectrum_free(&spectrum);
	return code;
}

static int srs_file(const char *file, const struct arguments *arguments)
{
	struct record record;
	int code = files_read(&record, file, arguments->columns, arguments->drop);

	if (code != COMMAND_DONE)
		return code;
	code = evaluate_put_right(&record, arguments->chain);
	if (code == COMMAND_DONE)
		code = stretch_each(&record, &arguments->stretch, &arguments->events, spectrum_of,
		                    (struct arguments *)(uintptr_t)arguments);
	record_free(&record);
	return code;
}

static int srs_files(char **words, int count, const struct arguments *arguments)
{
	struct files files;
	int code = files_expand(&files, words, count);

	for (size_t i = 0; code != COMMAND_USAGE && i < files.count; i++) {
		int one = srs_file(files.file[i], arguments);

		if (i + 1 < files.count && !arguments->json)
			putchar('\n');
		code = one != COMMAND_DONE ? one : code; /* the other files still have theirs */
	}
	files_free(&files);
	return code;
}

int command_srs(int argc, char **argv)
{
	struct arguments arguments = {
	        .stretch = STRETCH_ALL,
	        .spectrum = {
	                .srs = {.damping = -1}, .side = SRS_MAXIMAX, .part = SRS_TOTAL, .per_octave = 12}};
	struct limit_curve limit = {0};
	char message[READ_MESSAGE_MAX];
	int code = option_read(&known_options, &arguments, argc, argv);

	if (code != OPTIONS_READ)
		return code;
	code = srs_check(&arguments, argc, argv);
	if (code != COMMAND_DONE)
		return code;
	if (arguments.spectrum.to_hz > 0 && arguments.spectrum.to_hz < arguments.spectrum.from_hz)
		return command_usage("srs", "--from %g Hz lies above --to %g Hz", arguments.spectrum.from_hz,
		                     arguments.spectrum.to_hz);
	if (arguments.limit_file && limit_read(&limit, arguments.limit_file, LIMIT_SPECTRUM, message) != 0) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	if (arguments.limit_file)
		arguments.spectrum.limit = &limit;
	code = srs_files(argv + optind, argc - optind, &arguments);
	limit_free(&limit);
	return code;
}
