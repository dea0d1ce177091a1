/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <errno.h>
#include <getopt.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "host/chart/chart.h"
#include "host/command/command.h"

static const char help[] =
        "usage: droptower chart SUBJECT [OPTIONS]\n"
        "\n"
        "Pictures and CSV files of what droptower costs and where it, and others' methods, fail.\n"
        "\n"
        "accuracy         estimates: error against cost of every method, beside the Cramer-Rao bound, on\n"
        "                 simulated drops of known truth\n"
        "stability        estimates: where each method fails: noise, damping, record length, rate, "
        "clipping,\n"
        "                 gaps, offset, hum, spikes, second mode, jitter, pulse shape\n"
        "model            predictions: every rung against the study's tables and the finest rung, "
        "integrators;\n"
        "                 error against cost\n"
        "model-stability  predictions: where methods fail: resonance, step size, restitution, flat angles,\n"
        "                 dents deeper than the mat, decrement at high damping\n"
        "\n"
        "  --out DIR    where SUBJECT-*.svg, SUBJECT-*.csv are written; made if missing; default: here\n"
        "  --drops N    drops for each figure; default 1000 (accuracy), 100 (stability) or 40\n"
        "               (model-stability, its decrement); model drops the study's once\n"
        "  --seed N     another seed makes other drops; the same one the same; default 1\n";

enum { OPTION_OUT = 256, OPTION_DROPS, OPTION_SEED };

static const struct subject {
	const char *name;
	int (*draw)(const struct chart_options *options, FILE *out, char *message);
	unsigned drops;
} subjects[] = {
        {"accuracy", chart_accuracy, 1000},
        {"stability", chart_stability, 100},
        {"model", chart_model, 1},
        {"model-stability", chart_model_stability, 40},
};
enum { SUBJECTS = sizeof(subjects) / sizeof(subjects[0]) };

static const struct option long_options[] = {
        {"out", required_argument, NULL, OPTION_OUT},
        {"drops", required_argument, NULL, OPTION_DROPS},
        {"seed", required_argument, NULL, OPTION_SEED},
        {"help", no_argument, NULL, 'h'},
        {0},
};

struct arguments {
	const char *folder;
	double drops, seed; /* drops 0: the chart's own */
	int help;
};

static int parse(struct arguments *arguments, int argc, char **argv)
{
	int option, code = COMMAND_DONE;

	opterr = 0;
	while (code == COMMAND_DONE && (option = getopt_long(argc, argv, "h", long_options, NULL)) != -1) {
		switch (option) {
		case OPTION_OUT:
			arguments->folder = optarg;
			break;
		case OPTION_DROPS:
			code = command_number("chart", "drops", optarg, 2, 1e6, &arguments->drops);
			break;
		case OPTION_SEED:
			code = command_number("chart", "seed", optarg, 0, 1e9, &arguments->seed);
			break;
		case 'h':
			arguments->help = 1;
			return COMMAND_DONE;
		default:
			return command_option("chart", argv[optind - 1]);
		}
	}
	return code;
}

static int draw(const struct arguments *arguments, const struct subject *subject)
{
	char message[CHART_MESSAGE_MAX];
	struct chart_options options = {.folder = arguments->folder, .seed = (unsigned long)arguments->seed};

	options.drops = arguments->drops > 0 ? (unsigned)arguments->drops : subject->drops;
	if (mkdir(options.folder, 0777) != 0 && errno != EEXIST) {
		command_error("%s: %s", options.folder, strerror(errno));
		return COMMAND_INPUT;
	}
	if (subject->draw(&options, stdout, message)) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	return COMMAND_DONE;
}

int command_chart(int argc, char **argv)
{
	struct arguments arguments = {.folder = ".", .seed = 1};
	int code = parse(&arguments, argc, argv);

	if (code != COMMAND_DONE)
		return code;
	if (arguments.help) {
		fputs(help, stdout);
		return COMMAND_DONE;
	}
	for (size_t i = 0; optind + 1 == argc && i < SUBJECTS; i++)
		if (strcmp(argv[optind], subjects[i].name) == 0)
			return draw(&arguments, &subjects[i]);
	return command_usage("chart", "say which chart: accuracy, stability, model or model-stability");
}
