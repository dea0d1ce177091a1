/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/accuracy/bound.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <gsl/gsl_linalg.h>

#define PI 3.14159265358979323846
#define G_M_S2 9.80665

enum { UNKNOWNS_MAX = 8, ONSETS = 6, LAG_EVERY = 3, SAMPLES_MAX = 2000 };

/* A signal of size unknowns as a vector; what is not kept is 0 whatever they are. */
struct problem {
	const struct stage *stage;
	int axis;
	unsigned size;
	double at[UNKNOWNS_MAX], step[UNKNOWNS_MAX];
	void (*signal)(const struct problem *problem, const double *p, double *out, size_t *count);
};

struct covariance {
	unsigned size;
	double value[UNKNOWNS_MAX][UNKNOWNS_MAX];
};

/* Inverse of a symmetric positive definite matrix; ends the program if it is not: a bound that does not
 * exist is the test's fault. Rows and columns are scaled to a diagonal of 1 first. */
static void invert(double m[UNKNOWNS_MAX][UNKNOWNS_MAX], unsigned size)
{
	double scale[UNKNOWNS_MAX], flat[UNKNOWNS_MAX * UNKNOWNS_MAX];
	gsl_matrix_view view = gsl_matrix_view_array(flat, size, size);

	for (unsigned i = 0; i < size; i++)
		scale[i] = sqrt(m[i][i]);
	for (unsigned i = 0; i < size; i++)
		for (unsigned j = 0; j < size; j++)
			flat[i * size + j] = m[i][j] / scale[i] / scale[j];
	if (gsl_linalg_cholesky_decomp1(&view.matrix) || gsl_linalg_cholesky_invert(&view.matrix))
		abort();
	for (unsigned i = 0; i < size; i++)
		for (unsigned j = 0; j < size; j++)
			m[i][j] = flat[i * size + j] / scale[i] / scale[j];
}

static void find_covariance(const struct problem *problem, struct covariance *covariance)
{
	static double jacobian[UNKNOWNS_MAX][SAMPLES_MAX], low[SAMPLES_MAX];
	double noise = stage_noise(&problem->stage->scene);
	size_t count = 0;

	covariance->size = problem->size;
	for (unsigned i = 0; i < problem->size; i++) {
		double p[UNKNOWNS_MAX], h = problem->step[i];

		memcpy(p, problem->at, sizeof(p));
		p[i] = problem->at[i] - h;
		problem->signal(problem, p, low, &count);
		p[i] = problem->at[i] + h;
		problem->signal(problem, p, jacobian[i], &count);
		for (size_t k = 0; k < count; k++)
			jacobian[i][k] = (jacobian[i][k] - low[k]) / (2 * h);
	}
	for (unsigned i = 0; i < problem->size; i++)
		for (unsigned j = 0; j < problem->size; j++) {
			covariance->value[i][j] = 0;
			for (size_t k = 0; k < count; k++)
				covariance->value[i][j] += jacobian[i][k] * jacobian[j][k] / (noise * noise);
		}
	invert(covariance->value, problem->size);
}

static double variance(const struct covariance *covariance, const double *gradient)
{
	double sum = 0;

	for (unsigned i = 0; i < covariance->size; i++)
		for (unsigned j = 0; j < covariance->size; j++)
			sum += gradient[i] * covariance->value[i][j] * gradient[j];
	return sum;
}

/* ---- the pulse: A, t_p, T ------------------------------------------------------------------------- */

static double pulse_at(enum synth_shape shape, const double *p, double time_s)
{
	return p[0] * synth_pulse(shape, synth_pulse_summit(shape) + (time_s - p[1]) / p[2]);
}

static void pulse_samples(const struct problem *problem, const double *p, double *out, size_t *count)
{
	const struct stage *stage = problem->stage;
	enum stage_channel channel = problem->axis == 0 ? STAGE_S2X : STAGE_S2Y;
	double rate = stage_rate(channel);
	double onset = stage->onset_s + stage->axis[problem->axis].skew_s;

	*count = 0;
	for (size_t k = (size_t)((onset - 1e-3) * rate); (double)k < (onset + STAGE_CONTACT_S + 1e-3) * rate;
	     k++)
		out[(*count)++] = stage_keeps(stage, channel, k)
		                          ? pulse_at(stage->scene.shape, p, (double)k / rate)
		                          : 0;
}

static struct problem pulse_problem(const struct stage *stage, int axis)
{
	const struct stage_axis *of = &stage->axis[axis];

	return (struct problem){
	        stage,
	        axis,
	        3,
	        {of->s2_g,
	         stage->onset_s + of->skew_s + synth_pulse_summit(stage->scene.shape) * STAGE_CONTACT_S,
	         STAGE_CONTACT_S},
	        {0.01, 1e-7, 1e-7},
	        pulse_samples};
}

/* The largest hypot of two pulses and when: golden section between, and a little beyond, their summits. */
static double resultant_of(enum synth_shape shape, const double *x, const double *y, double *at)
{
	const double golden = (sqrt(5) - 1) / 2;
	double a = fmin(x[1], y[1]) - 1e-4, b = fmax(x[1], y[1]) + 1e-4;

	for (int i = 0; i < 60; i++) {
		double c = b - golden * (b - a), d = a + golden * (b - a);

		if (hypot(pulse_at(shape, x, c), pulse_at(shape, y, c)) >
		    hypot(pulse_at(shape, x, d), pulse_at(shape, y, d)))
			b = d;
		else
			a = c;
	}
	*at = (a + b) / 2;
	return hypot(pulse_at(shape, x, *at), pulse_at(shape, y, *at));
}

double stage_resultant(const struct stage *stage, double *at)
{
	struct problem x = pulse_problem(stage, 0), y = pulse_problem(stage, 1);

	return resultant_of(stage->scene.shape, x.at, y.at, at);
}

static double plate_magnitude(const struct stage *stage, double time_s)
{
	return hypot(stage_signal(stage, STAGE_S1X, time_s), stage_signal(stage, STAGE_S1Y, time_s));
}

/* The signal is straight lines between the knots of a table: the summit of a parabola through three points
 * that are many knots apart. */
double stage_plate_resultant(const struct stage *stage, double *at)
{
	const double apart = 10 * SYNTH_STEP_S;
	double x = stage->axis[0].skew_s + stage->axis[0].s1_peak_s;
	double y = stage->axis[1].skew_s + stage->axis[1].s1_peak_s;
	double top = stage->onset_s + fmin(x, y), last = stage->onset_s + fmax(x, y), low, middle, high;

	for (double t = top; t < last; t += SYNTH_STEP_S)
		if (plate_magnitude(stage, t) > plate_magnitude(stage, top))
			top = t;
	low = plate_magnitude(stage, top - apart);
	middle = plate_magnitude(stage, top);
	high = plate_magnitude(stage, top + apart);
	*at = top + apart / 2 * (low - high) / (low - 2 * middle + high);
	return middle - (low - high) * (low - high) / (low - 2 * middle + high) / 8;
}

static void add_resultant(const struct problem p[2], const struct covariance c[2], struct bounds *sum)
{
	double value[2], time[2], gradient[UNKNOWNS_MAX], when[UNKNOWNS_MAX];

	for (int axis = 0; axis < 2; axis++) {
		for (unsigned i = 0; i < 3; i++) {
			for (int side = 0; side < 2; side++) {
				double q[2][UNKNOWNS_MAX];

				memcpy(q[0], p[0].at, sizeof(q[0]));
				memcpy(q[1], p[1].at, sizeof(q[1]));
				/* wide steps: the golden section ends at the root of rounding */
				q[axis][i] += (side ? 20 : -20) * p[axis].step[i];
				value[side] = resultant_of(p[0].stage->scene.shape, q[0], q[1], &time[side]);
			}
			gradient[i] = (value[1] - value[0]) / (40 * p[axis].step[i]);
			when[i] = (time[1] - time[0]) / (40 * p[axis].step[i]);
		}
		sum->resultant_g += variance(&c[axis], gradient);
		sum->resultant_s += variance(&c[axis], when);
	}
}

static void add_pulses(const struct stage *stage, struct bounds *sum)
{
	struct problem p[2];
	struct covariance c[2];

	for (int axis = 0; axis < 2; axis++) {
		double area = synth_pulse_area(stage->scene.shape) * G_M_S2;
		double velocity[3] = {area * STAGE_CONTACT_S, 0, area * stage->axis[axis].s2_g};

		p[axis] = pulse_problem(stage, axis);
		find_covariance(&p[axis], &c[axis]);
		sum->peak_g[axis] += c[axis].value[0][0];
		sum->peak_s[axis] += c[axis].value[1][1];
		sum->contact_s[axis] += c[axis].value[2][2];
		sum->velocity_m_s[axis] += variance(&c[axis], velocity);
	}
	add_resultant(p, c, sum);
}

/* ---- the free decay: a, w, c, s, and those of a second mode -------------------------------------------- */

static void decay_samples(const struct problem *problem, const double *p, double *out, size_t *count)
{
	const struct stage *stage = problem->stage;
	enum stage_channel channel = problem->axis == 0 ? STAGE_S1X : STAGE_S1Y;
	const struct stage_axis *axis = &stage->axis[problem->axis];
	double rate = stage_rate(channel);
	double from = stage->onset_s + axis->skew_s + axis->delay_s + STAGE_CONTACT_S;

	*count = 0;
	for (size_t k = (size_t)ceil(from * rate); (double)k < (from + STAGE_DECAY_S) * rate; k++) {
		double t = (double)k / rate - from, value = 0;

		for (const double *m = p; m < p + problem->size; m += 4)
			value += exp(-m[0] * t) * (m[2] * cos(m[1] * t) + m[3] * sin(m[1] * t));
		out[(*count)++] = stage_keeps(stage, channel, k) ? value : 0;
	}
}

/* a, w, c, s of a driven oscillator of that frequency once its drive has ended, from two of its values. */
static void free_decay(const double *plate, double damped_hz, double gain, double *p)
{
	double quarter = 0.25 / damped_hz, first, second;

	p[1] = 2 * PI * damped_hz;
	p[0] = p[1] * STAGE_DAMPING / sqrt(1 - STAGE_DAMPING * STAGE_DAMPING);
	first = synth_table(plate, STAGE_TABLE, SYNTH_STEP_S, STAGE_CONTACT_S);
	second = synth_table(plate, STAGE_TABLE, SYNTH_STEP_S, STAGE_CONTACT_S + quarter);
	p[2] = gain * first;
	p[3] = gain * second * exp(p[0] * quarter);
}

static struct problem decay_problem(const struct stage *stage, int axis)
{
	struct problem problem = {.stage = stage, .axis = axis, .size = 4, .signal = decay_samples};
	double gain = stage->axis[axis].gain;

	free_decay(stage->plate, stage->damped_hz, gain, problem.at);
	if (stage->second) {
		free_decay(stage->second, stage->damped_hz + stage->scene.second_hz,
		           gain * stage->scene.second_part, problem.at + 4);
		problem.size = 8;
	}
	for (unsigned i = 0; i < problem.size; i++)
		problem.step[i] = i % 4 < 2 ? 1e-3 : 1e-2;
	return problem;
}

/* Variances of frequency, damping ratio and natural frequency from those of a and w. */
static void decay_variances(const double a, const double w, double c[2][2], double out[3])
{
	double natural = hypot(a, w);
	double zeta[2] = {w * w / pow(natural, 3), -a * w / pow(natural, 3)};
	double n[2] = {a / natural, w / natural};

	out[0] = c[1][1] / (4 * PI * PI);
	out[1] = zeta[0] * zeta[0] * c[0][0] + 2 * zeta[0] * zeta[1] * c[0][1] + zeta[1] * zeta[1] * c[1][1];
	out[2] = (n[0] * n[0] * c[0][0] + 2 * n[0] * n[1] * c[0][1] + n[1] * n[1] * c[1][1]) / (4 * PI * PI);
}

static void invert2(double m[2][2])
{
	double determinant = m[0][0] * m[1][1] - m[0][1] * m[1][0], swap = m[0][0];

	m[0][0] = m[1][1] / determinant;
	m[1][1] = swap / determinant;
	m[0][1] = m[1][0] = -m[0][1] / determinant;
}

static void add_decays(const struct stage *stage, struct bounds *sum)
{
	double joint[2][2] = {{0}}, out[3], a = 0, w = 0;

	for (int axis = 0; axis < 2; axis++) {
		struct problem problem = decay_problem(stage, axis);
		struct covariance c;
		double own[2][2];

		find_covariance(&problem, &c);
		for (int i = 0; i < 4; i++)
			own[i / 2][i % 2] = c.value[i / 2][i % 2];
		a = problem.at[0], w = problem.at[1];
		decay_variances(a, w, own, out);
		sum->frequency_hz[axis] += out[0];
		sum->damping[axis] += out[1];
		sum->natural_hz[axis] += out[2];
		invert2(own);
		for (int i = 0; i < 4; i++)
			joint[i / 2][i % 2] += own[i / 2][i % 2];
	}
	invert2(joint);
	decay_variances(a, w, joint, out);
	sum->joint_hz += out[0];
	sum->joint_damping += out[1];
	sum->joint_natural_hz += out[2];
}

/* ---- the lag: pulse and oscillator together ---------------------------------------------------------- */

/* A, t_p, T, gain, delay, natural frequency, damping. The oscillator of a pulse of another base is made
 * anew. */
static void lag_samples(const struct problem *problem, const double *p, double *out, size_t *count)
{
	static double plate[STAGE_TABLE];
	const struct stage *stage = problem->stage;
	enum stage_channel channel = problem->axis == 0 ? STAGE_S1X : STAGE_S1Y;
	double rate = stage_rate(channel), onset = p[1] - synth_pulse_summit(stage->scene.shape) * p[2];
	size_t n;

	synth_plate(plate, STAGE_TABLE, stage->scene.shape, p[2], p[5], p[6]);
	pulse_samples(problem, p, out, count);
	n = *count;
	for (size_t k = (size_t)((stage->onset_s - 1e-3) * rate);
	     (double)k < (stage->onset_s + STAGE_CONTACT_S + STAGE_DECAY_S) * rate; k++) {
		double t = (double)k / rate - onset - p[4];

		out[n++] = stage_keeps(stage, channel, k)
		                   ? p[3] * synth_table(plate, STAGE_TABLE, SYNTH_STEP_S, t)
		                   : 0;
	}
	*count = n;
}

/* What hangs on those: the lag, S1's peak and its time. */
enum { LAG, PLATE_G, PLATE_S, OUTCOMES };

static void outcome(const struct stage *stage, const double *p, double out[OUTCOMES])
{
	static double plate[STAGE_TABLE];
	double height;

	synth_plate(plate, STAGE_TABLE, stage->scene.shape, p[2], p[5], p[6]);
	out[LAG] = p[4] + synth_plate_peak(plate, STAGE_TABLE, &height) -
	           synth_pulse_summit(stage->scene.shape) * p[2];
	out[PLATE_G] = p[3] * height;
	out[PLATE_S] = p[1] + out[LAG];
}

static void add_lags(const struct stage *stage, struct bounds *sum)
{
	double weight = 0;

	for (int axis = 0; axis < 2; axis++) {
		struct problem problem = pulse_problem(stage, axis);
		struct covariance c;
		double natural = stage->damped_hz / sqrt(1 - STAGE_DAMPING * STAGE_DAMPING);
		double more[4] = {stage->axis[axis].gain, stage->axis[axis].delay_s, natural, STAGE_DAMPING};
		double step[4] = {stage->axis[axis].gain * 1e-4, 2e-6, 0.1, 1e-3};
		double gradient[OUTCOMES][7];

		memcpy(problem.at + 3, more, sizeof(more));
		memcpy(problem.step + 3, step, sizeof(step));
		problem.step[1] = problem.step[2] = 2e-6;
		problem.size = 7;
		problem.signal = lag_samples;
		find_covariance(&problem, &c);
		for (unsigned i = 0; i < 7; i++) {
			double p[UNKNOWNS_MAX], high[OUTCOMES], low[OUTCOMES];

			memcpy(p, problem.at, sizeof(p));
			p[i] += problem.step[i];
			outcome(stage, p, high);
			p[i] -= 2 * problem.step[i];
			outcome(stage, p, low);
			for (unsigned j = 0; j < OUTCOMES; j++)
				gradient[j][i] = (high[j] - low[j]) / (2 * problem.step[i]);
		}
		sum->lag_s[axis] += variance(&c, gradient[LAG]);
		sum->plate_g[axis] += variance(&c, gradient[PLATE_G]);
		sum->plate_s[axis] += variance(&c, gradient[PLATE_S]);
		weight += 1 / variance(&c, gradient[LAG]);
	}
	sum->joint_lag_s += 1 / weight;
}

void bounds_find(struct stage *stage, bool lags, struct bounds *bounds)
{
	double *value = (double *)bounds;
	struct bounds lag = {0};

	memset(bounds, 0, sizeof(*bounds));
	for (int i = 0; i < ONSETS; i++) {
		stage->onset_s = STAGE_PRE_S + (i + 0.5) / ONSETS * 1e-3;
		add_pulses(stage, bounds);
		add_decays(stage, bounds);
		if (lags && i % LAG_EVERY == 0)
			add_lags(stage, &lag);
	}
	for (int i = 0; i < 2; i++) {
		bounds->lag_s[i] = lag.lag_s[i] * LAG_EVERY;
		bounds->plate_g[i] = lag.plate_g[i] * LAG_EVERY;
		bounds->plate_s[i] = lag.plate_s[i] * LAG_EVERY;
	}
	bounds->joint_lag_s = lag.joint_lag_s * LAG_EVERY;
	for (size_t i = 0; i < sizeof(*bounds) / sizeof(double); i++)
		value[i] = sqrt(value[i] / ONSETS);
}
