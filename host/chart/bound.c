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
enum { PARAMETERS = SECOND_DAMPING + 1, ONSETS = 6, OUTCOMES = 3 };

static const double steps[PARAMETERS] = {0.05, 1e-6, 1e-6, 1e-3, 1e-6, 1e-2, 1e-4, 1e-3, 1e-6, 1e-2, 1e-4};

/* Which samples count: S2's, S1's from the contact's end on, all. */
enum part { PULSE, DECAY, WHOLE };

/* Of one axis: covariance of the parameters from..until. */
struct fisher {
	struct synthetic *synthetic;
	int axis;
	enum part part;
	unsigned from, until;
	double covariance[PARAMETERS][PARAMETERS];
};

/* A signal with one parameter moved. */
struct moved {
	struct synthetic_signal signal;
	bool owned; /* else its tables are the drop's own */
};

static double *parameter(struct synthetic_axis *axis, unsigned i)
{
	double *const all[PARAMETERS] = {&axis->peak_g,    &axis->onset_s,       &axis->contact_s,
	                                 &axis->gain,      &axis->delay_s,       &axis->damped_hz,
	                                 &axis->damping,   &axis->second_gain,   &axis->second_delay_s,
	                                 &axis->second_hz, &axis->second_damping};

	return all[i];
}

/* Whether the oscillator's response, of unit gain and counted from its start, is another then. */
static bool is_response(const struct fisher *fisher, unsigned i)
{
	return fisher->part != PULSE && (i == CONTACT || i == HZ || i == DAMPING || i >= SECOND_HZ);
}

static int bound_move(const struct fisher *fisher, unsigned i, double by, struct moved *moved)
{
	const struct synthetic_signal *from = &fisher->synthetic->signal[fisher->axis];
	struct synthetic_axis axis = from->axis;

	*parameter(&axis, i) += by * steps[i];
	moved->owned = is_response(fisher, i);
	if (moved->owned)
		return synthetic_signal_open(&moved->signal, from->family, &axis);
	moved->signal = *from;
	moved->signal.axis = axis;
	return 0;
}

static void let_go(struct moved *moved)
{
	if (moved->owned)
		synthetic_signal_close(&moved->signal);
}

/* Samples of S1, then of S2, as far as they count; others are 0. */
static void bound_sample(const struct fisher *fisher, const struct synthetic_signal *signal, double *out)
{
	const struct synthetic *s = fisher->synthetic;
	const struct synthetic_axis *axis = &s->signal[fisher->axis].axis;
	double decays = s->onset_s + axis->onset_s + axis->contact_s + axis->delay_s;
	double until = fisher->part == DECAY && s->scene.decay_s > 0 ? decays + s->scene.decay_s : INFINITY;

	for (int sensor = 0; sensor < 2; sensor++) {
		enum synthetic_channel c =
		        (enum synthetic_channel)((sensor ? SYNTHETIC_S2X : SYNTHETIC_S1X) + fisher->axis);
		double from = fisher->part == DECAY ? decays : s->onset_s - 2e-3;
		bool counts = fisher->part == WHOLE || (fisher->part == DECAY) == (sensor == 0);

		for (size_t k = 0; k < s->record.channels[c].count; k++, out++) {
			double t = (double)k / axis->rate_hz;

			*out = 0;
			if (counts && t >= from && t < until && synthetic_keeps(s, c, k))
				*out = sensor ? synthetic_box(signal, t - s->onset_s)
				              : synthetic_plate(signal, t - s->onset_s);
		}
	}
}

/* Scaled to a diagonal of 1 first: the units are far apart. */
static int invert_fisher(double m[PARAMETERS][PARAMETERS], unsigned size)
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

static int bound_fill(struct fisher *fisher, double *jacobian, double *low, size_t n)
{
	const struct synthetic_scene *scene = &fisher->synthetic->scene;
	double weight = (1 - scene->missing) / (gsl_pow_2(scene->noise_g) + gsl_pow_2(scene->step_g) / 12);
	unsigned size = fisher->until - fisher->from;

	for (unsigned i = 0; i < size; i++) {
		double *row = jacobian + i * n;

		for (int side = -1; side <= 1; side += 2) {
			struct moved moved;

			if (bound_move(fisher, fisher->from + i, side, &moved))
				return DT_E_MEMORY;
			bound_sample(fisher, &moved.signal, side < 0 ? low : row);
			let_go(&moved);
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
	return invert_fisher(fisher->covariance, size);
}

static int fisher_open(struct fisher *fisher, struct synthetic *synthetic, int axis, enum part part)
{
	size_t n = 2 * synthetic->record.channels[axis].count;
	double *jacobian = malloc(n * PARAMETERS * sizeof(*jacobian)), *low = malloc(n * sizeof(*low));
	unsigned last = synthetic->signal[axis].second ? PARAMETERS : (unsigned)SECOND_GAIN;
	int status = DT_E_MEMORY;

	*fisher = (struct fisher){.synthetic = synthetic,
	                          .axis = axis,
	                          .part = part,
	                          .from = part == DECAY ? GAIN : PEAK,
	                          .until = part == PULSE ? GAIN : last};
	if (jacobian && low)
		status = bound_fill(fisher, jacobian, low, n);
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

/* Adds the variances of functions of both axes' signals, as far as this axis' parameters move them. */
static int add_variances(const struct fisher *fisher,
                         void (*f)(const struct synthetic_signal signal[2], int axis, double *out),
                         unsigned count, double *const sum[])
{
	double gradient[OUTCOMES][PARAMETERS] = {{0}};

	for (unsigned i = fisher->from; i < fisher->until; i++) {
		double value[2][OUTCOMES];

		for (int side = 0; side < 2; side++) {
			struct synthetic_signal pair[2] = {fisher->synthetic->signal[0],
			                                   fisher->synthetic->signal[1]};
			struct moved moved;

			/* wide steps: a summit is found to the root of rounding */
			if (bound_move(fisher, i, side ? 4 : -4, &moved))
				return DT_E_MEMORY;
			pair[fisher->axis] = moved.signal;
			f(pair, fisher->axis, value[side]);
			let_go(&moved);
		}
		for (unsigned o = 0; o < count; o++)
			gradient[o][i] = (value[1][o] - value[0][o]) / (8 * steps[i]);
	}
	for (unsigned o = 0; o < count; o++)
		*sum[o] += variance(fisher, gradient[o]);
	return 0;
}

static void resultant_of(const struct synthetic_signal signal[2], int axis, double *out)
{
	(void)axis;
	out[0] = synthetic_resultant(signal, &out[1]);
}

static int add_pulses(struct synthetic *synthetic, struct bound *sum)
{
	double *const resultant[] = {&sum->resultant_g, &sum->resultant_s};
	double summit = synthetic_pulse_summit(synthetic->scene.family);
	double area = synthetic_pulse_area(synthetic->scene.family) * UNITS_G_M_S2;

	for (int axis = 0; axis < 2; axis++) {
		const struct synthetic_axis *a = &synthetic->signal[axis].axis;
		double instant[PARAMETERS] = {[ONSET] = 1, [CONTACT] = summit};
		double velocity[PARAMETERS] = {[PEAK] = area * a->contact_s, [CONTACT] = area * a->peak_g};
		struct fisher fisher;
		int status = fisher_open(&fisher, synthetic, axis, PULSE);

		if (!status)
			status = add_variances(&fisher, resultant_of, 2, resultant);
		if (status)
			return status;
		sum->peak_g[axis] += fisher.covariance[PEAK][PEAK];
		sum->contact_s[axis] += fisher.covariance[CONTACT][CONTACT];
		sum->peak_s[axis] += variance(&fisher, instant);
		sum->velocity_m_s[axis] += variance(&fisher, velocity);
	}
	return 0;
}

static void invert2(double m[2][2])
{
	double determinant = m[0][0] * m[1][1] - m[0][1] * m[1][0], swap = m[0][0];

	m[0][0] = m[1][1] / determinant;
	m[1][1] = swap / determinant;
	m[0][1] = m[1][0] = -m[0][1] / determinant;
}

/* Natural frequency is damped / sqrt(1 - damping^2). */
static void decay_variances(const struct synthetic_scene *scene, double c[2][2], double *hz, double *damping,
                            double *natural)
{
	double rest = 1 - gsl_pow_2(scene->damping);
	double n[2] = {1 / sqrt(rest), scene->damped_hz * scene->damping / (rest * sqrt(rest))};

	*hz += c[0][0];
	*damping += c[1][1];
	*natural += n[0] * n[0] * c[0][0] + 2 * n[0] * n[1] * c[0][1] + n[1] * n[1] * c[1][1];
}

/* X and Y share frequency and damping: the information of both adds up, 2 by 2. */
static int add_decays(struct synthetic *synthetic, struct bound *sum)
{
	double pair[2][2] = {{0}};

	for (int axis = 0; axis < 2; axis++) {
		struct fisher fisher;
		double own[2][2];
		int status = fisher_open(&fisher, synthetic, axis, DECAY);

		if (status)
			return status;
		for (int i = 0; i < 4; i++)
			own[i / 2][i % 2] = fisher.covariance[HZ - GAIN + i / 2][HZ - GAIN + i % 2];
		decay_variances(&synthetic->scene, own, &sum->damped_hz[axis], &sum->damping[axis],
		                &sum->natural_hz[axis]);
		invert2(own);
		for (int i = 0; i < 4; i++)
			pair[i / 2][i % 2] += own[i / 2][i % 2];
	}
	invert2(pair);
	decay_variances(&synthetic->scene, pair, &sum->pair_hz, &sum->pair_damping, &sum->pair_natural_hz);
	return 0;
}

static void bound_plate_of(const struct synthetic_signal signal[2], int axis, double *out)
{
	out[0] = synthetic_lag(&signal[axis]);
	out[1] = synthetic_plate_summit(&signal[axis]);
	out[2] = synthetic_plate(&signal[axis], out[1]);
}

static int add_lags(struct synthetic *synthetic, struct bound *sum)
{
	double weight = 0;

	for (int axis = 0; axis < 2; axis++) {
		double before = sum->lag_s[axis];
		double *const all[] = {&sum->lag_s[axis], &sum->plate_s[axis], &sum->plate_g[axis]};
		struct fisher fisher;
		int status = fisher_open(&fisher, synthetic, axis, WHOLE);

		if (!status)
			status = add_variances(&fisher, bound_plate_of, 3, all);
		if (status)
			return status;
		weight += 1 / (sum->lag_s[axis] - before);
	}
	sum->pair_lag_s += 1 / weight;
	return 0;
}

int bound_find(struct synthetic *synthetic, bool lags, struct bound *bound)
{
	struct bound sum = {0};
	double *value = (double *)&sum;
	int status = 0;

	for (int i = 0; i < ONSETS && !status; i++) {
		synthetic->onset_s = synthetic->scene.pre_s + (i + 0.5) / ONSETS * 1e-3;
		status = add_pulses(synthetic, &sum);
		if (!status)
			status = add_decays(synthetic, &sum);
		if (!status && lags)
			status = add_lags(synthetic, &sum);
	}
	if (status)
		return status;
	for (size_t i = 0; i < sizeof(sum) / sizeof(double); i++)
		value[i] = sqrt(value[i] / ONSETS);
	*bound = sum;
	return 0;
}
