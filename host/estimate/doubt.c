/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/doubt.h"

#include <math.h>

#include "common/units.h"
#include "host/estimate/limits.h"
#include "host/estimate/quiet.h"

enum {
	PLATEAU_SAMPLES = 3,
	JUMPS = 3,
	LEFT_RISES = 4,     /* a pulse that has an end has ended so many rises after its peak */
	WIDTH_SAMPLES = 12, /* of a pulse whose width straight lines and curves tell without a bias */
	BATCHES_MIN = 8,    /* of the quiet part, for the scatter of their means */
	ROUGH_SAMPLES = 12,
	ROUGH_WIDTHS = 4,
	AFTER_BLOCKS = 12, /* of half a width, that follow the pulse */
	AFTER_FEWEST = 3,  /* of them, in a record that ends soon */
};

/* A limit trembles less than noise would in so many of as many tops. */
#define PLATEAU_CHANCE 1e-5

/* Variance of a parabola's samples about their mean, over the square of its height. */
#define ROUND_SPREAD (4.0 / 45)

/* A step over what either side bends, and over those that are left when a few are taken away: a lost block
 * has two, two in each other's place three. */
#define STEP_STEEPER 3.0

/* Noise of what is missing at a step, and of third differences, over that of samples. */
#define JUMP_NOISE 3.23
#define DIFFERENCES_NOISE 4.47

/* How far a step is from what it looks like by its neighbour's rise on either side, over it. */
#define JUMP_APART 0.25

/* Differences of a ring over the peak; slower than this it may be a plate. */
#define ROUGH_HEIGHT 0.01
#define ROUGH_HZ 620.0

/* A pulse's force has faded this part of its width after its 10 % point. */
#define AFTER_FROM 0.3

/* Beyond so much of a width before its 10 % point a pulse has a 200th of its area or less. */
#define FOOT_PART 0.1

/* What a width of n samples is off, times n squared: kinks between the samples. */
#define WIDTH_BIAS 1.4

/* The samples of a flat top, both included. */
struct plateau {
	size_t from, until;
};

/* Whether two good samples lie on either side. */
static bool plateau_inside(const struct trace *trace, const struct plateau *top)
{
	return top->from >= 2 && top->until + 2 < trace->count && trace_good(trace, top->from - 1) &&
	       trace_good(trace, top->from - 2) && trace_good(trace, top->until + 1) &&
	       trace_good(trace, top->until + 2);
}

/* The largest good sample of the event by magnitude; count when there is none. */
static size_t plateau_largest(const struct trace *trace)
{
	size_t at = trace->count;
	double most = 0;

	for (size_t k = trace->first; k < trace->last; k++) {
		if (!(trace_most(trace, k) > most)) {
			k |= TRACE_BLOCK - 1;
			continue;
		}
		if (trace_good(trace, k) && fabs(trace->value_g[k]) > most) {
			most = fabs(trace->value_g[k]);
			at = k;
		}
	}
	return at;
}

/* How much it falls off on either side, at least, within two samples. */
static double plateau_fall(const struct trace *trace, const struct plateau *top)
{
	const double *v = trace->value_g;
	double sign = v[top->from] < 0 ? -1 : 1;

	return fmin(sign * (v[top->from] - v[top->from - 2]), sign * (v[top->until] - v[top->until + 2]));
}

/* Whether more than noise falls off beside them, and a round top that falls off so would be as round between
 * them that it shows. */
static bool plateau_ends(const struct trace *trace, const struct plateau *top, double noise_g)
{
	double fall = plateau_fall(trace, top), half = (double)(top->until - top->from) / 2;

	return fall > LIMIT_NOISE * noise_g && fall * half * half / (4 * half + 4) > LIMIT_AGREE * noise_g;
}

/* About the mean of the samples of a top. */
struct tremble {
	double square;      /* sum of squares */
	double slope, bend; /* of a straight line, of a parabola outward, in their standard deviations */
	double count;
};

static struct tremble plateau_tremble(const struct trace *trace, const struct plateau *top, double noise_g)
{
	double n = (double)(top->until - top->from + 1), mean = 0, along = 0, outward = 0;
	struct tremble tremble = {0, 0, 0, n};

	for (size_t k = top->from; k <= top->until; k++)
		mean += trace->value_g[k] / n;
	tremble.square = n * trace->step_g * trace->step_g / 12; /* that rounding hides */
	for (size_t k = top->from; k <= top->until; k++) {
		double off = trace->value_g[k] - mean, place = (double)(k - top->from) - (n - 1) / 2;

		tremble.square += off * off;
		along += off * place;
		outward += off * place * place;
	}
	tremble.slope = fabs(along) / (noise_g * sqrt(n * (n * n - 1) / 12));
	tremble.bend = outward / (noise_g * sqrt(n * (n * n - 1) * (n * n - 4) / 180));
	return tremble;
}

/* Whether noise trembles no more than the samples do but once in many tops: the first term of chi-square's
 * distribution. */
static bool plateau_cut(const struct trace *trace, const struct plateau *top, double noise_g)
{
	struct tremble tremble = plateau_tremble(trace, top, noise_g);
	double half = (tremble.count - 1) / 2;

	return pow(tremble.square / (2 * noise_g * noise_g), half) / tgamma(half + 1) < PLATEAU_CHANCE;
}

/* Whether they tremble as noise about a level top, and bend far less than a round one that falls off so. */
static bool plateau_flat(const struct trace *trace, const struct plateau *top, double noise_g)
{
	double half = (double)(top->until - top->from) / 2, sign = trace->value_g[top->from] < 0 ? 1 : -1;
	double round_g = plateau_fall(trace, top) * half * half / (4 * half + 4);
	struct tremble tremble = plateau_tremble(trace, top, noise_g);
	double freedom = tremble.count - 1, bend = sign * tremble.bend;

	return tremble.count > PLATEAU_SAMPLES && tremble.slope < LIMIT_AGREE && bend < LIMIT_AGREE &&
	       tremble.square < noise_g * noise_g * freedom * (1 + LIMIT_CHI * sqrt(2 / freedom)) &&
	       sqrt(ROUND_SPREAD * tremble.count) * round_g / noise_g - fmax(bend, 0) > LIMIT_NOISE;
}

/* Sample by sample outward from the largest one, to the ends of what is flat by that. */
static bool plateau_find(const struct trace *trace, double noise_g,
                         bool (*is_flat)(const struct trace *, const struct plateau *, double),
                         struct plateau *top)
{
	size_t at = plateau_largest(trace);
	double high, low, sign;

	if (at == trace->count || trace->sample[at] & SAMPLE_CLIPPED)
		return false;
	*top = (struct plateau){at, at};
	high = low = fabs(trace->value_g[at]);
	sign = trace->value_g[at] < 0 ? -1 : 1;
	while (low > LIMIT_MOST * high && plateau_inside(trace, top)) {
		double before = sign * trace->value_g[top->from - 1];
		double after = sign * trace->value_g[top->until + 1];

		if (top->until - top->from + 1 >= PLATEAU_SAMPLES && plateau_ends(trace, top, noise_g) &&
		    is_flat(trace, top, noise_g))
			return true;
		low = fmin(low, fmax(before, after));
		top->from -= before > after;
		top->until += !(before > after);
	}
	return false;
}

/* Noise of samples side by side: less than all of them have where it is not white. */
static double plateau_noise(const struct trace *trace, double noise_g)
{
	size_t from, until;

	quiet_find(trace, &from, &until);
	return fmin(noise_g, hypot(quiet_noise(trace, from, until), trace->step_g / sqrt(12.0)));
}

void doubt_plateau(struct trace *trace, double noise_g)
{
	struct plateau top;

	if (!plateau_find(trace, plateau_noise(trace, noise_g), plateau_cut, &top))
		return;
	trace->flags |= RECORD_FLAG_CLIPPED;
	for (size_t k = top.from; k <= top.until; k++)
		trace->sample[k] |= SAMPLE_CLIPPED | TRACE_LIMIT;
}

/* How far a sample is off the parabola through the three beyond it. */
static double doubt_off(const double *v, ptrdiff_t away)
{
	return fabs(v[0] - v[3 * away] - 3 * (v[away] - v[2 * away]));
}

/* The largest magnitude of three samples. */
static double doubt_most(const double *v)
{
	return fmax(fmax(fabs(v[0]), fabs(v[1])), fabs(v[2]));
}

/* What is missing between samples k and k + 1 when parabolas through three to either side are led to their
 * middle; 0 where it is a kink or an edge, which rise beside as much or whose samples next to it are off the
 * others, where a contact begins, or ends with little, and where one of the eight is missing. */
static double doubt_jump(const struct trace *trace, size_t k, double height_g)
{
	const double *v = trace->value_g + k;
	double rise, before, after, jump;

	if (k < 3 || k + 4 >= trace->count)
		return 0;
	rise = v[1] - v[0];
	before = rise - (v[0] - v[-1]);
	after = rise - (v[2] - v[1]);
	jump = (15 * rise - 10 * (v[2] - v[-1]) + 3 * (v[3] - v[-2])) / 8;
	if (!(fmax(fabs(before - jump), fabs(after - jump)) < JUMP_APART * fabs(jump)) ||
	    !(fmax(doubt_off(v, -1), doubt_off(v + 1, 1)) <
	      LIMIT_SLIGHT * fabs(jump) + LIMIT_HINT * DIFFERENCES_NOISE * trace->noise_g) ||
	    doubt_most(v - 2) < LIMIT_EDGE * height_g ||
	    (doubt_most(v + 1) < LIMIT_EDGE * height_g && fabs(jump) < LIMIT_AGAIN * height_g))
		return 0;
	for (size_t i = k - 3; i <= k + 4; i++)
		if (!trace_usable(trace, i))
			return 0;
	return fabs(jump);
}

/* Samples [from, until), and the jumps found among them so far. */
struct jumps {
	size_t from, until, found, at[JUMPS];
};

/* The next largest that is not beside one of those. */
static double doubt_largest_jump(const struct trace *trace, struct jumps *jumps, double height_g)
{
	double most = 0;

	for (size_t k = jumps->from; k < jumps->until; k++) {
		double jump = doubt_jump(trace, k, height_g);
		bool other = jump > most;

		for (size_t i = 0; other && i < jumps->found; i++)
			other = k + 2 < jumps->at[i] || k > jumps->at[i] + 2;
		if (other) {
			most = jump;
			jumps->at[jumps->found] = k;
		}
	}
	jumps->found++;
	return most;
}

/* Whether there is a step in the pulse or around it, whose like are few: of a gain, a cable, a block of
 * samples. */
static bool doubt_step(const struct trace *trace, const struct peak *peak, const struct estimate_pulse *pulse)
{
	double height = fabs(peak->result.value_g), most, next = 0;
	struct jumps jumps = {.from = trace_index(trace, pulse->start_s - pulse->duration_s),
	                      .until = trace_index(trace, pulse->end_s + pulse->duration_s)};

	most = doubt_largest_jump(trace, &jumps, height);
	if (!(most > LIMIT_EDGE * height) || !(most > LIMIT_SIGNIFICANT * JUMP_NOISE * trace->noise_g))
		return false;
	while (jumps.found < JUMPS)
		next = doubt_largest_jump(trace, &jumps, height);
	return most > STEP_STEEPER * next;
}

/* Whether the mean square of n second or third differences is beyond noise's, and more than a hundredth of
 * the peak and the swing, slower than a loose sensor's, have. */
static bool rough_beyond(const struct trace *trace, const struct peak *peak, double rough, double swing,
                         double n, unsigned order)
{
	static const double square[] = {6, 20}, spread[] = {3.9, 4.6}; /* of white noise */
	double noise = square[order - 2] * trace->noise_g * trace->noise_g;
	double slow = pow(2 * sin(UNITS_PI * ROUGH_HZ / trace->rate_hz), 2 * order);

	rough -= noise;
	return rough > LIMIT_SURE * noise * sqrt(spread[order - 2] / n) &&
	       rough > pow(ROUGH_HEIGHT * peak->result.value_g, 2) && rough > slow * swing;
}

/* Whether it rings on after the pulse, faster than a plate does: second differences stand out of noise best,
 * third ones of a swing. */
static bool doubt_rough(const struct trace *trace, const struct peak *peak,
                        const struct estimate_pulse *pulse)
{
	size_t k = trace_index(trace, pulse->end_s + AFTER_FROM * pulse->duration_s);
	size_t until = trace_index(trace, pulse->end_s + (AFTER_FROM + ROUGH_WIDTHS) * pulse->duration_s);
	double second = 0, third = 0, swing = 0, n = 0;
	const double *v = trace->value_g;

	for (; k + 3 < until; k++) {
		if (!trace_usable(trace, k) || !trace_usable(trace, k + 1) || !trace_usable(trace, k + 2) ||
		    !trace_usable(trace, k + 3))
			continue;
		second += pow(v[k] - 2 * v[k + 1] + v[k + 2], 2);
		third += pow(doubt_off(v + k, 1), 2);
		swing += v[k] * v[k];
		n++;
	}
	swing = swing / n - trace->noise_g * trace->noise_g;
	return n >= ROUGH_SAMPLES && (rough_beyond(trace, peak, second / n, swing, n, 2) ||
	                              rough_beyond(trace, peak, third / n, swing, n, 3));
}

/* Mean of n samples from k on; false where one of them is missing. */
static bool doubt_mean(const struct trace *trace, size_t k, size_t n, double *mean_g)
{
	double sum = 0;

	if (k + n > trace->count)
		return false;
	for (size_t i = k; i < k + n; i++) {
		if (!trace_usable(trace, i))
			return false;
		sum += trace->value_g[i];
	}
	*mean_g = sum / (double)n;
	return true;
}

/* Standard deviation of the mean of n samples side by side, by such means of the quiet part. */
static double doubt_mean_sigma(const struct trace *trace, const struct estimate_baseline *baseline, size_t n)
{
	size_t until = trace_index(trace, baseline->until_s), batches = 0;
	double square = 0, white = trace->noise_g / sqrt((double)n), mean;

	for (size_t k = trace_index(trace, baseline->from_s); k + n <= until; k += n) {
		if (!doubt_mean(trace, k, n, &mean))
			continue;
		square += mean * mean;
		batches++;
	}
	return batches < BATCHES_MIN ? white : fmax(white, sqrt(square / (double)batches));
}

/* What follows the pulse in blocks of half a width. */
struct after {
	size_t n, samples;
	double mean_g[AFTER_BLOCKS], sigma_g; /* of each, by the quiet part */
	double again_g;                       /* rises by so much are another contact's */
};

/* As far as to a hole or to what rises again. */
static void after_find(const struct trace *trace, const struct estimate_baseline *baseline,
                       const struct peak *peak, const struct estimate_pulse *pulse, struct after *after)
{
	size_t k = trace_index(trace, pulse->end_s + AFTER_FROM * pulse->duration_s);

	/* The sum of straight lines goes on to where the reading is back at zero. */
	while (peak->lopsided && k < trace->count &&
	       trace_time(trace, k) < pulse->end_s + pulse->duration_s && peak->sign * trace->value_g[k] > 0)
		k++;
	after->n = 0;
	after->again_g = LIMIT_EDGE * fabs(peak->result.value_g);
	after->samples = (size_t)fmax(pulse->duration_s * trace->rate_hz / 2, 1);
	after->sigma_g = doubt_mean_sigma(trace, baseline, after->samples);
	for (; after->n < AFTER_BLOCKS; after->n++, k += after->samples) {
		double *mean = &after->mean_g[after->n];

		if (!doubt_mean(trace, k, after->samples, mean))
			break;
		*mean *= peak->sign;
		if (after->n > 0 && *mean > fmax(mean[-1], 0) + after->again_g) {
			after->n--; /* it may have begun there */
			break;
		}
	}
}

/* By how much zero after differs from zero before: of a supply or a sensor that was shifted; a plate that the
 * case feels swings about it. Behind a high-pass all of it lies below, most at first. */
static double after_shift(const struct after *after)
{
	double mean = 0, first = 0, square = 0, n = (double)after->n, sigma;
	double least = after->mean_g[0] - LIMIT_AGREE * M_SQRT2 * after->sigma_g;
	bool below = true, turns = false;

	if (after->n < AFTER_FEWEST)
		return 0;
	for (size_t i = 0; i < after->n; i++) {
		mean += after->mean_g[i] / n;
		first += i < AFTER_BLOCKS / 2 ? after->mean_g[i] / (AFTER_BLOCKS / 2) : 0;
		below = below && after->mean_g[i] < 0;
		turns = turns || after->mean_g[i] < least;
	}
	if (after->n <
	    AFTER_BLOCKS / 2) /* too few to tell a shift from a swing, but what only falls back is none */
		return below && !turns && -mean > LIMIT_SIGNIFICANT * after->sigma_g ? -mean : 0;
	for (size_t i = 0; i < after->n; i++)
		square += pow(after->mean_g[i] - mean, 2) / (n - 1);
	sigma = fmax(after->sigma_g, sqrt(square)) / sqrt(n);
	if (below && -first > LIMIT_SIGNIFICANT * after->sigma_g / sqrt(AFTER_BLOCKS / 2.0))
		return -first;
	return fabs(mean) > LIMIT_SIGNIFICANT * sigma ? fabs(mean) : 0;
}

/* Area in g s of a force that fades on: never below zero, never rising, its second half less than half of its
 * first, and no contact next. */
static double after_tail(const struct trace *trace, const struct after *after)
{
	double sum = 0, first = 0, chance = LIMIT_AGREE * after->sigma_g, least = INFINITY;

	if (after->n < AFTER_BLOCKS / 2 || after->mean_g[0] > after->again_g)
		return 0;
	for (size_t i = 0; i < after->n; i++) {
		if (after->mean_g[i] < -chance || after->mean_g[i] > least + M_SQRT2 * chance)
			return 0;
		least = fmin(least, fmax(after->mean_g[i], 0));
		sum += after->mean_g[i];
		first += i < after->n / 2 ? after->mean_g[i] : 0;
	}
	if (!(sum > LIMIT_SIGNIFICANT * after->sigma_g * sqrt((double)after->n)) ||
	    sum - first > LIMIT_EXPLAINS * first)
		return 0;
	return sum * (double)after->samples / trace->rate_hz;
}

/* Area in g s of what follows next in its direction: nobody knows whether it is of the pulse. */
static double after_first(const struct trace *trace, const struct after *after)
{
	if (after->n == 0 || !(after->mean_g[0] > LIMIT_HINT * after->sigma_g))
		return 0;
	return after->mean_g[0] * (1 + 2 * AFTER_FROM) * (double)after->samples / trace->rate_hz;
}

/* Area in g s of what comes before the pulse in its direction, within a width: an edge that touched first. */
static double doubt_first_touch(const struct trace *trace, const struct peak *peak,
                                const struct estimate_pulse *pulse)
{
	double from_s = pulse->start_s - (1 + FOOT_PART) * pulse->duration_s, mean;
	size_t n = (size_t)fmax(pulse->duration_s * trace->rate_hz, 1);

	if (!doubt_mean(trace, trace_index(trace, from_s), n, &mean) ||
	    !(peak->sign * mean > LIMIT_SIGNIFICANT * trace->noise_g / sqrt((double)n)))
		return 0;
	return fabs(mean) * (double)n / trace->rate_hz;
}

/* Nobody knows when zero shifted: it may have by the peak, and before the pulse. */
static void doubt_after(const struct trace *trace, const struct estimate_baseline *baseline, bool swings,
                        struct peak *peak, struct estimate_pulse *pulse)
{
	struct estimate_peak *top = &peak->result;
	struct after after;
	double shift_g, shift_m_s, tail_m_s, next_m_s;

	if (baseline->samples == 0)
		return;
	after_find(trace, baseline, peak, pulse, &after);
	shift_g = after_shift(&after);
	shift_m_s = UNITS_G_M_S2 * shift_g * pulse->duration_s;
	tail_m_s = UNITS_G_M_S2 * after_tail(trace, &after);
	next_m_s = UNITS_G_M_S2 * (after_first(trace, &after) + doubt_first_touch(trace, peak, pulse));
	pulse->sigma_velocity_m_s = hypot(pulse->sigma_velocity_m_s, next_m_s);
	if (fmax(shift_m_s, tail_m_s) > LIMIT_PART * fabs(pulse->velocity_change_m_s)) {
		pulse->sigma_velocity_m_s = hypot(pulse->sigma_velocity_m_s, fmax(shift_m_s, tail_m_s));
		if (!swings || shift_m_s > LIMIT_PART * fabs(pulse->velocity_change_m_s))
			pulse->flags |= ESTIMATE_FLAG_TAIL;
	}
	if (shift_g > LIMIT_PART * fabs(top->value_g)) {
		top->sigma_g = hypot(top->sigma_g, shift_g);
		top->how.flags |= ESTIMATE_FLAG_TAIL;
	}
}

/* What a pulse that never ends has come back to, long after its peak: how far from zero before. 0: the record
 * ends in it. */
static double doubt_left_over(const struct trace *trace, const struct peak *peak)
{
	double edge = LIMIT_EDGE * fabs(peak->result.value_g), mean = 0;
	size_t top = trace_index(trace, peak->result.time_s), rise = 1, from;

	while (rise <= top && peak->sign * trace->value_g[top - rise] > edge)
		rise++;
	from = top + LEFT_RISES * rise;
	if (rise > top || from + rise > trace->count || !doubt_mean(trace, from, trace->count - from, &mean))
		return 0;
	return fabs(mean);
}

static void doubt_endless(const struct trace *trace, struct peak *peak)
{
	struct estimate_peak *top = &peak->result;
	double left_g = isfinite(top->value_g) ? doubt_left_over(trace, peak) : 0;

	if (left_g > LIMIT_PART * fabs(top->value_g)) {
		top->sigma_g = hypot(top->sigma_g, left_g);
		top->how.flags |= ESTIMATE_FLAG_TAIL;
	}
}

static void doubt_flag(struct peak *peak, struct estimate_pulse *pulse, unsigned flag)
{
	peak->result.how.flags |= flag;
	pulse->flags |= flag;
}

void doubt_channel(const struct trace *trace, const struct estimate_baseline *baseline, bool swings,
                   struct peak *peak, struct estimate_pulse *pulse)
{
	double samples = pulse->duration_s * trace->rate_hz;
	struct plateau top;

	if (!isfinite(pulse->duration_s)) {
		doubt_endless(trace, peak);
		return;
	}
	if (doubt_step(trace, peak, pulse))
		doubt_flag(peak, pulse, ESTIMATE_FLAG_STEP);
	if (doubt_rough(trace, peak, pulse))
		doubt_flag(peak, pulse, ESTIMATE_FLAG_ROUGH);
	if (plateau_find(trace, trace->noise_g, plateau_flat, &top))
		doubt_flag(peak, pulse, ESTIMATE_FLAG_FLAT);
	if (samples < WIDTH_SAMPLES)
		pulse->sigma_duration_s =
		        hypot(pulse->sigma_duration_s, WIDTH_BIAS / (samples * samples) * pulse->duration_s);
	peak->result.sigma_g = hypot(peak->result.sigma_g, trace->step_g / sqrt(12.0));
	doubt_after(trace, baseline, swings, peak, pulse);
}
