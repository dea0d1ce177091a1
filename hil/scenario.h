/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HIL_SCENARIO_H
#define DT_HIL_SCENARIO_H
/*
 * A scenario: one run of the bench with everything that happens in it and everything that must come of it,
 * read from an .ini file (hil/scenarios, whose README.md is the manual). Numbers stand in scenario.def.
 *
 * Plain data, no heap; the text of names lives in the struct.
 */
#include <stdbool.h>
#include <stdint.h>

#include "common/error.h"
#include "common/scenes/scene.h"
#include "common/wire.h"
#include "hil/event.h"

enum {
	SCENARIO_MESSAGE_MAX = SETTINGS_MESSAGE_MAX,
	SCENARIO_LIST_MAX = 64,
	SCENARIO_OVERRIDES_MAX = 16,
	SCENARIO_PARAMETERS_MAX = WIRE_PARAMETERS,
};

enum scenario_result {
#define SCENARIO_RESULT(name, min, max, doc) SCENARIO_##name,
#include "hil/scenario.def"
	SCENARIO_RESULTS
};

/* Limits, both included; NAN: nothing is expected. */
struct scenario_range {
	double min, max;
};

struct scenario_list {
	bool given;
	unsigned count;
	int32_t item[SCENARIO_LIST_MAX];
};

struct scenario {
	char title[128];
	char scene_file[256];
#define SCENARIO_NUMBER(section, key, min, max, initial, doc) double section##_##key;
#include "hil/scenario.def"

	unsigned override_count; /* of the scene's values */
	struct scenario_override {
		size_t offset; /* in struct scene */
		double value;
	} override[SCENARIO_OVERRIDES_MAX];
	unsigned parameter_count; /* the operator writes before it arms, in this order */
	struct scenario_parameter {
		uint16_t index;
		uint32_t value;
	} parameter[SCENARIO_PARAMETERS_MAX];
	unsigned event_count;
	struct event event[EVENTS_MAX];

	struct scenario_list end;     /* one state, the last */
	struct scenario_list fault;   /* one fault, latched at the end */
	struct scenario_list emcy;    /* faults in the order they were told, NONE for a clearing */
	struct scenario_list path;    /* states in order */
	struct scenario_list checks;  /* told as not green since it first was READY, any order */
	struct scenario_list marks;   /* bits of the last capture end, any order */
	struct scenario_list replies; /* state told in each reply, in order */
	struct scenario_list refused; /* DT_E_* of replies in order */
	struct scenario_list aborts;  /* SDO abort codes in order */
	struct scenario_range result[SCENARIO_RESULTS];
	struct scenario_range counter[WIRE_COUNTERS]; /* 0 where the file says nothing */
};

/* Reads and checks file. 0, or DT_E_* with "FILE:LINE: what is wrong, what was expected" in message. */
DT_MUST_USE int scenario_read(struct scenario *scenario, const char *file,
                              char message[SCENARIO_MESSAGE_MAX]);

/* The scene it drops, its own values put in. 0, or DT_E_* and message. */
DT_MUST_USE int scenario_scene(const struct scenario *scenario, struct scene *scene,
                               char message[SCENE_MESSAGE_MAX]);

const char *scenario_result_name(unsigned result);

/* "TOKEN" of DT_E_TOKEN; "?" for a number that is no error. */
const char *scenario_error_name(int error);

#endif
