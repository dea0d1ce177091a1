/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>

#include "common/units.h"
#include "host/estimate/clip.h"
#include "host/estimate/doubt.h"
#include "host/estimate/gram.h"
#include "host/estimate/limits.h"
#include "host/estimate/phasor.h"
#include "host/estimate/quiet.h"

/* The case is at rest between two contacts when it has been so long. */
#define REST_S 5e-3

/* Before a second contact its foot. */
#define FOOT_S 1e-3

/* Both sensors see one shock: what Y reads of X differs by more between them only where something is wrong.
 */
#define RATIO_APART 1.6

/* X's and Y's 10 % points on the case are apart by more than these parts of the width. On our own tower they
 * begin within 0.002 of it and end within 0.06, as it turns. */
#define BEGIN_APART 0.025
#define END_APART 0.15

/* What the stronger axis of a sensor reads beyond its part of the other, root mean square, as part of its
 * peak: by two parts and by four. Own tower, 10 to 70 degrees: of the case 0.046 and 0.023, of a plate that
 * swings at one frequency 0.077 and 0.034. */
#define UNLIKE_TWO 0.06
#define UNLIKE_FOUR 0.03
#define PLATE_TWO 0.1
#define PLATE_FOUR 0.045
enum { SHAPE_SAMPLES = 12, SHAPE_PARTS = 4 };

/* An axis that stands out of its noise by less has width, time and area by its sensor's strongest one too. */
#define SHARE_NOISE 40.0
#define SHARE_CHANCE 3.0

/* Axes that peak further apart than this part of the width do so: no shape is asked then. */
#define SHARE_TIME 0.1

/* Squared, over the mean square of what straight lines between samples miss of a bend, at kinks. */
#define LINE_SQUARE 20.0

/* How far the speeds that S1 and S2 gain in X and Y may be apart, over S2's: where the box turns. Own tower,
 * 10 to 70 degrees: 0.48 at most. Their fade, and the mean square of that. */
#define SPEED_APART 0.6
#define FADE_S 0.08
#define FADE_SQUARE 0.375

/* Of an axis whose sign and height mean something; half of it is what the sign is taken by. */
#define AXIS_SIGMAS 20.0

/* Where the contact that sample k belongs to has ended; last when it has not. */
static size_t contact_end(const struct trace *trace, size_t k, double zero_g, double level_g)
{
	size_t rest = (size_t)(REST_S * trace->rate_hz) + 1, n = 0;

	for (; k < trace->last && n < rest; k++) {
		n++;
		if (trace_good(trace, k) && fabs(trace->value_g[k] - zero_g) > level_g)
			n = 0;
	}
	return n < rest ? trace->last : k;
}

/* The first of two samples side by side from k on that are off zero by as much. */
static size_t contact_begin(const struct trace *trace, size_t k, double zero_g, double level_g)
{
	for (; k + 1 < trace->last; k++)
		if (trace_good(trace, k) && trace_good(trace, k + 1) &&
		    fabs(trace->value_g[k] - zero_g) > level_g &&
		    fabs(trace->value_g[k + 1] - zero_g) > level_g)
			return k;
	return trace->last;
}

/* The largest of two samples side by side in [k, until). */
static double contact_height(const struct trace *trace, size_t k, size_t until, double zero_g)
{
	double most = 0;

	for (; k + 1 < until; k++) {
		if (!(trace_most(trace, k) + fabs(zero_g) > most)) {
			k |= TRACE_BLOCK - 1;
			continue;
		}
		if (trace_good(trace, k) && trace_good(trace, k + 1))
			most = fmax(most, fmin(fabs(trace->value_g[k] - zero_g),
			                       fabs(trace->value_g[k + 1] - zero_g)));
	}
	return most;
}

/* What two samples of a contact reach: more than noise and one step of coarse numbers, which hide it. */
static double contact_level(const struct trace *trace, double most_g, double sigma_g)
{
	return fmax(LIMIT_AGAIN * most_g, LIMIT_NOISE * fmax(sigma_g, clip_step(trace) / sqrt(12.0)));
}

double doubt_height_g(const struct trace *trace)
{
	return contact_height(trace, trace->first, trace->last, quiet_glance(trace, 0, trace->count, NULL));
}

double doubt_touch_s(const struct trace *trace)
{
	double sigma = 0, zero = quiet_glance(trace, 0, trace->count, &sigma);
	double most = contact_height(trace, trace->first, trace->last, zero);
	size_t k = contact_begin(trace, trace->first, zero, contact_level(trace, most, sigma));
	size_t foot = k, rise;

	if (k >= trace->last)
		return INFINITY;
	while (foot > 0 &&
	       !(trace_good(trace, foot) && fabs(trace->value_g[foot] - zero) < LIMIT_EDGE * most))
		foot--;
	rise = k - foot + 2;
	return foot < rise ? INFINITY : trace_time(trace, foot - rise);
}

double doubt_slap_s(const struct trace *trace)
{
	double zero, most, sigma = 0, level;
	size_t first, end, again;

	if (trace->still == 0 || trace->still >= trace->last)
		return INFINITY;
	zero = quiet_glance(trace, 0, trace->still, &sigma);
	most = contact_height(trace, trace->first, trace->last, zero);
	level = contact_level(trace, most, sigma);
	first = contact_begin(trace, trace->first, zero, level);
	end = contact_end(trace, first, zero, LIMIT_EDGE * most);
	again = contact_begin(trace, end, zero, level);
	if (again >= trace->last ||
	    !(contact_height(trace, end, trace->last, zero) > contact_height(trace, first, end, zero)))
		return INFINITY;
	return trace_time(trace, again) - FOOT_S;
}

/* Whether an axis stands so far out of its noise that its sign and height mean something. */
static bool axis_sure(const struct estimate_channel *channel)
{
	return channel->peak.how.status == ESTIMATE_OK && !(channel->peak.how.flags & ESTIMATE_FLAG_WEAK) &&
	       fabs(channel->peak.value_g) > AXIS_SIGMAS * channel->baseline.noise_g;
}

/* The direction that a trace first goes in, by half of its peak; 0 where it has none. */
static int axis_sign(const struct trace *trace, const struct estimate_channel *channel)
{
	size_t k = trace_reaches(trace, trace->first, trace->last, fabs(channel->peak.value_g) / 2);

	return k == trace->last ? 0 : trace->value_g[k] < 0 ? -1 : 1;
}

static void axis_flag(struct estimate_channel *channel)
{
	channel->peak.how.flags |= ESTIMATE_FLAG_AXES;
	channel->pulse.flags |= ESTIMATE_FLAG_AXES;
}

/* X and Y of one sensor against the other's, one of which shows nothing of what it should by far. */
static bool axis_dead(struct estimate_channel *const alive[2], struct estimate_channel *const other[2])
{
	for (unsigned i = 0; i < 2; i++) {
		const struct estimate_channel *dead = other[i], *beside = other[1 - i];

		if (dead->peak.how.status == ESTIMATE_NO_PEAK && axis_sure(alive[0]) && axis_sure(alive[1]) &&
		    axis_sure(beside) &&
		    fabs(alive[i]->peak.value_g / alive[1 - i]->peak.value_g * beside->peak.value_g) >
		            AXIS_SIGMAS * dead->baseline.noise_g)
			return true;
	}
	return false;
}

/* Exchanged X and Y explain what S1 and S2 read better than what they are called. */
static bool axis_exchanged(struct estimate_channel *const channel[2][2])
{
	double s1 = log(fabs(channel[0][1]->peak.value_g / channel[0][0]->peak.value_g));
	double s2 = log(fabs(channel[1][1]->peak.value_g / channel[1][0]->peak.value_g));

	for (unsigned i = 0; i < 4; i++)
		if (!axis_sure(channel[i / 2][i % 2]))
			return false;
	return fabs(s1 - s2) > log(RATIO_APART) && fabs(s1 + s2) < fabs(s1 - s2) / 2;
}

/* X and Y of the case begin and end together: one is late otherwise, or behind a filter of its own. */
static bool axis_late(struct estimate_channel *const xy[2])
{
	const struct estimate_pulse *x = &xy[0]->pulse, *y = &xy[1]->pulse;
	double width = fmax(x->duration_s, y->duration_s);
	double chance = LIMIT_SIGNIFICANT * hypot(x->sigma_duration_s, y->sigma_duration_s) / sqrt(2.0);

	return axis_sure(xy[0]) && axis_sure(xy[1]) &&
	       (fabs(x->start_s - y->start_s) > BEGIN_APART * width + chance ||
	        fabs(x->end_s - y->end_s) > END_APART * width + chance);
}

/* What the stronger axis of a sensor reads beyond its part of the other, which sees the same pulse: a little
 * earlier or later, as filters of their own let it, and another part while the box turns. */
struct shapes {
	const struct trace *trace[2]; /* the stronger one first */
	size_t from, until;           /* of its samples */
	struct gram gram;
	double bends; /* squares of the other's second differences */
};

/* The other axis at sample k, what it rises by there, both as they grow; false where it is missing. */
static bool shapes_row(struct shapes *shapes, size_t k, double row[GRAM_COMMON])
{
	const struct trace *trace = shapes->trace[1];
	double time_s = trace_time(shapes->trace[0], k), step_s = 1 / trace->rate_hz, at, before, behind;
	double place = (double)(k - shapes->from) / (double)(shapes->until - shapes->from);

	if (!trace_usable(shapes->trace[0], k) || !trace_at(trace, time_s, &at) ||
	    !trace_at(trace, time_s - step_s, &before) || !trace_at(trace, time_s + step_s, &behind))
		return false;
	row[0] = at;
	row[1] = (behind - before) / 2;
	row[2] = place * at;
	row[3] = place * place * at;
	row[4] = shapes->trace[0]->value_g[k];
	row[5] = 0;
	shapes->bends += pow(before - 2 * at + behind, 2);
	return true;
}

/* Whether the mean square beyond the first parts is more than apart_g, noise and the straight lines between
 * the other's samples make. */
static bool shapes_beyond(const struct shapes *shapes, unsigned parts, double apart_g)
{
	double normal[CHOLESKY_MAX][CHOLESKY_MAX] = {{0}}, right[CHOLESKY_MAX] = {0},
	       part[CHOLESKY_MAX] = {0};
	double rest = 0, count = (double)gram_finish(&shapes->gram, normal, right, &rest), whole, noise;
	struct cholesky factor;

	if (count < SHAPE_SAMPLES || !cholesky_factor(&factor, parts, normal))
		return false;
	cholesky_solve(&factor, right, part);
	for (unsigned i = 0; i < parts; i++)
		rest -= part[i] * right[i];
	whole = part[0] + part[2] / 2 + part[3] / 3;
	noise = hypot(shapes->trace[0]->noise_g, hypot(whole, part[1]) * shapes->trace[1]->noise_g);
	count -= parts;
	return rest / count > apart_g * apart_g + noise * noise * (1 + LIMIT_CHI * sqrt(2 / count)) +
	                              whole * whole * shapes->bends / (LINE_SQUARE * count);
}

/* One axis shows another pulse than its sensor's other one: a limit, a gain, a filter or a hold of its own.
 */
static bool axis_unlike(const struct trace *const trace[2], struct estimate_channel *const xy[2], double two,
                        double four)
{
	unsigned strong =
	        fabs(xy[1]->peak.value_g) / trace[1]->noise_g > fabs(xy[0]->peak.value_g) / trace[0]->noise_g;
	struct shapes shapes = {.trace = {trace[strong], trace[1 - strong]}};
	double row[GRAM_COMMON], peak_g = fabs(xy[strong]->peak.value_g);

	if (!axis_sure(xy[0]) || !axis_sure(xy[1]))
		return false;
	shapes.from = trace_index(trace[strong], xy[strong]->pulse.start_s);
	shapes.until = trace_index(trace[strong], xy[strong]->pulse.end_s);
	gram_start(&shapes.gram, SHAPE_PARTS);
	for (size_t k = shapes.from; k < shapes.until; k++)
		if (shapes_row(&shapes, k, row))
			gram_add(&shapes.gram, row);
	return shapes_beyond(&shapes, 2, two * peak_g) || shapes_beyond(&shapes, SHAPE_PARTS, four * peak_g);
}

/* X and Y of a plate that swing at one frequency show one swing from the same pulse. */
static bool plate_unlike(const struct trace *const trace[2], struct estimate_channel *const xy[2])
{
	const struct estimate_ringdown *x = &xy[0]->ringdown, *y = &xy[1]->ringdown;

	return x->how.status == ESTIMATE_OK && y->how.status == ESTIMATE_OK &&
	       fabs(x->frequency_hz - y->frequency_hz) < LIMIT_PART * x->frequency_hz &&
	       axis_unlike(trace, xy, PLATE_TWO, PLATE_FOUR);
}

/* What a sensor's axis has gained of speed, in g s, over the fade that lets the plate swing about the case;
 * its standard deviation. NAN where a sample is missing. */
static double axis_speed(const struct trace *trace, const struct estimate_baseline *baseline, double from_s,
                         double *sigma)
{
	size_t k = trace_index(trace, from_s), n = (size_t)(FADE_S * trace->rate_hz);
	struct phasor fade = phasor_at(0, UNITS_PI / (double)n);
	double sum = 0;

	if (k + n > trace->count || baseline->samples == 0)
		return NAN;
	for (size_t i = 0; i < n; i++) {
		if (!trace_usable(trace, k + i))
			return NAN;
		sum += trace->value_g[k + i] * (1 + fade.cosine) / 2;
		phasor_turn(&fade);
	}
	*sigma = trace->noise_g *
	         hypot(sqrt(FADE_SQUARE * (double)n), (double)n / 2 / sqrt((double)baseline->samples)) /
	         trace->rate_hz;
	return sum / trace->rate_hz;
}

/* Plate and case go on together, but for what the box turns, whatever is between them: one of them reads too
 * much or too little. */
static bool axes_part(const struct trace *const trace[2][2], struct estimate_channel *const channel[2][2])
{
	double from_s = fmin(channel[1][0]->pulse.start_s, channel[1][1]->pulse.start_s);
	double gained = 0, apart = 0, most = 0;

	if (isnan(from_s))
		return false;
	for (unsigned axis = 0; axis < 2; axis++) {
		double speed[2], sigma[2];

		for (unsigned s = 0; s < 2; s++) {
			if (channel[s][axis]->baseline.unsettled || channel[s][axis]->baseline.doubtful)
				return false;
			speed[s] = axis_speed(trace[s][axis], &channel[s][axis]->baseline, from_s, &sigma[s]);
		}
		gained = hypot(gained, speed[1]);
		apart = hypot(apart, speed[0] - speed[1]);
		most = fmax(most, hypot(sigma[0], sigma[1]));
	}
	return apart > SPEED_APART * gained + LIMIT_NOISE * most; /* false where one is not known */
}

/* Whether the plate begins before the case that shakes it, whose axes begin together. */
static bool axes_lead(struct estimate_channel *const s1[2], struct estimate_channel *const s2[2])
{
	for (unsigned i = 0; i < 2; i++) {
		const struct estimate_pulse *plate = &s1[i]->pulse, *box = &s2[i]->pulse;

		if (!axis_sure(s1[i]) || !axis_sure(s2[i]) ||
		    !(plate->start_s <
		      box->start_s - BEGIN_APART * box->duration_s -
		              LIMIT_SIGNIFICANT * hypot(plate->sigma_duration_s, box->sigma_duration_s)))
			return false;
	}
	return true;
}

/* A sensor is loose on all of its axes. */
static void loose_flag(struct estimate_channel *const xy[2])
{
	unsigned rough = (xy[0]->peak.how.flags | xy[1]->peak.how.flags) & ESTIMATE_FLAG_ROUGH;

	for (unsigned i = 0; i < 2; i++) {
		xy[i]->peak.how.flags |= rough;
		xy[i]->pulse.flags |= rough;
	}
}

/* By what differs beyond chance from what the strong axis says. */
static void share_widen(double *sigma, double value, double strong, double strong_sigma)
{
	double apart = fabs(value - strong);

	if (apart > SHARE_CHANCE * hypot(*sigma, strong_sigma))
		*sigma = hypot(*sigma, apart);
}

static void share_near_noise(const struct peak *strong, struct peak *peak, const struct estimate_pulse *whole,
                             struct estimate_pulse *pulse)
{
	double part = peak->result.value_g / strong->result.value_g;

	if (fabs(peak->result.time_s - strong->result.time_s) < SHARE_TIME * whole->duration_s)
		share_widen(&peak->result.sigma_time_s, peak->result.time_s, strong->result.time_s,
		            strong->result.sigma_time_s);
	share_widen(&pulse->sigma_duration_s, pulse->duration_s, whole->duration_s, whole->sigma_duration_s);
	share_widen(&pulse->sigma_velocity_m_s, pulse->velocity_change_m_s, part * whole->velocity_change_m_s,
	            hypot(part * whole->sigma_velocity_m_s,
	                  peak->result.sigma_g / strong->result.value_g * whole->velocity_change_m_s));
	share_widen(&pulse->sigma_contact_s, pulse->contact_time_s, whole->contact_time_s,
	            whole->sigma_contact_s);
	share_widen(&pulse->sigma_fitted_velocity_m_s, pulse->fitted_velocity_m_s,
	            part * whole->velocity_change_m_s,
	            hypot(part * whole->sigma_velocity_m_s,
	                  peak->result.sigma_g / strong->result.value_g * whole->velocity_change_m_s));
}

void doubt_share(const struct trace *const trace[2], struct peak *const peak[2],
                 struct estimate_pulse *const pulse[2])
{
	const struct peak *strong = peak[0];
	double clear = fabs(peak[1]->result.value_g) / trace[1]->noise_g;

	if (strong->result.how.status != ESTIMATE_OK ||
	    !(clear < fabs(strong->result.value_g) / trace[0]->noise_g) ||
	    peak[1]->result.how.flags & ESTIMATE_FLAG_WEAK)
		return;
	peak[1]->result.how.flags |= strong->result.how.flags & ESTIMATE_FLAG_FLAT;
	pulse[1]->flags |= strong->result.how.flags & ESTIMATE_FLAG_FLAT;
	if (strong->doubt_s > peak[1]->doubt_s) {
		peak[1]->result.sigma_time_s = hypot(peak[1]->result.sigma_time_s, strong->doubt_s);
		peak[1]->doubt_s = strong->doubt_s;
	}
	if (isnan(pulse[0]->contact_time_s)) {
		pulse[1]->contact.flags |= ESTIMATE_FLAG_MODEL;
		if (fabs(peak[1]->plain.value_g) > 0) {
			peak[1]->result.sigma_g = hypot(peak[1]->plain.sigma_g,
			                                peak[1]->result.value_g - peak[1]->plain.value_g);
			peak[1]->result.sigma_time_s = hypot(peak[1]->plain.sigma_time_s,
			                                     peak[1]->result.time_s - peak[1]->plain.time_s);
		}
	}
	if (clear < SHARE_NOISE)
		share_near_noise(strong, peak[1], pulse[0], pulse[1]);
}

unsigned doubt_axes(const struct trace *const trace[2][2], struct estimate_channel *const channel[2][2])
{
	struct estimate_channel *const *s1 = channel[0], *const *s2 = channel[1];
	bool any = axis_exchanged(channel) || axis_dead(s1, s2) || axis_dead(s2, s1) || axis_late(s2) ||
	           axis_unlike(trace[1], s2, UNLIKE_TWO, UNLIKE_FOUR) || plate_unlike(trace[0], s1) ||
	           axes_part(trace, channel) || axes_lead(s1, s2);
	/* What shifts zero on both axes of the case is in a supply that the plate's have too. */
	unsigned shared = s2[0]->peak.how.flags & s2[1]->peak.how.flags & ESTIMATE_FLAG_TAIL;

	loose_flag(s1);
	loose_flag(s2);
	for (unsigned i = 0; i < 4; i++) {
		if (any)
			axis_flag(channel[i / 2][i % 2]);
		channel[i / 2][i % 2]->peak.how.flags |= shared;
		channel[i / 2][i % 2]->pulse.flags |= shared;
	}
	for (unsigned i = 0; i < 2; i++) {
		if (!axis_sure(channel[0][i]) || !axis_sure(channel[1][i]) ||
		    axis_sign(trace[0][i], channel[0][i]) * axis_sign(trace[1][i], channel[1][i]) >= 0)
			continue;
		axis_flag(channel[0][i]);
		axis_flag(channel[1][i]);
		any = true;
	}
	return shared | (any ? ESTIMATE_FLAG_AXES : 0u);
}
