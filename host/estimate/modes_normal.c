/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/modes_private.h"

#include <string.h>

#include "common/units.h"
#include "host/estimate/phasor.h"
#include "host/estimate/simd2.h"

enum { DECAYS_MAX = 3 }; /* two modes and the hum */

static unsigned decays_of(const struct modes *modes)
{
	return modes->count + (modes->hum_hz > 0);
}

/* Where a decay's cosine stands among the unknowns, its sine after it. */
static unsigned swing_place(const struct modes *modes, unsigned d)
{
	return d < modes->count ? MODES_COSINE + MODES_EACH * d : 1 + MODES_EACH * modes->count;
}

/* What a fit looks at: a series from its first good point to its last, and the decays there. */
struct view {
	const double *value_g;
	const bool *good;
	unsigned count, decays;
	double first_s, step_s, offset_g;
	struct phasor decay[DECAYS_MAX]; /* the modes, then the hum, which does not decay */
	double swing[DECAYS_MAX][2];     /* their cosines and sines */
};

static struct view modes_normal_look(const struct modes_problem *problem, const double *p)
{
	const struct modes *modes = problem->modes;
	const struct block_means *series = problem->series;
	struct view view = {.count = series->count,
	                    .decays = decays_of(modes),
	                    .step_s = series->step_s,
	                    .offset_g = p[MODES_OFFSET]};
	unsigned skip = 0;

	while (view.count > 0 && !series->good[view.count - 1])
		view.count--;
	while (skip < view.count && !series->good[skip])
		skip++;
	view.count -= skip;
	view.value_g = series->value_g + skip;
	view.good = series->good + skip;
	view.first_s = series->first_s + skip * series->step_s;
	for (unsigned d = 0; d < view.decays; d++) {
		const double *mode = p + MODES_EACH * d;
		const bool hum = d == modes->count;

		view.decay[d] = phasor_decaying(hum ? 0 : mode[MODES_DECAY],
		                                hum ? 2 * UNITS_PI * modes->hum_hz : mode[MODES_OMEGA],
		                                view.first_s, view.step_s);
		memcpy(view.swing[d], p + swing_place(modes, d), sizeof(view.swing[d]));
	}
	return view;
}

/* Two complex numbers side by side. */
struct complex_pair {
	PAIR re, im;
};

static inline struct complex_pair times(struct complex_pair a, struct complex_pair b)
{
	return (struct complex_pair){a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
}

static inline struct complex_pair plus(struct complex_pair a, struct complex_pair b)
{
	return (struct complex_pair){a.re + b.re, a.im + b.im};
}

static inline struct complex_pair modes_normal_scale(PAIR factor, struct complex_pair a)
{
	return (struct complex_pair){factor * a.re, factor * a.im};
}

/* Of two geometric series: j^0, j^1 and j^2 times w^j, summed over j < n, n > 0. By doubling: the second half
 * of a sum is the first one, so much later. */
static void sum_geometric(struct complex_pair w, unsigned n, struct complex_pair sum[3])
{
	const PAIR one = {1, 1};
	struct complex_pair power = w; /* w^m */
	PAIR m = one;                  /* so many terms are summed */
	unsigned bit = 1;

	memset(sum, 0, 3 * sizeof(*sum));
	sum[0].re = one;
	while (bit <= n / 2)
		bit *= 2;
	while (bit >>= 1) {
		struct complex_pair late = plus(sum[1], modes_normal_scale(m, sum[0]));
		struct complex_pair later = plus(sum[2], modes_normal_scale(m, plus(sum[1], late)));

		sum[0] = plus(sum[0], times(power, sum[0]));
		sum[1] = plus(sum[1], times(power, late));
		sum[2] = plus(sum[2], times(power, later));
		power = times(power, power);
		m += m;
		if (n & bit) {
			sum[0] = plus(sum[0], power);
			sum[1] = plus(sum[1], modes_normal_scale(m, power));
			sum[2] = plus(sum[2], modes_normal_scale(m * m, power));
			power = times(power, w);
			m += one;
		}
	}
}

/* From sums over the index j to sums over the view's times, of what begins with start. */
static void by_time(struct complex_pair sum[3], struct complex_pair start, const struct view *view)
{
	const PAIR first = {view->first_s, view->first_s}, step = {view->step_s, view->step_s};
	struct complex_pair late = plus(modes_normal_scale(first, sum[0]), modes_normal_scale(step, sum[1]));
	struct complex_pair later = plus(modes_normal_scale(step, sum[1]), late);

	later = plus(modes_normal_scale(first, later), modes_normal_scale(step * step, sum[2]));
	sum[0] = times(start, sum[0]);
	sum[1] = times(start, late);
	sum[2] = times(start, later);
}

/* Of the residual, by itself and times each decay, with t^0 and t^1; even and odd points apart. */
struct residual_sums {
	PAIR c[DECAYS_MAX][2], s[DECAYS_MAX][2], sum, squares;
};

/* Over the good points, with t^0, t^1 and t^2. As complex numbers: a decay by itself (in [0]), and its
 * product with another, no later one, and with the other's conjugate. */
struct sums {
	struct complex_pair of[DECAYS_MAX][3], with[DECAYS_MAX][DECAYS_MAX][3];
	struct residual_sums residual;
};

/* a b and a times b's conjugate */
static inline struct complex_pair product(double ac, double as, double bc, double bs)
{
	return times((struct complex_pair){{ac, ac}, {as, as}}, (struct complex_pair){{bc, bc}, {bs, -bs}});
}

/* All but the residual's, as if no point were missing. */
static void sum_whole(struct sums *sums, const struct view *view)
{
	for (unsigned d = 0; d < view->decays; d++) {
		const struct phasor *a = &view->decay[d];
		struct complex_pair *of = sums->of[d];

		sum_geometric((struct complex_pair){{a->step_cosine}, {a->step_sine}}, view->count, of);
		by_time(of, (struct complex_pair){{a->cosine}, {a->sine}}, view);
		for (unsigned e = 0; e <= d; e++) {
			const struct phasor *b = &view->decay[e];
			struct complex_pair *with = sums->with[d][e];

			sum_geometric(product(a->step_cosine, a->step_sine, b->step_cosine, b->step_sine),
			              view->count, with);
			by_time(with, product(a->cosine, a->sine, b->cosine, b->sine), view);
		}
	}
}

/* Takes off a point: value times t^0, t^1, t^2. */
static inline void take_off(struct complex_pair sum[3], struct complex_pair value, double time)
{
	const PAIR minus = {-1, -1}, later = {time, time};

	value = modes_normal_scale(minus, value);
	for (unsigned i = 0; i < 3; i++, value = modes_normal_scale(later, value))
		sum[i] = plus(sum[i], value);
}

/* A point that is missing: the first or the second of two. */
static void leave_out(struct sums *sums, const struct phasor_pair *decay, unsigned decays, unsigned which,
                      double time)
{
	for (unsigned d = 0; d < decays; d++) {
		const double c = decay[d].cosine[which], s = decay[d].sine[which];

		take_off(sums->of[d], (struct complex_pair){{c}, {s}}, time);
		for (unsigned e = 0; e <= d; e++)
			take_off(sums->with[d][e],
			         product(c, s, decay[e].cosine[which], decay[e].sine[which]), time);
	}
}

/* Leaves out what is missing. Inlined where there is one decay: its sums stay in registers. */
static inline __attribute__((always_inline)) void sum_residual(struct sums *sums, const struct view *view,
                                                               const unsigned decays)
{
	PAIR time = {view->first_s, view->first_s + view->step_s};
	struct residual_sums residual = {.sum = {0}};
	struct phasor_pair decay[DECAYS_MAX];

	for (unsigned d = 0; d < decays; d++)
		decay[d] = phasor_two(view->decay[d]);
	for (unsigned k = 0; k < view->count; k += 2) {
		const bool more = k + 1 < view->count;
		PAIR r = more ? pair_load(view->value_g + k) : (PAIR){view->value_g[k]};

		r -= view->offset_g;
		for (unsigned d = 0; d < decays; d++)
			r -= view->swing[d][0] * decay[d].cosine + view->swing[d][1] * decay[d].sine;
		if (!more || !view->good[k] || !view->good[k + 1]) {
			const bool first = view->good[k], second = more && view->good[k + 1];

			if (!first)
				leave_out(sums, decay, decays, 0, time[0]);
			if (more && !second)
				leave_out(sums, decay, decays, 1, time[1]);
			r = (PAIR){first ? r[0] : 0, second ? r[1] : 0};
		}
		residual.sum += r;
		residual.squares += r * r;
		for (unsigned d = 0; d < decays; d++) {
			const PAIR c = r * decay[d].cosine, s = r * decay[d].sine;

			residual.c[d][0] += c;
			residual.s[d][0] += s;
			residual.c[d][1] += time * c;
			residual.s[d][1] += time * s;
			phasor_pair_turn(&decay[d]);
		}
		time += 2 * view->step_s;
	}
	sums->residual = residual;
}

static void sum_up(struct sums *sums, const struct view *view)
{
	sum_whole(sums, view);
	if (view->decays == 1)
		sum_residual(sums, view, 1);
	else
		sum_residual(sums, view, view->decays);
}

/* A derivative of the model: a decay's cosine and sine times these, and t where it is late. */
struct column {
	unsigned decay, late;
	double c, s;
};

/* The derivative by decay is -t (c cos + s sin), that by omega t (s cos - c sin). */
static unsigned make_columns(struct column column[CHOLESKY_MAX], const struct modes *modes, const double *p)
{
	unsigned n = 0;

	for (unsigned d = 0; d < decays_of(modes); d++) {
		const double *swing = p + swing_place(modes, d);

		if (d < modes->count) {
			column[n++] = (struct column){d, 1, -swing[0], -swing[1]};
			column[n++] = (struct column){d, 1, swing[1], -swing[0]};
		}
		column[n++] = (struct column){d, 0, 1, 0};
		column[n++] = (struct column){d, 0, 0, 1};
	}
	return n;
}

static inline double modes_normal_both(PAIR pair)
{
	return pair[0] + pair[1];
}

/* The products of linear unknowns: the offset, then each decay's cosine and sine. */
static void linear_products(const struct sums *sums, const struct view *view, unsigned used,
                            double product[CHOLESKY_MAX][CHOLESKY_MAX], double right[CHOLESKY_MAX])
{
	const struct residual_sums *r = &sums->residual;

	product[0][0] = used;
	right[0] = modes_normal_both(r->sum);
	for (unsigned d = 0; d < view->decays; d++) {
		double *c = product[1 + 2 * d], *s = product[2 + 2 * d];

		right[1 + 2 * d] = modes_normal_both(r->c[d][0]);
		right[2 + 2 * d] = modes_normal_both(r->s[d][0]);
		c[0] = sums->of[d][0].re[0];
		s[0] = sums->of[d][0].im[0];
		for (unsigned e = 0; e <= d; e++) {
			const struct complex_pair with = sums->with[d][e][0];

			c[1 + 2 * e] = (with.re[0] + with.re[1]) / 2;
			c[2 + 2 * e] = (with.im[0] - with.im[1]) / 2;
			s[1 + 2 * e] = (with.im[0] + with.im[1]) / 2;
			s[2 + 2 * e] = (with.re[1] - with.re[0]) / 2;
		}
	}
}

/* Takes c cos + s sin of decay e off the residual's sums with decay d. */
static void take_swing_off(struct sums *sums, unsigned d, unsigned e, double c, double s)
{
	const unsigned high = d > e ? d : e, low = d > e ? e : d;

	for (unsigned late = 0; late < 2; late++) {
		const struct complex_pair with = sums->with[high][low][late];
		const double turned = d < e ? -with.im[1] : with.im[1];

		sums->residual.c[d][late][0] -=
		        (c * (with.re[0] + with.re[1]) + s * (with.im[0] - turned)) / 2;
		sums->residual.s[d][late][0] -=
		        (c * (with.im[0] + turned) + s * (with.re[1] - with.re[0])) / 2;
	}
}

/* Moves the linear unknowns of p to their best, and the sums of the residual with them. Left as they are
 * where the series does not determine them. */
static void project(struct sums *sums, struct view *view, const struct modes_problem *problem, double *p)
{
	double product[CHOLESKY_MAX][CHOLESKY_MAX], right[CHOLESKY_MAX], change[CHOLESKY_MAX];
	const unsigned size = 1 + 2 * view->decays;
	struct residual_sums *r = &sums->residual;
	struct cholesky factor;

	linear_products(sums, view, problem->series->used, product, right);
	if (!cholesky_factor(&factor, size, product))
		return;
	cholesky_solve(&factor, right, change);
	r->sum[0] -= change[0] * problem->series->used;
	for (unsigned i = 0; i < size; i++)
		r->squares[0] -= change[i] * right[i];
	p[MODES_OFFSET] += change[0];
	for (unsigned d = 0; d < view->decays; d++) {
		const double c = change[1 + 2 * d], s = change[2 + 2 * d];
		double *swing = p + swing_place(problem->modes, d);

		swing[0] += c;
		swing[1] += s;
		r->sum[0] -= c * sums->of[d][0].re[0] + s * sums->of[d][0].im[0];
		for (unsigned late = 0; late < 2; late++) {
			r->c[d][late][0] -= change[0] * sums->of[d][late].re[0];
			r->s[d][late][0] -= change[0] * sums->of[d][late].im[0];
		}
		for (unsigned e = 0; e < view->decays; e++)
			take_swing_off(sums, e, d, c, s);
	}
}

/* All products of derivatives follow from those of the decays, and these are geometric series but for what is
 * missing; only the residual is summed point by point. */
size_t modes_undisturbed(const void *context, double *p, double normal[CHOLESKY_MAX][CHOLESKY_MAX],
                         double right[CHOLESKY_MAX], double *squares)
{
	const struct modes_problem *problem = context;
	struct column column[CHOLESKY_MAX];
	struct view view;
	struct sums sums;
	unsigned n;

	if (!modes_possible(problem->modes, p))
		return 0;
	view = modes_normal_look(problem, p);
	sum_up(&sums, &view);
	if (problem->modes->count > 1)
		project(&sums, &view, problem, p);
	n = make_columns(column, problem->modes, p);
	normal[MODES_OFFSET][MODES_OFFSET] = problem->series->used;
	right[MODES_OFFSET] = modes_normal_both(sums.residual.sum);
	*squares = modes_normal_both(sums.residual.squares);
	for (unsigned i = 0; i < n; i++) {
		const struct column a = column[i];
		const struct complex_pair of = sums.of[a.decay][a.late];

		normal[1 + i][MODES_OFFSET] = a.c * of.re[0] + a.s * of.im[0];
		right[1 + i] = modes_normal_both(a.c * sums.residual.c[a.decay][a.late] +
		                                 a.s * sums.residual.s[a.decay][a.late]);
		for (unsigned j = 0; j <= i; j++) {
			const struct column b = column[j];
			const struct complex_pair with = sums.with[a.decay][b.decay][a.late + b.late];

			normal[1 + i][1 + j] =
			        ((a.c * b.c - a.s * b.s) * with.re[0] + (a.c * b.c + a.s * b.s) * with.re[1] +
			         (a.s * b.c + a.c * b.s) * with.im[0] +
			         (a.s * b.c - a.c * b.s) * with.im[1]) /
			        2;
		}
	}
	return problem->series->used;
}
