/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/spring.h"

#include <math.h>
#include <string.h>

#include "common/base/wide.h"
#include "common/units.h"
#include "host/estimate/limits.h"
#include "host/estimate/modes.h"

/* A small swing is stiffer than one without end by at most this part of that, and softer by less. */
#define B_MAX 10.0
#define B_MIN (-1 + 1 / B_MAX)

/* Of spring_at's steps. */
#define STEPS_PER_CYCLE 64.0

/* Of steps that go by what was before, over 1 + the swing that Q calls large. */
#define STEP_ON 0.5

enum { PLACE_Q = MODES_LAW, PLACE_D = MODES_LAW + 1, LANES = 4, BEFORE = 5 };

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

double spring_mean_hz(const double *p, unsigned cycles, unsigned steps)
{
	const double longest = 2 * UNITS_PI / steps;
	/* No spring takes longer. */
	const unsigned most = (unsigned)(B_MAX * steps) * cycles;
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
	       p[PLACE_Q] * spring_swing(p) < 1 / LIMIT_SMALL && spring_lost(p) > B_MIN / (1 + B_MIN) &&
	       spring_lost(p) < B_MAX / (1 + B_MAX);
}

/* Four solutions, in steps: times are parts of one, and x of what Q calls large. Stiffness is
 * still + soft / (1 + x^2). */
struct quad {
	QUAD loss, still, soft;
	QUAD x, v;
	QUAD gained, a[BEFORE]; /* x's last step; the accelerations one step ago, two, .. */
};

/* What the solutions are off the spring at p: loss, k, the swing of time 0 as a part of itself. */
enum { LANE_LOSS = 1, LANE_K, LANE_SWING };

/* Where the series begins. */
static void quad_start(struct quad *quad, double difference[LANES], const struct spring *spring,
                       double first_s, double sample_s)
{
	const double swing = spring->at.x * spring->at.x + spring->at.v * spring->at.v,
	             root = sqrt(spring->q);
	const double step = spring->omega0 * sample_s;

	difference[LANE_LOSS] = LIMIT_SMALL * fmax(fabs(spring->loss), LIMIT_LEAST);
	difference[LANE_K] = LIMIT_SMALL * fmax(fabs(spring->k), LIMIT_LEAST / swing);
	difference[LANE_SWING] = LIMIT_SMALL;
	for (unsigned i = 0; i < LANES; i++) {
		struct spring s = *spring;

		s.loss += i == LANE_LOSS ? difference[i] : 0;
		s.k += i == LANE_K ? difference[i] : 0;
		s.at.x *= i == LANE_SWING ? 1 + difference[i] : 1;
		s.at.v *= i == LANE_SWING ? 1 + difference[i] : 1;
		spring_go(&s, first_s, sample_s);
		quad->loss[i] = s.loss * step;
		quad->still[i] = (1 - s.k / s.q) * step * step;
		quad->soft[i] = s.k / s.q * step * step;
		quad->x[i] = s.at.x * root;
		quad->v[i] = s.at.v * root * step;
	}
}

INSIDE push_quad(const struct quad *s, const QUAD *x, const QUAD *v, QUAD *near, QUAD *a)
{
	*near = 1 / (1 + *x * *x);
	*a = -s->loss * *v - *x * (s->still + s->soft * *near);
}

/* As spring_step: gives the acceleration before it, and how fast the first solution's changes there. */
INSIDE quad_step(struct quad *s, QUAD *a1, double *slope)
{
	const QUAD x = s->x, v = s->v;
	QUAD x2, v2, a2, x3, v3, a3, x4, v4, a4, near;

	push_quad(s, &x, &v, &near, a1);
	*slope = -s->loss[0] * (*a1)[0] - v[0] * (s->still[0] + s->soft[0] * near[0] * (2 * near[0] - 1));
	x2 = x + v * 0.5;
	v2 = v + *a1 * 0.5;
	push_quad(s, &x2, &v2, &near, &a2);
	x3 = x + v2 * 0.5;
	v3 = v + a2 * 0.5;
	push_quad(s, &x3, &v3, &near, &a3);
	x4 = x + v3;
	v4 = v + a3;
	push_quad(s, &x4, &v4, &near, &a4);
	s->x = x + (v + 2 * (v2 + v3) + v4) * (1.0 / 6);
	s->v = v + (*a1 + 2 * (a2 + a3) + a4) * (1.0 / 6);
}

/* What there was before: the same in a time that runs the other way. */
static void quad_look_back(struct quad *s)
{
	struct quad back = *s;
	double slope;
	QUAD a;

	back.loss = -s->loss;
	back.v = -s->v;
	quad_step(&back, &a, &slope);
	s->gained = s->x - back.x;
	for (unsigned i = 0; i < BEFORE; i++)
		quad_step(&back, &s->a[i], &slope);
}

/* The same as quad_step by what was before: one look at the forces a step, not four one after the other.
 * Stoermer's and Adams' formulas of the sixth order. */
INSIDE quad_step_on(struct quad *s, QUAD *a0, double *slope)
{
	const QUAD *a = s->a;
	QUAD near;

	push_quad(s, &s->x, &s->v, &near, a0);
	*slope = -s->loss[0] * (*a0)[0] - s->v[0] * (s->still[0] + s->soft[0] * near[0] * (2 * near[0] - 1));
	s->v += (*a0 * 4277 - a[0] * 7923 + (a[1] * 9982 - a[2] * 7298) + (a[3] * 2877 - a[4] * 475)) *
	        (1.0 / 1440);
	s->gained +=
	        (*a0 * 317 - a[0] * 266 + (a[1] * 374 - a[2] * 276) + (a[3] * 109 - a[4] * 18)) * (1.0 / 240);
	s->x += s->gained;
	s->a[4] = a[3];
	s->a[3] = a[2];
	s->a[2] = a[1];
	s->a[1] = a[0];
	s->a[0] = *a0;
}

/* Of a block's samples: the accelerations; the first solution's slope, and that times the steps since time 0.
 */
struct block {
	QUAD push;
	double slope, late;
};

INSIDE quad_block(struct quad *quad, bool on, unsigned samples, double gone, struct block *sum)
{
	*sum = (struct block){.push = {0}};
	for (unsigned j = 0; j < samples; j++) {
		double slope;
		QUAD a;

		if (on)
			quad_step_on(quad, &a, &slope);
		else
			quad_step(quad, &a, &slope);
		sum->push += a;
		sum->slope += slope;
		sum->late += slope * (gone + j);
	}
}

/* What the derivatives by the unknowns are made of: that by the offset, the lanes' (the swing's twice: once
 * less the acceleration itself), the slope in time, and that times the time. The last column is the residual.
 */
enum { OF_OFFSET, OF_LOSS, OF_K, OF_SWING, OF_SLOPE, OF_TIME, OF_BENT, OF_RESIDUAL };
_Static_assert((int)OF_RESIDUAL == (int)SPRING_SIZE && SPRING_SIZE + 1 == 2 * LANES,
               "a row fills two registers");

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

/* How the solutions stand to the series. */
struct spring_scale {
	QUAD by;     /* differences of the lanes */
	double push; /* from the sum of a block to its mean in g */
	double step; /* in 1/w0 */
	double gone; /* steps from time 0 to the first sample */
	double offset_g;
};

INSIDE spring_sum_by(struct spring_sums *sums, const struct quad *start, bool on,
                     const struct spring_scale *scale, const struct block_means *series)
{
	struct spring_sums all = {.taken = 0};
	struct quad quad = *start;

	for (unsigned k = 0; k < series->count; k++) {
		struct block sum;
		QUAD low, high, push;

		quad_block(&quad, on, series->block, scale->gone + (double)k * series->block, &sum);
		if (!series->good[k])
			continue;
		push = sum.push * scale->push;
		low = (push - push[0]) / scale->by;
		high[OF_SLOPE - LANES] = sum.slope * scale->push / scale->step;
		high[OF_TIME - LANES] = sum.late * scale->push;
		high[OF_BENT - LANES] = low[OF_SWING] - push[0];
		high[OF_RESIDUAL - LANES] = series->value_g[k] - scale->offset_g - push[0];
		low[OF_OFFSET] = 1;
		spring_add(&all, &low, &high);
	}
	*sums = all;
}

WIDE static void spring_sum(struct spring_sums *sums, const struct quad *start, bool on,
                            const struct spring_scale *scale, const struct block_means *series)
{
	if (on)
		spring_sum_by(sums, start, true, scale, series);
	else
		spring_sum_by(sums, start, false, scale, series);
}

/* The derivatives by the unknowns from the columns: a row each. The solution is scaled with its swing where q
 * and k are scaled by its inverse square, and states along it are it, later. False where these do not tell
 * two states' derivatives apart. */
static bool by_unknowns(double by[SPRING_SIZE][SPRING_SIZE], const struct spring *s, const double *p)
{
	const double x = s->at.x, v = s->at.v, push_0 = push(s, x, v), apart = x * push_0 - v * v;
	const double a = p[MODES_DECAY], w = p[MODES_OMEGA], swing = spring_swing(p);
	const double cube = s->omega0 * s->omega0 * s->omega0, by_swing = -2 * p[PLACE_D] / (swing * swing);

	memset(by, 0, SPRING_SIZE * sizeof(*by));
	if (!(fabs(apart) > LIMIT_SMALL * swing))
		return false;
	by[MODES_OFFSET][OF_OFFSET] = 1;
	by[MODES_DECAY][OF_LOSS] = 2 * w * w / cube;
	by[MODES_DECAY][OF_TIME] = a / (s->omega0 * s->omega0);
	by[MODES_OMEGA][OF_LOSS] = -2 * a * w / cube;
	by[MODES_OMEGA][OF_TIME] = w / (s->omega0 * s->omega0);
	by[MODES_COSINE][OF_SWING] = push_0 / apart;
	by[MODES_COSINE][OF_SLOPE] = -v / apart;
	by[MODES_COSINE][OF_K] = x * by_swing;
	by[MODES_SINE][OF_SWING] = -v / apart;
	by[MODES_SINE][OF_SLOPE] = x / apart;
	by[MODES_SINE][OF_K] = v * by_swing;
	by[PLACE_Q][OF_BENT] = 1 / (2 * s->q);
	by[PLACE_Q][OF_K] = p[PLACE_D] - s->k / s->q;
	by[PLACE_D][OF_K] = 1 / swing + s->q;
	return true;
}

static double sum_of(const struct spring_sums *sums, unsigned i, unsigned j)
{
	const unsigned high = i > j ? i : j, low = i > j ? j : i;

	return sums->of[high][low / LANES][low % LANES];
}

/* From sums over columns to those over derivatives, each of a few columns only. */
static void spring_turn_sums(const struct spring_sums *sums, double by[SPRING_SIZE][SPRING_SIZE],
                             double normal[CHOLESKY_MAX][CHOLESKY_MAX], double right[CHOLESKY_MAX])
{
	double half[SPRING_SIZE][SPRING_SIZE + 1] = {{0}};

	for (unsigned i = 0; i < SPRING_SIZE; i++) {
		for (unsigned n = 0; n < SPRING_SIZE; n++)
			for (unsigned j = 0; by[i][n] != 0 && j <= SPRING_SIZE; j++)
				half[i][j] += by[i][n] * sum_of(sums, n, j);
		right[i] = half[i][OF_RESIDUAL];
	}
	for (unsigned j = 0; j < SPRING_SIZE; j++)
		for (unsigned n = 0; n < SPRING_SIZE; n++)
			for (unsigned i = j; by[j][n] != 0 && i < SPRING_SIZE; i++)
				normal[i][j] += by[j][n] * half[i][n];
}

size_t spring_normal(const struct block_means *series, const double *p,
                     double normal[CHOLESKY_MAX][CHOLESKY_MAX], double right[CHOLESKY_MAX], double *squares)
{
	double by[SPRING_SIZE][SPRING_SIZE], difference[LANES] = {1};
	const double sample_s = series->step_s / series->block;
	const double first_s = series->first_s - (series->block - 1) * sample_s / 2;
	struct spring_scale scale;
	struct spring_sums sums;
	struct quad quad;
	struct spring s;
	bool on;

	if (!spring_possible(p))
		return 0;
	s = spring_of(p);
	if (!by_unknowns(by, &s, p))
		return 0;
	quad_start(&quad, difference, &s, first_s, sample_s);
	memcpy(&scale.by, difference, sizeof(scale.by));
	scale.step = s.omega0 * sample_s;
	scale.push = 1 / (scale.step * scale.step * sqrt(s.q) * series->block);
	scale.gone = first_s / sample_s;
	scale.offset_g = p[MODES_OFFSET];
	on = scale.step * (1 + sqrt(p[PLACE_Q] * spring_swing(p))) < STEP_ON;
	if (on)
		quad_look_back(&quad);
	spring_sum(&sums, &quad, on, &scale, series);
	spring_turn_sums(&sums, by, normal, right);
	*squares = sums.of[OF_RESIDUAL][1][OF_RESIDUAL - LANES];
	return sums.taken;
}
