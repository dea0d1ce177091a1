/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/chart/campaign.h"

#include <math.h>
#include <stdatomic.h>
#include <stdio.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "host/base/progress.h"

enum { PROCESSES_MAX = 64 };

static const double TOLD_AFTER_S = 2.0;

void tally_add(struct tally *tally, double value, double truth, double sigma, double gross)
{
	double error = value - truth;

	if (!isfinite(value))
		return;
	tally->gross += fabs(error) > gross;
	tally->values++;
	tally->error += error;
	tally->square += error * error;
	tally->covered += isfinite(sigma) && fabs(error) <= 2 * sigma;
}

double tally_bias(const struct tally *tally)
{
	return tally->values > 0 ? tally->error / tally->values : (double)NAN;
}

double tally_rms(const struct tally *tally)
{
	return tally->values > 0 ? sqrt(tally->square / tally->values) : (double)NAN;
}

double tally_ratio(const struct tally *tally)
{
	return tally_rms(tally) / tally->bound;
}

void *campaign_memory(size_t bytes)
{
	void *memory = mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);

	return memory == MAP_FAILED ? NULL : memory;
}

void campaign_free(void *memory, size_t bytes)
{
	munmap(memory, bytes);
}

static int campaign_run_scene(const struct campaign *campaign, size_t i, atomic_size_t *done)
{
	struct synthetic synthetic;
	int status = synthetic_open(&synthetic, campaign->scene(campaign->context, i));

	if (status)
		return status;
	status = campaign->begin(campaign->context, i, &synthetic);
	for (unsigned drop = 0; drop < campaign->drops && !status; drop++) {
		synthetic_drop(&synthetic, drop);
		status = campaign->drop(campaign->context, i, &synthetic, drop);
		if (done != NULL)
			atomic_fetch_add(done, 1);
	}
	synthetic_close(&synthetic);
	return status;
}

static size_t processes(const struct campaign *campaign)
{
	long jobs = sysconf(_SC_NPROCESSORS_ONLN);
	size_t most = campaign->count < PROCESSES_MAX ? campaign->count : PROCESSES_MAX;

	if (jobs < 1)
		jobs = 1;
	return (size_t)jobs < most ? (size_t)jobs : most;
}

/* The next process that ends, as wait; meanwhile a terminal sees how far they are. */
static pid_t campaign_wait(const struct campaign *campaign, const atomic_size_t *done,
                           struct progress *progress, int *status)
{
	static const struct timespec look = {.tv_nsec = 100000000};
	size_t all = campaign->count * campaign->drops;
	pid_t ended;

	while (done != NULL && progress->terminal && (ended = waitpid(-1, status, WNOHANG)) == 0) {
		size_t now = atomic_load(done);

		progress_tell(progress, (double)now / (double)all, "%zu of %zu drops, %.0f drops/s", now, all,
		              (double)now / progress_seconds(progress));
		nanosleep(&look, NULL);
	}
	return done != NULL && progress->terminal ? ended : wait(status);
}

int campaign_run(const struct campaign *campaign)
{
	atomic_size_t *done = campaign_memory(sizeof(*done)); /* NULL: nothing is told */
	size_t jobs = processes(campaign), started = 0;
	struct progress progress;
	int result = 0;

	progress_begin(&progress, TOLD_AFTER_S);

	fflush(NULL); /* or each process writes it again */
	for (; started < jobs && !result; started++) {
		pid_t child = fork();

		if (child == 0) {
			int status = 0;

			for (size_t i = started; i < campaign->count && !status; i += jobs)
				status = campaign_run_scene(campaign, i, done);
			_exit(-status);
		}
		if (child < 0) {
			result = DT_E_SYSTEM;
			break;
		}
	}
	for (; started > 0; started--) {
		int status = 0;

		if (campaign_wait(campaign, done, &progress, &status) < 0 || !WIFEXITED(status))
			result = DT_E_SYSTEM;
		else if (WEXITSTATUS(status) != 0)
			result = -WEXITSTATUS(status);
	}
	progress_end(&progress);
	if (done != NULL)
		campaign_free(done, sizeof(*done));
	return result;
}
