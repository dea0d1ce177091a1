/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/shock/srs.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/units.h"

const char *const srs_quantity_names[SRS_QUANTITIES] = {"acceleration", "velocity", "displacement"};
const char *const srs_quantity_units[SRS_QUANTITIES] = {"g", "m_s", "m"};
const char *const srs_side_names[SRS_SIDES] = {"positive", "negative", "maximax"};
const char *const srs_part_names[SRS_PARTS] = {"primary", "residual", "total"};

/* A frequency above this part of the rate is up-sampled, to this many points a cycle. */
#define UPSAMPLE_ABOVE (0.1 * (1 + 1e-9))
#define CYCLE_POINTS 32.0
#define FREQUENCY_MAX 0.5
#define FREQUENCY_MAX_KEPT 0.45

enum {
	LANES = 16,        /* oscillators side by side */
	TAPS = 32,         /* of the interpolation */
	PHASES = 8,        /* computed side by side; the factor is a multiple */
	FACTOR_MAX = 16,   /* CYCLE_POINTS at FREQUENCY_MAX */
	BLOCK = 64,        /* samples up-sampled at a time */
	SERIES_TERMS = 60, /* for 2 pi FREQUENCY_MAX and less */
};

/* Eight registers of two hold little of this: where the processor has more, they are used. The numbers are
 * the same, as nothing is fused or reordered. */
#if defined(__x86_64__) && defined(__gnu_linux__)
#define WIDE __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define WIDE
#endif

/* LANES oscillators. y is the response with a static gain of +1, d its last increment. */
struct bank {
	double decay[LANES], stiffness[LANES], now[LANES], before[LANES]; /* coefficients */
	double y[LANES], d[LANES], high[LANES], low[LANES];
	double base, step; /* last sample and last difference of the base */
	double fill[6];    /* to whole cache lines */
};

enum { ALIGNMENT = 64 };
_Static_assert(sizeof(struct bank) % ALIGNMENT == 0, "banks begin on cache lines");

/* An oscillator and a sampling step. */
struct oscillator {
	double tau;     /* natural angular frequency times the step */
	double damping; /* ratio */
	double decay;   /* exp(-damping tau): in one step */
	double angle;   /* of the damped motion in one step */
};

static struct oscillator oscillator(double frequency_hz, double rate_hz, double damping)
{
	struct oscillator o = {.tau = 2 * UNITS_PI * frequency_hz / rate_hz, .damping = damping};

	o.decay = exp(-damping * o.tau);
	o.angle = sqrt((1 - damping) * (1 + damping)) * o.tau;
	return o;
}

/* The response to a base acceleration t, for y'' + 2 D y' + y = rate_force + t, at tau over tau and at -tau
 * over -tau: its power series. */
static void ramp_response(const struct oscillator *o, double rate_force, double *ahead, double *back)
{
	double c = 0, next = 0; /* coefficients n and n + 1 */
	double power = 1 / o->tau, sign = -1;

	*ahead = 0;
	*back = 0;
	for (unsigned n = 0; n < SERIES_TERMS; n++) {
		double right = n == 0 ? rate_force : n == 1 ? 1 : 0;
		double after = (right - 2 * o->damping * (n + 1) * next - c) / ((n + 1.0) * (n + 2.0));

		*ahead += c * power;
		*back += sign * c * power;
		power *= o->tau;
		sign = -sign;
		c = next;
		next = after;
	}
}

/* y[k] = y[k-1] + d[k], d[k] = E^2 d[k-1] + g (a[k-1] - y[k-1]) + b0 (a[k]-a[k-1]) - b2 (a[k-1]-a[k-2]):
 * ISO 18431-4's difference equation with b1 replaced by g = b0 + b1 + b2 = 1 - 2 C + E^2. b0 is the response
 * after one step to a ramp, b2 that before it, decayed. */
static void set_lane(struct bank *bank, unsigned lane, const struct oscillator *o, enum srs_quantity quantity)
{
	double sine = sin(o->angle / 2), loss = expm1(-o->damping * o->tau), ahead, back;

	ramp_response(o, quantity == SRS_ACCELERATION ? 2 * o->damping : 0, &ahead, &back);
	bank->decay[lane] = o->decay * o->decay;
	bank->stiffness[lane] = loss * loss + 4 * o->decay * sine * sine;
	bank->now[lane] = ahead;
	bank->before[lane] = o->decay * o->decay * back;
}

/* What a sample of the base is to every oscillator. */
struct input {
	double last, change, step; /* the sample before, the difference to it, and the difference before */
};

static inline double increment(const struct bank *b, unsigned i, const struct input *in, double y, double d)
{
	return b->decay[i] * d + b->stiffness[i] * (in->last - y) +
	       (b->now[i] * in->change - b->before[i] * in->step);
}

static inline double srs_larger(double a, double b)
{
	return a > b ? a : b;
}

static inline double srs_smaller(double a, double b)
{
	return a < b ? a : b;
}

static void run_one(struct bank *restrict bank, const struct input *in)
{
	for (unsigned i = 0; i < LANES; i++) {
		bank->d[i] = increment(bank, i, in, bank->y[i], bank->d[i]);
		bank->y[i] += bank->d[i];
		bank->high[i] = srs_larger(bank->high[i], bank->y[i]);
		bank->low[i] = srs_smaller(bank->low[i], bank->y[i]);
	}
}

/* Four at once: what an oscillator holds is loaded and stored once for them. base[-2] and base[-1] are there.
 */
WIDE static void run_four(struct bank *restrict bank, const double *base)
{
	double change[5] = {base[-1] - base[-2], base[0] - base[-1], base[1] - base[0], base[2] - base[1],
	                    base[3] - base[2]};
	struct input in[4] = {{base[-1], change[1], change[0]},
	                      {base[0], change[2], change[1]},
	                      {base[1], change[3], change[2]},
	                      {base[2], change[4], change[3]}};

	for (unsigned i = 0; i < LANES; i++) {
		double d = increment(bank, i, &in[0], bank->y[i], bank->d[i]), y = bank->y[i] + d;
		double high = srs_larger(bank->high[i], y), low = srs_smaller(bank->low[i], y);

		d = increment(bank, i, &in[1], y, d);
		y += d;
		high = srs_larger(high, y);
		low = srs_smaller(low, y);
		d = increment(bank, i, &in[2], y, d);
		y += d;
		high = srs_larger(high, y);
		low = srs_smaller(low, y);
		d = increment(bank, i, &in[3], y, d);
		y += d;
		bank->high[i] = srs_larger(high, y);
		bank->low[i] = srs_smaller(low, y);
		bank->d[i] = d;
		bank->y[i] = y;
	}
}

static void srs_run(struct bank *bank, const double *base, size_t count)
{
	size_t k = 0;

	while (k < count) {
		struct input in = {bank->base, base[k] - bank->base, bank->step};

		if (k >= 2 && k + 4 <= count) {
			run_four(bank, base + k);
			k += 4;
		} else {
			run_one(bank, &in);
			k++;
		}
		bank->base = base[k - 1];
		bank->step = k >= 2 ? base[k - 1] - base[k - 2] : in.change;
	}
}

/* ---- up-sampling ---- */

struct upsampler {
	size_t factor;
	double weight[TAPS][FACTOR_MAX]; /* of sample k - TAPS/2 + 1 + tap, for the points after sample k */
};

/* Modified Bessel function of order 0. */
static double bessel(double x)
{
	double term = 1, sum = 1;

	for (unsigned n = 1; n < 40; n++) {
		term *= x / (2 * n) * (x / (2 * n));
		sum += term;
	}
	return sum;
}

static void upsampler_make(struct upsampler *u, size_t factor)
{
	const double beta = 8, half = TAPS / 2;

	u->factor = factor;
	for (size_t p = 0; p < factor; p++) {
		double sum = 0;

		for (int tap = 0; tap < TAPS; tap++) {
			double x = tap - (TAPS / 2 - 1) - (double)p / (double)factor;
			double window = bessel(beta * sqrt(fmax(0, 1 - x * x / (half * half))));

			u->weight[tap][p] = window * (fabs(x) > 0 ? sin(UNITS_PI * x) / (UNITS_PI * x) : 1);
			sum += u->weight[tap][p];
		}
		for (int tap = 0; tap < TAPS; tap++)
			u->weight[tap][p] /= sum;
	}
}

/* Sample k, continued beyond both ends by point reflection. */
static double reflected(const double *value, size_t count, ptrdiff_t k)
{
	ptrdiff_t last = (ptrdiff_t)count - 1;

	if (k >= 0 && k <= last)
		return value[k];
	if (k < 0)
		return 2 * value[0] - value[-k < last ? -k : last];
	return 2 * value[last] - value[2 * last - k > 0 ? 2 * last - k : 0];
}

/* The points from sample `from` up to sample from + count; in begins TAPS/2 - 1 samples before. */
WIDE static void upsample(const struct upsampler *u, const double *in, size_t count, double *out)
{
	for (size_t k = 0; k < count; k++) {
		for (size_t p = 0; p < u->factor; p += PHASES) {
			double sum[PHASES] = {0};

			for (unsigned tap = 0; tap < TAPS; tap++)
				for (unsigned i = 0; i < PHASES; i++)
					sum[i] += u->weight[tap][p + i] * in[k + tap];
			memcpy(out + k * u->factor + p, sum, sizeof(sum));
		}
	}
}

static void run_all(struct bank *bank, size_t banks, const double *base, size_t count)
{
	for (size_t b = 0; b < banks; b++)
		srs_run(&bank[b], base, count);
}

/* The points of a straight line, its first left out. */
static void run_line(struct bank *bank, size_t banks, double from, double to, size_t points)
{
	double line[FACTOR_MAX];

	for (size_t p = 0; p < points; p++)
		line[p] = from + (to - from) * (double)(p + 1) / (double)points;
	run_all(bank, banks, line, points);
}

static void run_upsampled(struct bank *bank, size_t banks, const double *value, size_t count, size_t factor)
{
	double in[BLOCK + TAPS], out[BLOCK * FACTOR_MAX];
	struct upsampler u;

	upsampler_make(&u, factor);
	run_line(bank, banks, 0, value[0], factor);
	for (size_t from = 0; from + 1 < count; from += BLOCK) {
		size_t n = count - 1 - from < BLOCK ? count - 1 - from : BLOCK;

		for (size_t i = 0; i < n + TAPS; i++)
			in[i] = reflected(value, count, (ptrdiff_t)(from + i) - (TAPS / 2 - 1));
		upsample(&u, in, n, out);
		run_all(bank, banks, out + (from == 0), n * factor - (from == 0));
	}
	if (count > 1)
		run_all(bank, banks, &value[count - 1], 1);
	if (factor > 1)
		run_line(bank, banks, value[count - 1], value[count - 1] / (double)factor, factor - 1);
}

/* ---- the free response after the record ---- */

/* Extremes from the first instant without base acceleration on. d1 is the increment to the next sample. */
static void free_extremes(const struct oscillator *o, double y0, double d1, double *high, double *low)
{
	double root = sqrt((1 - o->damping) * (1 + o->damping)), sine = sin(o->angle / 2);
	double rest = -expm1(-o->damping * o->tau) + 2 * o->decay * sine * sine;
	double b = (d1 + y0 * rest) / (o->decay * sin(o->angle));
	double angle = atan2(root * b - o->damping * y0, root * y0 + o->damping * b);

	*high = fmax(y0, 0);
	*low = fmin(y0, 0);
	if (angle < 0)
		angle += UNITS_PI;
	for (unsigned half = 0; half < 2; half++) {
		double y = exp(-o->damping / root * angle) * (y0 * cos(angle) + b * sin(angle));

		*high = fmax(*high, y);
		*low = fmin(*low, y);
		angle += UNITS_PI;
	}
}

/* From a gain of +1 at zero frequency to the quantity. */
static double srs_scale_of(enum srs_quantity quantity, double frequency_hz)
{
	double w = 2 * UNITS_PI * frequency_hz;

	switch (quantity) {
	case SRS_VELOCITY:
		return -UNITS_G_M_S2 / w;
	case SRS_DISPLACEMENT:
		return -UNITS_G_M_S2 / (w * w);
	default:
		return 1;
	}
}

static void srs_scale(double factor, double *high, double *low)
{
	double h = *high * factor, l = *low * factor;

	*high = fmax(h, l);
	*low = fmin(h, l);
}

static void read_lane(struct bank *bank, unsigned lane, const struct oscillator *o, double factor,
                      struct srs_value *value)
{
	struct bank next = *bank; /* at the first sample without base acceleration, and one on */
	double d1;

	value->primary_high = bank->high[lane];
	value->primary_low = bank->low[lane];
	srs_run(&next, (const double[1]){0}, 1);
	d1 = next.decay[lane] * next.d[lane] - next.stiffness[lane] * next.y[lane] -
	     next.before[lane] * next.step;
	free_extremes(o, next.y[lane], d1, &value->residual_high, &value->residual_low);
	srs_scale(factor, &value->primary_high, &value->primary_low);
	srs_scale(factor, &value->residual_high, &value->residual_low);
}

/* ---- all of it ---- */

/* The frequencies of one rate: those that are up-sampled, or those that are not. */
static void compute_set(const double *value_g, size_t count, double rate_hz, const double *frequency_hz,
                        const size_t *index, size_t size, size_t factor, const struct srs_options *options,
                        struct bank *bank, struct srs_value *value)
{
	size_t banks = (size + LANES - 1) / LANES;
	double rate = rate_hz * (double)factor;

	memset(bank, 0, banks * sizeof(*bank));
	for (size_t i = 0; i < banks * LANES; i++) {
		struct oscillator o =
		        oscillator(frequency_hz[index[i < size ? i : 0]], rate, options->damping);

		set_lane(&bank[i / LANES], i % LANES, &o, options->quantity);
	}
	if (factor > 1)
		run_upsampled(bank, banks, value_g, count, factor);
	else
		run_all(bank, banks, value_g, count);
	for (size_t i = 0; i < size; i++) {
		struct oscillator o = oscillator(frequency_hz[index[i]], rate, options->damping);

		read_lane(&bank[i / LANES], i % LANES, &o,
		          srs_scale_of(options->quantity, frequency_hz[index[i]]), &value[index[i]]);
	}
}

static int shock_srs_check(const double *value_g, size_t count, double rate_hz, const double *frequency_hz,
                           size_t frequency_count, const struct srs_options *options)
{
	double most = rate_hz * (options->keep_rate ? FREQUENCY_MAX_KEPT : FREQUENCY_MAX);

	if (!(options->damping >= 0 && options->damping < 1) || !isfinite(rate_hz) || !(rate_hz > 0) ||
	    count == 0)
		return DT_E_ARGUMENT;
	for (size_t k = 0; k < count; k++)
		if (!isfinite(value_g[k]))
			return DT_E_ARGUMENT;
	for (size_t i = 0; i < frequency_count; i++) {
		if (!(frequency_hz[i] > 0))
			return DT_E_ARGUMENT;
		if (frequency_hz[i] > most)
			return DT_E_RANGE;
	}
	return 0;
}

int srs_compute(const double *value_g, size_t count, double rate_hz, const double *frequency_hz,
                size_t frequency_count, const struct srs_options *options, struct srs_value *value)
{
	int result = shock_srs_check(value_g, count, rate_hz, frequency_hz, frequency_count, options);
	size_t *index, low = 0, high = 0;
	double most = 0;
	struct bank *bank;

	if (result != 0)
		return result;
	index = malloc((frequency_count + 1) * sizeof(*index));
	bank = aligned_alloc(ALIGNMENT, (frequency_count / LANES + 1) * sizeof(*bank));
	if (index && bank) {
		for (size_t i = 0; i < frequency_count; i++) {
			if (options->keep_rate || frequency_hz[i] <= UPSAMPLE_ABOVE * rate_hz)
				index[low++] = i;
			else
				index[frequency_count - ++high] = i;
			most = fmax(most, frequency_hz[i]);
		}
		compute_set(value_g, count, rate_hz, frequency_hz, index, low, 1, options, bank, value);
		compute_set(value_g, count, rate_hz, frequency_hz, index + low, high,
		            CYCLE_POINTS * most <= PHASES * rate_hz ? PHASES : FACTOR_MAX, options, bank,
		            value);
	} else {
		result = DT_E_MEMORY;
	}
	free(bank);
	free(index);
	return result;
}

double srs_pick(const struct srs_value *value, enum srs_side side, enum srs_part part)
{
	double high = 0, low = 0;

	if (part != SRS_RESIDUAL) {
		high = value->primary_high;
		low = value->primary_low;
	}
	if (part != SRS_PRIMARY) {
		high = fmax(high, value->residual_high);
		low = fmin(low, value->residual_low);
	}
	switch (side) {
	case SRS_POSITIVE:
		return high;
	case SRS_NEGATIVE:
		return 0.0 - low;
	default:
		return fmax(high, -low);
	}
}
