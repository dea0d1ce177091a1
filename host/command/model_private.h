/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_COMMAND_MODEL_PRIVATE_H
#define DT_HOST_COMMAND_MODEL_PRIVATE_H
/*
 * What the files of `droptower model` share: model.c has the options, model_answer.c what is done with them.
 */
#include <stdbool.h>
#include <stdint.h>

#include "host/model/ensemble.h"
#include "host/report/design.h"

struct model_arguments {
	const char *scene_file, *history;
	double angle_deg, step_us, span_ms; /* of the history: 0: not said */
	unsigned draws;
	uint64_t seed;
	struct ensemble ensemble; /* scene is set once it is read */
	const char *vary, *design_keys;
	struct design design; /* its ensemble's scene and axes are set once the scene is read */
	bool json, csv, sensitivity;
};

/* Prints what was asked for. A COMMAND_* exit code; what is wrong was printed. */
int model_answer(const struct model_arguments *arguments);

#endif
