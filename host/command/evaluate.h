/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_COMMAND_EVALUATE_H
#define DT_HOST_COMMAND_EVALUATE_H
/*
 * What `run` and `analyze` do with a record once they have one: estimate, predict, report. One road for
 * live drops, replayed ones and files.
 */
#include <stdbool.h>

#include "common/base/option.h"
#include "common/scenes/scene.h"
#include "host/estimate/estimate.h"
#include "host/fit/fit.h"
#include "host/record/record.h"
#include "host/report/report.h"
#include "host/result/repeats.h"

struct evaluate_options {
	const struct scene *scene;   /* NULL: no model */
	const char *chain;           /* files of the sensors, in place of the scene's; NULL: those */
	double lowpass_hz;           /* 0 = raw */
	double iepe_time_constant_s; /* 0 = not undone, NAN = the scene's */
	unsigned cfc;                /* channel frequency class; 0 = none */
	enum estimate_family family;
	double tolerance;                /* of estimate_options */
	struct events_options events;    /* how shocks are found */
	bool show_events;                /* shocks and free falls in the table too */
	struct band_options band;        /* its curve NULL: none */
	const char *limits;              /* a preset's name, in place of the scene's limits; NULL: those */
	bool json;                       /* JSON to stdout instead of the table */
	const char *html;                /* page to write; NULL: none */
	const struct language *language; /* of the page; NULL: English */
	const char *json_file;           /* JSON beside it; NULL: none */
	bool strict;                     /* a flag is a failure */
	bool simulated;                  /* the page says so */
	bool unattended;                 /* JSON says so */
	struct repeats *repeats;         /* what is found goes there, and nothing is printed; NULL: printed */
};

/* The row of --limits; at: a const char * of the struct in, for evaluate_options' limits. The word list is
 * taken, too; what prints no presets refuses it with EVALUATE_NO_LIST. */
#define EVALUATE_LIMITS_ROW(in, at)                                                            \
	OPTION_TAKEN("limits", "PRESET", in, at, evaluate_take_limits,                         \
	             "hold the drop against a test standard's pulse, in place of the scene's " \
	             "[limits]; 'list' tells them")
#define EVALUATE_NO_LIST "--limits list: 'droptower analyze --limits list' tells them"

option_take evaluate_take_limits;
bool evaluate_is_list(const char *limits);

/* A record with all that is found of it. */
struct evaluated {
	struct report report; /* points into what follows */
	struct analysis analysis;
	struct model_prediction prediction, below;
	struct events events;
	struct free_falls falls;
	struct band band;
	struct verdict verdict;
	char refused[FIT_MESSAGE_MAX]; /* what analysis.motion.refused says */
	struct sensors sensors;
	struct record corrected; /* by them */
	struct budget budget;
};

enum { EVALUATE_TOLD = 1 };

/* Estimates and predicts; e stays where it is until evaluate_close, and so do record and scene. Why there is
 * no prediction is printed. What is estimated and reported is the record as its sensors' files put it right,
 * where there are any. 0, DT_E_*, or EVALUATE_TOLD when what was wrong was printed: sensors' files, cfc or
 * band. */
DT_MUST_USE int evaluate_open(struct evaluated *e, const struct record *record,
                              const struct evaluate_options *options);
void evaluate_close(struct evaluated *e);

/* What a record that was just made does not know of itself: when, by whom, of what, measured by which
 * sensors. */
int evaluate_sign(struct record *record, const struct evaluate_options *options, const char *operator_name);

/* The record as the files of chain put its readings right; NULL or "": as it is. 0 or a COMMAND_* code,
 * errors printed. */
int evaluate_put_right(struct record *record, const char *chain);

/* All that was found, for the table of quantities. */
struct result evaluate_said(struct evaluated *e);

/* Prints and writes what was asked for. Returns a COMMAND_* exit code; errors were printed. */
int evaluate(struct record *record, const struct evaluate_options *options);

/* The JSON of a record as `analyze --scene --chain` gives it, to be freed, with e open; NULL if it cannot be
 * analysed. scene and chain may be NULL. */
char *evaluate_json(struct evaluated *e, const struct record *record, const struct scene *scene,
                    const char *chain);

/* A drop of the tower as a fit wants it; borrows record's samples. NULL, or the channel that is missing. */
const char *evaluate_fit_drop(const struct record *record, double angle_deg, double height_m,
                              struct fit_drop *drop);

/* Whether the files that list names can be used. 0 or a COMMAND_* code, errors printed. */
int evaluate_check_chain(const char *list);

/* Those of the options, or of their scene; "": none. */
const char *evaluate_chain(const struct evaluate_options *options);

/* Reads a scene and lays angle_deg over it when that is not NAN. 0 or a COMMAND_* code, errors printed. */
int evaluate_read_scene(struct scene *scene, const char *file, double angle_deg);

/* Whether a tower can let it fall; where names it. 0 or COMMAND_INPUT, the error printed. */
int evaluate_check_tower(const struct scene *scene, const char *where);

#endif
