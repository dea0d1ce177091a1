/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Fits of simulated drops by the hundred: errors against the truth, coverage of the bars, false minima, cost.
 * campaign SCENE GROUPS SEED KIND ANGLE...: a group has a drop at each angle; KIND says what the fit is not
 * told.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <gsl/gsl_randist.h>

#include "tests/unit/fit_by_hand.h"

struct tally {
	double squares, sum, bars;
	unsigned count, within;
};

static void tally_add(struct tally *t, double error, double sd)
{
	t->squares += error * error;
	t->sum += error;
	t->bars += sd * sd;
	t->count++;
	t->within += fabs(error) <= 2 * sd;
}

static void tally_print(const char *name, const struct tally *t, double scale)
{
	if (t->count)
		printf("%-22s mean %9.4g rms %9.5g bar %9.5g  within 2 bars %3.0f %%  n %u\n", name,
		       scale * t->sum / t->count, scale * sqrt(t->squares / t->count),
		       scale * sqrt(t->bars / t->count), 100.0 * t->within / t->count, t->count);
}

/* One more drop of each group's product at any angle of 15 to 35 deg, by the scene that the group gave. */
struct later {
	struct tally e, contact, lag, lag_x, spin, all;
	unsigned asked, refused, failed;
	clock_t cost;
};

static void later_tally(struct later *l, const struct by_hand_truth *t, const struct fit_drop_result *r)
{
	const double truth[] = {t->restitution, t->contact_s, t->lag_s, t->lag_x_s, t->spin_rad_s};
	const enum motion_derived of[] = {MOTION_RESTITUTION, MOTION_CONTACT_S, MOTION_LAG_S, MOTION_LAG_X_S,
	                                  MOTION_SPIN_RAD_S};
	struct tally *to[] = {&l->e, &l->contact, &l->lag, &l->lag_x, &l->spin};

	for (size_t i = 0; i < 5; i++) {
		double found = i == 4 ? fabs(r->derived[of[i]]) : r->derived[of[i]], off = found - truth[i];

		tally_add(to[i], i == 0 ? off / truth[i] : off,
		          r->derived_sd[of[i]] / (i == 0 ? truth[i] : 1));
		tally_add(&l->all, off / r->derived_sd[of[i]], 1);
		if (getenv("V") && fabs(off) > 3 * r->derived_sd[of[i]])
			printf("later %zu: %g for %g +- %g\n", i, found, truth[i], r->derived_sd[of[i]]);
	}
}

static void later_drop(struct later *l, struct by_hand *h, const struct scene *scene,
                       const struct fit_options *o, gsl_rng *random)
{
	static struct by_hand_drop drop;
	char message[FIT_MESSAGE_MAX];
	struct fit_later found;
	struct by_hand_truth truth;
	clock_t from;
	int error;

	h->truth.drop_angle_deg = 15 + 20 * gsl_rng_uniform(random);
	by_hand_drop(h, random, &drop);
	from = clock();
	error = fit_later_drop(scene, &drop.drop, o, &found, message);
	l->cost += clock() - from;
	l->asked++;
	if (error)
		printf("later failed: %s\n", message);
	else if (found.doubt.words[0])
		printf("later doubt at %.1f deg: %s\n", drop.angle_deg, found.doubt.words);
	l->failed += error != 0;
	l->refused += !error && found.doubt.words[0];
	if (error || found.doubt.words[0])
		return;
	truth = by_hand_truth(h, &drop);
	later_tally(l, &truth, &found.drop);
}

static void later_print(const struct later *l)
{
	tally_print("later: restitution, %", &l->e, 100);
	tally_print("later: contact time, us", &l->contact, 1e6);
	tally_print("later: lag, us", &l->lag, 1e6);
	tally_print("later: lag of X, us", &l->lag_x, 1e6);
	tally_print("later: spin, rad/s", &l->spin, 1);
	tally_print("later: all, in bars", &l->all, 1);
	printf("later: %u drops, failed %u, refused %u, CPU %.2f ms each\n", l->asked, l->failed, l->refused,
	       1e3 * (double)l->cost / CLOCKS_PER_SEC / fmax(l->asked, 1));
}

static bool is(const char *kind, const char *name)
{
	return strcmp(kind, name) == 0;
}

static void kind_of(const char *kind, struct by_hand *h, struct fit_options *o, gsl_rng *random)
{
	if (is(kind, "wide"))
		for (int s = 0; s < 2; s++)
			h->gain_sd[s] *= 2;
	if (is(kind, "narrow"))
		for (int s = 0; s < 2; s++)
			h->gain_sd[s] /= 2;
	for (int a = 0; a < 4; a++)
		h->common[a] = is(kind, "common") ? gsl_ran_gaussian_ziggurat(random, o->common_gain_sd) : 0;
	if (is(kind, "nocommon"))
		o->common_gain_sd = 1e-5;
	if (is(kind, "coloured"))
		h->colour = .7;
	if (is(kind, "clipped"))
		h->clip_g = 350;
	if (is(kind, "low"))
		h->truth.drop_height_m = .45;
	if (is(kind, "mode")) {
		h->mode_hz = 900;
		h->mode_share = .1;
	}
	if (is(kind, "late"))
		h->late_s = 15e-6;
	if (is(kind, "cross"))
		h->common[0] = 0.05;
}

int main(int argc, char **argv)
{
	static struct by_hand_drop drops[16];
	static struct fit_drop given[16];
	static struct fit fit;
	char message[FIT_MESSAGE_MAX];
	struct tally shared[MOTION_SHARED] = {{0}}, widened = {0}, e = {0}, contact = {0}, lag = {0},
	             gamma = {0}, all = {0};
	unsigned groups, refused = 0, wrong = 0, failed = 0, count = (unsigned)argc - 5, same = 0;
	double truth_p[MOTION_PARAMETERS], chi2 = 0;
	gsl_rng *random = gsl_rng_alloc(gsl_rng_mt19937);
	struct scene scene, start;
	struct later later = {.asked = 0};
	clock_t cost = 0;

	if (argc < 6 || count > 16 || scene_read(&scene, argv[1], message) != 0)
		return 2;
	groups = (unsigned)atoi(argv[2]);
	gsl_rng_set(random, (unsigned long)atol(argv[3]));
	motion_of_scene(&scene, truth_p);
	for (unsigned g = 0; g < groups; g++) {
		struct by_hand h = {.truth = scene,
		                    .gain_sd = {scene.mount_plate_mass_kg > 0 ? .02 : .01, .01},
		                    .noise_g = 1};
		struct fit_options o = fit_options_usual(&scene);
		clock_t from;
		int error;

		kind_of(argv[4], &h, &o, random);
		for (unsigned k = 0; k < count; k++) {
			h.truth.drop_angle_deg = atof(argv[5 + k]);
			by_hand_drop(&h, random, &drops[k]);
			given[k] = drops[k].drop;
		}
		start = scene;
		start.contact_stiffness_n_m15 *= exp((2 * gsl_rng_uniform(random) - 1) * log(3));
		start.mount_stiffness_n_m *= exp((2 * gsl_rng_uniform(random) - 1) * log(3));
		start.mount_damping_n_s_m *= exp((2 * gsl_rng_uniform(random) - 1) * log(3));
		start.contact_tangential_ratio *= exp((2 * gsl_rng_uniform(random) - 1) * log(3));
		start.product_balance_angle_deg += (2 * gsl_rng_uniform(random) - 1) * 6;
		start.contact_restitution = .35 + .3 * gsl_rng_uniform(random);
		from = clock();
		error = fit_drops(&start, given, count, &o, &fit, message);
		cost += clock() - from;
		if (error) {
			failed++;
			printf("failed: %s\n", message);
			continue;
		}
		for (unsigned k = 0; k < 4 && !fit.doubt.words[0]; k++)
			later_drop(&later, &h, &fit.scene, &o, random);
		chi2 += fit.doubt.chi2 / (double)fit.doubt.samples;
		same += fit.agreed;
		if (fit.doubt.words[0]) {
			refused++;
			printf("doubt: %s\n", fit.doubt.words);
			for (size_t i = 0; getenv("V") && i < MOTION_SHARED; i++)
				printf("  %s %g (%g) true %g gamma %g true %g agreed %u\n", scene_fitted[i],
				       fit.common[i], fit.sd[i], truth_p[i], fit.drop[0].own[1],
				       drops[0].angle_deg, fit.agreed);
			continue;
		}
		for (size_t i = 0; i < MOTION_SHARED; i++)
			if (fit.status[i] != FIT_ABSENT &&
			    (i != MOTION_LN_GRIP || fit.status[i] == FIT_IDENTIFIED)) {
				tally_add(&shared[i], fit.common[i] - truth_p[i], fit.sd[i]);
				tally_add(&all, (fit.common[i] - truth_p[i]) / fit.sd[i], 1);
			}
		wrong += fit.status[MOTION_LN_GRIP] == FIT_IDENTIFIED &&
		         fabs(fit.common[MOTION_LN_GRIP] - truth_p[MOTION_LN_GRIP]) >
		                 5 * fit.sd[MOTION_LN_GRIP];
		tally_add(&widened, fit.widened, 1);
		for (unsigned k = 0; k < count; k++) {
			struct by_hand_truth t = by_hand_truth(&h, &drops[k]);
			const struct fit_drop_result *r = &fit.drop[k];

			tally_add(&contact, r->derived[MOTION_CONTACT_S] - t.contact_s,
			          r->derived_sd[MOTION_CONTACT_S]);
			tally_add(&e, r->derived[MOTION_RESTITUTION] - t.restitution,
			          r->derived_sd[MOTION_RESTITUTION]);
			tally_add(&lag, r->derived[MOTION_LAG_S] - t.lag_s, r->derived_sd[MOTION_LAG_S]);
			tally_add(&gamma, r->own[FIT_GAMMA_DEG] - drops[k].angle_deg, r->sd[FIT_GAMMA_DEG]);
			tally_add(&all,
			          (r->derived[MOTION_CONTACT_S] - t.contact_s) /
			                  r->derived_sd[MOTION_CONTACT_S],
			          1);
			tally_add(&all,
			          (r->derived[MOTION_RESTITUTION] - t.restitution) /
			                  r->derived_sd[MOTION_RESTITUTION],
			          1);
		}
	}
	for (size_t i = 0; i < MOTION_SHARED; i++)
		tally_print(scene_fitted[i], &shared[i], 1);
	tally_print("restitution of centre", &e, 1);
	tally_print("contact time, us", &contact, 1e6);
	tally_print("lag, us", &lag, 1e6);
	tally_print("angle, deg", &gamma, 1);
	tally_print("widened", &widened, 1);
	tally_print("all, in bars", &all, 1);
	printf("%s: %u groups of %u, failed %u, doubted %u, false minima %u, chi2/n %.3f, starts agreed "
	       "%.1f, CPU %.3f s each\n",
	       argv[4], groups, count, failed, refused, wrong, chi2 / (groups - failed),
	       (double)same / groups, (double)cost / CLOCKS_PER_SEC / groups);
	later_print(&later);
	printf("next drop: %.0f deg from %.2f m, gain %.1f\n", fit.next.angle_deg, fit.next.height_m,
	       fit.next.d_gain);
	for (int a = 0; a < 4 && groups == 1; a++)
		for (int w = 0; w < FIT_WINDOWS; w++)
			printf("%s %-20s z %.2f\n", fit_axis_names[a], fit_window_names[w],
			       fit.doubt.window_z[a][w]);
	printf("periodogram %.1f pull %.1f group %.1f\n", fit.doubt.periodogram, fit.doubt.pull,
	       fit.doubt.group);
	gsl_rng_free(random);
	return 0;
}
