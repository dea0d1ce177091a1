/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <getopt.h>
#include <math.h>
#include <stdio.h>

#include "host/command/command.h"
#include "host/command/evaluate.h"
#include "host/record/read.h"

static const char help[] =
        "usage: droptower analyze FILE... [OPTIONS]\n"
        "\n"
        "Analyses logged drops (candump text, LCM event log, our CSV) and foreign recordings (any delimited\n"
        "text, LabVIEW .lvm). The format is found from the content.\n"
        "\n"
        "  --columns SPEC   for foreign text: one name:unit per column, '-' before the unit flips the sign,\n"
        "                   a lone '-' skips, e.g. \"time:ms,fixture:g,board:-g,-\"; units s ms us, g m/s2;\n"
        "                   without a time column say name:unit@RATE_HZ\n"
        "  --scene FILE     compare with the model's prediction for this scene\n"
        "  --angle DEG      contact angle, instead of the scene's\n"
        "  --lowpass HZ     zero-phase low-pass before everything else\n"
        "  --iepe S         undo the sensor supply's high-pass of this time constant (0: leave it);\n"
        "                   without it, the scene's\n"
        "  --family NAME    the contact pulse is a half-sine, haversine or sine-power (auto)\n"
        "  --tolerance PCT  standard uncertainty asked for, of the value (0.5); what it takes is done\n"
        "  --json           one JSON object per file on standard output\n"
        "  --html PAGE      write a page (one FILE only)\n"
        "  --strict         a flagged result is a failure (exit 3)\n";

enum {
	OPTION_COLUMNS = 256,
	OPTION_SCENE,
	OPTION_ANGLE,
	OPTION_LOWPASS,
	OPTION_IEPE,
	OPTION_FAMILY,
	OPTION_TOLERANCE,
	OPTION_JSON,
	OPTION_HTML,
	OPTION_STRICT
};

static const struct option long_options[] = {
        {"columns", required_argument, NULL, OPTION_COLUMNS},
        {"scene", required_argument, NULL, OPTION_SCENE},
        {"angle", required_argument, NULL, OPTION_ANGLE},
        {"lowpass", required_argument, NULL, OPTION_LOWPASS},
        {"iepe", required_argument, NULL, OPTION_IEPE},
        {"family", required_argument, NULL, OPTION_FAMILY},
        {"tolerance", required_argument, NULL, OPTION_TOLERANCE},
        {"json", no_argument, NULL, OPTION_JSON},
        {"html", required_argument, NULL, OPTION_HTML},
        {"strict", no_argument, NULL, OPTION_STRICT},
        {"help", no_argument, NULL, 'h'},
        {0},
};

struct arguments {
	const char *columns, *scene_file;
	double angle_deg;
	struct evaluate_options evaluate;
	int help;
};

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
			code = command_number("analyze", "angle", optarg, 10, 80, &arguments->angle_deg);
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
			return command_usage("analyze", "option '%s' is not known or lacks its value",
			                     argv[optind - 1]);
		}
	}
	return code;
}

static int analyze_file(const char *file, const struct arguments *arguments)
{
	char message[READ_MESSAGE_MAX];
	struct record record;
	int code;

	if (read_record(&record, file, arguments->columns, message) != 0) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	code = evaluate(&record, &arguments->evaluate);
	record_free(&record);
	return code;
}

int command_analyze(int argc, char **argv)
{
	struct arguments arguments = {.angle_deg = NAN, .evaluate = {.iepe_time_constant_s = NAN}};
	struct scene scene;
	int code = parse(&arguments, argc, argv);

	if (code != COMMAND_DONE)
		return code;
	if (arguments.help) {
		fputs(help, stdout);
		return COMMAND_DONE;
	}
	if (optind == argc)
		return command_usage("analyze", "no FILE given");
	if (arguments.evaluate.html != NULL && optind + 1 != argc)
		return command_usage("analyze", "--html takes one FILE, %d are given", argc - optind);
	if (!isnan(arguments.angle_deg) && arguments.scene_file == NULL)
		return command_usage("analyze", "--angle needs a --scene to lay it over");
	if (arguments.scene_file != NULL) {
		code = evaluate_read_scene(&scene, arguments.scene_file, arguments.angle_deg);
		if (code != COMMAND_DONE)
			return code;
		arguments.evaluate.scene = &scene;
	}
	for (int i = optind; i < argc; i++) {
		int one = analyze_file(argv[i], &arguments);

		if (one != COMMAND_DONE)
			code = one; /* the other files are still analysed */
	}
	return code;
}
