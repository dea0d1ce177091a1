/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/ripple.h"

#include <math.h>

#include "common/units.h"
#include "host/estimate/phasor.h"

enum {
	REST_MAX = 256,     /* samples of an axis; at higher rates every second one, or fewer */
	STEPS_PER_LINE = 3, /* from frequency to frequency */
	TOP_STEPS = 40,     /* to either side of the top */
};

/* Cycles under the curve that a line has at least: slower, it is the pulse's own shape. */
#define CYCLES_LEAST 2.0

/* Of half the sampling rate, the fastest line: three samples a cycle. */
#define FASTEST 0.7

/* As of LIMIT_HINT: so often chance makes a line as large. */
#define CHANCE 0.05

/* Of the width, where the top is looked for. */
#define TOP_REACH 0.25

/* What an axis reads beyond its curve, in parts of its peak. */
struct rest {
	struct peak *peak;
	double from_s, step_s, weight; /* of a sample: one over the square of its noise */
	unsigned count;
	double value[REST_MAX]; /* 0 where a sample is missing, and behind the last */
};

/* Of both axes, in parts of the peak: cosine and sine from at_s on. */
struct line {
	double omega, at_s, cosine, sine;
	double power; /* over noise's: a mean of 1, distributed exponentially */
};

/* Where samples told the curve that gave the value. */
static struct local_span curve_span(const struct peak *peak)
{
	bool family = peak->model == PEAK_MODEL_SHAPE;
	double centre_s = family ? peak->shape.peak_s : peak->local.centre_s;
	double half_s = family ? peak->shape.base_s / 2 : peak->local.half_s;
	struct local_span span = {centre_s - half_s, centre_s + half_s};

	if (family)
		return span;
	return (struct local_span){fmax(span.from_s, peak->span.from_s),
	                           fmin(span.until_s, peak->span.until_s)};
}

static bool rest_take(const struct trace *trace, struct peak *peak, struct rest *rest)
{
	const struct estimate_peak *top = &peak->result;
	struct local_span span = curve_span(peak);
	size_t first = trace_index(trace, span.from_s), last = trace_index(trace, span.until_s), stride;
	double d[3];

	if (top->how.status != ESTIMATE_OK || peak_is_weak(trace, peak) || peak->model == PEAK_MODEL_NONE ||
	    !(trace->noise_g > 0) || first >= last)
		return false;
	stride = (last - first - 1) / REST_MAX + 1;
	*rest = (struct rest){.peak = peak,
	                      .from_s = trace_time(trace, first),
	                      .step_s = (double)stride / trace->rate_hz,
	                      .weight = pow(top->value_g / trace->noise_g, 2)};
	for (size_t k = first; k < last; k += stride) {
		bool there = trace_usable(trace, k) && peak_at(peak, trace_time(trace, k), d, NULL);

		rest->value[rest->count++] = there ? (trace->value_g[k] - d[0]) / top->value_g : 0;
	}
	return true;
}

static struct line line_find(const struct rest rest[], unsigned count, double at_s, double omega)
{
	struct line line = {.omega = omega, .at_s = at_s};
	double weight = 0;

	for (unsigned i = 0; i < count; i++) {
		struct phasor_pair r =
		        phasor_two(phasor_at(omega * (rest[i].from_s - at_s), omega * rest[i].step_s));
		PAIR cosine = {0, 0}, sine = {0, 0};

		for (unsigned k = 0; k < rest[i].count; k += 2) {
			const PAIR value = pair_load(&rest[i].value[k]);

			cosine += value * r.cosine;
			sine += value * r.sine;
			phasor_pair_turn(&r);
		}
		line.cosine += rest[i].weight * (cosine[0] + cosine[1]);
		line.sine += rest[i].weight * (sine[0] + sine[1]);
		weight += rest[i].weight * rest[i].count;
	}
	line.power = (line.cosine * line.cosine + line.sine * line.sine) / weight;
	line.cosine *= 2 / weight;
	line.sine *= 2 / weight;
	return line;
}

/* The largest one; false where chance makes one as large. */
static bool line_largest(const struct rest rest[], unsigned count, struct line *largest)
{
	double base_s = INFINITY, step_s = 0, first, last, turn;

	for (unsigned i = 0; i < count; i++) {
		base_s = fmin(base_s, rest[i].count * rest[i].step_s);
		step_s = fmax(step_s, rest[i].step_s);
	}
	turn = 2 * UNITS_PI / base_s;
	first = CYCLES_LEAST * turn;
	last = FASTEST * UNITS_PI / step_s;
	*largest = (struct line){.power = 0};
	for (double omega = first; omega < last; omega += turn / STEPS_PER_LINE) {
		struct line line = line_find(rest, count, rest[0].peak->result.time_s, omega);

		if (line.power > largest->power)
			*largest = line;
	}
	return largest->power > log((1 + (last - first) / turn) / CHANCE);
}

/* By what the curve's top changes when the line is added. */
static void line_widen(const struct line *line, struct peak *peak)
{
	struct estimate_peak *top = &peak->result;
	double most = 0, moved_s = 0, d[3];

	for (int i = -TOP_STEPS; i <= TOP_STEPS; i++) {
		double off_s = TOP_REACH * peak->width_s * i / TOP_STEPS;
		double phase = line->omega * (top->time_s + off_s - line->at_s), value;

		if (!peak_at(peak, top->time_s + off_s, d, NULL))
			continue;
		value = d[0] / top->value_g + line->cosine * cos(phase) + line->sine * sin(phase);
		if (value > most) {
			most = value;
			moved_s = off_s;
		}
	}
	top->sigma_time_s = hypot(top->sigma_time_s, moved_s);
	top->sigma_g = hypot(top->sigma_g, (most - 1) * top->value_g);
	peak->doubt_s = hypot(peak->doubt_s, moved_s);
	peak->ripple_s = fabs(moved_s);
}

void ripple_widen(const struct trace *const trace[], struct peak *const peak[], unsigned count)
{
	struct rest rest[2];
	struct line line;
	unsigned used = 0;

	for (unsigned i = 0; i < count; i++)
		used += rest_take(trace[i], peak[i], &rest[used]);
	if (used == 0 || !line_largest(rest, used, &line))
		return;
	for (unsigned i = 0; i < used; i++)
		line_widen(&line, rest[i].peak);
}
