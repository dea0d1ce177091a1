/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/spring.h"

#include <math.h>
#include <string.h>

#include "common/units.h"
#include "host/estimate/gram.h"
#include "host/estimate/limits.h"
#include "host/estimate/modes.h"
#include "host/estimate/pair.h"

/* Q, of a swing as large as the start's: beyond is no spring any more. */
#define SOFT_MAX 1e4
#define B_MIN -0.9
#define B_MAX 10.0

/* Of spring_at's steps and those of the first cycles. */
#define STEPS_PER_CYCLE 64.0

enum { PLACE_Q = MODES_LAW, PLACE_B = MODES_LAW + 1, PAIRS = (SPRING_SIZE + 1) / 2 };

/* In units of g: x is w0^2 of the deflection, v is w0 of the speed, time is in 1/w0. */
struct state {
	double x, v;
};

struct spring {
	double loss, q, b, omega0; /* loss: 2 a / w0 */
	struct state at;
};

static struct spring spring_of(const double *p)
{
	double omega0 = hypot(p[MODES_OMEGA], p[MODES_DECAY]);

	return (struct spring){2 * p[MODES_DECAY] / omega0,
	                       p[PLACE_Q],
	                       p[PLACE_B],
	                       omega0,
	                       {p[MODES_COSINE], p[MODES_SINE]}};
}

static inline double push(const struct spring *s, double x, double v)
{
	return -s->loss * v - x * (1 + s->b / (1 + s->q * x * x)) / (1 + s->b);
}

/* By step in 1/w0, either way. */
static inline void spring_step(struct spring *s, double h)
{
	const double x = s->at.x, v = s->at.v;
	const double a1 = push(s, x, v), v2 = v + h / 2 * a1, a2 = push(s, x + h / 2 * v, v2);
	const double v3 = v + h / 2 * a2, a3 = push(s, x + h / 2 * v2, v3), v4 = v + h * a3;
	const double a4 = push(s, x + h * v3, v4);

	s->at.x = x + h / 6 * (v + 2 * v2 + 2 * v3 + v4);
	s->at.v = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
}

/* From time 0 in steps no longer than longest_s. */
static void spring_go(struct spring *s, double time_s, double longest_s)
{
	unsigned steps = (unsigned)fmin(ceil(fabs(time_s) / longest_s), 1e6);

	for (unsigned i = 0; i < steps; i++)
		spring_step(s, time_s * s->omega0 / steps);
}

double spring_at(const double *p, double time_s)
{
	struct spring s = spring_of(p);

	spring_go(&s, time_s, 2 * UNITS_PI / (STEPS_PER_CYCLE * s.omega0));
	return p[MODES_OFFSET] + push(&s, s.at.x, s.at.v);
}

double spring_softness(const double *p)
{
	double swing = p[MODES_COSINE] * p[MODES_COSINE] + p[MODES_SINE] * p[MODES_SINE];

	return (1 + p[PLACE_B] / (1 + p[PLACE_Q] * swing)) / (1 + p[PLACE_B]);
}

/* The angle from one state to the next. */
static double spring_turned(const struct state *from, const struct state *to)
{
	return atan2(from->v * to->x - from->x * to->v, from->x * to->x + from->v * to->v);
}

double spring_mean_hz(const double *p, unsigned cycles)
{
	const double turns = 2 * UNITS_PI * cycles, longest = 2 * UNITS_PI / STEPS_PER_CYCLE;
	/* No spring takes longer. */
	const unsigned most = (unsigned)(B_MAX * STEPS_PER_CYCLE) * cycles;
	struct spring s = spring_of(p);
	double left = turns, time = 0;

	/* What is left is a step too far or too short, each time a smaller one. */
	for (unsigned i = 0; i < most && fabs(left) > LIMIT_ROUNDING; i++) {
		const struct state before = s.at;
		double step = fmin(longest, left);

		spring_step(&s, step);
		time += step;
		left -= spring_turned(&before, &s.at);
	}
	return cycles * s.omega0 / time;
}

static bool spring_possible(const double *p)
{
	double swing = p[MODES_COSINE] * p[MODES_COSINE] + p[MODES_SINE] * p[MODES_SINE];

	return p[MODES_OMEGA] > 0 && fabs(p[MODES_DECAY]) < p[MODES_OMEGA] && p[PLACE_Q] >= 0 &&
	       p[PLACE_Q] * swing < SOFT_MAX && p[PLACE_B] > B_MIN && p[PLACE_B] < B_MAX;
}

/* The spring at p and, for each unknown but the offset, at p a little changed by difference. */
static void start_all(struct spring *s, double *difference, const double *p, const struct series *series)
{
	const double swing = hypot(p[MODES_COSINE], p[MODES_SINE]);
	const double least[SPRING_SIZE] = {
	        1, 0, 0, LIMIT_LEAST, LIMIT_LEAST, LIMIT_SMALL / (swing * swing), LIMIT_LEAST};
	const double sample_s = series->step_s / series->block;

	for (unsigned i = 0; i < SPRING_SIZE; i++) {
		double q[SPRING_SIZE];

		memcpy(q, p, sizeof(q));
		difference[i] = LIMIT_SMALL * fmax(fabs(p[i]), least[i]);
		if (i != MODES_OFFSET)
			q[i] += difference[i];
		s[i] = spring_of(q);
		spring_go(&s[i], series->first_s - (series->block - 1) * sample_s / 2, sample_s);
	}
}

/* Two solutions. */
struct pair {
	PAIR loss, q, b, share, step; /* share: 1 / (1 + b); step in 1/w0 */
	PAIR x, v;
};

static struct pair pair_of(const struct spring *one, const struct spring *other, double step_s)
{
	const PAIR b = {one->b, other->b};

	return (struct pair){.loss = {one->loss, other->loss},
	                     .q = {one->q, other->q},
	                     .b = b,
	                     .share = 1 / (1 + b),
	                     .step = {one->omega0 * step_s, other->omega0 * step_s},
	                     .x = {one->at.x, other->at.x},
	                     .v = {one->at.v, other->at.v}};
}

static inline PAIR push_pair(const struct pair *s, PAIR x, PAIR v)
{
	return -s->loss * v - x * (1 + s->b / (1 + s->q * x * x)) * s->share;
}

/* As spring_step; returns the accelerations before it. */
static inline PAIR pair_step(struct pair *s)
{
	const PAIR x = s->x, v = s->v, h = s->step;
	const PAIR a1 = push_pair(s, x, v), v2 = v + h / 2 * a1, a2 = push_pair(s, x + h / 2 * v, v2);
	const PAIR v3 = v + h / 2 * a2, a3 = push_pair(s, x + h / 2 * v2, v3), v4 = v + h * a3;
	const PAIR a4 = push_pair(s, x + h * v3, v4);

	s->x = x + h / 6 * (v + 2 * v2 + 2 * v3 + v4);
	s->v = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
	return a1;
}

/* The next block's mean of each solution. */
static void spring_block_means(struct pair pair[PAIRS], unsigned block, double mean[2 * PAIRS])
{
	for (unsigned i = 0; i < PAIRS; i++) {
		struct pair here = pair[i];
		PAIR sum = {0, 0};

		for (unsigned j = 0; j < block; j++)
			sum += pair_step(&here);
		pair[i] = here;
		mean[2 * i] = sum[0] / block;
		mean[2 * i + 1] = sum[1] / block;
	}
}

size_t spring_normal(const struct series *series, const double *p, double normal[CHOLESKY_MAX][CHOLESKY_MAX],
                     double right[CHOLESKY_MAX], double *squares)
{
	struct spring s[2 * PAIRS];
	struct pair pair[PAIRS];
	double difference[SPRING_SIZE];
	struct gram gram;

	if (!spring_possible(p))
		return 0;
	start_all(s, difference, p, series);
	s[SPRING_SIZE] = s[0]; /* one too few for pairs */
	for (unsigned i = 0; i < PAIRS; i++)
		pair[i] = pair_of(&s[2 * i], &s[2 * i + 1], series->step_s / series->block);
	gram_start(&gram, SPRING_SIZE);
	for (unsigned k = 0; k < series->count; k++) {
		double mean[2 * PAIRS], row[SPRING_SIZE + 1];

		spring_block_means(pair, series->block, mean);
		for (unsigned i = 0; i < SPRING_SIZE; i++)
			row[i] = (mean[i] - mean[MODES_OFFSET]) / difference[i];
		row[MODES_OFFSET] = 1;
		row[SPRING_SIZE] = series->value_g[k] - p[MODES_OFFSET] - mean[MODES_OFFSET];
		if (series->good[k])
			gram_add(&gram, row);
	}
	return gram_finish(&gram, normal, right, squares);
}
