/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <errno.h>
#include <getopt.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "host/chart/chart.h"
#include "host/command/command.h"
#include "host/model/corner.h"

static const struct subject {
	const char *name;
	bool of_drops; /* simulated ones, which may be of a scene */
	int (*draw)(const struct chart_options *options, FILE *out, char *message);
	unsigned drops;
} subjects[] = {
        {"accuracy", true, chart_accuracy, 1000},
        {"stability", true, chart_stability, 100},
        {"model", false, chart_model, 1},
        {"model-stability", false, chart_model_stability, 40},
};
enum { SUBJECTS = sizeof(subjects) / sizeof(subjects[0]) };

struct arguments {
	const char *folder;
	unsigned drops; /* 0: the chart's own */
	uint64_t seed;
	const char *scene_file;
};

static const struct option_row rows[] = {
        OPTION_TEXT("out", "DIR", struct arguments, folder,
                    "where SUBJECT-*.svg, SUBJECT-*.csv are written; made if missing; default: here"),
        OPTION_TEXT(
                "scene", "FILE", struct arguments, scene_file,
                "accuracy, stability: of this product: its pulse, plate and sensors as predicted; default: "
                "the study's, 485 g in 3 ms, plate of 129 Hz"),
        OPTION_UNSIGNED("drops", "N", struct arguments, drops, 2, 1e6,
                        "drops for each figure; default 1000 (accuracy), 100 (stability) or 40 "
                        "(model-stability, its decrement); model drops the study's once"),
        OPTION_UINT64("seed", "N", struct arguments, seed, 0, 1e9,
                      "another seed makes other drops; the same one the same; default 1"),
};

static const struct option_table known_options = {
        .program = "droptower",
        .command = "chart",
        .head = "usage: droptower chart SUBJECT [OPTIONS]\n"
                "\n"
                "Pictures and CSV files of what droptower costs and where it, and others' methods, fail.\n"
                "\n"
                "accuracy         estimates: error against cost of every method, beside the Cramer-Rao "
                "bound, on\n"
                "                 simulated drops of known truth\n"
                "stability        estimates: where each method fails: noise, damping, record length, rate, "
                "clipping,\n"
                "                 gaps, offset, hum, spikes, second mode, jitter, pulse shape\n"
                "model            predictions: every rung against the study's tables and the finest rung, "
                "integrators;\n"
                "                 error against cost\n"
                "model-stability  predictions: where methods fail: resonance, step size, restitution, flat "
                "angles,\n"
                "                 dents deeper than the mat, decrement at high damping\n"
                "\n",
        OPTION_ROWS(rows),
        .words = true,
};

/* The drop that accuracy and stability simulate. */
static int take_scene(const struct arguments *arguments, struct chart_options *options)
{
	char message[CHART_MESSAGE_MAX];
	struct scene scene;

	if (arguments->scene_file &&
	    (scene_read(&scene, arguments->scene_file, message) != 0 || corner_fill(&scene, message) != 0)) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	if (chart_drop(arguments->scene_file ? &scene : NULL, options, message)) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	return COMMAND_DONE;
}

static int chart_draw(const struct arguments *arguments, const struct subject *subject)
{
	char message[CHART_MESSAGE_MAX];
	struct chart_options options = {.folder = arguments->folder, .seed = arguments->seed};

	if (arguments->scene_file && !subject->of_drops)
		return command_usage("chart", "--scene goes with accuracy and stability only");
	if (take_scene(arguments, &options) != COMMAND_DONE)
		return COMMAND_INPUT;
	options.drops = arguments->drops > 0 ? arguments->drops : subject->drops;
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
	int code = option_read(&known_options, &arguments, argc, argv);

	if (code != OPTIONS_READ)
		return code;
	for (size_t i = 0; optind + 1 == argc && i < SUBJECTS; i++)
		if (strcmp(argv[optind], subjects[i].name) == 0)
			return chart_draw(&arguments, &subjects[i]);
	return command_usage("chart", "say which chart: accuracy, stability, model or model-stability");
}
