/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/pulse.h"

#include <math.h>

#include "common/units.h"
#include "host/estimate/control_variate.h"
#include "host/estimate/crest.h"
#include "host/estimate/limits.h"

/* Of the time from the level to twice it: half the window of a parabola on a slow edge. */
#define SLOW_HALF 0.7

/* What a family that was not told adds to the width at 10 % is its own: so much of it is its doubt. */
#define FEET_PART 0.2

/* Noise of a second difference over that of samples. */
#define BEND_NOISE 2.45

/* Standard deviation of what may lie anywhere between two samples. */
#define STEP_DOUBT 0.29

enum {
	AGAIN_WITHIN = 4, /* samples */
	SLOW_NEWTON = 4,  /* steps to where the parabola meets the level */
};

struct edge {
	double time_s;
	double slope_g_s; /* magnitude */
	double sigma_s;   /* at a known level */
};

/* Second difference around sample k, 0 where a neighbour is missing. */
static double pulse_bend(const struct trace *trace, size_t k)
{
	if (k == 0 || k + 1 >= trace->count || !trace_good(trace, k - 1) || !trace_good(trace, k) ||
	    !trace_good(trace, k + 1))
		return 0;
	return trace->value_g[k - 1] - 2 * trace->value_g[k] + trace->value_g[k + 1];
}

/* The smaller of two that agree in sign: what a kink beside the interval cannot feign. */
static double agreed(double a, double b)
{
	if (a * b <= 0)
		return 0;
	return fabs(a) < fabs(b) ? a : b;
}

/* Standard deviation of a parabola through three samples at place u between two of them, for samples with one
 * of 1: the mean over the third before and the third after. */
static double parabola_spread(double u)
{
	double w = 1 - u, beyond = u * w / 2;
	double before = w * (1 + u), after = u * (1 + w);

	return sqrt((before * before + after * after + pow(u * (1 + u) / 2, 2) + pow(w * (1 + w) / 2, 2)) /
	                    2 +
	            beyond * beyond);
}

/* On a slow edge noise crosses the level before the pulse does, and after: how much later the last time, at
 * most so many samples after the one before. */
static double crossed_again(const struct trace *trace, const struct peak *peak, size_t at, int step,
                            double level_g)
{
	size_t last = at;

	for (size_t n = 0, k = at; n < AGAIN_WITHIN && k > 0 && k + 1 < trace->count; n++) {
		k = step < 0 ? k - 1 : k + 1;
		if (!trace_good(trace, k) || !(peak->sign * trace->value_g[k] > level_g))
			continue;
		last = k;
		n = 0;
	}
	return (double)(step < 0 ? at - last : last - at) / trace->rate_hz;
}

/* A slow edge by a parabola through the samples around edge, where there are enough for one that meets the
 * level within its window. */
static void find_slow_edge(const struct trace *trace, const struct peak *peak, int step, double level_g,
                           struct edge *edge)
{
	struct local_span all = {-INFINITY, INFINITY};
	struct local local;
	double inside, half, d[3], noise, time = edge->time_s;

	if (!trace_edge(trace, peak->at, step, peak->sign, 2 * level_g, &inside))
		return;
	half = SLOW_HALF * fabs(edge->time_s - inside);
	if (!local_fit(&local, trace, edge->time_s, half, &all, 2))
		return;
	for (unsigned i = 0; i < SLOW_NEWTON; i++) {
		local_at(&local, time, d);
		if (!(step * peak->sign * d[1] < 0))
			return;
		time += (peak->sign * level_g - d[0]) / d[1];
		if (!(fabs(time - edge->time_s) < half))
			return;
	}
	noise = crest_noise(&local, trace);
	edge->time_s = time;
	edge->slope_g_s = fabs(d[1]);
	edge->sigma_s = noise * local_spread(&local, time, 0) / edge->slope_g_s;
}

/* Where between two samples, in parts of their distance, the level that a straight line meets at place is met
 * when all that bends beside them is one kink between them; place where there is none. */
static double kinked_place(double rise, double bend0, double bend1, double place)
{
	double at = bend1 / (bend0 + bend1), before = rise - bend0, behind = rise + bend1;
	double beyond = (place * rise - before * at) / rise;

	if (!(bend0 * bend1 > 0) || !((beyond > 0 ? behind : before) / rise > 0))
		return place;
	return beyond > 0 ? at + beyond * rise / behind : place * rise / before;
}

/* A rise that bends up before and down behind, as far as it may be a step within it, which is met anywhere.
 */
static double step_part(double rise, double bend0, double bend1)
{
	double part = fmin(bend0 / rise, -bend1 / rise);

	return pow(fmin(fmax(part, 0), 1), 2);
}

/* What of the bend between samples before and before + 1 those beside them do not share, as a kink's: 0 to 1.
 */
static double kink_part(const struct trace *trace, size_t before, double bent)
{
	double shared = before == 0 ? 0 : fabs(agreed(pulse_bend(trace, before - 1), bent));

	shared = fmax(shared, fabs(agreed(pulse_bend(trace, before + 2), bent)));
	if (!(fabs(bent) > LIMIT_AGREE * BEND_NOISE * trace->noise_g))
		return 0;
	return fmax(1 - shared / fabs(bent), 0);
}

/* Where the pulse meets level_g on one side, by the parabola through the two samples as bent as both their
 * neighbourhoods say; and how well that is known: noise, the bend that they do not agree on, and the hole
 * when they are no neighbours. */
static bool find_edge(const struct trace *trace, const struct peak *peak, int step, double level_g,
                      struct edge *edge)
{
	size_t before, after;
	double gap, rise, missing, bend0, bend1, bent, place, noise, smooth, kinked, stepped;

	if (!trace_edge(trace, peak->at, step, peak->sign, level_g, &edge->time_s))
		return false;
	after = trace_index(trace, edge->time_s);
	if (after == 0)
		after = 1;
	before = after - 1;
	while (before > 0 && !trace_good(trace, before))
		before--;
	while (after + 1 < trace->count && !trace_good(trace, after))
		after++;
	gap = (double)(after - before) / trace->rate_hz;
	rise = trace->value_g[after] - trace->value_g[before];
	missing = after - before > 1 ? gap / sqrt(12.0) : 0;
	edge->slope_g_s = fabs(rise) / gap;
	bend0 = pulse_bend(trace, before);
	bend1 = pulse_bend(trace, after);
	bent = after - before == 1 ? agreed(bend0, bend1) : 0;
	place = (edge->time_s - trace_time(trace, before)) / gap;
	/* linear + bent u (u - 1) / 2 meets the level this much of the interval later */
	smooth = fmin(fmax(bent * place * (1 - place) / (2 * rise), -0.5), 0.5);
	kinked = kink_part(trace, before, bent) * (kinked_place(rise, bend0, bend1, place) - place - smooth);
	stepped = step_part(rise, bend0, bend1);
	edge->time_s += gap * (smooth + kinked / 2 + stepped * (0.5 - place));
	noise = trace->noise_g * (fabs(bent) > 0 ? parabola_spread(place) : hypot(place, 1 - place));
	edge->sigma_s = hypot(noise, fmax(fabs(bend0 - bent), fabs(bend1 - bent)) / 16) / edge->slope_g_s;
	edge->sigma_s = hypot(hypot(edge->sigma_s, gap * kinked / 2), missing);
	edge->sigma_s = hypot(edge->sigma_s, gap * STEP_DOUBT * stepped);
	edge->sigma_s =
	        hypot(edge->sigma_s, crossed_again(trace, peak, step < 0 ? before : after, step, level_g));
	/* Two samples tell its slope no more, and noise crosses the level before the pulse does. */
	if (after - before == 1 && fabs(rise) < LIMIT_NOISE * trace->noise_g)
		find_slow_edge(trace, peak, step, level_g, edge);
	return true;
}

/* A sample under the pulse; where it is missing or clipped what the peak's family says, if one gave it. */
static bool reading(const struct trace *trace, const struct peak *peak, size_t k, double *value_g)
{
	double time = trace_time(trace, k), derivative[3];

	*value_g = trace->value_g[k];
	if (trace_good(trace, k) && !(time > peak->clipped_from_s && time < peak->clipped_until_s))
		return true;
	if (peak->model != PEAK_MODEL_SHAPE)
		return trace_good(trace, k);
	shape_at(&peak->shape, time, derivative, NULL);
	*value_g = derivative[0];
	return true;
}

/* Trapezoid sum in g s. *hole_g_s: what a parabola as sharp as the pulse would hide in the holes. */
static double area(const struct trace *trace, const struct peak *peak, double from_s, double until_s,
                   double *hole_g_s)
{
	double sharpness = fabs(peak->result.value_g) * pow(UNITS_PI / peak->width_s, 2);
	double sum = 0, time = from_s, value = 0, end = 0, next;

	*hole_g_s = 0;
	if (!trace_at(trace, from_s, &value))
		value = 0;
	for (size_t k = trace_index(trace, from_s); k < trace->count && trace_time(trace, k) <= until_s;
	     k++) {
		double step = trace_time(trace, k) - time;

		if (!reading(trace, peak, k, &next))
			continue;
		sum += step * (value + next) / 2;
		if (step * trace->rate_hz > 1.5)
			*hole_g_s += step * step * step / 12 * sharpness;
		time = trace_time(trace, k);
		value = next;
	}
	if (!trace_at(trace, until_s, &end))
		end = 0;
	return sum + (until_s - time) * (value + end) / 2;
}

/* How much of the pulse reading fills in. */
static double filled(const struct trace *trace, const struct peak *peak, double from_s, double until_s)
{
	double step = 1 / trace->rate_hz, value;
	size_t n = 0;

	if (peak->model != PEAK_MODEL_SHAPE)
		return 0;
	for (size_t k = trace_index(trace, from_s); k < trace->count && trace_time(trace, k) <= until_s; k++)
		if (reading(trace, peak, k, &value) &&
		    (!trace_good(trace, k) || fabs(value - trace->value_g[k]) > 0))
			n++;
	return (double)n * step;
}

/* With the doubt of zero over the pulse's length. */
static void take_velocity_sigma(const struct trace *trace, const struct estimate_baseline *baseline,
                                double sigma_g_s, double length_s, struct estimate_pulse *pulse)
{
	double zero = trace->noise_g * length_s / sqrt((double)baseline->samples);

	pulse->sigma_velocity_m_s = baseline->samples > 0 ? UNITS_G_M_S2 * hypot(sigma_g_s, zero) : NAN;
}

static void pulse_velocity(const struct trace *trace, const struct peak *peak,
                           const struct estimate_baseline *baseline, const struct edge edge[2],
                           struct estimate_pulse *pulse)
{
	double from, until, length, hole, step = 1 / trace->rate_hz, sigma;
	/* Standard deviation of the trapezoid's error at a kink, over its place x between two samples, in
	 * units of slope times step squared: that of x (1 - x) / 2 for x uniform in 0..1. The two kinks of a
	 * pulse may fall on the same place, so that their errors add up. */
	const double kink = 1 / sqrt(720.0);

	trace_edge(trace, peak->at, -1, peak->sign, 0, &from);
	trace_edge(trace, peak->at, 1, peak->sign, 0, &until);
	from = fmax(from, pulse->start_s - pulse->duration_s);
	until = fmin(until, pulse->end_s + pulse->duration_s);
	length = until - from;
	pulse->velocity_change_m_s = UNITS_G_M_S2 * area(trace, peak, from, until, &hole);
	sigma = hypot(trace->noise_g * sqrt(step * length), hole);
	sigma = hypot(sigma, filled(trace, peak, from, until) * peak->result.sigma_g);
	sigma = hypot(sigma, kink * step * step * (edge[0].slope_g_s + edge[1].slope_g_s));
	take_velocity_sigma(trace, baseline, sigma, length, pulse);
}

/* The family's fit, the peak's own where it has that already. */
static bool fit(const struct trace *trace, const struct peak *peak, enum estimate_family family,
                struct shape *shape)
{
	if (peak->shape.family == family || peak->half_sine.family == family) {
		*shape = peak->shape.family == family ? peak->shape : peak->half_sine;
		return true;
	}
	return shape_fit(shape, trace, family, &peak->start);
}

/* A family that was not told is one power of many: how much worse a free one's base is known, of a half-sine
 * and of a haversine. */
static const double free_base[] = {2.4, 5.3};

/* Where neither of two powers is refused the base is as unsure as what their residuals ask lets the power be.
 */
static void pulse_between(struct shape *best, const struct shape *other)
{
	double per_sigma = fabs((best->base_s - other->base_s) / (best->power_z - other->power_z));

	if (best->power_z * other->power_z < 0 && fabs(other->power_z) < LIMIT_SIGNIFICANT)
		best->sigma_base_s = fmax(best->sigma_base_s, per_sigma * hypot(1, best->power_z));
}

/* The best of those that are not refused; best stays AUTO when all are. False where no symmetric pulse will
 * do. */
static bool pulse_choose(const struct trace *trace, const struct peak *peak, enum estimate_family family,
                         struct shape *best, struct estimate_how *how)
{
	struct shape before = {.family = ESTIMATE_FAMILY_AUTO};
	unsigned tried = 0;

	for (unsigned i = 0; i < SHAPE_LADDER; i++) {
		enum shape_verdict verdict;
		struct shape shape;

		if (family != ESTIMATE_FAMILY_AUTO && family != shape_ladder[i])
			continue;
		if (family == ESTIMATE_FAMILY_AUTO && peak->lopsided)
			return false;
		if (shape_ladder[i] == ESTIMATE_FAMILY_SINE_POWER && best->family != ESTIMATE_FAMILY_AUTO)
			return true;
		how->path[tried++] = estimate_family_name(shape_ladder[i]);
		if (!fit(trace, peak, shape_ladder[i], &shape))
			continue;
		/* How far the best of the refused ones is off. */
		if (best->family == ESTIMATE_FAMILY_AUTO && !(how->chi_square < shape.chi_square))
			how->chi_square = shape.chi_square;
		if (shape_hopeless(&shape))
			return false;
		verdict = shape_judge(&shape);
		if (family == ESTIMATE_FAMILY_AUTO && i < sizeof(free_base) / sizeof(free_base[0]))
			shape.sigma_base_s *= free_base[i];
		if (before.family != ESTIMATE_FAMILY_AUTO) {
			pulse_between(&shape, &before);
			pulse_between(best, &shape);
		}
		before = shape;
		/* A doubtful one is not preferred, but what was asked for is given. */
		if (verdict > (family == ESTIMATE_FAMILY_AUTO ? SHAPE_FITS : SHAPE_DOUBTFUL) ||
		    (best->family != ESTIMATE_FAMILY_AUTO && !(shape.chi_square < best->chi_square)))
			continue;
		*best = shape;
		how->flags |= verdict == SHAPE_FITS ? 0 : ESTIMATE_FLAG_MODEL;
	}
	return true;
}

/* True with a curve through the samples: the family where none of its questions is open, otherwise a pulse
 * without one. */
static bool pulse_contact(const struct trace *trace, const struct peak *peak, enum estimate_family family,
                          struct estimate_pulse *pulse, struct control_variate *variate)
{
	struct estimate_how *how = &pulse->contact;
	struct shape shape = {.family = ESTIMATE_FAMILY_AUTO};
	bool symmetric;

	how->status = pulse->status;
	how->flags = peak->result.how.flags &
	             (ESTIMATE_FLAG_GAPS | ESTIMATE_FLAG_SPIKE | ESTIMATE_FLAG_EXTRAPOLATED);
	symmetric = pulse_choose(trace, peak, family, &shape, how);
	if (shape.family == ESTIMATE_FAMILY_AUTO) {
		how->flags |= ESTIMATE_FLAG_MODEL;
		how->status = ESTIMATE_NOT_CONVERGED;
		return symmetric && control_variate_from_cosine_pulse(trace, peak, variate) &&
		       control_variate_ends(variate, trace);
	}
	if (family == ESTIMATE_FAMILY_AUTO && control_variate_from_shape(&shape, variate) &&
	    !control_variate_ends(variate, trace)) {
		how->flags |= ESTIMATE_FLAG_MODEL;
		how->status = ESTIMATE_NOT_CONVERGED;
		return false;
	}
	how->method = estimate_family_name(shape.family);
	how->chi_square = shape.chi_square;
	pulse->family = shape.family;
	pulse->contact_time_s = shape.base_s;
	pulse->sigma_contact_s = shape.sigma_base_s;
	if (family == ESTIMATE_FAMILY_AUTO)
		pulse->sigma_contact_s =
		        hypot(shape.sigma_base_s, FEET_PART * (shape.base_s - pulse->duration_s));
	pulse->contact_start_s = shape.peak_s - shape.base_s / 2;
	pulse->fitted_velocity_m_s = UNITS_G_M_S2 * shape.area_g_s;
	pulse->sigma_fitted_velocity_m_s = UNITS_G_M_S2 * shape.sigma_area_g_s;
	return how->flags & ESTIMATE_FLAG_MODEL ? control_variate_from_cosine_pulse(trace, peak, variate)
	                                        : control_variate_from_shape(&shape, variate);
}

/* The sum once more, by what the samples say beyond the curve. */
static void variate_velocity(const struct trace *trace, const struct peak *peak,
                             const struct estimate_baseline *baseline, const struct control_variate *variate,
                             struct estimate_pulse *pulse)
{
	double sigma;

	pulse->velocity_change_m_s = UNITS_G_M_S2 * control_variate_area(variate, trace, peak, &sigma);
	take_velocity_sigma(trace, baseline, sigma, variate->curve.base_s, pulse);
}

static void variate_width(const struct trace *trace, const struct peak *peak,
                          const struct control_variate *variate, struct estimate_pulse *pulse)
{
	double level = LIMIT_EDGE * fabs(peak->result.value_g);
	struct control_variate_edge edge[2];

	if (!control_variate_edge(variate, trace, -1, level, &edge[0]) ||
	    !control_variate_edge(variate, trace, 1, level, &edge[1]))
		return;
	pulse->start_s = edge[0].time_s;
	pulse->end_s = edge[1].time_s;
	pulse->duration_s = pulse->end_s - pulse->start_s;
	pulse->sigma_duration_s =
	        hypot(control_variate_spread(variate, edge),
	              LIMIT_EDGE * peak->result.sigma_g * (1 / edge[0].slope_g_s + 1 / edge[1].slope_g_s));
}

void pulse_measure(const struct trace *trace, const struct peak *peak,
                   const struct estimate_baseline *baseline, enum estimate_family family,
                   struct estimate_pulse *pulse)
{
	struct estimate_pulse found = {
	        .duration_s = NAN,
	        .sigma_duration_s = NAN,
	        .velocity_change_m_s = NAN,
	        .sigma_velocity_m_s = NAN,
	        .start_s = NAN,
	        .end_s = NAN,
	        .status = peak->result.how.status,
	        .contact_time_s = NAN,
	        .sigma_contact_s = NAN,
	        .contact_start_s = NAN,
	        .fitted_velocity_m_s = NAN,
	        .sigma_fitted_velocity_m_s = NAN,
	        .contact = {.method = "", .chi_square = NAN, .status = ESTIMATE_SHORT},
	};
	double level = LIMIT_EDGE * fabs(peak->result.value_g), tilt;
	struct edge edge[2];
	struct control_variate variate;
	bool has_curve;

	*pulse = found;
	if (found.status == ESTIMATE_SHORT || found.status == ESTIMATE_NO_PEAK)
		return;
	if (!find_edge(trace, peak, -1, level, &edge[0]) || !find_edge(trace, peak, 1, level, &edge[1]) ||
	    !(edge[1].time_s > edge[0].time_s)) {
		pulse->status = ESTIMATE_SHORT;
		return;
	}
	tilt = 1 / edge[0].slope_g_s + 1 / edge[1].slope_g_s;
	pulse->start_s = edge[0].time_s;
	pulse->end_s = edge[1].time_s;
	pulse->duration_s = pulse->end_s - pulse->start_s;
	pulse->flags =
	        (peak->result.how.flags & (ESTIMATE_FLAG_GAPS | ESTIMATE_FLAG_SPIKE | ESTIMATE_FLAG_RIVAL)) |
	        (baseline->doubtful ? ESTIMATE_FLAG_ZERO : 0u);
	pulse->sigma_duration_s =
	        hypot(hypot(edge[0].sigma_s, edge[1].sigma_s), LIMIT_EDGE * peak->result.sigma_g * tilt);
	/* In a peak near its noise a curve may have found one hump: its feet then are not the pulse's. */
	has_curve = peak->model != PEAK_MODEL_NONE && pulse_contact(trace, peak, family, pulse, &variate) &&
	            fabs(peak->result.value_g) > LIMIT_SURE * trace->noise_g;
	if (!has_curve) {
		pulse_velocity(trace, peak, baseline, edge, pulse);
		return;
	}
	variate_velocity(trace, peak, baseline, &variate, pulse);
	variate_width(trace, peak, &variate, pulse);
}

void pulse_of_weak(const struct trace *trace, const struct peak *weak,
                   const struct estimate_baseline *baseline, const struct estimate_pulse *strong,
                   struct estimate_pulse *pulse)
{
	double part = weak->result.sigma_g / fabs(weak->result.value_g), scale = weak->scale, sigma;

	*pulse = *strong;
	pulse->velocity_change_m_s *= scale;
	sigma = hypot(scale * pulse->sigma_velocity_m_s, part * pulse->velocity_change_m_s);
	take_velocity_sigma(trace, baseline, sigma / UNITS_G_M_S2, pulse->duration_s, pulse);
	pulse->flags |= baseline->doubtful ? ESTIMATE_FLAG_ZERO : 0u;
	pulse->fitted_velocity_m_s *= scale;
	pulse->sigma_fitted_velocity_m_s =
	        hypot(scale * pulse->sigma_fitted_velocity_m_s, part * pulse->fitted_velocity_m_s);
	pulse->contact.flags |= ESTIMATE_FLAG_WEAK;
}
