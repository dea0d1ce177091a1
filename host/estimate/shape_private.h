/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_SHAPE_PRIVATE_H
#define DT_HOST_ESTIMATE_SHAPE_PRIVATE_H
/*
 * What the parts of shape share: one family's fit to a trace.
 *   shape.c        the fit, samples at a limit, what it says
 *   shape_judge.c  what the residual says of the family
 */
#include <math.h>

#include "common/units.h"
#include "host/estimate/shape.h"

enum { SHAPE_PEAK, SHAPE_TIME, SHAPE_BASE, SHAPE_POWER, SHAPE_UNKNOWNS };

/* No contact is flatter, none sharper: keeps a fit in range. */
#define SHAPE_POWER_MIN 0.3
#define SHAPE_POWER_MAX 8.0

struct shape_problem {
	const struct trace *trace;
	enum estimate_family family;
	size_t first, last;              /* [first, last) */
	bool plain;                      /* none of these samples carries a mark */
	double near_s;                   /* time is counted from here */
	double base_s;                   /* at the start */
	double noise_g;                  /* of censored samples, positive */
	size_t limit_first, limit_count; /* samples that are as if at a limit */
};

/* Of the samples those under the pulse, [first, last), and phi of the first and from one to the next. */
struct shape_under {
	size_t first, last;
	double phi, step;
};

struct shape_under shape_under_pulse(const struct shape_problem *m, const double *p);

/* The pulse of height 1, its derivative by phi, and by the power. */
static inline void shape_unit(enum estimate_family family, double power, double cosine, double sine,
                              double out[3])
{
	double logarithm, rest;

	switch (family) {
	case ESTIMATE_FAMILY_HALF_SINE:
		out[0] = cosine;
		out[1] = -sine;
		out[2] = 0;
		return;
	case ESTIMATE_FAMILY_HAVERSINE:
		out[0] = cosine * cosine;
		out[1] = -2 * cosine * sine;
		out[2] = 0;
		return;
	default:
		logarithm = log(cosine);
		rest = exp((power - 1) * logarithm);
		out[0] = rest * cosine;
		out[1] = -power * rest * sine;
		out[2] = out[0] * logarithm;
	}
}

static inline bool shape_is_censored(const struct shape_problem *m, size_t k)
{
	return k - m->limit_first < m->limit_count || m->trace->sample[k] & TRACE_LIMIT;
}

static inline unsigned shape_unknowns(enum estimate_family family)
{
	return family == ESTIMATE_FAMILY_SINE_POWER ? SHAPE_UNKNOWNS : SHAPE_UNKNOWNS - 1;
}

/* Value and derivatives by the unknowns. */
static inline double shape_row(const struct shape_problem *m, const double *p, double phi, double cosine,
                               double sine, double row[SHAPE_UNKNOWNS])
{
	double unit[3], slope;

	shape_unit(m->family, p[SHAPE_POWER], cosine, sine, unit);
	slope = -p[SHAPE_PEAK] * unit[1] / p[SHAPE_BASE];
	row[SHAPE_PEAK] = unit[0];
	row[SHAPE_TIME] = UNITS_PI * slope;
	row[SHAPE_BASE] = phi * slope;
	row[SHAPE_POWER] = p[SHAPE_PEAK] * unit[2];
	return p[SHAPE_PEAK] * unit[0];
}

/* Of the samples beyond the pulse's feet. */
double shape_squares_beyond(const struct shape_problem *m, const struct shape_under *under);

/* Samples that are neither missing nor at a limit. */
size_t shape_count_used(const struct shape_problem *m);

/* Chi-square of the samples that were read, and the scores. False when hardly one lies inside the base. */
bool shape_question(const struct shape_problem *m, const double *p, struct shape *shape);

#endif
