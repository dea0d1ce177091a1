/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <getopt.h>
#include <math.h>
#include <stdio.h>

#include "host/command/command.h"
#include "host/command/evaluate.h"
#include "host/command/list.h"
#include "host/estimate/cfc.h"
#include "host/record/log_capture.h"
#include "host/record/read.h"

static const char help[] =
        "usage: droptower analyze FILE... [OPTIONS]\n"
        "\n"
        "Analyses logged drops (candump text, LCM event log, our CSV), UFF58, HDF5 and LabVIEW .lvm files,\n"
        "and any delimited text. The format is found from the content. A log of several drops gives one\n"
        "result for each.\n"
        "\n"
        "  --list           what drops a log holds, without analysing them; of a large log an index is kept\n"
        "                   as FILE.index\n"
        "  --drop N         only the N-th drop of the log, counted from 1 (one FILE only)\n"
        "  --columns SPEC   for foreign text: one name:unit per column, '-' before the unit flips the sign,\n"
        "                   a lone '-' skips, e.g. \"time:ms,fixture:g,board:-g,-\"; units s ms us, g m/s2;\n"
        "                   without a time column say name:unit@RATE_HZ\n"
        "  --scene FILE     compare with the model's prediction for this scene\n"
        "  --angle DEG      contact angle, instead of the scene's\n"
        "  --lowpass HZ     zero-phase low-pass before everything else\n"
        "  --cfc CLASS      channel frequency class 60, 180, 600 or 1000 (SAE J211, ISO 6487), zero-phase\n"
        "  --iepe S         undo the sensor supply's high-pass of this time constant (0: leave it);\n"
        "                   without it, the scene's where channels are the tower's\n"
        "  --family NAME    the contact pulse is a half-sine, haversine or sine-power (auto)\n"
        "  --tolerance PCT  standard uncertainty asked for, of the value (0.5); what it takes is done\n"
        "  --events         list shocks, largest first, and free falls in the table too\n"
        "  --event-level G  what leaves its rest by more than this is a shock; without it, 8 sigma of the "
        "noise\n"
        "  --hold-off S     a shock is over when nothing has left that level for so long (0.02)\n"
        "  --band CSV       hold a pulse against time_s,lower_g,upper_g; time 0 is where it leaves 10 %\n"
        "  --band-at-peak   time 0 of the band is the pulse's peak\n"
        "  --channel NAME   the band's channel; without it, the one with the largest peak\n"
        "  --json           one JSON object per drop on standard output\n"
        "  --html PAGE      write a page (one FILE of one drop, or --drop N)\n"
        "  --strict         a flagged record or channel is a failure (exit 3)\n";

enum {
	OPTION_COLUMNS = 256,
	OPTION_SCENE,
	OPTION_ANGLE,
	OPTION_LOWPASS,
	OPTION_CFC,
	OPTION_IEPE,
	OPTION_FAMILY,
	OPTION_TOLERANCE,
	OPTION_EVENTS,
	OPTION_EVENT_LEVEL,
	OPTION_HOLD_OFF,
	OPTION_BAND,
	OPTION_BAND_AT_PEAK,
	OPTION_CHANNEL,
	OPTION_JSON,
	OPTION_HTML,
	OPTION_STRICT,
	OPTION_LIST,
	OPTION_DROP
};

static const struct option long_options[] = {
        {"columns", required_argument, NULL, OPTION_COLUMNS},
        {"scene", required_argument, NULL, OPTION_SCENE},
        {"angle", required_argument, NULL, OPTION_ANGLE},
        {"lowpass", required_argument, NULL, OPTION_LOWPASS},
        {"cfc", required_argument, NULL, OPTION_CFC},
        {"iepe", required_argument, NULL, OPTION_IEPE},
        {"family", required_argument, NULL, OPTION_FAMILY},
        {"tolerance", required_argument, NULL, OPTION_TOLERANCE},
        {"events", no_argument, NULL, OPTION_EVENTS},
        {"event-level", required_argument, NULL, OPTION_EVENT_LEVEL},
        {"hold-off", required_argument, NULL, OPTION_HOLD_OFF},
        {"band", required_argument, NULL, OPTION_BAND},
        {"band-at-peak", no_argument, NULL, OPTION_BAND_AT_PEAK},
        {"channel", required_argument, NULL, OPTION_CHANNEL},
        {"json", no_argument, NULL, OPTION_JSON},
        {"html", required_argument, NULL, OPTION_HTML},
        {"strict", no_argument, NULL, OPTION_STRICT},
        {"list", no_argument, NULL, OPTION_LIST},
        {"drop", required_argument, NULL, OPTION_DROP},
        {"help", no_argument, NULL, 'h'},
        {0},
};

struct arguments {
	const char *columns, *scene_file, *band_file;
	double angle_deg;
	unsigned drop; /* of the log; 0: all */
	bool list;
	struct evaluate_options evaluate;
	int help;
};

static int parse_class(struct arguments *arguments, const char *text)
{
	double class = 0;
	int code = command_number("analyze", "cfc", text, 60, 1000, &class);

	arguments->evaluate.cfc = (unsigned)class;
	if (code != COMMAND_DONE || (cfc_check((unsigned)class, INFINITY) == 0 && class <= floor(class)))
		return code;
	return command_usage("analyze", "--cfc is '%s', expected 60, 180, 600 or 1000", text);
}

/* What concerns filters, shocks and bands, and which drops. */
static int parse_shock(struct arguments *arguments, int option, const char *unknown)
{
	struct evaluate_options *evaluate = &arguments->evaluate;

	switch (option) {
	case OPTION_CFC:
		return parse_class(arguments, optarg);
	case OPTION_EVENTS:
		evaluate->show_events = true;
		return COMMAND_DONE;
	case OPTION_EVENT_LEVEL:
		return command_number("analyze", "event-level", optarg, 1e-6, 1e9, &evaluate->events.level_g);
	case OPTION_HOLD_OFF:
		return command_number("analyze", "hold-off", optarg, 1e-9, 1e3, &evaluate->events.hold_off_s);
	case OPTION_BAND:
		arguments->band_file = optarg;
		return COMMAND_DONE;
	case OPTION_BAND_AT_PEAK:
		evaluate->band.at_peak = true;
		return COMMAND_DONE;
	case OPTION_CHANNEL:
		evaluate->band.channel = optarg;
		return COMMAND_DONE;
	case OPTION_LIST:
		arguments->list = true;
		return COMMAND_DONE;
	case OPTION_DROP:
		return command_drop("analyze", optarg, &arguments->drop);
	default:
		return command_option("analyze", unknown);
	}
}

static int parse(struct arguments *arguments, int argc, char **argv)
{
	int option, code = COMMAND_DONE;
	double percent = 0;

	opterr = 0;
	while (code == COMMAND_DONE && (option = getopt_long(argc, argv, "h", long_options, NULL)) != -1) {
		switch (option) {
		case OPTION_COLUMNS:
			arguments->columns = optarg;
			break;
		case OPTION_SCENE:
			arguments->scene_file = optarg;
			break;
		case OPTION_ANGLE:
			code = command_angle("analyze", optarg, &arguments->angle_deg);
			break;
		case OPTION_LOWPASS:
			code = command_number("analyze", "lowpass", optarg, 1e-3, 1e9,
			                      &arguments->evaluate.lowpass_hz);
			break;
		case OPTION_IEPE:
			code = command_number("analyze", "iepe", optarg, 0, 1e3,
			                      &arguments->evaluate.iepe_time_constant_s);
			break;
		case OPTION_FAMILY:
			if (estimate_family_parse(optarg, &arguments->evaluate.family) != 0)
				code = command_usage("analyze",
				                     "--family: '%s' is none of auto, half-sine, haversine, "
				                     "sine-power",
				                     optarg);
			break;
		case OPTION_TOLERANCE:
			code = command_number("analyze", "tolerance", optarg, 1e-6, 100, &percent);
			arguments->evaluate.tolerance = percent / 100;
			break;
		case OPTION_JSON:
			arguments->evaluate.json = true;
			break;
		case OPTION_HTML:
			arguments->evaluate.html = optarg;
			break;
		case OPTION_STRICT:
			arguments->evaluate.strict = true;
			break;
		case 'h':
			arguments->help = 1;
			return COMMAND_DONE;
		default:
			code = parse_shock(arguments, option, argv[optind - 1]);
		}
	}
	return code;
}

static int analyze_one(const char *file, const struct arguments *arguments)
{
	char message[READ_MESSAGE_MAX];
	struct record record;
	int code;

	if (read_nth(&record, file, arguments->columns, arguments->drop, message) != 0) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	code = evaluate(&record, &arguments->evaluate);
	record_free(&record);
	return code;
}

struct analysing {
	const char *file;
	const struct arguments *arguments;
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
		if (analysing->count++ > 0 && !options->json)
			putchar('\n');
		code = evaluate(record, options);
		record_free(record);
	}
	if (code != COMMAND_DONE)
		analysing->code = code; /* the others are still analysed */
	return 0;
}

static int analyze_each(const char *file, const struct arguments *arguments)
{
	struct analysing analysing = {.file = file, .arguments = arguments, .code = COMMAND_DONE};
	char message[READ_MESSAGE_MAX];

	if (read_each(file, arguments->columns, analyze_drop, &analysing, message) == 0)
		return analysing.code;
	command_error("%s", message);
	return COMMAND_INPUT;
}

static int analyze_file(const char *file, const struct arguments *arguments)
{
	if (arguments->list)
		return list_drops(file, arguments->evaluate.json);
	return arguments->drop != 0 || arguments->evaluate.html != NULL ? analyze_one(file, arguments)
	                                                                : analyze_each(file, arguments);
}

static int check(const struct arguments *arguments, int argc, char **argv)
{
	if (optind == argc)
		return command_usage("analyze", "no FILE given");
	if (arguments->evaluate.html != NULL && optind + 1 != argc)
		return command_usage("analyze", "--html takes one FILE, %d are given", argc - optind);
	if (arguments->drop != 0 && optind + 1 != argc)
		return command_usage("analyze", "--drop takes one FILE, %d are given", argc - optind);
	if (arguments->list && (arguments->drop != 0 || arguments->evaluate.html != NULL))
		return command_usage("analyze", "--list goes without --drop and --html");
	if (!isnan(arguments->angle_deg) && arguments->scene_file == NULL)
		return command_usage("analyze", "--angle needs a --scene to lay it over");
	if (arguments->band_file == NULL &&
	    (arguments->evaluate.band.channel != NULL || arguments->evaluate.band.at_peak))
		return command_usage("analyze", "--channel and --band-at-peak need a --band");
	if (command_is_input("analyze", arguments->evaluate.html, argv[optind]))
		return COMMAND_USAGE;
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

static int analyze_files(char **files, int count, const struct arguments *arguments)
{
	int code = COMMAND_DONE;

	for (int i = 0; i < count; i++) {
		int one = analyze_file(files[i], arguments);

		if (one != COMMAND_DONE)
			code = one; /* the other files are still analysed */
	}
	return code;
}

int command_analyze(int argc, char **argv)
{
	struct arguments arguments = {.angle_deg = NAN, .evaluate = {.iepe_time_constant_s = NAN}};
	struct limit_curve band = {0};
	struct scene scene;
	int code = parse(&arguments, argc, argv);

	if (code == COMMAND_DONE && arguments.help) {
		fputs(help, stdout);
		return COMMAND_DONE;
	}
	if (code == COMMAND_DONE)
		code = check(&arguments, argc, argv);
	if (code == COMMAND_DONE && arguments.scene_file != NULL) {
		code = evaluate_read_scene(&scene, arguments.scene_file, arguments.angle_deg);
		arguments.evaluate.scene = &scene;
	}
	if (code == COMMAND_DONE && arguments.band_file != NULL) {
		code = read_band(&band, arguments.band_file);
		arguments.evaluate.band.curve = &band;
	}
	if (code == COMMAND_DONE)
		code = analyze_files(argv + optind, argc - optind, &arguments);
	limit_free(&band);
	return code;
}
