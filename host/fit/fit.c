/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/fit/fit.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/fit/fit_private.h"

const char *const fit_axis_names[MOTION_AXES] = {"S1X", "S1Y", "S2X", "S2Y"};

/* Weak: they decide only what the data leave open. */
static const double prior_sds[MOTION_SHARED] = {1.2, 1.0, 6.0, 1.2, 1.2, 0.35, 0.8, 1.2, 6.0};
#define BEYOND_SDS 3.0
#define BEYOND_YAW_DEG 15.0

/* Where a start does not follow from a scan. */
#define START_SOFTENING 0.2
#define START_STRAIN 0.8
#define START_DAMPING_S 2.76e-4 /* over the mount's stiffness */

/* Mounts and their softening: stages of the weights, shares of the envelope. */
static const double stages[] = {0.15, 0.02, 0.0};

/* Tangential stiffness has a false minimum where a corner slips otherwise: so many starts. */
static const struct {
	double grip, gamma_deg;
} starts[] = {{1.8, 0.0}, {3.2, 0.0}, {0.6, 0.0}, {1.1, 0.0}, {4.5, 0.0}, {1.8, 1.2}, {3.2, -1.2}};
_Static_assert((int)SCENE_FITTED == (int)MOTION_SHARED, "[fit] has them all, in this order");
enum { STARTS = sizeof(starts) / sizeof(starts[0]), STARTS_OF_MANY = 2 };

/* Of another minimum, and how much higher it may seem before the last stage. */
#define ANOTHER_GRIP 0.05
#define ANOTHER_SQUARES 30.0

/* Angles that differ by this rule the false minimum out. */
#define MANY_SPAN_DEG 8.0
enum { MANY_DROPS = 3 };

enum { SCAN_POINTS = 15, SCAN_NODES = MOTION_FINE_NODES + 140, ITERATIONS = 30 };
#define SCAN_REACH 1.75

/* Squares of the eight gains and cross-axis where the priors are right: what the product takes up is missing.
 */
#define SCATTER_USUAL 5.0

/* A corner that does not slide tells nothing of the tangential stiffness. */
#define SLIDES_DEG 3.0

/* ---- start ---- */

struct fit_options fit_options_usual(const struct scene *scene)
{
	bool plate = scene->mount_plate_mass_kg > 0.0;

	return (struct fit_options){.angle_sd_deg = 1.0,
	                            .speed_sd = 0.003,
	                            .gain_sd = {plate ? 0.02 : 0.01, 0.01},
	                            .common_gain_sd = 0.003};
}

void fit_start_common(const struct scene *scene, const struct fit_options *o, struct solve *s)
{
	double p[MOTION_PARAMETERS];
	bool plate = scene->mount_plate_mass_kg > 0.0;

	motion_of_scene(scene, p);
	if (!(scene->contact_tangential_ratio > 0.0))
		p[MOTION_LN_GRIP] = log(starts[0].grip);
	if (!(scene->mount_softening > 0.0)) {
		p[MOTION_SOFTENING] = START_SOFTENING;
		p[MOTION_LN_STRAIN] = log(START_STRAIN);
	}
	if (!(scene->mount_damping_n_s_m > 0.0))
		p[MOTION_LN_MOUNT_C] = p[MOTION_LN_MOUNT_K] + log(START_DAMPING_S);
	for (size_t i = 0; i < MOTION_SHARED; i++)
		if (plate || i < MOTION_LN_MOUNT_K) {
			s->centre[i] = p[i];
			s->prior_sd[i] = prior_sds[i];
		}
	for (size_t i = FIT_GAIN; i < FIT_COMMON; i++)
		s->prior_sd[i] = o->common_gain_sd;
	for (size_t i = 0; i < FIT_COMMON; i++)
		s->known[i][i] = s->prior_sd[i] > 0.0 ? 1.0 / (s->prior_sd[i] * s->prior_sd[i]) : 1.0;
	memcpy(s->common, s->centre, sizeof(s->common));
}

/* Onset of the model that reaches a quarter of its peak of S2X when the record does. */
void fit_align(struct solve *s, struct solve_drop *d)
{
	double p[MOTION_PARAMETERS], most = 0.0;
	size_t n = 0;

	solve_parameters(s, d, p);
	d->own[FIT_ONSET_MS] = 0.0;
	if (motion_solve(s->scene, p, MOTION_FINE_NODES / 2, s->motion, NULL) != 0)
		return;
	for (size_t i = 0; i < s->motion->nodes; i++)
		most = fmax(most, s->motion->axis[i][MOTION_S2X]);
	while (n < s->motion->nodes && s->motion->axis[n][MOTION_S2X] < 0.25 * most)
		n++;
	d->own[FIT_ONSET_MS] = 1e3 * (d->quarter_s[MOTION_S2X] - d->touch_s - motion_node_s(n));
}

/* Stiffness of contact and mounts where the histories fit best, the rest as a start has it. */
static void scan_starts(struct solve *s)
{
	int points = s->prior_sd[MOTION_LN_MOUNT_K] > 0.0 ? SCAN_POINTS : 1;
	unsigned drops = s->drops;
	double best = (double)INFINITY, found[FIT_COMMON],
	       from[2] = {s->centre[MOTION_LN_STIFFNESS], s->centre[MOTION_LN_MOUNT_K]};

	s->drops = 1;
	s->nodes = SCAN_NODES;
	s->share = stages[0];
	memcpy(found, s->common, sizeof(found));
	for (int i = 0; i < SCAN_POINTS; i++) {
		s->common[MOTION_LN_STIFFNESS] = from[0] + SCAN_REACH * (2.0 * i / (SCAN_POINTS - 1) - 1.0);
		fit_align(s, s->drop);
		for (int j = 0; j < points; j++) {
			double now;

			if (points > 1) {
				s->common[MOTION_LN_MOUNT_K] =
				        from[1] + SCAN_REACH * (2.0 * j / (SCAN_POINTS - 1) - 1.0);
				s->common[MOTION_LN_MOUNT_C] =
				        s->common[MOTION_LN_MOUNT_K] + log(START_DAMPING_S);
			}
			now = solve_squares(s);
			if (now < best) {
				best = now;
				memcpy(found, s->common, sizeof(found));
			}
		}
	}
	memcpy(s->common, found, sizeof(found));
	s->drops = drops;
	s->nodes = MOTION_NODES;
}

/* ---- starts ---- */

struct minimum {
	double squares, common[FIT_COMMON], own[FIT_DROPS_MAX][FIT_OWN];
};

static void minimum_keep(struct minimum *m, struct solve *s)
{
	m->squares = s->squares;
	memcpy(m->common, s->common, sizeof(m->common));
	for (unsigned k = 0; k < s->drops; k++)
		memcpy(m->own[k], s->drop[k].own, sizeof(m->own[k]));
}

static void minimum_take(const struct minimum *m, struct solve *s)
{
	memcpy(s->common, m->common, sizeof(m->common));
	for (unsigned k = 0; k < s->drops; k++)
		memcpy(s->drop[k].own, m->own[k], sizeof(m->own[k]));
}

static unsigned starts_of(const struct solve *s)
{
	double least = (double)INFINITY, most = 0.0;

	for (unsigned k = 0; k < s->drops; k++) {
		least = fmin(least, s->drop[k].centre[FIT_GAMMA_DEG]);
		most = fmax(most, s->drop[k].centre[FIT_GAMMA_DEG]);
	}
	return s->drops >= MANY_DROPS && most - least >= MANY_SPAN_DEG ? STARTS_OF_MANY : STARTS;
}

static void start_drops(struct solve *s, const double zero[][MOTION_AXES], double gamma_deg)
{
	for (unsigned k = 0; k < s->drops; k++) {
		struct solve_drop *d = &s->drop[k];

		memset(d->own, 0, sizeof(d->own));
		d->own[FIT_GAMMA_DEG] = d->centre[FIT_GAMMA_DEG] + gamma_deg;
		d->own[FIT_LN_SPEED] = d->centre[FIT_LN_SPEED];
		memcpy(d->own + FIT_ZERO, zero[k], sizeof(zero[k]));
		fit_align(s, d);
	}
}

/* Through the last stage; out and s->squares are what it comes to. */
static bool finish(struct solve *s, const struct minimum *from, struct minimum *out)
{
	minimum_take(from, s);
	s->share = stages[2];
	if (!solve_run(s, ITERATIONS, 0.01))
		return false;
	minimum_keep(out, s);
	return true;
}

/* The lowest of those that are not the one given. NULL: there is none. */
static const struct minimum *lowest(const struct minimum *reached, unsigned count, const struct minimum *but)
{
	const struct minimum *best = NULL;

	for (unsigned i = 0; i < count; i++)
		if ((!but ||
		     fabs(reached[i].common[MOTION_LN_GRIP] - but->common[MOTION_LN_GRIP]) > ANOTHER_GRIP) &&
		    (!best || reached[i].squares < best->squares))
			best = &reached[i];
	return best;
}

/* The lowest two go through the last stage: loose weights may rank them wrongly. */
static bool choose_minimum(struct solve *s, const struct minimum *reached, unsigned count)
{
	const struct minimum *first = lowest(reached, count, NULL), *second;
	struct minimum end[2];

	if (!first || !finish(s, first, &end[0]))
		return false;
	second = lowest(reached, count, first);
	if (second && second->squares < first->squares + ANOTHER_SQUARES && finish(s, second, &end[1]) &&
	    end[1].squares < end[0].squares)
		return solve_covariance(s);
	minimum_take(&end[0], s);
	return solve_covariance(s);
}

/* All starts through the first two stages. */
static bool search_minima(struct solve *s, struct fit *fit, struct minimum reached[STARTS])
{
	double from[FIT_COMMON], zero[FIT_DROPS_MAX][MOTION_AXES];
	unsigned count = starts_of(s), n = 0;

	for (unsigned k = 0; k < s->drops; k++)
		memcpy(zero[k], s->drop[k].centre + FIT_ZERO, sizeof(zero[k]));
	s->common[MOTION_LOGIT_RESTITUTION] = 0.0;
	s->common[MOTION_LN_GRIP] = log(starts[0].grip);
	s->nodes = MOTION_NODES;
	start_drops(s, (const double(*)[MOTION_AXES])zero, 0.0);
	scan_starts(s);
	memcpy(from, s->common, sizeof(from));
	for (unsigned i = 0; i < count; i++) {
		memcpy(s->common, from, sizeof(from));
		s->common[MOTION_LN_GRIP] = log(starts[i].grip);
		start_drops(s, (const double(*)[MOTION_AXES])zero, starts[i].gamma_deg);
		s->share = stages[0];
		if (!solve_run(s, ITERATIONS, 0.1))
			continue;
		s->share = stages[1];
		if (solve_run(s, ITERATIONS, 0.05))
			minimum_keep(&reached[n++], s);
	}
	fit->starts = count;
	fit->agreed = 0;
	for (unsigned i = 0; i < n; i++)
		fit->agreed += reached[i].squares < lowest(reached, n, NULL)->squares + 0.5;
	return choose_minimum(s, reached, n);
}

/* ---- results ---- */

static double covariance_of(const struct solve *s, const struct solve_drop *d, size_t i, size_t j)
{
	static const size_t own[] = {FIT_GAMMA_DEG, FIT_LN_SPEED};

	if (i < MOTION_SHARED && j < MOTION_SHARED)
		return s->held || s->prior_sd[i] == 0.0 || s->prior_sd[j] == 0.0 ? 0.0 : s->covariance[i][j];
	if (i < MOTION_SHARED)
		return s->held || s->prior_sd[i] == 0.0 ? 0.0 : d->cross[i][own[j - MOTION_SHARED]];
	return j < MOTION_SHARED ? covariance_of(s, d, j, i)
	                         : d->covariance[own[i - MOTION_SHARED]][own[j - MOTION_SHARED]];
}

/* Of the histories that solve_histories made last, with slopes. */
static void derive(const struct solve *s, const struct solve_drop *d, struct fit_drop_result *r)
{
	double slope[MOTION_PARAMETERS][MOTION_DERIVED] = {{0.0}};

	memcpy(r->derived, s->derived[0], sizeof(r->derived));
	for (size_t i = 0; i < MOTION_PARAMETERS; i++)
		for (size_t q = 0; q < MOTION_DERIVED && solve_moves(s, i); q++)
			slope[i][q] = (s->derived[1 + i][q] - s->derived[0][q]) / solve_step_of(i);
	for (size_t q = 0; q < MOTION_DERIVED; q++) {
		double variance = 0.0;

		for (size_t i = 0; i < MOTION_PARAMETERS; i++)
			for (size_t j = 0; j < MOTION_PARAMETERS; j++)
				variance += slope[i][q] * slope[j][q] * covariance_of(s, d, i, j);
		r->derived_sd[q] = sqrt(variance);
	}
}

static double pull_of(const struct solve_drop *d)
{
	double sum = 0.0;

	for (size_t i = FIT_GAMMA_DEG; i < FIT_ZERO; i++)
		sum += pow((d->own[i] - d->centre[i]) / d->prior_sd[i], 2);
	return sum;
}

/* Squares of gains and cross-axis about their means over the drops, of one drop. */
static double scatter_of(const struct solve *s)
{
	double sum = 0.0;

	for (size_t i = FIT_MIX; i < FIT_ZERO; i++) {
		double mean = 0.0;

		for (unsigned k = 0; k < s->drops; k++)
			mean += s->drop[k].own[i] / s->drops;
		for (unsigned k = 0; k < s->drops; k++)
			sum += pow((s->drop[k].own[i] - mean) / s->drop[k].prior_sd[i], 2) / (s->drops - 1);
	}
	return sum;
}

/* Gains that scatter more from drop to drop than their priors allow: the priors are too narrow, and so are
 * all bars. What is off in all drops together is a fault and widens nothing. */
static void widen(struct solve *s, struct fit *fit)
{
	double by = s->drops < MANY_DROPS ? 1.0 : scatter_of(s) / SCATTER_USUAL;

	fit->widened = 1.0;
	if (by < 1.0 + 2.0 * sqrt(2.0 / (SCATTER_USUAL * s->drops)))
		return;
	fit->widened = by;
	for (size_t i = 0; i < FIT_COMMON * FIT_COMMON; i++)
		(&s->covariance[0][0])[i] *= by;
	for (unsigned k = 0; k < s->drops; k++) {
		for (size_t i = 0; i < FIT_OWN * FIT_OWN; i++)
			(&s->drop[k].covariance[0][0])[i] *= by;
		for (size_t i = 0; i < FIT_COMMON * FIT_OWN; i++)
			(&s->drop[k].cross[0][0])[i] *= by;
	}
}

void fit_conclude_drop(const struct solve *s, const struct solve_drop *d, struct fit_drop_result *r)
{
	memcpy(r->own, d->own, sizeof(r->own));
	r->pull = pull_of(d);
	for (size_t i = 0; i < FIT_OWN; i++)
		r->sd[i] = sqrt(d->covariance[i][i]);
	derive(s, d, r);
}

static enum fit_status status_of(const struct solve *s, size_t i)
{
	double most = 0.0;

	if (s->prior_sd[i] == 0.0)
		return FIT_ABSENT;
	if (fabs(s->common[i] - s->centre[i]) > BEYOND_SDS * s->prior_sd[i] ||
	    (i == MOTION_YAW_DEG && fabs(s->common[i]) > BEYOND_YAW_DEG))
		return FIT_BEYOND;
	for (unsigned k = 0; k < s->drops; k++)
		most = fmax(most, fabs(s->drop[k].own[FIT_GAMMA_DEG] - s->common[MOTION_BALANCE_DEG]));
	if (i == MOTION_LN_GRIP && most < SLIDES_DEG)
		return FIT_NOT_IDENTIFIED;
	return sqrt(s->covariance[i][i]) < s->prior_sd[i] / 3.0 ? FIT_IDENTIFIED : FIT_NOT_IDENTIFIED;
}

static void conclude_common(const struct solve *s, struct fit *fit)
{
	memcpy(fit->common, s->common, sizeof(fit->common));
	memcpy(fit->prior_sd, s->prior_sd, sizeof(fit->prior_sd));
	for (size_t i = 0; i < FIT_COMMON; i++)
		fit->sd[i] = s->prior_sd[i] > 0.0 ? sqrt(s->covariance[i][i]) : 0.0;
	for (size_t i = 0; i < MOTION_SHARED; i++) {
		fit->status[i] = status_of(s, i);
		for (size_t j = 0; j < MOTION_SHARED; j++)
			fit->covariance[i][j] =
			        s->prior_sd[i] > 0.0 && s->prior_sd[j] > 0.0 ? s->covariance[i][j] : 0.0;
	}
	/* where no drop slides, the local bar is wrong */
	if (fit->status[MOTION_LN_GRIP] == FIT_NOT_IDENTIFIED) {
		fit->covariance[MOTION_LN_GRIP][MOTION_LN_GRIP] += pow(prior_sds[MOTION_LN_GRIP], 2);
		fit->sd[MOTION_LN_GRIP] = sqrt(fit->covariance[MOTION_LN_GRIP][MOTION_LN_GRIP]);
	}
}

/* The scene's bars: relative and in deg as the coordinates are, of logit e, too. */
static void conclude_bars(struct fit *fit)
{
	struct scene *to = &fit->scene;

	for (size_t i = 0; i < MOTION_SHARED; i++) {
		to->fitted_u[i] = sqrt(fit->covariance[i][i]);
		for (size_t j = 0; j < MOTION_SHARED; j++) {
			double both = sqrt(fit->covariance[i][i] * fit->covariance[j][j]);

			to->fitted_correlation[i][j] = both > 0.0 ? fit->covariance[i][j] / both : 0.0;
		}
	}
}

static void conclude_scene(const struct solve *s, const struct scene *start, struct fit *fit)
{
	struct scene *to = &fit->scene;

	*to = *start;
	to->predicted_u = 0.0;
	motion_to_scene(s->common, to);
	if (isfinite(fit->drop[0].derived[MOTION_CONTACT_S])) {
		to->contact_duration_s = fit->drop[0].derived[MOTION_CONTACT_S];
		to->contact_duration_height_m =
		        exp(2.0 * fit->drop[0].own[FIT_LN_SPEED]) / (2.0 * start->drop_gravity_m_s2);
		to->contact_mass_kg = start->product_case_mass_kg;
	}
	conclude_bars(fit);
	if (start->mount_plate_mass_kg > 0.0)
		to->mount_damping_ratio = to->mount_damping_n_s_m /
		                          (2.0 * sqrt(to->mount_stiffness_n_m * start->mount_plate_mass_kg));
}

static int fit_prepared(const struct scene *start, const struct fit_options *options, struct solve *s,
                        struct fit *fit, char message[FIT_MESSAGE_MAX])
{
	struct minimum *reached = malloc(STARTS * sizeof(*reached));
	bool found;

	if (!reached || !s->motion) {
		free(reached);
		snprintf(message, FIT_MESSAGE_MAX, "no memory");
		return DT_E_MEMORY;
	}
	fit_start_common(start, options, s);
	found = search_minima(s, fit, reached);
	free(reached);
	if (!found) {
		snprintf(message, FIT_MESSAGE_MAX, "no parameters explain these drops: nothing converged");
		return DT_E_NUMERIC;
	}
	widen(s, fit);
	conclude_common(s, fit);
	s->derives = true;
	for (unsigned k = 0; k < s->drops; k++)
		if (solve_histories(s, &s->drop[k], true))
			fit_conclude_drop(s, &s->drop[k], &fit->drop[k]);
	s->derives = false;
	conclude_scene(s, start, fit);
	if (judge(s, fit->drop, fit->widened, &fit->doubt) != 0) {
		snprintf(message, FIT_MESSAGE_MAX, "no memory");
		return DT_E_MEMORY;
	}
	judge_next(s, fit);
	return 0;
}

int fit_drops(const struct scene *start, const struct fit_drop *drops, unsigned count,
              const struct fit_options *options, struct fit *fit, char message[FIT_MESSAGE_MAX])
{
	struct solve_drop *prepared = calloc(count + 1, sizeof(*prepared));
	struct solve s = {.scene = start, .drop = prepared, .drops = count, .nodes = MOTION_NODES};
	int error = prepared ? 0 : DT_E_MEMORY;

	s.motion = calloc(1 + MOTION_PARAMETERS, sizeof(*s.motion));
	*fit = (struct fit){.drops = count};
	for (unsigned k = 0; k < count && !error; k++) {
		char why[FIT_MESSAGE_MAX];

		error = prepare_drop(start, &drops[k], options, &prepared[k], why);
		if (error)
			snprintf(message, FIT_MESSAGE_MAX, "drop %u: %.480s", k + 1, why);
	}
	if (!error)
		error = fit_prepared(start, options, &s, fit, message);
	for (unsigned k = 0; prepared && k < count; k++)
		prepare_free(&prepared[k]);
	free(prepared);
	free(s.motion);
	return error;
}

/* ---- traces ---- */

static void traces_of(const struct solve_drop *d, const double *residual,
                      void (*each)(void *context, const struct fit_trace *trace), void *context)
{
	for (size_t i = 0; i < d->count; i++) {
		const struct solve_sample *sample = &d->sample[i];
		double value = sample->value_g - d->own[FIT_ZERO + sample->axis];
		struct fit_trace trace = {sample->axis, sample->t_s - d->own[FIT_ONSET_MS] * 1e-3, value,
		                          value - residual[i] * d->noise_g[sample->axis]};

		if (!isnan(residual[i]))
			each(context, &trace);
	}
}

int fit_traces(const struct fit *fit, unsigned k, const struct scene *start, const struct fit_drop *drop,
               const struct fit_options *options, void (*each)(void *context, const struct fit_trace *trace),
               void *context)
{
	struct solve_drop d = {.count = 0};
	struct solve s = {.scene = start, .drop = &d, .drops = 1, .nodes = MOTION_NODES};
	char message[FIT_MESSAGE_MAX];
	double *residual = NULL;
	int error = prepare_drop(start, drop, options, &d, message);

	if (error == 0) {
		s.motion = malloc(sizeof(*s.motion));
		residual = malloc((d.count + 1) * sizeof(*residual));
		error = s.motion && residual ? 0 : DT_E_MEMORY;
	}
	if (error == 0) {
		memcpy(s.common, fit->common, sizeof(s.common));
		memcpy(d.own, fit->drop[k].own, sizeof(d.own));
		if (solve_residuals(&s, &d, residual))
			traces_of(&d, residual, each, context);
		else
			error = DT_E_NUMERIC;
	}
	free(residual);
	free(s.motion);
	prepare_free(&d);
	return error;
}
