/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/model/ode.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define SAFETY 0.9
#define SHRINK_MAX 0.2
#define GROWTH_MAX 5.0

void ode_start(struct ode *ode, const double y[], double first_step)
{
	ode->t = 0.0;
	ode->next = first_step;
	ode->evaluations = 1;
	memcpy(ode->y, y, ode->count * sizeof(*y));
	ode->rates(ode->context, ode->y, ode->rate[0]);
	ode->last = (struct ode_piece){.length = 1.0};
	memcpy(ode->last.term[0], y, ode->count * sizeof(*y));
	ode->before = ode->last;
}

/* Dormand and Prince 1980, stage by stage; y1 ends as the solution of order 5, whose rate the next step
 * starts with. Written out: looped over a table it takes twice the time. */
static void stages(struct ode *ode, double h, double y1[])
{
	const double *y = ode->y, *k1 = ode->rate[0];
	double *k2 = ode->rate[1], *k3 = ode->rate[2], *k4 = ode->rate[3], *k5 = ode->rate[4],
	       *k6 = ode->rate[5], *k7 = ode->rate[6];
	size_t n = ode->count, i;

	for (i = 0; i < n; i++)
		y1[i] = y[i] + h * (1.0 / 5) * k1[i];
	ode->rates(ode->context, y1, k2);
	for (i = 0; i < n; i++)
		y1[i] = y[i] + h * (3.0 / 40 * k1[i] + 9.0 / 40 * k2[i]);
	ode->rates(ode->context, y1, k3);
	for (i = 0; i < n; i++)
		y1[i] = y[i] + h * (44.0 / 45 * k1[i] - 56.0 / 15 * k2[i] + 32.0 / 9 * k3[i]);
	ode->rates(ode->context, y1, k4);
	for (i = 0; i < n; i++)
		y1[i] = y[i] + h * (19372.0 / 6561 * k1[i] - 25360.0 / 2187 * k2[i] + 64448.0 / 6561 * k3[i] -
		                    212.0 / 729 * k4[i]);
	ode->rates(ode->context, y1, k5);
	for (i = 0; i < n; i++)
		y1[i] = y[i] + h * (9017.0 / 3168 * k1[i] - 355.0 / 33 * k2[i] + 46732.0 / 5247 * k3[i] +
		                    49.0 / 176 * k4[i] - 5103.0 / 18656 * k5[i]);
	ode->rates(ode->context, y1, k6);
	for (i = 0; i < n; i++)
		y1[i] = y[i] + h * (35.0 / 384 * k1[i] + 500.0 / 1113 * k3[i] + 125.0 / 192 * k4[i] -
		                    2187.0 / 6784 * k5[i] + 11.0 / 84 * k6[i]);
	ode->rates(ode->context, y1, k7);
	ode->evaluations += ODE_STAGES - 1;
}

/* Order 5 less order 4, the worst state's, in units of the tolerance. */
static double ode_error_of(const struct ode *ode, double h)
{
	const double(*k)[ODE_STATES_MAX] = ode->rate;
	double worst = 0.0;

	for (size_t i = 0; i < ode->count; i++) {
		double error = 71.0 / 57600 * k[0][i] - 71.0 / 16695 * k[2][i] + 71.0 / 1920 * k[3][i] -
		               17253.0 / 339200 * k[4][i] + 22.0 / 525 * k[5][i] - 1.0 / 40 * k[6][i];

		error = fabs(h * error) / (ode->tolerance * ode->scale[i]);
		if (!(error <= worst)) /* a NaN stays */
			worst = error;
	}
	return worst;
}

/* The last term of the continuous extension (Hairer, Norsett and Wanner, Solving ODE I, II.6). */
static double extension(const struct ode *ode, size_t i)
{
	const double(*k)[ODE_STATES_MAX] = ode->rate;

	return -12715105075.0 / 11282082432.0 * k[0][i] + 87487479700.0 / 32700410799.0 * k[2][i] -
	       10690763975.0 / 1880347072.0 * k[3][i] + 701980252875.0 / 199316789632.0 * k[4][i] -
	       1453857185.0 / 822651844.0 * k[5][i] + 69997945.0 / 29380423.0 * k[6][i];
}

static void ode_keep(struct ode *ode, double h, const double y1[])
{
	struct ode_piece *p = &ode->last;

	ode->before = *p;
	p->from = ode->t;
	p->length = h;
	p->end = ode->t + h;
	for (size_t i = 0; i < ode->count; i++) {
		double rise = y1[i] - ode->y[i], bend = h * ode->rate[0][i] - rise;

		p->term[0][i] = ode->y[i];
		p->term[1][i] = rise;
		p->term[2][i] = bend;
		p->term[3][i] = rise - h * ode->rate[ODE_STAGES - 1][i] - bend;
		p->term[4][i] = h * extension(ode, i);
		ode->y[i] = y1[i];
	}
	memcpy(ode->rate[0], ode->rate[ODE_STAGES - 1], ode->count * sizeof(ode->rate[0][0]));
	ode->t = p->end;
}

int ode_step(struct ode *ode, double until)
{
	double y1[ODE_STATES_MAX];

	while (ode->evaluations < ODE_EVALUATIONS_MAX) {
		double left = until - ode->t, h = ode->next < left ? ode->next : left;
		double error, factor;

		if (!(h > 16.0 * DBL_EPSILON * ode->t) || !(h > 0.0))
			return DT_E_NUMERIC;
		stages(ode, h, y1);
		error = ode_error_of(ode, h);
		factor = SAFETY * pow(error, -0.2);
		if (!(factor > SHRINK_MAX)) /* a NaN shrinks the step as well */
			factor = SHRINK_MAX;
		if (error <= 1.0) {
			ode_keep(ode, h, y1);
			if (h == left)
				ode->t = ode->last.end = until;
			if (h < left ||
			    factor < 1.0) /* a step cut short by `until` says nothing of the next */
				ode->next = h * (factor < GROWTH_MAX ? factor : GROWTH_MAX);
			return 0;
		}
		ode->next = h * (factor < SAFETY ? factor : SAFETY);
	}
	return DT_E_NUMERIC;
}

void ode_at(const struct ode *ode, double t, double y[])
{
	const struct ode_piece *p = t < ode->last.from ? &ode->before : &ode->last;
	double a = (t - p->from) / p->length, b = 1.0 - a;

	for (size_t i = 0; i < ode->count; i++)
		y[i] = p->term[0][i] +
		       a * (p->term[1][i] + b * (p->term[2][i] + a * (p->term[3][i] + b * p->term[4][i])));
}

void ode_cut(struct ode *ode, double t)
{
	ode_at(ode, t, ode->y);
	ode->t = ode->last.end = t;
	ode_renew(ode);
}

void ode_renew(struct ode *ode)
{
	ode->rates(ode->context, ode->y, ode->rate[0]);
	ode->evaluations++;
}
