/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/chart/compare.h"

#include <math.h>
#include <time.h>

#include <gsl/gsl_sort.h>
#include <gsl/gsl_statistics_double.h>

/* Each call is repeated until a batch takes this long; the least of the batches counts. */
#define BATCH_US 20.0

enum { BATCHES = 3 };

struct compare_cell *compare_cells(size_t count)
{
	return campaign_memory(count * sizeof(struct compare_cell));
}

void compare_free(struct compare_cell *cells, size_t count)
{
	campaign_free(cells, count * sizeof(*cells));
}

unsigned compare_gross(const struct compare *compare, const struct tally *tally)
{
	return tally->gross + compare->drops - tally->values;
}

static double now_us(void)
{
	struct timespec now;

	clock_gettime(CLOCK_MONOTONIC, &now);
	return (double)now.tv_sec * 1e6 + (double)now.tv_nsec * 1e-3;
}

static double batch(const struct method *method, const struct trial *trial, unsigned repeats)
{
	volatile double sink = 0;
	double start = now_us();

	for (unsigned i = 0; i < repeats; i++) {
		if (method->work)
			method->work(trial);
		else
			sink = method->value(trial);
	}
	(void)sink;
	return now_us() - start;
}

static double cost_of(const struct method *method, const struct trial *trial)
{
	double once = batch(method, trial, 1), least = INFINITY;
	unsigned repeats = once < BATCH_US ? (unsigned)(BATCH_US / fmax(once, 0.02)) + 1 : 1;

	for (int i = 0; i < BATCHES; i++)
		least = fmin(least, batch(method, trial, repeats) / repeats);
	return least;
}

static bool doubts(const struct estimate_how *how)
{
	return how->status != ESTIMATE_OK ||
	       (how->flags & (ESTIMATE_FLAG_EXTRAPOLATED | ESTIMATE_FLAG_TOLERANCE | ESTIMATE_FLAG_MODEL |
	                      ESTIMATE_FLAG_NOT_SEPARABLE));
}

static const struct synthetic_scene *scene_of(void *context, size_t i)
{
	const struct compare *compare = context;

	return &compare->cells[i].scene;
}

static int find_bounds(void *context, size_t i, struct synthetic *synthetic)
{
	const struct compare *compare = context;
	size_t methods;
	const struct method *method = method_table(&methods);
	struct bound bound;
	int status = bound_find(synthetic, true, &bound);

	for (size_t m = 0; m < methods && !status; m++)
		compare->cells[i].tally[m].bound = *(double *)((char *)&bound + method[m].bound);
	return status;
}

static int look(void *context, size_t i, const struct synthetic *synthetic, unsigned drop)
{
	const struct compare *compare = context;
	struct compare_cell *cell = &compare->cells[i];
	size_t methods;
	const struct method *method = method_table(&methods);
	struct trial trial;
	int status = trial_open(&trial, synthetic);

	if (status)
		return status;
	for (size_t m = 0; m < methods; m++) {
		tally_add(&cell->tally[m], method[m].value(&trial), method_truth(&method[m], &trial),
		          (double)NAN, method_gross(&method[m], &trial));
		cell->tally[m].doubted += method[m].how && doubts(method[m].how(&trial));
		if (compare->timed && drop < COMPARE_TIMED)
			cell->drop_us[m][drop] = cost_of(&method[m], &trial);
	}
	trial_close(&trial);
	return 0;
}

int compare_run(struct compare *compare)
{
	const struct campaign campaign = {.count = compare->count,
	                                  .drops = compare->drops,
	                                  .context = compare,
	                                  .scene = scene_of,
	                                  .begin = find_bounds,
	                                  .drop = look};
	size_t timed = compare->drops < COMPARE_TIMED ? compare->drops : (size_t)COMPARE_TIMED;
	int status = campaign_run(&campaign);

	for (size_t i = 0; i < compare->count && !status; i++)
		for (size_t m = 0; m < COMPARE_METHODS_MAX; m++) {
			struct compare_cell *cell = &compare->cells[i];

			gsl_sort(cell->drop_us[m], 1, timed);
			cell->cost_us[m] =
			        compare->timed ? gsl_stats_median_from_sorted_data(cell->drop_us[m], 1, timed)
			                       : (double)NAN;
		}
	return status;
}
