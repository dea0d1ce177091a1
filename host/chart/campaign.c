/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/chart/campaign.h"

#include <math.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <gsl/gsl_statistics_double.h>
#include <gsl/gsl_sort.h>

/* Each call is repeated until a batch takes this long; the least of the batches counts. */
#define BATCH_US 20.0

enum { BATCHES = 3, TIMED_DROPS = 25, PROCESSES_MAX = 64 };

struct campaign_cell *campaign_cells(size_t count)
{
	void *cells = mmap(NULL, count * sizeof(struct campaign_cell), PROT_READ | PROT_WRITE,
	                   MAP_SHARED | MAP_ANONYMOUS, -1, 0);

	return cells == MAP_FAILED ? NULL : cells;
}

void campaign_free(struct campaign_cell *cells, size_t count)
{
	munmap(cells, count * sizeof(*cells));
}

/* ---- one scene --------------------------------------------------------------------------------------------
 */

static bool doubts(const struct estimate_how *how)
{
	return how->status != ESTIMATE_OK ||
	       (how->flags & (ESTIMATE_FLAG_EXTRAPOLATED | ESTIMATE_FLAG_TOLERANCE | ESTIMATE_FLAG_MODEL |
	                      ESTIMATE_FLAG_NOT_SEPARABLE));
}

static void count(struct campaign_tally *tally, const struct method *method, const struct trial *trial)
{
	double value = method->value(trial), error = value - method_truth(method, trial);

	if (method->how && doubts(method->how(trial)))
		tally->doubted++;
	if (!isfinite(value) || fabs(error) > method_gross(method, trial))
		tally->gross++;
	if (!isfinite(value))
		return;
	tally->values++;
	tally->error += error;
	tally->square += error * error;
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

/* Where in struct bound the method's is. */
static double bound_of(const struct bound *bound, const struct method *method)
{
	return *(const double *)((const char *)bound + method->bound);
}

static int run_drop(const struct campaign *campaign, struct campaign_cell *cell, struct synthetic *synthetic,
                    unsigned drop, double cost[CAMPAIGN_METHODS_MAX][TIMED_DROPS])
{
	size_t methods;
	const struct method *method = method_table(&methods);
	struct trial trial;
	int status;

	synthetic_drop(synthetic, campaign->seed, drop);
	status = trial_open(&trial, synthetic);
	if (status)
		return status;
	for (size_t m = 0; m < methods; m++) {
		count(&cell->tally[m], &method[m], &trial);
		if (campaign->timed && drop < TIMED_DROPS)
			cost[m][drop] = cost_of(&method[m], &trial);
	}
	trial_close(&trial);
	return 0;
}

static int run_cell(const struct campaign *campaign, struct campaign_cell *cell)
{
	double cost[CAMPAIGN_METHODS_MAX][TIMED_DROPS];
	size_t methods, timed = campaign->drops < TIMED_DROPS ? campaign->drops : TIMED_DROPS;
	const struct method *method = method_table(&methods);
	struct synthetic synthetic;
	struct bound bound;
	int status = synthetic_open(&synthetic, &cell->scene);

	if (status)
		return status;
	status = bound_find(&synthetic, &bound);
	for (unsigned drop = 0; drop < campaign->drops && !status; drop++)
		status = run_drop(campaign, cell, &synthetic, drop, cost);
	synthetic_close(&synthetic);
	for (size_t m = 0; m < methods && !status; m++) {
		cell->tally[m].bound = bound_of(&bound, &method[m]);
		cell->tally[m].cost_us = NAN;
		if (!campaign->timed)
			continue;
		gsl_sort(cost[m], 1, timed);
		cell->tally[m].cost_us = gsl_stats_median_from_sorted_data(cost[m], 1, timed);
	}
	return status;
}

/* ---- all --------------------------------------------------------------------------------------------------
 */

int campaign_run(struct campaign *campaign)
{
	long processors = sysconf(_SC_NPROCESSORS_ONLN);
	size_t jobs = processors > 0 ? (size_t)processors : 1;
	int result = 0;

	if (jobs > PROCESSES_MAX)
		jobs = PROCESSES_MAX;
	if (jobs > campaign->count)
		jobs = campaign->count;
	for (size_t job = 0; job < jobs; job++) {
		pid_t child = fork();

		if (child == 0) {
			int status = 0;

			for (size_t i = job; i < campaign->count && !status; i += jobs)
				status = run_cell(campaign, &campaign->cells[i]);
			_exit(-status);
		}
		if (child < 0) {
			result = DT_E_SYSTEM;
			jobs = job;
		}
	}
	for (size_t job = 0; job < jobs; job++) {
		int status = 0;

		if (wait(&status) < 0 || !WIFEXITED(status))
			result = DT_E_SYSTEM;
		else if (WEXITSTATUS(status) != 0)
			result = -WEXITSTATUS(status);
	}
	return result;
}

double campaign_bias(const struct campaign_tally *tally)
{
	return tally->values > 0 ? tally->error / tally->values : (double)NAN;
}

double campaign_rms(const struct campaign_tally *tally)
{
	return tally->values > 0 ? sqrt(tally->square / tally->values) : (double)NAN;
}

double campaign_ratio(const struct campaign_tally *tally)
{
	return campaign_rms(tally) / tally->bound;
}
