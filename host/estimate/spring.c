/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/spring.h"

#include <math.h>
#include <string.h>

#include "common/units.h"
#include "host/estimate/limits.h"
#include "host/estimate/modes.h"

/* Q, of a swing as large as the start's: beyond is no spring any more. */
#define SOFT_MAX 1e4

/* A small swing is stiffer than one without end by at most this part of that, and softer by less. */
#define B_MIN -0.9
#define B_MAX 10.0

/* Of spring_at's steps and those of the first cycles. */
#define STEPS_PER_CYCLE 64.0

enum { PLACE_Q = MODES_LAW, PLACE_D = MODES_LAW + 1, LANES = 4 };

/* Where the processor has registers of four they are used. The numbers are the same, as nothing is fused or
 * reordered. */
#if defined(__x86_64__) && defined(__gnu_linux__)
#define WIDE __attribute__((target_clones("avx2", "default")))
#else
#define WIDE
#endif
#define INSIDE static inline __attribute__((always_inline)) void

/* Four numbers side by side: element by element like one number. By pointers, since how they are passed hangs
 * on the processor. */
#define QUAD double __attribute__((vector_size(LANES * sizeof(double))))

/* In units of g: x is w0^2 of the deflection, v is w0 of the speed, time is in 1/w0. */
struct state {
	double x, v;
};

struct spring {
	double loss, q, k, omega0; /* loss: 2 a / w0 */
	struct state at;
};

static double spring_swing(const double *p)
{
	return p[MODES_COSINE] * p[MODES_COSINE] + p[MODES_SINE] * p[MODES_SINE];
}

/* The part of the stiffness that a swing without end would have lost. */
static double spring_lost(const double *p)
{
	const double swing = p[PLACE_Q] * spring_swing(p);

	return p[PLACE_D] * (1 + swing) / swing;
}

static struct spring spring_of(const double *p)
{
	double omega0 = hypot(p[MODES_OMEGA], p[MODES_DECAY]), swing = spring_swing(p);

	return (struct spring){2 * p[MODES_DECAY] / omega0,
	                       p[PLACE_Q],
	                       p[PLACE_D] * (1 / swing + p[PLACE_Q]),
	                       omega0,
	                       {p[MODES_COSINE], p[MODES_SINE]}};
}

static inline double push(const struct spring *s, double x, double v)
{
	const double y = x * x;

	return -s->loss * v - x * (1 - s->k * y / (1 + s->q * y));
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
	return 1 - p[PLACE_D];
}

/* The angle from one state to the next. */
static double spring_turned(const struct state *from, const struct state *to)
{
	return atan2(from->v * to->x - from->x * to->v, from->x * to->x + from->v * to->v);
}

/* Whole steps until the last quarter of the last turn: a turn begins as the state comes past where it was at
 * time 0. Returns the steps, fewer than most. */
static unsigned spring_turn(struct spring *s, unsigned cycles, double step, unsigned most)
{
	const struct state start = s->at;
	unsigned steps = 0, turns = 0;
	bool late = false; /* in the second half of a turn */

	while (steps < most) {
		double along, aside;

		spring_step(s, step);
		steps++;
		along = start.x * s->at.x + start.v * s->at.v;
		aside = start.v * s->at.x - start.x * s->at.v;
		turns += late && aside >= 0;
		late = aside < 0;
		if (turns + 1 >= cycles && late && along > 0)
			break;
	}
	return steps;
}

double spring_mean_hz(const double *p, unsigned cycles)
{
	const double longest = 2 * UNITS_PI / STEPS_PER_CYCLE;
	/* No spring takes longer. */
	const unsigned most = (unsigned)(B_MAX * STEPS_PER_CYCLE) * cycles;
	struct spring s = spring_of(p);
	const struct state start = s.at;
	const unsigned whole = spring_turn(&s, cycles, longest, most);
	double time = whole * longest, left = -spring_turned(&start, &s.at);

	/* What is left is a step too far or too short, each time a smaller one. */
	for (unsigned i = whole; i < most && fabs(left) > LIMIT_ROUNDING; i++) {
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
	return p[MODES_OMEGA] > 0 && fabs(p[MODES_DECAY]) < p[MODES_OMEGA] && p[PLACE_Q] > 0 &&
	       p[PLACE_Q] * spring_swing(p) < SOFT_MAX && spring_lost(p) > B_MIN / (1 + B_MIN) &&
	       spring_lost(p) < B_MAX / (1 + B_MAX);
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

/* Four solutions. */
struct quad {
	QUAD loss, q, k, step; /* step in 1/w0 */
	QUAD x, v;
};

static void quad_set(struct quad *quad, const struct spring *s, double step_s)
{
	for (unsigned i = 0; i < LANES; i++) {
		quad->loss[i] = s[i].loss;
		quad->q[i] = s[i].q;
		quad->k[i] = s[i].k;
		quad->step[i] = s[i].omega0 * step_s;
		quad->x[i] = s[i].at.x;
		quad->v[i] = s[i].at.v;
	}
}

INSIDE push_quad(const struct quad *s, const QUAD *x, const QUAD *v, QUAD *a)
{
	const QUAD y = *x * *x;

	*a = -s->loss * *v - *x * (1 - s->k * y / (1 + s->q * y));
}

/* As spring_step. */
INSIDE quad_step(struct quad *s, QUAD *a1)
{
	const QUAD x = s->x, v = s->v, h = s->step;
	QUAD x2, v2, a2, x3, v3, a3, x4, v4, a4;

	push_quad(s, &x, &v, a1);
	x2 = x + h / 2 * v;
	v2 = v + h / 2 * *a1;
	push_quad(s, &x2, &v2, &a2);
	x3 = x + h / 2 * v2;
	v3 = v + h / 2 * a2;
	push_quad(s, &x3, &v3, &a3);
	x4 = x + h * v3;
	v4 = v + h * a3;
	push_quad(s, &x4, &v4, &a4);
	s->x = x + h / 6 * (v + 2 * v2 + 2 * v3 + v4);
	s->v = v + h / 6 * (*a1 + 2 * a2 + 2 * a3 + a4);
}

/* The next block's mean of each solution: of the accelerations before its steps. */
INSIDE quad_block_mean(struct quad *quad, unsigned block, QUAD *mean)
{
	struct quad here = *quad;
	QUAD sum = {0}, a;

	for (unsigned j = 0; j < block; j++) {
		quad_step(&here, &a);
		sum += a;
	}
	*quad = here;
	*mean = sum / block;
}

/* Derivatives and, last, the residual: a row of the normal equations, and the sums of its products. */
_Static_assert(SPRING_SIZE + 1 == 2 * LANES, "a row fills two registers");

struct spring_sums {
	QUAD of[2 * LANES][2]; /* of a column with the first four and the last four */
	size_t taken;
};

INSIDE spring_add(struct spring_sums *sums, const QUAD *low, const QUAD *high)
{
	for (unsigned i = 0; i < LANES; i++) {
		sums->of[i][0] += (*low)[i] * *low;
		sums->of[LANES + i][0] += (*high)[i] * *low;
		sums->of[LANES + i][1] += (*high)[i] * *high;
	}
	sums->taken++;
}

WIDE static void spring_sum(struct spring_sums *sums, struct quad quad[2], const QUAD difference[2],
                            const struct series *series, double offset_g)
{
	struct spring_sums all = {.taken = 0};

	for (unsigned k = 0; k < series->count; k++) {
		QUAD low, high;
		double at;

		quad_block_mean(&quad[0], series->block, &low);
		quad_block_mean(&quad[1], series->block, &high);
		if (!series->good[k])
			continue;
		at = low[MODES_OFFSET];
		low = (low - at) / difference[0];
		high = (high - at) / difference[1];
		low[MODES_OFFSET] = 1;
		high[LANES - 1] = series->value_g[k] - offset_g - at;
		spring_add(&all, &low, &high);
	}
	*sums = all;
}

size_t spring_normal(const struct series *series, const double *p, double normal[CHOLESKY_MAX][CHOLESKY_MAX],
                     double right[CHOLESKY_MAX], double *squares)
{
	struct spring s[2 * LANES];
	struct spring_sums sums;
	struct quad quad[2];
	double difference[2 * LANES];
	QUAD by[2];

	if (!spring_possible(p))
		return 0;
	start_all(s, difference, p, series);
	s[SPRING_SIZE] = s[0]; /* one too few */
	difference[SPRING_SIZE] = 1;
	for (unsigned i = 0; i < 2; i++)
		quad_set(&quad[i], &s[LANES * i], series->step_s / series->block);
	memcpy(by, difference, sizeof(by));
	spring_sum(&sums, quad, by, series, p[MODES_OFFSET]);
	for (unsigned i = 0; i < SPRING_SIZE; i++) {
		for (unsigned j = 0; j <= i; j++)
			normal[i][j] = sums.of[i][j / LANES][j % LANES];
		right[i] = sums.of[SPRING_SIZE][i / LANES][i % LANES];
	}
	*squares = sums.of[SPRING_SIZE][1][LANES - 1];
	return sums.taken;
}
