/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * `droptower model`: its options.
 */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/base/number.h"
#include "host/command/command.h"
#include "host/command/evaluate.h"
#include "host/command/model_private.h"

static const uint64_t NO_SEED = UINT64_MAX;

enum { LIST_MAX = 256, HISTORY_MAX = 10000000 };

/* The next word of a list with commas, from *list on; false at its end. */
static bool model_next_word(const char **list, char word[LIST_MAX])
{
	size_t length = strcspn(*list, ",");

	if (**list == '\0')
		return false;
	snprintf(word, LIST_MAX, "%.*s", (int)(length < LIST_MAX ? length : LIST_MAX - 1), *list);
	*list += length + ((*list)[length] == ',');
	return true;
}

static int take_ask(const struct option_table *table, const char *name, const char *list, void *into)
{
	struct model_options *asking = into;
	char word[LIST_MAX];

	while (model_next_word(&list, word)) {
		enum model_question question;

		if (model_question_parse(word, &question) != 0)
			return option_wrong(table,
			                    "--%s has '%s', expected plate, axes, box, lag, s2 or direction",
			                    name, word);
		asking->asked |= question;
	}
	return OPTIONS_READ;
}

static int take_refine(const struct option_table *table, const char *name, const char *list, void *into)
{
	struct model_options *refined = into;
	char word[LIST_MAX];

	refined->refinements = 0;
	if (strcmp(list, "none") == 0)
		return OPTIONS_READ;
	while (model_next_word(&list, word)) {
		enum model_refinement refinement;

		if (strcmp(word, "none") == 0)
			return option_wrong(table, "--%s has none among others, expected it alone", name);
		if (model_refinement_parse(word, &refinement) != 0)
			return option_wrong(table,
			                    "--%s has '%s', expected stiffness, wedge, grip, mounts or none",
			                    name, word);
		refined->refinements |= refinement;
	}
	return OPTIONS_READ;
}

static int take_fidelity(const struct option_table *table, const char *name, const char *text, void *fidelity)
{
	if (model_fidelity_parse(text, fidelity) == 0)
		return OPTIONS_READ;
	return option_wrong(table, "--%s is '%s', expected auto, paper, steady, sdof, coupled or planar",
	                    name, text);
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
	char end;
	int code = parse_key("sweep", text, length, &axis->key);

	if (code != COMMAND_DONE)
		return code;
	if (text[length] != '=' ||
	    sscanf(text + length + 1, "%lf:%lf:%lf%c", &axis->from, &axis->to, &axis->step, &end) != 3 ||
	    !(axis->step > 0.0 && axis->to >= axis->from) || !isfinite(axis->step))
		return command_usage("model",
		                     "--sweep is '%s', expected KEY=FROM:TO:STEP with a step above 0", text);
	if (!(axis->from >= axis->key.min && axis->to <= axis->key.max))
		return command_usage("model", "--sweep is '%s', expected %s from %g to %g", text,
		                     axis->key.key, axis->key.min, axis->key.max);
	if ((axis->to - axis->from) / axis->step > ENSEMBLE_POINTS_MAX)
		return command_usage("model", "--sweep is '%s', expected %d points at most", text,
		                     ENSEMBLE_POINTS_MAX);
	axis->count = (size_t)((axis->to - axis->from) / axis->step * (1.0 + 1e-12) + 1e-9) + 1;
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

	while (code == COMMAND_DONE && model_next_word(&list, word)) {
		if (ensemble->axes == ENSEMBLE_KEYS_MAX)
			return command_usage("model", "--vary has too many keys, expected %d at most",
			                     ENSEMBLE_KEYS_MAX);
		code = parse_uncertain(ensemble, word);
	}
	return code;
}

static int take_sweep(const struct option_table *table, const char *name, const char *text, void *into)
{
	struct ensemble *ensemble = into;

	if (ensemble->axes == ENSEMBLE_KEYS_MAX)
		return option_wrong(table, "--%s is given too often, expected %d at most", name,
		                    ENSEMBLE_KEYS_MAX);
	return parse_sweep(ensemble, text) == COMMAND_DONE ? OPTIONS_READ : OPTIONS_WRONG;
}

static int take_limit(const struct option_table *table, const char *name, const char *text, void *into)
{
	struct design *design = into;
	struct design_limit *limit = &design->limit[design->limits];
	size_t length = strcspn(text, "=");
	char quantity[LIST_MAX];

	if (design->limits == DESIGN_LIMITS_MAX)
		return option_wrong(table, "--%s is given too often, expected %d at most", name,
		                    DESIGN_LIMITS_MAX);
	snprintf(quantity, sizeof(quantity), "%.*s", (int)(length < LIST_MAX ? length : LIST_MAX - 1), text);
	if (design_quantity(quantity, &limit->quantity) != 0)
		return option_wrong(table,
		                    "--%s: no quantity '%s', expected one of --json's predicted, such as "
		                    "s1_resultant_g or plate_travel_m",
		                    name, quantity);
	if (text[length] != '=' || !number_read(text + length + 1, DBL_TRUE_MIN, DBL_MAX, &limit->value))
		return option_wrong(table, "--%s is '%s', expected QUANTITY=VALUE above 0", name, text);
	design->limits++;
	return OPTIONS_READ;
}

/* After the scene is read: its values are the middles. */
static int parse_design(struct design *design, const struct ensemble *ensemble, const char *list)
{
	char word[LIST_MAX];

	design->ensemble = *ensemble;
	if (design->limits == 0)
		return command_usage("model", "--design needs --limit QUANTITY=VALUE");
	while (model_next_word(&list, word)) {
		struct vary_key key;
		int code = parse_key("design", word, strlen(word), &key);

		if (code != COMMAND_DONE)
			return code;
		switch (design_add_key(design, &key)) {
		case 0:
			break;
		case DT_E_RANGE:
			return command_usage("model", "--design has too many keys, expected %d at most",
			                     DESIGN_KEYS_MAX);
		case DT_E_STATE:
			return command_usage("model", "--design has %s twice", key.name);
		default:
			return command_usage("model", "--design: %s of the scene is not above 0", key.name);
		}
	}
	return COMMAND_DONE;
}

static const struct option_row rows[] = {
        OPTION_TEXT("scene", "FILE", struct model_arguments, scene_file, "what falls"),
        OPTION_TAKEN("angle", "DEG", struct model_arguments, angle_deg, command_angle,
                     "instead of the scene's"),
        OPTION_TAKEN("fidelity", "NAME", struct model_arguments, ensemble.fidelity, take_fidelity,
                     "auto: sdof, coupled or planar, the least that serves; or one of these; or the study's, "
                     "paper or steady, for comparison; default: auto"),
        OPTION_PERCENT("tolerance", struct model_arguments, ensemble.options.accuracy,
                       "auto: how far the answer may be from planar's (5)"),
        OPTION_NUMBER("lag-tolerance", "US", struct model_arguments, ensemble.options.lag_accuracy_us, 0.1,
                      1e6, "the same of a lag (50)"),
        OPTION_TAKEN("ask", "LIST", struct model_arguments, ensemble.options, take_ask,
                     "plate, axes, box, lag, s2, direction: only these; default: everything"),
        OPTION_TAKEN("refine", "LIST", struct model_arguments, ensemble.options, take_refine,
                     "stiffness, wedge, grip, mounts or none, instead of the rung's own"),
        OPTION_FLAG("json", struct model_arguments, json,
                    "one JSON object on standard output instead of the table"),
        OPTION_TEXT("history", "FILE", struct model_arguments, history,
                    "write time histories as CSV, from 2 ms before the touch"),
        OPTION_NUMBER("step", "US", struct model_arguments, step_us, 0.001, 1e6,
                      "step of the histories (10)"),
        OPTION_NUMBER("span", "MS", struct model_arguments, span_ms, 0.001, 1e6, "how far they go (12)"),
        OPTION_TAKEN("sweep", "KEY=FROM:TO:STEP", struct model_arguments, ensemble, take_sweep,
                     "a row for each value; several make a grid"),
        OPTION_UNSIGNED("monte-carlo", "N", struct model_arguments, draws, 2, 1e6,
                        "N drops with the inputs of --vary, and what [fit] of the scene says of its "
                        "parameters, at random: mean, SD, 95 % bands"),
        OPTION_TEXT("vary", "KEY=SD,...", struct model_arguments, vary,
                    "their standard deviations; SD% is percent of the scene's value"),
        OPTION_UINT64("seed", "S", struct model_arguments, seed, 0, 1e9,
                      "another seed makes other drops (1)"),
        OPTION_TEXT(
                "design", "KEY,...", struct model_arguments, design_keys,
                "which values of up to three keys, from a quarter to four times the scene's, keep the "
                "limits of --limit: the best, those that none beats, and how often they hold under [fit]"),
        OPTION_TAKEN("limit", "QUANTITY=VALUE", struct model_arguments, design, take_limit,
                     "of --design: s1_resultant_g=300, plate_travel_m=0.004, ...; several at once"),
        OPTION_FLAG("csv", struct model_arguments, csv, "--design's table as CSV"),
        OPTION_FLAG("sensitivity", struct model_arguments, sensitivity,
                    "percent for a percent (angles: for a degree) of every key that matters"),
};

static const struct option_table known_options = {
        .program = "droptower",
        .command = "model",
        .head = "usage: droptower model --scene FILE [OPTIONS]\n"
                "\n"
                "What a drop of the scene should look like, by the least model that answers.\n"
                "\n",
        OPTION_ROWS(rows),
        .tail = "\n"
                "KEY is section.key of a scene file, alone, or with what depends on it: angle, height "
                "(contact "
                "time),\n"
                "mass, contact-time (contact stiffness), restitution, cube (mounts' stiffness and dampers),\n"
                "stiffness, damping (dampers).\n",
};

/* What does not go together. */
static int model_check(struct model_arguments *a)
{
	int tasks = (a->ensemble.axes > 0) + (a->draws > 0) + a->sensitivity + (a->history != NULL) +
	            (a->design_keys != NULL);

	if (!a->scene_file)
		return command_usage("model", "no scene, expected --scene FILE");
	if (tasks > 1)
		return command_usage(
		        "model",
		        "expected one of --sweep, --monte-carlo, --design, --sensitivity and --history");
	if (!a->design_keys && (a->design.limits > 0 || a->csv))
		return command_usage("model", "--%s needs --design KEY", a->csv ? "csv" : "limit");
	if (a->csv && a->json)
		return command_usage("model", "expected one of --json and --csv");
	if (command_is_input("model", a->history, a->scene_file))
		return COMMAND_USAGE;
	if (a->history == NULL && (a->step_us > 0 || a->span_ms > 0))
		return command_usage("model", "--%s needs --history FILE", a->step_us > 0 ? "step" : "span");
	if (a->ensemble.axes > 0 && ensemble_points(&a->ensemble) == 0)
		return command_usage("model", "--sweep makes too many points, expected %d at most",
		                     ENSEMBLE_POINTS_MAX);
	if (a->vary && a->draws == 0)
		return command_usage("model", "--vary needs --monte-carlo N");
	if (a->seed != NO_SEED && a->draws == 0)
		return command_usage("model", "--seed needs --monte-carlo N");
	a->step_us = a->step_us > 0 ? a->step_us : 10;
	a->span_ms = a->span_ms > 0 ? a->span_ms : 12;
	if (a->span_ms / a->step_us * 1e3 > HISTORY_MAX)
		return command_usage("model",
		                     "--span over --step makes too many samples, expected %d at most",
		                     HISTORY_MAX);
	return COMMAND_DONE;
}

int command_model(int argc, char **argv)
{
	struct model_arguments a = {.angle_deg = NAN, .seed = NO_SEED};
	struct scene scene;
	int code;

	a.ensemble.fidelity = MODEL_AUTO;
	a.ensemble.options = model_defaults;
	code = option_read(&known_options, &a, argc, argv);
	if (code != OPTIONS_READ)
		return code;
	code = model_check(&a);
	if (code == COMMAND_DONE)
		code = evaluate_read_scene(&scene, a.scene_file, a.angle_deg);
	if (code != COMMAND_DONE)
		return code;
	a.ensemble.scene = &scene;
	a.ensemble.seed = a.seed != NO_SEED ? a.seed : 1;
	if (a.design_keys)
		code = parse_design(&a.design, &a.ensemble, a.design_keys);
	else if (a.vary)
		code = parse_vary(&a.ensemble, a.vary);
	else if (a.draws > 0 && !ensemble_fitted(&scene))
		code = command_usage(
		        "model", "--monte-carlo needs --vary, or a scene with [fit] or of contact 'corner'");
	return code == COMMAND_DONE ? model_answer(&a) : code;
}
