/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/chart/bound.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <gsl/gsl_linalg.h>
#include <gsl/gsl_math.h>

#include "common/units.h"

/* A signal's parameters, in the order of struct synthetic_axis from peak_g on. */
enum { PEAK, ONSET, CONTACT, GAIN, DELAY, HZ, DAMPING, SECOND_GAIN, SECOND_DELAY, SECOND_HZ, SECOND_DAMPING };
enum { PARAMETERS = SECOND_DAMPING + 1, ONSETS = 4 };

static const double steps[PARAMETERS] = {0.05, 1e-6, 1e-6, 1e-3, 1e-6, 1e-2, 1e-4, 1e-3, 1e-6, 1e-2, 1e-4};

/* Which samples count. */
enum part { PULSE, DECAY, WHOLE };

/* Of one axis: Jacobian over the parameters from..until, and gradients of what is asked. */
struct fisher {
	struct synthetic *synthetic;
	int axis;
	unsigned from, until;
	double covariance[PARAMETERS][PARAMETERS];
};

static double *parameter(struct synthetic_axis *axis, unsigned i)
{
	double *const all[PARAMETERS] = {&axis->peak_g,    &axis->onset_s,       &axis->contact_s,
	                                 &axis->gain,      &axis->delay_s,       &axis->damped_hz,
	                                 &axis->damping,   &axis->second_gain,   &axis->second_delay_s,
	                                 &axis->second_hz, &axis->second_damping};

	return all[i];
}

/* The signal with one parameter moved. */
static int moved(const struct fisher *fisher, unsigned i, double by, struct synthetic_signal *signal)
{
	struct synthetic_axis axis = fisher->synthetic->signal[fisher->axis].axis;

	*parameter(&axis, i) += by * steps[i];
	return synthetic_signal_open(signal, fisher->synthetic->scene.family, &axis);
}

/* Samples of S2, then of S1, as far as they count; others are 0. */
static void sample(const struct fisher *fisher, enum part part, const struct synthetic_signal *signal,
                   double *out)
{
	const struct synthetic *s = fisher->synthetic;
	const struct synthetic_axis *axis = &s->signal[fisher->axis].axis;
	double decays = s->onset_s + axis->onset_s + axis->contact_s + axis->delay_s;

	for (unsigned c = 0; c < SYNTHETIC_CHANNELS; c++) {
		bool plate = c < SYNTHETIC_S2X;
		size_t count = s->record.channels[c].count;

		if ((int)(c & 1u) != fisher->axis)
			continue;
		for (size_t k = 0; k < count; k++, out++) {
			double t = (double)k / axis->rate_hz;
			bool counts = plate ? part == WHOLE || (part == DECAY && t >= decays) : part != DECAY;

			*out = 0;
			if (t > s->onset_s - 2e-3 && counts &&
			    synthetic_keeps(s, (enum synthetic_channel)c, k))
				*out = plate ? synthetic_plate(signal, t - s->onset_s)
				             : synthetic_box(signal, t - s->onset_s);
		}
	}
}

/* Scaled to a diagonal of 1 first: the units are far apart. */
static int invert(double m[PARAMETERS][PARAMETERS], unsigned size)
{
	double scale[PARAMETERS], flat[PARAMETERS * PARAMETERS];
	gsl_matrix_view view = gsl_matrix_view_array(flat, size, size);

	for (unsigned i = 0; i < size; i++)
		scale[i] = sqrt(m[i][i]);
	for (unsigned i = 0; i < size * size; i++)
		flat[i] = m[i / size][i % size] / scale[i / size] / scale[i % size];
	if (gsl_linalg_cholesky_decomp1(&view.matrix) || gsl_linalg_cholesky_invert(&view.matrix))
		return DT_E_ARGUMENT;
	for (unsigned i = 0; i < size * size; i++)
		m[i / size][i % size] = flat[i] / scale[i / size] / scale[i % size];
	return 0;
}

static int fill(struct fisher *fisher, enum part part, double *jacobian, double *low, size_t n)
{
	const struct synthetic_scene *scene = &fisher->synthetic->scene;
	double weight = (1 - scene->missing) / (gsl_pow_2(scene->noise_g) + gsl_pow_2(scene->step_g) / 12);
	unsigned size = fisher->until - fisher->from;

	for (unsigned i = 0; i < size; i++) {
		double *row = jacobian + i * n;

		for (int side = -1; side <= 1; side += 2) {
			struct synthetic_signal signal;

			if (moved(fisher, fisher->from + i, side, &signal))
				return DT_E_MEMORY;
			sample(fisher, part, &signal, side < 0 ? low : row);
			synthetic_signal_close(&signal);
		}
		for (size_t k = 0; k < n; k++)
			row[k] = (row[k] - low[k]) / (2 * steps[fisher->from + i]);
	}
	for (unsigned i = 0; i < size; i++)
		for (unsigned j = 0; j < size; j++) {
			double sum = 0;

			for (size_t k = 0; k < n; k++)
				sum += jacobian[i * n + k] * jacobian[j * n + k];
			fisher->covariance[i][j] = weight * sum;
		}
	return invert(fisher->covariance, size);
}

static int fisher_open(struct fisher *fisher, struct synthetic *synthetic, int axis, enum part part)
{
	size_t n = 2 * synthetic->record.channels[axis].count;
	double *jacobian = malloc(n * PARAMETERS * sizeof(*jacobian)), *low = malloc(n * sizeof(*low));
	unsigned last = synthetic->signal[axis].second ? PARAMETERS : (unsigned)SECOND_GAIN;
	int status = DT_E_MEMORY;

	*fisher = (struct fisher){
	        synthetic, axis, part == DECAY ? GAIN : PEAK, part == PULSE ? GAIN : last, {{0}}};
	if (jacobian && low)
		status = fill(fisher, part, jacobian, low, n);
	free(jacobian);
	free(low);
	return status;
}

static double variance(const struct fisher *fisher, const double *gradient)
{
	double sum = 0;

	for (unsigned i = fisher->from; i < fisher->until; i++)
		for (unsigned j = fisher->from; j < fisher->until; j++)
			sum += gradient[i] * gradient[j] *
			       fisher->covariance[i - fisher->from][j - fisher->from];
	return sum;
}

/* Variance of a function of both axes' signals, as far as this axis' parameters move it. */
static int variance_of(const struct fisher *fisher, double (*f)(const struct synthetic_signal signal[2]),
                       double *result)
{
	double gradient[PARAMETERS] = {0};

	for (unsigned i = fisher->from; i < fisher->until; i++) {
		double value[2];

		for (int side = 0; side < 2; side++) {
			struct synthetic_signal pair[2] = {fisher->synthetic->signal[0],
			                                   fisher->synthetic->signal[1]};

			if (moved(fisher, i, side ? 1 : -1, &pair[fisher->axis]))
				return DT_E_MEMORY;
			value[side] = f(pair);
			synthetic_signal_close(&pair[fisher->axis]);
		}
		gradient[i] = (value[1] - value[0]) / (2 * steps[i]);
	}
	*result += variance(fisher, gradient);
	return 0;
}

static double lag_of_x(const struct synthetic_signal signal[2])
{
	return synthetic_lag(&signal[0]);
}

static int add_pulses(struct synthetic *synthetic, struct bound *sum)
{
	double summit = synthetic_pulse_summit(synthetic->scene.family);
	double area = synthetic_pulse_area(synthetic->scene.family) * UNITS_G_M_S2;

	for (int axis = 0; axis < 2; axis++) {
		const struct synthetic_axis *a = &synthetic->signal[axis].axis;
		double instant[PARAMETERS] = {[ONSET] = 1, [CONTACT] = summit};
		double velocity[PARAMETERS] = {[PEAK] = area * a->contact_s, [CONTACT] = area * a->peak_g};
		struct fisher fisher;
		int status = fisher_open(&fisher, synthetic, axis, PULSE);

		if (status || variance_of(&fisher, synthetic_resultant, &sum->resultant_g))
			return status ? status : DT_E_MEMORY;
		if (axis > 0)
			continue;
		sum->peak_g += fisher.covariance[PEAK][PEAK];
		sum->contact_s += fisher.covariance[CONTACT][CONTACT];
		sum->peak_s += variance(&fisher, instant);
		sum->velocity_m_s += variance(&fisher, velocity);
	}
	return 0;
}

/* X and Y share frequency and damping: the information of both adds up, 2 by 2. */
static int add_decays(struct synthetic *synthetic, struct bound *sum)
{
	double both[3] = {0}, determinant;

	for (int axis = 0; axis < 2; axis++) {
		struct fisher fisher;
		int status = fisher_open(&fisher, synthetic, axis, DECAY);
		double hz = fisher.covariance[HZ - GAIN][HZ - GAIN];
		double damping = fisher.covariance[DAMPING - GAIN][DAMPING - GAIN];
		double cross = fisher.covariance[HZ - GAIN][DAMPING - GAIN];

		if (status)
			return status;
		if (axis == 0) {
			sum->damped_hz += hz;
			sum->damping += damping;
		}
		determinant = hz * damping - cross * cross;
		both[0] += damping / determinant;
		both[1] += hz / determinant;
		both[2] -= cross / determinant;
	}
	determinant = both[0] * both[1] - both[2] * both[2];
	sum->pair_hz += both[1] / determinant;
	sum->pair_damping += both[0] / determinant;
	return 0;
}

static double plate_peak_of_x(const struct synthetic_signal signal[2])
{
	return synthetic_plate_peak(&signal[0]);
}

static int add_lag(struct synthetic *synthetic, struct bound *sum)
{
	struct fisher fisher;
	int status = fisher_open(&fisher, synthetic, 0, WHOLE);

	if (!status)
		status = variance_of(&fisher, lag_of_x, &sum->lag_s);
	return status ? status : variance_of(&fisher, plate_peak_of_x, &sum->plate_peak_g);
}

int bound_find(struct synthetic *synthetic, struct bound *bound)
{
	struct bound sum = {0};
	double *value = (double *)&sum;
	int status = 0;

	for (int i = 0; i < ONSETS && !status; i++) {
		synthetic->onset_s = synthetic->scene.pre_s + (i + 0.5) / ONSETS * 1e-3;
		status = add_pulses(synthetic, &sum);
		if (!status)
			status = add_decays(synthetic, &sum);
		if (!status)
			status = add_lag(synthetic, &sum);
	}
	if (status)
		return status;
	for (size_t i = 0; i < sizeof(sum) / sizeof(double); i++)
		value[i] = sqrt(value[i] / ONSETS);
	*bound = sum;
	return 0;
}
