/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_MODEL_ENSEMBLE_H
#define DT_HOST_MODEL_ENSEMBLE_H
/*
 * Many predictions: a grid of scenes, scenes drawn at random about one, and what each key of a scene does.
 *
 * Points are independent and each is a function of its number alone, so that any number of threads gives the
 * same. Memory is the caller's, except where said. Units by key: "_g", "_s", "_deg".
 */
#include "host/model/model.h"
#include "host/model/vary.h"

/* What a prediction says, in the order that tables have it. */
struct ensemble_output {
	const char *key; /* "s1_resultant_g" */
	unsigned asked;  /* the question it answers */
	size_t offset;   /* in struct model_prediction */
};

enum { ENSEMBLE_OUTPUTS = 12 };
extern const struct ensemble_output ensemble_outputs[ENSEMBLE_OUTPUTS];

/* Those that answer what is asked, 0: everything. Returns how many. */
size_t ensemble_select(unsigned asked, const struct ensemble_output *outputs[ENSEMBLE_OUTPUTS]);
double ensemble_value(const struct model_prediction *prediction, const struct ensemble_output *output);

enum { ENSEMBLE_KEYS_MAX = 8 };

/* One axis of a grid, or one uncertain input. */
struct ensemble_axis {
	struct vary_key key;
	double from, to, step; /* grid; a range has no step */
	size_t count;
	double sd; /* random: standard deviation */
};

struct ensemble {
	const struct scene *scene;
	enum model_fidelity fidelity;
	struct model_options options;
	struct ensemble_axis axis[ENSEMBLE_KEYS_MAX];
	size_t axes;
	unsigned long seed;
};

/* Points of the grid; 0 when there are more than ENSEMBLE_POINTS_MAX. The last axis runs fastest. */
#define ENSEMBLE_POINTS_MAX 10000000
size_t ensemble_points(const struct ensemble *ensemble);

/* The scene with the axes' keys at value[axes], in whatever order they move each other. */
void ensemble_set(const struct ensemble *ensemble, const double value[], struct scene *scene);

/* The scene of a point of the grid, or of a random draw, with the varied values in value[axes]. */
void ensemble_grid_scene(const struct ensemble *ensemble, size_t point, struct scene *scene, double value[]);
/* (a scene with [fit]: its parameters are drawn from their covariance first) */
void ensemble_random_scene(const struct ensemble *ensemble, size_t point, struct scene *scene,
                           double value[]);

/* Calls work(context, first, count, thread) for all points, in blocks, on all cores; `done`, where there is
 * one, follows for each block, in order, on the caller's thread, and ends all with a value other than 0,
 * which is returned. */
enum { ENSEMBLE_BLOCK = 8192, ENSEMBLE_THREADS_MAX = 16 };
DT_MUST_USE int ensemble_run(size_t points,
                             void (*work)(void *context, size_t first, size_t count, int thread),
                             int (*done)(void *context, size_t first, size_t count, int thread),
                             void *context);

/* Distribution of one output over random draws. */
struct ensemble_spread {
	double mean, sd;
	double low, high; /* 95 % of the draws are between */
	size_t without;   /* draws that have no such value, those that make no drop among them */
};

/* spread[i] of the i-th output selected by options.asked; *failed: draws that make no drop, left out and
 * counted in each. 0, DT_E_MEMORY, or DT_E_EMPTY when fewer than two are left. */
DT_MUST_USE int ensemble_monte_carlo(const struct ensemble *ensemble, size_t draws,
                                     struct ensemble_spread spread[ENSEMBLE_OUTPUTS], size_t *failed);

/* Standard uncertainty of each of ensemble_outputs by what [fit] of the scene says of its parameters and by
 * the axes' SD, to the first order; NAN where a side makes no drop. False: the scene has no [fit]. */
bool ensemble_bars(const struct ensemble *ensemble, double u[ENSEMBLE_OUTPUTS]);
bool ensemble_fitted(const struct scene *scene);

/* Percent of each output per percent of a key (per degree of an angle), by central differences; NAN where a
 * side makes no drop. False: the scene's value is 0, or nothing depends on the key. */
bool ensemble_sensitivity(const struct ensemble *ensemble, const struct vary_key *key,
                          double percent[ENSEMBLE_OUTPUTS]);

#endif
