/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/chart/campaign.h"

#include <math.h>
#include <stdio.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

enum { PROCESSES_MAX = 64 };

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

static int campaign_run_scene(const struct campaign *campaign, size_t i)
{
	struct synthetic synthetic;
	int status = synthetic_open(&synthetic, campaign->scene(campaign->context, i));

	if (status)
		return status;
	status = campaign->begin(campaign->context, i, &synthetic);
	for (unsigned drop = 0; drop < campaign->drops && !status; drop++) {
		synthetic_drop(&synthetic, drop);
		status = campaign->drop(campaign->context, i, &synthetic, drop);
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

int campaign_run(const struct campaign *campaign)
{
	size_t jobs = processes(campaign), started = 0;
	int result = 0;

	fflush(NULL); /* or each process writes it again */
	for (; started < jobs && !result; started++) {
		pid_t child = fork();

		if (child == 0) {
			int status = 0;

			for (size_t i = started; i < campaign->count && !status; i += jobs)
				status = campaign_run_scene(campaign, i);
			_exit(-status);
		}
		if (child < 0) {
			result = DT_E_SYSTEM;
			break;
		}
	}
	for (; started > 0; started--) {
		int status = 0;

		if (wait(&status) < 0 || !WIFEXITED(status))
			result = DT_E_SYSTEM;
		else if (WEXITSTATUS(status) != 0)
			result = -WEXITSTATUS(status);
	}
	return result;
}
