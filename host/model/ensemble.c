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

void ensemble_grid_scene(const struct ensemble *e, size_t point, struct scene *scene, double value[])
{
	*scene = *e->scene;
	for (size_t i = e->axes; i-- > 0;) {
		const struct ensemble_axis *axis = &e->axis[i];

		value[i] = axis->from + (double)(point % axis->count) * axis->step;
		point /= axis->count;
		vary_set(scene, &axis->key, value[i]);
	}
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

void ensemble_random_scene(const struct ensemble *e, size_t point, struct scene *scene, double value[])
{
	uint64_t state = (uint64_t)e->seed * 0xd1342543de82ef95u + (uint64_t)point * 0x2545f4914f6cdd1du;

	*scene = *e->scene;
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
			if (result == 0)
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

static int ensemble_drawn(void *context, size_t first, size_t count, int thread)
{
	(void)context;
	(void)first;
	(void)count;
	(void)thread;
	return 0;
}

static int ascending(const void *a, const void *b)
{
	double x = *(const double *)a, y = *(const double *)b;

	return (x > y) - (x < y);
}

/* Sorts; NANs were taken out. */
static struct ensemble_spread ensemble_spread_of(double *value, size_t count)
{
	struct ensemble_spread s = {(double)NAN, (double)NAN, (double)NAN, (double)NAN};
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
	error = ensemble_run(draws, ensemble_draw, ensemble_drawn, &d);
	for (size_t i = 0; i < d.count; i++) {
		double *row = &d.value[i * draws];
		size_t kept = 0;

		for (size_t k = 0; k < draws; k++)
			if (!isnan(row[k]))
				row[kept++] = row[k];
		spread[i] = ensemble_spread_of(row, kept);
		if (kept > most)
			most = kept;
	}
	free(d.value);
	*failed = draws - most;
	return !error && most < 2 ? DT_E_EMPTY : error;
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
