/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * `droptower model`: its options.
 */
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/command/command.h"
#include "host/command/evaluate.h"
#include "host/command/model_private.h"

static const char help[] =
        "usage: droptower model --scene FILE [OPTIONS]\n"
        "\n"
        "What a drop of the scene should look like, by the least model that answers.\n"
        "\n"
        "  --angle DEG        instead of the scene's\n"
        "  --fidelity NAME    auto, paper, steady, sdof, coupled or planar; default: auto\n"
        "  --tolerance PCT    auto: how far the answer may be from planar's (5)\n"
        "  --ask LIST         plate, axes, box, lag, s2, direction: only these; default: everything\n"
        "  --refine LIST      stiffness, wedge, grip, mounts or none, instead of the rung's own\n"
        "  --json             one JSON object on standard output instead of the table\n"
        "  --history FILE     write time histories as CSV, from 2 ms before the touch\n"
        "  --step US          their step (10); --span MS: how far they go (12)\n"
        "  --sweep KEY=FROM:TO:STEP   a row for each value; several make a grid\n"
        "  --monte-carlo N    N drops with the inputs of --vary at random: mean, SD, 95 % bands\n"
        "  --vary KEY=SD,...  their standard deviations; SD% is percent of the scene's value\n"
        "  --seed S           another seed makes other drops (1)\n"
        "  --sensitivity      percent for a percent (angles: for a degree) of every key that matters\n"
        "\n"
        "KEY is section.key of a scene file, alone, or with what depends on it: angle, height (contact "
        "time),\n"
        "mass, contact-time (contact stiffness), restitution, cube (mounts' stiffness and dampers),\n"
        "stiffness, damping (dampers).\n";

enum {
	OPTION_SCENE = 256,
	OPTION_ANGLE,
	OPTION_FIDELITY,
	OPTION_TOLERANCE,
	OPTION_ASK,
	OPTION_REFINE,
	OPTION_JSON,
	OPTION_HISTORY,
	OPTION_STEP,
	OPTION_SPAN,
	OPTION_SWEEP,
	OPTION_MONTE_CARLO,
	OPTION_VARY,
	OPTION_SEED,
	OPTION_SENSITIVITY
};

static const struct option long_options[] = {
        {"scene", required_argument, NULL, OPTION_SCENE},
        {"angle", required_argument, NULL, OPTION_ANGLE},
        {"fidelity", required_argument, NULL, OPTION_FIDELITY},
        {"tolerance", required_argument, NULL, OPTION_TOLERANCE},
        {"ask", required_argument, NULL, OPTION_ASK},
        {"refine", required_argument, NULL, OPTION_REFINE},
        {"json", no_argument, NULL, OPTION_JSON},
        {"history", required_argument, NULL, OPTION_HISTORY},
        {"step", required_argument, NULL, OPTION_STEP},
        {"span", required_argument, NULL, OPTION_SPAN},
        {"sweep", required_argument, NULL, OPTION_SWEEP},
        {"monte-carlo", required_argument, NULL, OPTION_MONTE_CARLO},
        {"vary", required_argument, NULL, OPTION_VARY},
        {"seed", required_argument, NULL, OPTION_SEED},
        {"sensitivity", no_argument, NULL, OPTION_SENSITIVITY},
        {"help", no_argument, NULL, 'h'},
        {0},
};

enum { LIST_MAX = 256, HISTORY_MAX = 10000000 };

/* The next word of a list with commas, from *list on; false at its end. */
static bool next_word(const char **list, char word[LIST_MAX])
{
	size_t length = strcspn(*list, ",");

	if (**list == '\0')
		return false;
	snprintf(word, LIST_MAX, "%.*s", (int)(length < LIST_MAX ? length : LIST_MAX - 1), *list);
	*list += length + ((*list)[length] == ',');
	return true;
}

static int parse_ask(struct model_options *options, const char *list)
{
	char word[LIST_MAX];

	while (next_word(&list, word)) {
		enum model_question question;

		if (model_question_parse(word, &question) != 0)
			return command_usage(
			        "model", "--ask has '%s', expected plate, axes, box, lag, s2 or direction",
			        word);
		options->asked |= question;
	}
	return COMMAND_DONE;
}

static int parse_refine(struct model_options *options, const char *list)
{
	char word[LIST_MAX];

	options->refinements = 0;
	if (strcmp(list, "none") == 0)
		return COMMAND_DONE;
	while (next_word(&list, word)) {
		enum model_refinement refinement;

		if (strcmp(word, "none") == 0)
			return command_usage("model", "--refine has none among others, expected it alone");
		if (model_refinement_parse(word, &refinement) != 0)
			return command_usage(
			        "model", "--refine has '%s', expected stiffness, wedge, grip, mounts or none",
			        word);
		options->refinements |= refinement;
	}
	return COMMAND_DONE;
}

static int parse_key(const char *option, const char *text, size_t length, struct vary_key *key)
{
	char name[LIST_MAX];

	snprintf(name, sizeof(name), "%.*s", (int)(length < LIST_MAX ? length : LIST_MAX - 1), text);
	if (vary_find(name, key) != 0)
		return command_usage(
		        "model",
		        "--%s: no key '%s', expected section.key of a scene, angle, height, mass, "
		        "contact-time, restitution, cube, stiffness or damping",
		        option, name);
	return COMMAND_DONE;
}

static int parse_sweep(struct ensemble *ensemble, const char *text)
{
	struct ensemble_axis *axis = &ensemble->axis[ensemble->axes];
	size_t length = strcspn(text, "=");
	double to;
	char end;
	int code = parse_key("sweep", text, length, &axis->key);

	if (code != COMMAND_DONE)
		return code;
	if (text[length] != '=' ||
	    sscanf(text + length + 1, "%lf:%lf:%lf%c", &axis->from, &to, &axis->step, &end) != 3 ||
	    !(axis->step > 0.0 && to >= axis->from) || !isfinite(axis->step))
		return command_usage("model",
		                     "--sweep is '%s', expected KEY=FROM:TO:STEP with a step above 0", text);
	if (!(axis->from >= axis->key.min && to <= axis->key.max))
		return command_usage("model", "--sweep is '%s', expected %s from %g to %g", text,
		                     axis->key.key, axis->key.min, axis->key.max);
	if ((to - axis->from) / axis->step > ENSEMBLE_POINTS_MAX)
		return command_usage("model", "--sweep is '%s', expected %d points at most", text,
		                     ENSEMBLE_POINTS_MAX);
	axis->count = (size_t)((to - axis->from) / axis->step * (1.0 + 1e-12) + 1e-9) + 1;
	ensemble->axes++;
	return COMMAND_DONE;
}

/* KEY=SD or KEY=SD% */
static int parse_uncertain(struct ensemble *ensemble, const char *word)
{
	struct ensemble_axis *axis = &ensemble->axis[ensemble->axes];
	size_t length = strcspn(word, "=");
	char *end = NULL;
	int code = parse_key("vary", word, length, &axis->key);

	if (code != COMMAND_DONE)
		return code;
	axis->sd = word[length] == '=' ? strtod(word + length + 1, &end) : -1.0;
	if (end && *end == '%') {
		axis->sd *= 0.01 * fabs(vary_get(ensemble->scene, &axis->key));
		end++;
	}
	if (!end || end == word + length + 1 || *end != '\0' || !(axis->sd >= 0.0) || !isfinite(axis->sd))
		return command_usage("model", "--vary has '%s', expected KEY=SD or KEY=SD%%", word);
	ensemble->axes++;
	return COMMAND_DONE;
}

static int parse_vary(struct ensemble *ensemble, const char *list)
{
	char word[LIST_MAX];
	int code = COMMAND_DONE;

	while (code == COMMAND_DONE && next_word(&list, word)) {
		if (ensemble->axes == ENSEMBLE_KEYS_MAX)
			return command_usage("model", "--vary has too many keys, expected %d at most",
			                     ENSEMBLE_KEYS_MAX);
		code = parse_uncertain(ensemble, word);
	}
	return code;
}

static int parse_number(struct model_arguments *a, int option, const char *text)
{
	double percent;
	int code;

	switch (option) {
	case OPTION_ANGLE:
		return command_angle("model", text, &a->angle_deg);
	case OPTION_STEP:
		a->of_history = "--step";
		return command_number("model", "step", text, 0.001, 1e6, &a->step_us);
	case OPTION_SPAN:
		a->of_history = "--span";
		return command_number("model", "span", text, 0.001, 1e6, &a->span_ms);
	case OPTION_MONTE_CARLO:
		return command_number("model", "monte-carlo", text, 2, 1e6, &a->draws);
	case OPTION_SEED:
		return command_number("model", "seed", text, 0, 1e9, &a->seed);
	default:
		code = command_number("model", "tolerance", text, 1e-6, 100, &percent);
		if (code == COMMAND_DONE)
			a->ensemble.options.accuracy = percent / 100.0;
		return code;
	}
}

static int parse_one(struct model_arguments *a, int option, const char *unknown)
{
	switch (option) {
	case OPTION_SCENE:
		a->scene_file = optarg;
		return COMMAND_DONE;
	case OPTION_FIDELITY:
		if (model_fidelity_parse(optarg, &a->ensemble.fidelity) == 0)
			return COMMAND_DONE;
		return command_usage(
		        "model", "--fidelity is '%s', expected auto, paper, steady, sdof, coupled or planar",
		        optarg);
	case OPTION_ASK:
		return parse_ask(&a->ensemble.options, optarg);
	case OPTION_REFINE:
		return parse_refine(&a->ensemble.options, optarg);
	case OPTION_JSON:
		a->json = true;
		return COMMAND_DONE;
	case OPTION_HISTORY:
		a->history = optarg;
		return COMMAND_DONE;
	case OPTION_SWEEP:
		if (a->ensemble.axes == ENSEMBLE_KEYS_MAX)
			return command_usage("model", "--sweep is given too often, expected %d at most",
			                     ENSEMBLE_KEYS_MAX);
		return parse_sweep(&a->ensemble, optarg);
	case OPTION_VARY:
		a->vary = optarg;
		return COMMAND_DONE;
	case OPTION_SENSITIVITY:
		a->sensitivity = true;
		return COMMAND_DONE;
	case OPTION_ANGLE:
	case OPTION_STEP:
	case OPTION_SPAN:
	case OPTION_MONTE_CARLO:
	case OPTION_SEED:
	case OPTION_TOLERANCE:
		return parse_number(a, option, optarg);
	default:
		return command_option("model", unknown);
	}
}

/* What does not go together. */
static int check(const struct model_arguments *a, int rest)
{
	int tasks = (a->ensemble.axes > 0) + (a->draws > 0) + a->sensitivity + (a->history != NULL);

	if (rest > 0)
		return command_usage("model", "%d words too many, expected options only", rest);
	if (!a->scene_file)
		return command_usage("model", "no scene, expected --scene FILE");
	if (tasks > 1)
		return command_usage("model",
		                     "expected one of --sweep, --monte-carlo, --sensitivity and --history");
	if (command_is_input("model", a->history, a->scene_file))
		return COMMAND_USAGE;
	if (a->of_history != NULL && a->history == NULL)
		return command_usage("model", "%s needs --history FILE", a->of_history);
	if (a->ensemble.axes > 0 && ensemble_points(&a->ensemble) == 0)
		return command_usage("model", "--sweep makes too many points, expected %d at most",
		                     ENSEMBLE_POINTS_MAX);
	if ((a->draws > 0) != (a->vary != NULL))
		return command_usage("model", "--monte-carlo and --vary need each other");
	if (!isnan(a->seed) && a->draws == 0)
		return command_usage("model", "--seed needs --monte-carlo N");
	if (a->span_ms / a->step_us * 1e3 > HISTORY_MAX)
		return command_usage("model",
		                     "--span over --step makes too many samples, expected %d at most",
		                     HISTORY_MAX);
	return COMMAND_DONE;
}

static int parse(struct model_arguments *a, int argc, char **argv)
{
	int option, code = COMMAND_DONE;

	opterr = 0;
	while (code == COMMAND_DONE && (option = getopt_long(argc, argv, "h", long_options, NULL)) != -1) {
		if (option == 'h') {
			a->help = true;
			return COMMAND_DONE;
		}
		code = parse_one(a, option, argv[optind - 1]);
	}
	return code == COMMAND_DONE ? check(a, argc - optind) : code;
}

int command_model(int argc, char **argv)
{
	struct model_arguments a = {.angle_deg = NAN, .step_us = 10, .span_ms = 12, .seed = NAN};
	struct scene scene;
	int code;

	a.ensemble.fidelity = MODEL_AUTO;
	a.ensemble.options = model_defaults;
	code = parse(&a, argc, argv);
	if (code != COMMAND_DONE)
		return code;
	if (a.help) {
		fputs(help, stdout);
		return COMMAND_DONE;
	}
	code = evaluate_read_scene(&scene, a.scene_file, a.angle_deg);
	if (code != COMMAND_DONE)
		return code;
	a.ensemble.scene = &scene;
	a.ensemble.seed = isnan(a.seed) ? 1 : (unsigned long)a.seed;
	if (a.vary)
		code = parse_vary(&a.ensemble, a.vary);
	return code == COMMAND_DONE ? model_answer(&a) : code;
}
