/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/chart/compare.h"

#include <math.h>

#include <gsl/gsl_sort.h>
#include <gsl/gsl_statistics_double.h>

#include "host/chart/timing.h"

/* Of timing_us, for each of many drops. */
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

struct call {
	const struct method *method;
	const struct trial *trial;
};

static void compare_work(const void *context)
{
	const struct call *call = context;
	volatile double sink;

	if (call->method->work) {
		call->method->work(call->trial);
		return;
	}
	sink = call->method->value(call->trial);
	(void)sink;
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

static int compare_look(void *context, size_t i, const struct synthetic *synthetic, unsigned drop)
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
			cell->drop_us[m][drop] = timing_us(compare_work, &(struct call){&method[m], &trial},
			                                   BATCH_US, BATCHES);
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
	                                  .drop = compare_look};
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
