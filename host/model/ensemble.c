/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/model/ensemble.h"

#include <math.h>
#include <pthread.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/units.h"
#include "host/estimate/cholesky.h"

/* A draw outside a key's range is drawn again so many times, then put at the limit. */
#define DRAWS_MAX 20

/* Central differences go this far to each side. */
#define SENSITIVITY_SHARE 0.005
#define SENSITIVITY_DEG 0.25
#define SENSITIVITY_TOLERANCE 1e-8
#define SENSITIVITY_NONE 1e-6 /* percent per percent: an integrator's noise */

#define AT(member) offsetof(struct model_prediction, member)
const struct ensemble_output ensemble_outputs[ENSEMBLE_OUTPUTS] = {
        {"s1_resultant_g", MODEL_ASK_PLATE, AT(resultant[0].value_g)},
        {"s1_time_s", MODEL_ASK_PLATE, AT(resultant[0].time_s)},
        {"s1x_peak_g", MODEL_ASK_AXES, AT(peak[MODEL_S1X].value_g)},
        {"s1y_peak_g", MODEL_ASK_AXES, AT(peak[MODEL_S1Y].value_g)},
        {"box_peak_g", MODEL_ASK_BOX, AT(box.value_g)},
        {"lag_s", MODEL_ASK_LAG, AT(lag_s)},
        {"s2x_peak_g", MODEL_ASK_S2, AT(peak[MODEL_S2X].value_g)},
        {"s2y_peak_g", MODEL_ASK_S2, AT(peak[MODEL_S2Y].value_g)},
        {"s2_resultant_g", MODEL_ASK_S2, AT(resultant[1].value_g)},
        {"s1_direction_deg", MODEL_ASK_DIRECTION, AT(direction_deg[0])},
        {"s2_direction_deg", MODEL_ASK_DIRECTION, AT(direction_deg[1])},
        {"plate_frequency_hz", 0, AT(plate_frequency_hz)},
};

size_t ensemble_select(unsigned asked, const struct ensemble_output *outputs[ENSEMBLE_OUTPUTS])
{
	size_t count = 0;

	for (size_t i = 0; i < ENSEMBLE_OUTPUTS; i++)
		if (!asked || (ensemble_outputs[i].asked & asked))
			outputs[count++] = &ensemble_outputs[i];
	return count;
}

double ensemble_value(const struct model_prediction *prediction, const struct ensemble_output *output)
{
	return *(const double *)(const void *)((const char *)prediction + output->offset);
}

size_t ensemble_points(const struct ensemble *e)
{
	size_t points = 1;

	for (size_t i = 0; i < e->axes; i++) {
		if (e->axis[i].count == 0 || e->axis[i].count > ENSEMBLE_POINTS_MAX / points)
			return 0;
		points *= e->axis[i].count;
	}
	return points;
}

void ensemble_set(const struct ensemble *e, const double value[], struct scene *scene)
{
	*scene = *e->scene;
	/* twice: a key may move one before it, and where it stays it moves none */
	for (size_t i = 0; i < 2 * e->axes; i++)
		vary_set(scene, &e->axis[i % e->axes].key, value[i % e->axes]);
}

void ensemble_grid_scene(const struct ensemble *e, size_t point, struct scene *scene, double value[])
{
	for (size_t i = e->axes; i-- > 0;) {
		const struct ensemble_axis *axis = &e->axis[i];

		value[i] = axis->from + (double)(point % axis->count) * axis->step;
		point /= axis->count;
	}
	ensemble_set(e, value, scene);
}

/* Vigna's splitmix64, 0 to 1, both excluded. */
static double uniform(uint64_t *state)
{
	uint64_t z = (*state += 0x9e3779b97f4a7c15u);

	z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
	z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
	return ((double)((z ^ (z >> 31)) >> 12) + 0.5) * 0x1p-52;
}

static double ensemble_normal(uint64_t *state)
{
	double radius = sqrt(-2.0 * log(uniform(state)));

	return radius * cos(2.0 * UNITS_PI * uniform(state));
}

bool ensemble_fitted(const struct scene *scene)
{
	for (int i = 0; i < SCENE_FITTED; i++)
		if (scene->fitted_u[i] > 0.0)
			return true;
	return false;
}

/* The digits of a scene file may leave correlations that no draws have, by so much. */
#define CORRELATION_DIGITS 1e-5

static void draw_fitted(struct scene *scene, uint64_t *state)
{
	double a[CHOLESKY_MAX][CHOLESKY_MAX], move[SCENE_FITTED] = {0.0}, z[SCENE_FITTED];
	struct cholesky factor;

	for (int i = 0; i < SCENE_FITTED; i++) {
		for (int j = 0; j < i; j++)
			a[i][j] = scene->fitted_correlation[i][j];
		a[i][i] = 1.0 + CORRELATION_DIGITS;
	}
	if (!cholesky_factor(&factor, SCENE_FITTED, a))
		return;
	for (int i = 0; i < SCENE_FITTED; i++) {
		z[i] = ensemble_normal(state) / sqrt(factor.inverse[i]);
		move[i] = z[i];
		for (int j = 0; j < i; j++)
			move[i] += factor.lower[i][j] * z[j];
		move[i] *= scene->fitted_u[i];
	}
	vary_fitted(scene, move);
}

void ensemble_random_scene(const struct ensemble *e, size_t point, struct scene *scene, double value[])
{
	uint64_t state = (uint64_t)e->seed * 0xd1342543de82ef95u + (uint64_t)point * 0x2545f4914f6cdd1du;

	*scene = *e->scene;
	if (ensemble_fitted(scene))
		draw_fitted(scene, &state);
	for (size_t i = 0; i < e->axes; i++) {
		const struct ensemble_axis *axis = &e->axis[i];
		double middle = vary_get(e->scene, &axis->key);

		for (int k = 0; k < DRAWS_MAX; k++) {
			value[i] = middle + axis->sd * ensemble_normal(&state);
			if (value[i] >= axis->key.min && value[i] <= axis->key.max)
				break;
		}
		value[i] = fmin(fmax(value[i], axis->key.min), axis->key.max);
		vary_set(scene, &axis->key, value[i]);
	}
}

/* ---- on all cores ---- */

struct job {
	pthread_t thread;
	void (*work)(void *context, size_t first, size_t count, int thread);
	void *context;
	size_t first, count;
	int number;
	bool started;
};

static void *work_of(void *of)
{
	struct job *job = of;

	job->work(job->context, job->first, job->count, job->number);
	return NULL;
}

int ensemble_run(size_t points, void (*work)(void *context, size_t first, size_t count, int thread),
                 int (*done)(void *context, size_t first, size_t count, int thread), void *context)
{
	long cores = sysconf(_SC_NPROCESSORS_ONLN);
	int threads = cores < 1 ? 1 : cores > ENSEMBLE_THREADS_MAX ? ENSEMBLE_THREADS_MAX : (int)cores;
	struct job jobs[ENSEMBLE_THREADS_MAX];
	int result = 0;

	for (size_t at = 0; at < points && result == 0;) {
		int busy = 0;

		for (; busy < threads && at < points; busy++) {
			size_t count = points - at < ENSEMBLE_BLOCK ? points - at : ENSEMBLE_BLOCK;

			jobs[busy] = (struct job){.work = work,
			                          .context = context,
			                          .first = at,
			                          .count = count,
			                          .number = busy};
			at += count;
			jobs[busy].started = busy > 0 && pthread_create(&jobs[busy].thread, NULL, work_of,
			                                                &jobs[busy]) == 0;
		}
		for (int i = 0; i < busy; i++) /* the first is this thread's own, and what found no thread */
			if (!jobs[i].started)
				work_of(&jobs[i]);
		for (int i = 0; i < busy; i++) {
			if (jobs[i].started)
				pthread_join(jobs[i].thread, NULL);
			if (result == 0 && done != NULL)
				result = done(context, jobs[i].first, jobs[i].count, i);
		}
	}
	return result;
}

/* ---- random draws ---- */

struct draws {
	const struct ensemble *ensemble;
	const struct ensemble_output *outputs[ENSEMBLE_OUTPUTS];
	size_t count, points;
	double *value; /* one row of points for each output; NAN: no drop */
};

static void ensemble_draw(void *context, size_t first, size_t count, int thread)
{
	struct draws *d = context;
	const struct ensemble *e = d->ensemble;

	(void)thread;
	for (size_t k = first; k < first + count; k++) {
		double varied[ENSEMBLE_KEYS_MAX];
		struct model_prediction p;
		struct scene scene;
		bool drops;

		ensemble_random_scene(e, k, &scene, varied);
		drops = model_solve(&scene, e->fidelity, &e->options, &p, NULL) == 0;
		for (size_t i = 0; i < d->count; i++)
			d->value[i * d->points + k] = drops ? ensemble_value(&p, d->outputs[i]) : (double)NAN;
	}
}

static int ascending(const void *a, const void *b)
{
	double x = *(const double *)a, y = *(const double *)b;

	return (x > y) - (x < y);
}

/* Sorts; NANs were taken out. */
static struct ensemble_spread ensemble_spread_of(double *value, size_t count)
{
	struct ensemble_spread s = {(double)NAN, (double)NAN, (double)NAN, (double)NAN, 0};
	double sum = 0.0, squares = 0.0;

	if (count < 2)
		return s;
	for (size_t k = 0; k < count; k++)
		sum += value[k];
	s.mean = sum / (double)count;
	for (size_t k = 0; k < count; k++)
		squares += (value[k] - s.mean) * (value[k] - s.mean);
	s.sd = sqrt(squares / (double)(count - 1));
	qsort(value, count, sizeof(*value), ascending);
	s.low = value[(size_t)(0.025 * (double)(count - 1) + 0.5)];
	s.high = value[(size_t)(0.975 * (double)(count - 1) + 0.5)];
	return s;
}

int ensemble_monte_carlo(const struct ensemble *e, size_t draws,
                         struct ensemble_spread spread[ENSEMBLE_OUTPUTS], size_t *failed)
{
	struct draws d = {.ensemble = e, .points = draws};
	size_t most = 0;
	int error;

	d.count = ensemble_select(e->options.asked, d.outputs);
	d.value = malloc((draws ? draws : 1) * d.count * sizeof(*d.value));
	if (!d.value)
		return DT_E_MEMORY;
	error = ensemble_run(draws, ensemble_draw, NULL, &d);
	for (size_t i = 0; i < d.count; i++) {
		double *row = &d.value[i * draws];
		size_t kept = 0;

		for (size_t k = 0; k < draws; k++)
			if (!isnan(row[k]))
				row[kept++] = row[k];
		spread[i] = ensemble_spread_of(row, kept);
		spread[i].without = draws - kept;
		if (kept > most)
			most = kept;
	}
	free(d.value);
	*failed = draws - most;
	return !error && most < 2 ? DT_E_EMPTY : error;
}

/* ---- what the uncertainty of the parameters makes ---- */

/* Half of what an output changes from one scene to another. */
static void bar_slope(const struct ensemble *e, const struct scene *less, const struct scene *more,
                      double slope[ENSEMBLE_OUTPUTS])
{
	struct model_prediction below, above;
	bool drops = model_solve(less, e->fidelity, &e->options, &below, NULL) == 0 &&
	             model_solve(more, e->fidelity, &e->options, &above, NULL) == 0;

	for (int k = 0; k < ENSEMBLE_OUTPUTS; k++)
		slope[k] = drops ? 0.5 * (ensemble_value(&above, &ensemble_outputs[k]) -
		                          ensemble_value(&below, &ensemble_outputs[k]))
		                 : (double)NAN;
}

/* One standard deviation of what was fitted, or of an axis, to each side. */
static void bar_fitted(const struct ensemble *e, int parameter, double slope[ENSEMBLE_OUTPUTS])
{
	struct scene less = *e->scene, more = *e->scene;
	double move[SCENE_FITTED] = {0.0};

	move[parameter] = e->scene->fitted_u[parameter];
	if (!(move[parameter] > 0.0))
		return;
	vary_fitted(&more, move);
	move[parameter] = -move[parameter];
	vary_fitted(&less, move);
	bar_slope(e, &less, &more, slope);
}

static void bar_axis(const struct ensemble *e, const struct ensemble_axis *axis,
                     double slope[ENSEMBLE_OUTPUTS])
{
	struct scene less = *e->scene, more = *e->scene;
	double middle = vary_get(e->scene, &axis->key);

	vary_set(&less, &axis->key, middle - axis->sd);
	vary_set(&more, &axis->key, middle + axis->sd);
	bar_slope(e, &less, &more, slope);
}

bool ensemble_bars(const struct ensemble *e, double u[ENSEMBLE_OUTPUTS])
{
	const struct scene *scene = e->scene;
	double slope[SCENE_FITTED][ENSEMBLE_OUTPUTS] = {{0.0}}, own[ENSEMBLE_KEYS_MAX][ENSEMBLE_OUTPUTS];

	if (!ensemble_fitted(scene))
		return false;
	for (int i = 0; i < SCENE_FITTED; i++)
		bar_fitted(e, i, slope[i]);
	for (size_t i = 0; i < e->axes; i++)
		bar_axis(e, &e->axis[i], own[i]);
	for (int k = 0; k < ENSEMBLE_OUTPUTS; k++) {
		double variance = 0.0;

		for (int i = 0; i < SCENE_FITTED; i++)
			for (int j = 0; j < SCENE_FITTED; j++)
				variance += (i == j ? 1.0 : scene->fitted_correlation[i][j]) * slope[i][k] *
				            slope[j][k];
		for (size_t i = 0; i < e->axes; i++)
			variance += own[i][k] * own[i][k];
		u[k] = variance < 0.0 ? 0.0 : sqrt(variance);
	}
	return true;
}

/* ---- sensitivities ---- */

static bool is_angle(const struct vary_key *key)
{
	size_t length = strlen(key->key);

	return length > 4 && strcmp(key->key + length - 4, "_deg") == 0;
}

bool ensemble_sensitivity(const struct ensemble *e, const struct vary_key *key,
                          double percent[ENSEMBLE_OUTPUTS])
{
	const struct ensemble_output *outputs[ENSEMBLE_OUTPUTS];
	size_t count = ensemble_select(e->options.asked, outputs);
	double value = vary_get(e->scene, key),
	       step = is_angle(key) ? SENSITIVITY_DEG : SENSITIVITY_SHARE * value;
	double per = is_angle(key) ? 2.0 * SENSITIVITY_DEG : 200.0 * SENSITIVITY_SHARE;
	struct scene less = *e->scene, more = *e->scene;
	struct model_options options = e->options;
	struct model_prediction below, above;
	bool any = false;

	if (step == 0.0)
		return false;
	options.tolerance = SENSITIVITY_TOLERANCE;
	vary_set(&less, key, value - step);
	vary_set(&more, key, value + step);
	if (model_solve(&less, e->fidelity, &options, &below, NULL) != 0 ||
	    model_solve(&more, e->fidelity, &options, &above, NULL) != 0)
		return false;
	for (size_t i = 0; i < count; i++) {
		double low = ensemble_value(&below, outputs[i]), high = ensemble_value(&above, outputs[i]);

		percent[i] = 200.0 * (high - low) / (fabs(high + low) * per);
		any |= fabs(percent[i]) > SENSITIVITY_NONE;
	}
	return any;
}
