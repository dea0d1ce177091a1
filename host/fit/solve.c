/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/fit/solve.h"

#include <math.h>
#include <string.h>

/* Differences of two histories, and the longest step of one iteration. */
static const double steps[MOTION_PARAMETERS] = {1e-4, 1e-4, 5e-3, 1e-3, 1e-4, 1e-3,
                                                1e-3, 1e-3, 1e-2, 5e-3, 1e-4};
static const double most_step[FIT_COMMON] = {0.5, 0.7, 3, 0.7, 0.5, 0.3, 0.7, 0.7, 5, 0.05, 0.05, 0.05, 0.05};
#define MOST_ONSET_MS 0.15
#define MOST_GAMMA_DEG 2.0

#define ONSET_STEP_S 2e-6
#define DAMPING 1e-3
#define DAMPING_MOST 1e8

double solve_step_of(size_t parameter)
{
	return steps[parameter];
}

/* ---- small dense algebra ---- */

bool solve_factor(size_t n, size_t stride, double *a)
{
	for (size_t i = 0; i < n; i++)
		for (size_t j = 0; j <= i; j++) {
			double sum = a[i * stride + j];

			for (size_t k = 0; k < j; k++)
				sum -= a[i * stride + k] * a[j * stride + k];
			if (j < i)
				a[i * stride + j] = sum / a[j * stride + j];
			else if (sum > 1e-14 * fabs(a[i * stride + i]))
				a[i * stride + i] = sqrt(sum);
			else
				return false;
		}
	return true;
}

void solve_back(size_t n, size_t stride, const double *f, double *x)
{
	for (size_t i = 0; i < n; i++) {
		for (size_t k = 0; k < i; k++)
			x[i] -= f[i * stride + k] * x[k];
		x[i] /= f[i * stride + i];
	}
	for (size_t i = n; i-- > 0;) {
		for (size_t k = i + 1; k < n; k++)
			x[i] -= f[k * stride + i] * x[k];
		x[i] /= f[i * stride + i];
	}
}

void solve_invert(size_t n, const double *factor, double *inverse)
{
	for (size_t j = 0; j < n; j++) {
		double x[FIT_OWN + FIT_COMMON] = {0.0};

		x[j] = 1.0;
		solve_back(n, n, factor, x);
		for (size_t i = 0; i < n; i++)
			inverse[i * n + j] = x[i];
	}
}

/* ---- a history at the samples ---- */

struct place {
	size_t node;
	double weight[4];
};

/* Four nodes around t, none across the touch or the change of step. False: outside. */
static bool solve_place(double t, size_t nodes, struct place *place)
{
	bool fine = t < MOTION_FINE_NODES * MOTION_FINE_S;
	double step = fine ? MOTION_FINE_S : MOTION_COARSE_S, u;
	size_t low = fine ? 0 : MOTION_FINE_NODES, high = fine ? MOTION_FINE_NODES : nodes - 1, node;

	if (high > nodes - 1)
		high = nodes - 1;
	if (!(t >= 0.0) || t > motion_node_s(nodes - 1) || high < low + 3)
		return false;
	u = (t - motion_node_s(low)) / step;
	node = low + (size_t)u;
	node = node > low ? node - 1 : low;
	node = node > high - 3 ? high - 3 : node;
	u -= (double)(node - low);
	place->node = node;
	place->weight[0] = -(u - 1.0) * (u - 2.0) * (u - 3.0) / 6.0;
	place->weight[1] = u * (u - 2.0) * (u - 3.0) / 2.0;
	place->weight[2] = -u * (u - 1.0) * (u - 3.0) / 2.0;
	place->weight[3] = u * (u - 1.0) * (u - 2.0) / 6.0;
	return true;
}

static double solve_at(const struct motion *m, const struct place *p, size_t axis)
{
	const double(*a)[MOTION_AXES] = m->axis + p->node;

	return p->weight[0] * a[0][axis] + p->weight[1] * a[1][axis] + p->weight[2] * a[2][axis] +
	       p->weight[3] * a[3][axis];
}

void solve_parameters(const struct solve *s, const struct solve_drop *d, double p[MOTION_PARAMETERS])
{
	memcpy(p, s->common, MOTION_SHARED * sizeof(*p));
	p[MOTION_GAMMA_DEG] = d->own[FIT_GAMMA_DEG];
	p[MOTION_LN_SPEED] = d->own[FIT_LN_SPEED];
}

bool solve_moves(const struct solve *s, size_t parameter)
{
	return parameter >= MOTION_SHARED || (!s->held && s->prior_sd[parameter] > 0.0);
}

bool solve_histories(struct solve *s, const struct solve_drop *d, bool slopes)
{
	double p[MOTION_PARAMETERS];

	solve_parameters(s, d, p);
	if (slopes && s->tried)
		memcpy(s->derived[0], s->derived[1 + MOTION_PARAMETERS], sizeof(s->derived[0]));
	else if (motion_solve(s->scene, p, s->nodes, s->motion,
	                      s->derives ? s->derived[slopes ? 0 : 1 + MOTION_PARAMETERS] : NULL) != 0)
		return false;
	s->tried = false;
	for (size_t i = 0; slopes && i < MOTION_PARAMETERS; i++) {
		double was = p[i];

		if (!solve_moves(s, i))
			continue;
		p[i] += steps[i];
		if (motion_solve(s->scene, p, s->nodes, s->motion + 1 + i,
		                 s->derives ? s->derived[1 + i] : NULL) != 0)
			return false;
		p[i] = was;
	}
	return true;
}

/* ---- normal equations ---- */

/* Of one sample: slopes of what the channel reads. */
struct row {
	double model, common[FIT_COMMON], own[FIT_OWN];
};

static void solve_slopes(const struct solve *s, const struct place *place, size_t axis, const double gain[2],
                         double value, struct row *row)
{
	size_t x = axis & ~(size_t)1;

	for (size_t i = 0; i < MOTION_PARAMETERS; i++) {
		const struct motion *m = s->motion + 1 + i;
		double slope;

		if (!solve_moves(s, i) || place->node + 4 > m->nodes)
			continue;
		slope = (gain[0] * solve_at(m, place, x) + gain[1] * solve_at(m, place, x + 1) - value) /
		        steps[i];
		if (i < MOTION_SHARED)
			row->common[i] = slope;
		else
			row->own[i == MOTION_GAMMA_DEG ? FIT_GAMMA_DEG : FIT_LN_SPEED] = slope;
	}
}

/* What the channel reads, and its slopes if asked for. False: the sample is beyond the history. */
static bool solve_row(const struct solve *s, const struct solve_drop *d, const struct solve_sample *sample,
                      bool slopes, struct row *row)
{
	size_t axis = sample->axis, x = axis & ~(size_t)1, mix = FIT_MIX + axis / 2 * 4 + axis % 2 * 2;
	double t = sample->t_s - d->own[FIT_ONSET_MS] * 1e-3, felt[2], value;
	double gain[2] = {d->own[mix] + (axis % 2 == 0), d->own[mix + 1] + (axis % 2 == 1)};
	struct place place, beside;

	if (slopes)
		memset(row, 0, sizeof(*row));
	row->model = d->own[FIT_ZERO + axis];
	if (slopes)
		row->own[FIT_ZERO + axis] = 1.0;
	if (!(t > 0.0))
		return true;
	if (!solve_place(t, s->motion->nodes, &place))
		return false;
	gain[axis % 2] += s->common[FIT_GAIN + axis];
	felt[0] = solve_at(s->motion, &place, x);
	felt[1] = solve_at(s->motion, &place, x + 1);
	value = gain[0] * felt[0] + gain[1] * felt[1];
	row->model += value;
	if (!slopes)
		return true;
	solve_slopes(s, &place, axis, gain, value, row);
	row->common[FIT_GAIN + axis] = s->held ? 0.0 : felt[axis % 2];
	row->own[mix] = felt[0];
	row->own[mix + 1] = felt[1];
	if (solve_place(t - ONSET_STEP_S, s->motion->nodes, &beside))
		row->own[FIT_ONSET_MS] = (gain[0] * solve_at(s->motion, &beside, x) +
		                          gain[1] * solve_at(s->motion, &beside, x + 1) - value) /
		                         (ONSET_STEP_S * 1e3);
	return true;
}

static double solve_weight(const struct solve *s, const struct solve_drop *d,
                           const struct solve_sample *sample)
{
	double noise = d->noise_g[sample->axis], loose = s->share * sample->envelope_g;

	return 1.0 / (noise * noise * d->colour[sample->axis] + loose * loose);
}

static void solve_gather(const struct row *row, double weight, double residual, struct solve *s,
                         struct solve_drop *d)
{
	for (size_t i = 0; i < FIT_OWN; i++) {
		double wi = weight * row->own[i];

		if (wi == 0.0)
			continue;
		d->right[i] += wi * residual;
		for (size_t j = 0; j <= i; j++)
			d->c[i][j] += wi * row->own[j];
		for (size_t j = 0; j < FIT_COMMON; j++)
			d->b[j][i] += wi * row->common[j];
	}
	for (size_t i = 0; i < FIT_COMMON; i++) {
		double wi = weight * row->common[i];

		if (wi == 0.0)
			continue;
		s->right[i] += wi * residual;
		for (size_t j = 0; j <= i; j++)
			s->a[i][j] += wi * row->common[j];
	}
}

static double solve_prior(double value, double centre, double sd)
{
	return sd > 0.0 ? (value - centre) * (value - centre) / (sd * sd) : 0.0;
}

double solve_known(const struct solve *s)
{
	double sum = 0.0;

	for (size_t i = 0; i < FIT_COMMON; i++)
		for (size_t j = 0; j < FIT_COMMON; j++)
			sum += (s->common[i] - s->centre[i]) * s->known[i][j] * (s->common[j] - s->centre[j]);
	return sum;
}

static bool solve_sum(struct solve *s, struct solve_drop *d, bool slopes)
{
	if (!solve_histories(s, d, slopes))
		return false;
	for (size_t i = 0; i < d->count; i++) {
		const struct solve_sample *sample = &d->sample[i];
		double weight = solve_weight(s, d, sample), residual;
		struct row row;

		if (!solve_row(s, d, sample, slopes, &row))
			continue;
		residual = sample->value_g - row.model;
		s->used++;
		s->squares += weight * residual * residual;
		if (slopes)
			solve_gather(&row, weight, residual, s, d);
	}
	for (size_t i = 0; i < FIT_OWN; i++)
		s->squares += solve_prior(d->own[i], d->centre[i], d->prior_sd[i]);
	for (size_t i = 0; slopes && i < FIT_OWN; i++)
		if (d->prior_sd[i] > 0.0) {
			d->c[i][i] += 1.0 / (d->prior_sd[i] * d->prior_sd[i]);
			d->right[i] += (d->centre[i] - d->own[i]) / (d->prior_sd[i] * d->prior_sd[i]);
		}
	return true;
}

static void solve_clear_drop(struct solve_drop *d)
{
	memset(d->c, 0, sizeof(d->c));
	memset(d->b, 0, sizeof(d->b));
	memset(d->right, 0, sizeof(d->right));
}

/* Without slopes the equations stay as they are. */
static bool solve_normal(struct solve *s, bool slopes)
{
	if (slopes) {
		memset(s->a, 0, sizeof(s->a));
		memset(s->right, 0, sizeof(s->right));
	}
	s->squares = 0.0;
	s->used = 0;
	for (unsigned k = 0; k < s->drops; k++) {
		if (slopes)
			solve_clear_drop(&s->drop[k]);
		if (!solve_sum(s, &s->drop[k], slopes))
			return false;
	}
	s->squares += s->held ? 0.0 : solve_known(s);
	for (size_t i = 0; i < FIT_COMMON && !s->held && slopes; i++)
		for (size_t j = 0; j < FIT_COMMON; j++) {
			s->a[i][j] += s->known[i][j];
			s->right[i] += s->known[i][j] * (s->centre[j] - s->common[j]);
		}
	return isfinite(s->squares);
}

double solve_squares(struct solve *s)
{
	return solve_normal(s, false) ? s->squares : (double)INFINITY;
}

/* ---- one step ---- */

struct eliminated {
	double a[FIT_COMMON][FIT_COMMON], right[FIT_COMMON];
};

/* Takes a drop's own unknowns out: factor becomes that of c. */
static bool solve_eliminate(const struct solve_drop *d, double damping, double factor[FIT_OWN][FIT_OWN],
                            struct eliminated *e)
{
	double x[FIT_OWN];

	memcpy(factor, d->c, sizeof(d->c));
	for (size_t i = 0; i < FIT_OWN; i++)
		factor[i][i] *= 1.0 + damping;
	if (!solve_factor(FIT_OWN, FIT_OWN, &factor[0][0]))
		return false;
	for (size_t j = 0; j < FIT_COMMON; j++) {
		memcpy(x, d->b[j], sizeof(x));
		solve_back(FIT_OWN, FIT_OWN, &factor[0][0], x);
		for (size_t k = 0; k < FIT_OWN; k++) {
			e->right[j] -= x[k] * d->right[k];
			for (size_t i = j; i < FIT_COMMON; i++)
				e->a[i][j] -= d->b[i][k] * x[k];
		}
	}
	return true;
}

static double capped(double step, double most)
{
	return step > most ? most : step < -most ? -most : step;
}

/* Moves all unknowns by the damped step. */
static bool solve_step(struct solve *s, double damping)
{
	double factor[FIT_OWN][FIT_OWN], x[FIT_OWN];
	struct eliminated e = {.right = {0.0}};

	memcpy(e.a, s->a, sizeof(e.a));
	memcpy(e.right, s->right, sizeof(e.right));
	for (size_t i = 0; i < FIT_COMMON; i++)
		e.a[i][i] *= 1.0 + damping;
	for (unsigned k = 0; k < s->drops && !s->held; k++)
		if (!solve_eliminate(&s->drop[k], damping, factor, &e))
			return false;
	if (!s->held && !solve_factor(FIT_COMMON, FIT_COMMON, &e.a[0][0]))
		return false;
	if (!s->held)
		solve_back(FIT_COMMON, FIT_COMMON, &e.a[0][0], e.right);
	for (unsigned k = 0; k < s->drops; k++) {
		struct solve_drop *d = &s->drop[k];
		struct eliminated none = {.right = {0.0}};

		if (!solve_eliminate(d, damping, factor, &none))
			return false;
		memcpy(x, d->right, sizeof(x));
		for (size_t j = 0; j < FIT_COMMON && !s->held; j++)
			for (size_t i = 0; i < FIT_OWN; i++)
				x[i] -= d->b[j][i] * e.right[j];
		solve_back(FIT_OWN, FIT_OWN, &factor[0][0], x);
		x[FIT_ONSET_MS] = capped(x[FIT_ONSET_MS], MOST_ONSET_MS);
		x[FIT_GAMMA_DEG] = capped(x[FIT_GAMMA_DEG], MOST_GAMMA_DEG);
		for (size_t i = 0; i < FIT_OWN; i++)
			d->own[i] += x[i];
	}
	for (size_t i = 0; i < FIT_COMMON && !s->held; i++)
		s->common[i] += capped(e.right[i], most_step[i]);
	return true;
}

struct kept {
	double common[FIT_COMMON], own[FIT_DROPS_MAX][FIT_OWN];
};

static void solve_keep(struct solve *s, struct kept *kept, bool back)
{
	if (back)
		memcpy(s->common, kept->common, sizeof(s->common));
	else
		memcpy(kept->common, s->common, sizeof(s->common));
	for (unsigned k = 0; k < s->drops; k++)
		if (back)
			memcpy(s->drop[k].own, kept->own[k], sizeof(kept->own[k]));
		else
			memcpy(kept->own[k], s->drop[k].own, sizeof(kept->own[k]));
}

bool solve_run(struct solve *s, unsigned iterations, double enough)
{
	double damping = DAMPING, first, now, tried;
	struct kept kept;

	for (unsigned i = 0; i < iterations; i++) {
		if (!solve_normal(s, true))
			return false;
		now = s->squares;
		solve_keep(s, &kept, false);
		first = damping;
		for (tried = (double)INFINITY; damping < DAMPING_MOST; damping *= 8.0) {
			tried = solve_step(s, damping) ? solve_squares(s) : (double)INFINITY;
			if (tried <= now)
				break;
			solve_keep(s, &kept, true);
		}
		s->tried = s->drops == 1 && tried <= now && i + 1 < iterations;
		if (!(tried <= now)) {
			s->squares = now;
			return true;
		}
		/* a step that had to be shortened says nothing of how far the minimum is */
		if (now - tried < enough && !(damping > first)) {
			s->tried = false;
			return true;
		}
		damping = fmax(damping / 10.0, 1e-9);
	}
	return true;
}

/* ---- covariance ---- */

/* A drop's own: c^-1 + x S^-1 x^T with x = c^-1 b^T, and with the common ones: -S^-1 x^T. */
static bool solve_covariance_of(struct solve *s, struct solve_drop *d)
{
	double factor[FIT_OWN][FIT_OWN], x[FIT_COMMON][FIT_OWN];
	struct eliminated none = {.right = {0.0}};

	if (!solve_eliminate(d, 0.0, factor, &none))
		return false;
	solve_invert(FIT_OWN, &factor[0][0], &d->covariance[0][0]);
	memset(d->cross, 0, sizeof(d->cross));
	if (s->held)
		return true;
	for (size_t j = 0; j < FIT_COMMON; j++) {
		memcpy(x[j], d->b[j], sizeof(x[j]));
		solve_back(FIT_OWN, FIT_OWN, &factor[0][0], x[j]);
	}
	for (size_t i = 0; i < FIT_COMMON; i++)
		for (size_t j = 0; j < FIT_COMMON; j++)
			for (size_t k = 0; k < FIT_OWN; k++)
				d->cross[i][k] -= s->covariance[i][j] * x[j][k];
	for (size_t i = 0; i < FIT_COMMON; i++)
		for (size_t k = 0; k < FIT_OWN; k++)
			for (size_t l = 0; l < FIT_OWN; l++)
				d->covariance[k][l] -= x[i][k] * d->cross[i][l];
	return true;
}

bool solve_covariance(struct solve *s)
{
	return solve_normal(s, true) && solve_covariance_there(s);
}

bool solve_covariance_there(struct solve *s)
{
	double factor[FIT_OWN][FIT_OWN];
	struct eliminated e = {.right = {0.0}};

	memcpy(e.a, s->a, sizeof(e.a));
	for (unsigned k = 0; k < s->drops && !s->held; k++)
		if (!solve_eliminate(&s->drop[k], 0.0, factor, &e))
			return false;
	if (!s->held) {
		if (!solve_factor(FIT_COMMON, FIT_COMMON, &e.a[0][0]))
			return false;
		solve_invert(FIT_COMMON, &e.a[0][0], &s->covariance[0][0]);
	}
	for (unsigned k = 0; k < s->drops; k++)
		if (!solve_covariance_of(s, &s->drop[k]))
			return false;
	return true;
}

bool solve_information(struct solve *s, struct solve_drop *d, double information[FIT_COMMON][FIT_COMMON])
{
	double factor[FIT_OWN][FIT_OWN];
	struct eliminated e = {.right = {0.0}};

	memset(s->a, 0, sizeof(s->a));
	solve_clear_drop(d);
	if (!solve_sum(s, d, true))
		return false;
	memcpy(e.a, s->a, sizeof(e.a));
	if (!solve_eliminate(d, 0.0, factor, &e))
		return false;
	for (size_t i = 0; i < FIT_COMMON; i++)
		for (size_t j = 0; j < FIT_COMMON; j++)
			information[i][j] += e.a[i >= j ? i : j][i >= j ? j : i];
	return true;
}

bool solve_residuals(struct solve *s, struct solve_drop *d, double *residual)
{
	struct row row;

	if (!solve_histories(s, d, false))
		return false;
	for (size_t i = 0; i < d->count; i++)
		residual[i] = solve_row(s, d, &d->sample[i], false, &row)
		                      ? (d->sample[i].value_g - row.model) / d->noise_g[d->sample[i].axis]
		                      : (double)NAN;
	return true;
}
