/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <errno.h>
#include <getopt.h>
#include <stdio.h>
#include <string.h>

#include "host/command/command.h"
#include "host/record/read.h"
#include "host/record/whole.h"
#include "host/report/spectrum.h"
#include "host/shock/signal.h"

static const char help[] =
        "usage: droptower srs FILE [OPTIONS]\n"
        "\n"
        "Shock response spectrum of every channel (ramp-invariant, ISO 18431-4), one table on standard "
        "output.\n"
        "FILE and --columns are those of 'droptower analyze'; a sensor's high-pass is not undone.\n"
        "\n"
        "  --columns SPEC    for foreign text, e.g. \"time:ms,fixture:g,board:-g,-\"\n"
        "  --drop N          the N-th drop of a log of several, counted from 1\n"
        "  --q Q             quality factor (10)\n"
        "  --damping RATIO   damping ratio instead, 0 to below 1\n"
        "  --per-octave N    frequencies in an octave (12)\n"
        "  --from HZ         lowest frequency (5)\n"
        "  --to HZ           highest (2000, or a quarter of the slowest rate); none above half a channel's "
        "rate\n"
        "  --quantity NAME   acceleration (absolute, g), velocity (pseudo, m/s) or displacement (relative, "
        "m)\n"
        "  --side NAME       positive, negative or maximax (maximax)\n"
        "  --part NAME       primary, residual or total (total)\n"
        "  --offset keep     leave the offset before the shock in\n"
        "  --no-upsampling   take extremes from the samples as they are, above a tenth of the rate too\n"
        "  --limit CSV       hold the spectrum against the curve frequency_hz,limit\n"
        "  --csv FILE        write the table\n"
        "  --svg FILE        write a picture\n"
        "  --json            one JSON object on standard output instead of the table\n"
        "  --strict          a flag, or a failed limit, is a failure (exit 3)\n";

enum {
	OPTION_COLUMNS = 256,
	OPTION_DROP,
	OPTION_Q,
	OPTION_DAMPING,
	OPTION_PER_OCTAVE,
	OPTION_FROM,
	OPTION_TO,
	OPTION_QUANTITY,
	OPTION_SIDE,
	OPTION_PART,
	OPTION_OFFSET,
	OPTION_NO_UPSAMPLING,
	OPTION_LIMIT,
	OPTION_CSV,
	OPTION_SVG,
	OPTION_JSON,
	OPTION_STRICT
};

static const struct option long_options[] = {
        {"columns", required_argument, NULL, OPTION_COLUMNS},
        {"drop", required_argument, NULL, OPTION_DROP},
        {"q", required_argument, NULL, OPTION_Q},
        {"damping", required_argument, NULL, OPTION_DAMPING},
        {"per-octave", required_argument, NULL, OPTION_PER_OCTAVE},
        {"from", required_argument, NULL, OPTION_FROM},
        {"to", required_argument, NULL, OPTION_TO},
        {"quantity", required_argument, NULL, OPTION_QUANTITY},
        {"side", required_argument, NULL, OPTION_SIDE},
        {"part", required_argument, NULL, OPTION_PART},
        {"offset", required_argument, NULL, OPTION_OFFSET},
        {"no-upsampling", no_argument, NULL, OPTION_NO_UPSAMPLING},
        {"limit", required_argument, NULL, OPTION_LIMIT},
        {"csv", required_argument, NULL, OPTION_CSV},
        {"svg", required_argument, NULL, OPTION_SVG},
        {"json", no_argument, NULL, OPTION_JSON},
        {"strict", no_argument, NULL, OPTION_STRICT},
        {"help", no_argument, NULL, 'h'},
        {0},
};

struct arguments {
	const char *columns, *limit_file, *csv, *svg;
	unsigned drop; /* of a log of several; 0: the only one */
	double q;
	struct spectrum_options spectrum;
	bool json, strict, help;
};

static int choose(const char *option, const char *text, const char *const *names, int count, int *chosen)
{
	for (int i = 0; i < count; i++) {
		if (strcmp(text, names[i]) == 0) {
			*chosen = i;
			return COMMAND_DONE;
		}
	}
	return command_usage("srs", "--%s is '%s', expected %s, %s or %s", option, text, names[0], names[1],
	                     names[2]);
}

/* Options that choose one of three. */
static int parse_choice(struct spectrum_options *spectrum, int option, const char *text)
{
	int chosen = 0, code;

	switch (option) {
	case OPTION_QUANTITY:
		code = choose("quantity", text, srs_quantity_names, SRS_QUANTITIES, &chosen);
		spectrum->srs.quantity = (enum srs_quantity)chosen;
		return code;
	case OPTION_SIDE:
		code = choose("side", text, srs_side_names, SRS_SIDES, &chosen);
		spectrum->side = (enum srs_side)chosen;
		return code;
	default:
		code = choose("part", text, srs_part_names, SRS_PARTS, &chosen);
		spectrum->part = (enum srs_part)chosen;
		return code;
	}
}

/* Options that are a number. */
static int parse_number(struct arguments *arguments, int option, const char *text)
{
	struct spectrum_options *spectrum = &arguments->spectrum;

	switch (option) {
	case OPTION_Q:
		return command_number("srs", "q", text, 0.500001, 1e6, &arguments->q);
	case OPTION_DAMPING:
		return command_number("srs", "damping", text, 0, 0.999999, &spectrum->srs.damping);
	case OPTION_PER_OCTAVE:
		return command_number("srs", "per-octave", text, 0.1, 1000, &spectrum->per_octave);
	case OPTION_FROM:
		return command_number("srs", "from", text, 1e-6, 1e9, &spectrum->from_hz);
	default:
		return command_number("srs", "to", text, 1e-6, 1e9, &spectrum->to_hz);
	}
}

static int parse_one(struct arguments *arguments, int option, const char *unknown)
{
	switch (option) {
	case OPTION_COLUMNS:
		arguments->columns = optarg;
		return COMMAND_DONE;
	case OPTION_DROP:
		return command_drop("srs", optarg, &arguments->drop);
	case OPTION_Q:
	case OPTION_DAMPING:
	case OPTION_PER_OCTAVE:
	case OPTION_FROM:
	case OPTION_TO:
		return parse_number(arguments, option, optarg);
	case OPTION_QUANTITY:
	case OPTION_SIDE:
	case OPTION_PART:
		return parse_choice(&arguments->spectrum, option, optarg);
	case OPTION_OFFSET:
		arguments->spectrum.keep_offset = true;
		return strcmp(optarg, "keep") == 0
		               ? COMMAND_DONE
		               : command_usage("srs", "--offset is '%s', expected keep", optarg);
	case OPTION_NO_UPSAMPLING:
		arguments->spectrum.srs.keep_rate = true;
		return COMMAND_DONE;
	case OPTION_LIMIT:
		arguments->limit_file = optarg;
		return COMMAND_DONE;
	case OPTION_CSV:
		arguments->csv = optarg;
		return COMMAND_DONE;
	case OPTION_SVG:
		arguments->svg = optarg;
		return COMMAND_DONE;
	case OPTION_JSON:
		arguments->json = true;
		return COMMAND_DONE;
	case OPTION_STRICT:
		arguments->strict = true;
		return COMMAND_DONE;
	default:
		return command_option("srs", unknown);
	}
}

static int parse(struct arguments *arguments, int argc, char **argv)
{
	int option, code = COMMAND_DONE;

	opterr = 0;
	while (code == COMMAND_DONE && (option = getopt_long(argc, argv, "h", long_options, NULL)) != -1) {
		if (option == 'h') {
			arguments->help = true;
			return COMMAND_DONE;
		}
		code = parse_one(arguments, option, argv[optind - 1]);
	}
	if (code != COMMAND_DONE)
		return code;
	if (optind + 1 != argc)
		return command_usage("srs", "expected one FILE, %d given", argc - optind);
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

static int write_csv(const struct spectrum_report *report, const char *file, char *message, size_t size)
{
	struct whole whole;
	int result = whole_open(&whole, file, message, size);

	return result != 0 ? result : whole_close(&whole, spectrum_csv(report, whole.out), message, size);
}

static int write_svg(const struct spectrum_report *report, const char *file, char *message, size_t size)
{
	char why[READ_MESSAGE_MAX] = "";
	struct whole whole;
	int result = whole_open(&whole, file, message, size);

	if (result != 0)
		return result;
	result = whole_close(&whole, spectrum_svg(report, whole.out, why, sizeof(why)), message, size);
	if (result != 0 && why[0] != '\0')
		snprintf(message, size, "%s: %s", file, why);
	return result;
}

static int write_out(const struct spectrum_report *report, const struct arguments *arguments)
{
	char message[2 * READ_MESSAGE_MAX];

	if ((arguments->json ? spectrum_json(report, stdout) : spectrum_text(report, stdout)) != 0) {
		command_error("standard output: %s", strerror(errno));
		return COMMAND_INPUT;
	}
	if ((arguments->csv && write_csv(report, arguments->csv, message, sizeof(message)) != 0) ||
	    (arguments->svg && write_svg(report, arguments->svg, message, sizeof(message)) != 0)) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	return COMMAND_DONE;
}

static int judge(const struct spectrum_report *report)
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

static int refuse(const char *file, int result, const struct spectrum_options *options)
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
	if (!(options->to_hz > most / 2))
		return COMMAND_DONE;
	command_error("%s: --to %g Hz is above half of every rate, expected %g Hz at most", record->file,
	              options->to_hz, most / 2);
	return COMMAND_INPUT;
}

static int spectrum_of(const struct record *record, const struct arguments *arguments)
{
	struct spectrum spectrum;
	struct spectrum_report report = {record->file, &arguments->spectrum, &spectrum};
	int code = check_reach(record, &arguments->spectrum), result;

	if (code != COMMAND_DONE)
		return code;
	result = spectrum_compute(record, &arguments->spectrum, &spectrum);
	if (result != 0)
		return refuse(record->file, result, &arguments->spectrum);
	code = write_out(&report, arguments);
	if (code == COMMAND_DONE && arguments->strict)
		code = judge(&report);
	spectrum_free(&spectrum);
	return code;
}

int command_srs(int argc, char **argv)
{
	struct arguments arguments = {
	        .spectrum = {
	                .srs = {.damping = -1}, .side = SRS_MAXIMAX, .part = SRS_TOTAL, .per_octave = 12}};
	struct limit_curve limit = {0};
	char message[READ_MESSAGE_MAX];
	struct record record;
	int code = parse(&arguments, argc, argv);

	if (code != COMMAND_DONE)
		return code;
	if (arguments.help) {
		fputs(help, stdout);
		return COMMAND_DONE;
	}
	if (arguments.spectrum.to_hz > 0 && arguments.spectrum.to_hz < arguments.spectrum.from_hz)
		return command_usage("srs", "--from %g Hz lies above --to %g Hz", arguments.spectrum.from_hz,
		                     arguments.spectrum.to_hz);
	if (arguments.limit_file && limit_read(&limit, arguments.limit_file, LIMIT_SPECTRUM, message) != 0) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	if (arguments.limit_file)
		arguments.spectrum.limit = &limit;
	if (read_nth(&record, argv[optind], arguments.columns, arguments.drop, message) == 0) {
		code = spectrum_of(&record, &arguments);
		record_free(&record);
	} else {
		command_error("%s", message);
		code = COMMAND_INPUT;
	}
	limit_free(&limit);
	return code;
}
