/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/fit/fit_private.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/units.h"

const char *const fit_window_names[FIT_WINDOWS] = {"before the touch", "0 to 1 ms",   "1 ms to the release",
                                                   "release to 10 ms", "10 to 20 ms", "beyond 20 ms"};

/* Alarms: above all that drops of a product which the model describes showed. */
#define ALARM_WINDOW_Z 5.0
#define ALARM_PERIODOGRAM 14.0
#define ALARM_PULL 30.0
#define ALARM_GROUP 20.0
#define ALARM_MOVED 30.0

/* With any of those, an angle so many of its deviations from the one set is named first. */
#define TURNED_FAR 4.0

enum { PERIODOGRAM_LINES = 138 }; /* even: two at a time */

static double periodogram_hz(size_t line)
{
	return 50.0 + 25.0 * (double)line;
}

struct sums {
	double squares[MOTION_AXES][FIT_WINDOWS];
	size_t count[MOTION_AXES][FIT_WINDOWS];
};

static enum fit_window judge_window(double t, double release)
{
	if (t < 0.0)
		return FIT_BEFORE;
	if (t < 1e-3)
		return FIT_FIRST_MS;
	if (t < release)
		return FIT_CONTACT;
	return t < 10e-3 ? FIT_TO_10_MS : t < 20e-3 ? FIT_TO_20_MS : FIT_RING;
}

/* Of one channel of one drop, all frequencies at once (Goertzel 1958); a sample left out counts as 0. */
static void judge_periodogram(const struct solve_drop *d, const double *residual, unsigned axis,
                              struct fit_doubt *doubt)
{
	double by[PERIODOGRAM_LINES], now[PERIODOGRAM_LINES] = {0.0}, was[PERIODOGRAM_LINES] = {0.0};
	double step = (double)INFINITY, last = (double)NAN;
	size_t n = 0;

	for (size_t i = 1; i < d->count; i++)
		if (d->sample[i].axis == axis && d->sample[i - 1].axis == axis)
			step = fmin(step, d->sample[i].t_s - d->sample[i - 1].t_s);
	for (size_t k = 0; k < PERIODOGRAM_LINES; k++)
		by[k] = 2.0 * cos(2.0 * UNITS_PI * periodogram_hz(k) * step);
	for (size_t i = 0; i < d->count; i++) {
		if (d->sample[i].axis != axis || isnan(residual[i]))
			continue;
		for (long left_out = n ? lround((d->sample[i].t_s - last) / step) : 1; left_out > 0;
		     left_out--)
			for (size_t k = 0; k < PERIODOGRAM_LINES; k++) {
				double next = (left_out > 1 ? 0.0 : residual[i]) + by[k] * now[k] - was[k];

				was[k] = now[k];
				now[k] = next;
			}
		last = d->sample[i].t_s;
		n++;
	}
	for (size_t k = 0; k < PERIODOGRAM_LINES && n > 0; k++) {
		double power = (now[k] * now[k] + was[k] * was[k] - by[k] * now[k] * was[k]) /
		               ((double)n * d->colour[axis]);

		if (power > doubt->periodogram) {
			doubt->periodogram = power;
			doubt->periodogram_hz = periodogram_hz(k);
			doubt->periodogram_axis = (int)axis;
		}
	}
}

static int judge_drop(struct solve *s, struct solve_drop *d, double release, struct sums *sums,
                      struct fit_doubt *doubt)
{
	double *residual = malloc((d->count + 1) * sizeof(*residual));

	if (!residual)
		return DT_E_MEMORY;
	if (solve_residuals(s, d, residual)) {
		for (size_t i = 0; i < d->count; i++) {
			double t = d->sample[i].t_s - d->own[FIT_ONSET_MS] * 1e-3;
			enum fit_window w = judge_window(t, release);

			if (isnan(residual[i]))
				continue;
			sums->squares[d->sample[i].axis][w] += residual[i] * residual[i];
			sums->count[d->sample[i].axis][w]++;
		}
		for (unsigned a = 0; a < MOTION_AXES; a++)
			judge_periodogram(d, residual, a, doubt);
	}
	free(residual);
	return 0;
}

/* Gains that are the same in all drops. */
static double judge_group(const struct solve *s, double widened)
{
	double sum = 0.0;

	for (size_t i = 0; i < 8; i++) {
		size_t axis = i / 4 * 2 + i % 4 / 2;
		double sd = s->drop[0].prior_sd[FIT_MIX + i], mean = 0.0,
		       variance = widened * sd * sd / s->drops;

		for (unsigned k = 0; k < s->drops; k++)
			mean += s->drop[k].own[FIT_MIX + i] / s->drops;
		if (i % 4 == 0 || i % 4 == 3) {
			mean += s->common[FIT_GAIN + axis];
			variance += s->prior_sd[FIT_GAIN + axis] * s->prior_sd[FIT_GAIN + axis];
		}
		sum += mean * mean / variance;
	}
	return s->drops > 1 ? sum : 0.0;
}

static void judge_turned(const struct solve_drop *d, double widened, struct fit_doubt *doubt)
{
	double off = d->own[FIT_GAMMA_DEG] - d->centre[FIT_GAMMA_DEG],
	       sds = off / (d->prior_sd[FIT_GAMMA_DEG] * sqrt(widened));

	if (fabs(sds) <= fabs(doubt->turned))
		return;
	doubt->turned = sds;
	doubt->turned_deg = d->own[FIT_GAMMA_DEG];
	doubt->set_deg = d->centre[FIT_GAMMA_DEG];
}

static void judge_say(struct fit_doubt *d, unsigned axis, unsigned window, double z, unsigned drops)
{
	double level = ALARM_PERIODOGRAM + log((double)drops);

	if (z > ALARM_WINDOW_Z && d->periodogram > level)
		snprintf(d->words, sizeof(d->words),
		         "%s is not explained %s (%.3g standard deviations; most at %.0f Hz)",
		         fit_axis_names[axis], fit_window_names[window], z, d->periodogram_hz);
	else if (z > ALARM_WINDOW_Z)
		snprintf(d->words, sizeof(d->words), "%s is not explained %s (%.3g standard deviations)",
		         fit_axis_names[axis], fit_window_names[window], z);
	else if (d->periodogram > level)
		snprintf(d->words, sizeof(d->words),
		         "%s holds an oscillation of %.0f Hz that is not explained",
		         fit_axis_names[d->periodogram_axis], d->periodogram_hz);
	else if (d->pull > ALARM_PULL)
		snprintf(d->words, sizeof(d->words),
		         "angle, speed or gains of a drop are further from what was set than their spread "
		         "(%.3g for 10)",
		         d->pull);
	else if (d->group > ALARM_GROUP)
		snprintf(d->words, sizeof(d->words),
		         "the gains of all drops are off together (%.3g for 8): a sensitivity or the "
		         "cross-axis is wrong",
		         d->group);
	else if (d->moved > ALARM_MOVED)
		snprintf(d->words, sizeof(d->words),
		         "the product would have to be another than the scene's (%.3g for 9)", d->moved);
}

/* What is not explained may be an angle that was set wrongly. */
static void judge_angle(struct fit_doubt *d, unsigned drops)
{
	char rest[FIT_MESSAGE_MAX];

	if (d->words[0] == '\0' || !(fabs(d->turned) > TURNED_FAR))
		return;
	memcpy(rest, d->words, sizeof(rest));
	snprintf(d->words, sizeof(d->words),
	         "the angle of %s goes from %.3g deg as set towards %.3g (%.1f deviations): is it right? "
	         "%.300s",
	         drops > 1 ? "a drop" : "the drop", d->set_deg, d->turned_deg, fabs(d->turned), rest);
}

int judge(struct solve *s, const struct fit_drop_result *drop, double widened, struct fit_doubt *doubt)
{
	struct sums sums = {.count = {{0}}};
	unsigned worst[2] = {0, 0};
	double most = -(double)INFINITY;

	for (unsigned k = 0; k < s->drops; k++) {
		double release = drop[k].derived[MOTION_CONTACT_S];

		if (judge_drop(s, &s->drop[k], isfinite(release) ? release : 10e-3, &sums, doubt) != 0)
			return DT_E_MEMORY;
		doubt->pull = fmax(doubt->pull, drop[k].pull / widened);
		judge_turned(&s->drop[k], widened, doubt);
	}
	for (unsigned a = 0; a < MOTION_AXES; a++)
		for (unsigned w = 0; w < FIT_WINDOWS; w++) {
			double n = (double)sums.count[a][w],
			       z = n > 0 ? (sums.squares[a][w] - n) / sqrt(2.0 * n * s->drop[0].colour[a])
			                 : 0.0;

			doubt->window_z[a][w] = z;
			doubt->chi2 += sums.squares[a][w];
			doubt->samples += sums.count[a][w];
			if (z > most) {
				most = z;
				worst[0] = a;
				worst[1] = w;
			}
		}
	doubt->group = judge_group(s, widened);
	judge_say(doubt, worst[0], worst[1], most, s->drops);
	judge_angle(doubt, s->drops);
	return 0;
}

/* ---- the next drop ---- */

/* As much as the first drop, at another angle and height; what would clip tells nothing. */
static void next_samples(struct solve *s, struct solve_drop *d)
{
	double p[MOTION_PARAMETERS];

	solve_parameters(s, d, p);
	if (motion_solve(s->scene, p, s->nodes, s->motion, NULL) != 0)
		return;
	for (size_t i = 0; i < d->count; i++) {
		struct solve_sample *sample = &d->sample[i];
		double t = sample->t_s;
		size_t n = t <= 0.0 ? 0
		           : t < MOTION_FINE_NODES * MOTION_FINE_S
		                   ? (size_t)(t / MOTION_FINE_S)
		                   : MOTION_FINE_NODES + (size_t)((t - MOTION_FINE_NODES * MOTION_FINE_S) /
		                                                  MOTION_COARSE_S);

		sample->envelope_g = n < s->motion->nodes && fabs(s->motion->axis[n][sample->axis]) >
		                                                     s->scene->sensor_range_g
		                             ? 1e9
		                             : 0.0;
	}
}

/* Log of the determinant of what the product's parameters are known to, in terms of their priors, and the
 * largest bar in those terms. */
static double next_weigh(const struct solve *s, double information[FIT_COMMON][FIT_COMMON], int *largest,
                         double *sd)
{
	double a[FIT_COMMON][FIT_COMMON], log_det = 0.0, most = 0.0;

	memcpy(a, information, sizeof(a));
	if (!solve_factor(FIT_COMMON, FIT_COMMON, &a[0][0]))
		return (double)NAN;
	for (size_t i = 0; i < FIT_COMMON; i++)
		log_det += 2.0 * log(a[i][i]);
	for (size_t i = 0; i < MOTION_SHARED; i++) {
		double x[FIT_COMMON] = {0.0}, bar;

		if (s->prior_sd[i] == 0.0)
			continue;
		x[i] = 1.0;
		solve_back(FIT_COMMON, FIT_COMMON, &a[0][0], x);
		bar = sqrt(x[i]);
		if (bar / s->prior_sd[i] > most) {
			most = bar / s->prior_sd[i];
			*largest = (int)i;
			*sd = bar;
		}
	}
	return log_det;
}

static void next_start(struct solve *s, double information[FIT_COMMON][FIT_COMMON])
{
	memcpy(information, s->known, sizeof(s->known));
	for (unsigned k = 0; k < s->drops; k++)
		(void)solve_information(s, &s->drop[k], information);
}

void judge_next(struct solve *s, struct fit *fit)
{
	double information[FIT_COMMON][FIT_COMMON], now, best = -1.0;
	struct solve_drop d = s->drop[0];
	int largest = -1;
	double sd = 0.0;

	d.sample = malloc((d.count + 1) * sizeof(*d.sample));
	if (!d.sample)
		return;
	memcpy(d.sample, s->drop[0].sample, d.count * sizeof(*d.sample));
	memset(d.own, 0, sizeof(d.own));
	next_start(s, information);
	now = next_weigh(s, information, &largest, &sd);
	for (unsigned half = 0; half < 2; half++)
		for (int angle = FIT_JUDGED_FROM_DEG; angle <= FIT_JUDGED_TO_DEG;
		     angle += FIT_JUDGED_STEP_DEG) {
			double more[FIT_COMMON][FIT_COMMON], gain;

			memcpy(more, information, sizeof(more));
			d.own[FIT_GAMMA_DEG] = angle;
			d.own[FIT_LN_SPEED] = s->drop[0].centre[FIT_LN_SPEED] - (half ? 0.5 * log(2.0) : 0.0);
			s->share = 0.0;
			next_samples(s, &d);
			s->share = 1.0; /* what would clip has an envelope without end */
			if (!solve_information(s, &d, more))
				continue;
			gain = next_weigh(s, more, &largest, &sd) - now;
			if (!(gain > best))
				continue;
			best = gain;
			fit->next = (struct fit_next){
			        angle, exp(2.0 * d.own[FIT_LN_SPEED]) / (2.0 * s->scene->drop_gravity_m_s2),
			        gain, largest, sd};
		}
	free(d.sample);
}
