/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/ringdown_private.h"

#include <math.h>

#include "host/estimate/limits.h"

unsigned ringdown_freedom(const struct ringdown_job *job, const struct modes *modes)
{
	return job->series.used - modes_size(modes);
}

double ringdown_chi_square(const struct ringdown_job *job, const struct modes *modes)
{
	double noise = hypot(job->trace->noise_g, RINGDOWN_SWING_MODEL * modes_swing_g(modes, 0));

	return modes->fit.squares * job->series.block / (noise * noise * ringdown_freedom(job, modes));
}

bool ringdown_passes(const struct ringdown_job *job, const struct modes *modes)
{
	double spread = sqrt(2.0 / ringdown_freedom(job, modes) + 2 * LIMIT_KNOWN * LIMIT_KNOWN);

	return !(ringdown_chi_square(job, modes) > 1 + LIMIT_CHI * spread);
}

double ringdown_sigma_point(const struct ringdown_job *job, const struct modes *modes)
{
	double residual = sqrt(modes->fit.squares / ringdown_freedom(job, modes));

	return fmax(residual, job->trace->noise_g / sqrt(job->series.block));
}

double ringdown_explained(const struct ringdown_job *job)
{
	double noise = job->trace->noise_g, expected = 0, total = job->total;

	if (isfinite(noise))
		expected = noise * noise / job->series.block;
	total -= expected * (job->series.used - 1);
	return 1 - fmax(0, job->modes.fit.squares - expected * ringdown_freedom(job, &job->modes)) / total;
}

double ringdown_gain(const struct ringdown_job *job)
{
	double noise = job->trace->noise_g;

	return (job->total - job->modes.fit.squares) * job->series.block / (noise * noise);
}
