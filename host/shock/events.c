/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/shock/events.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/base/wide.h"
#include "common/units.h"
#include "host/base/mapped.h"
#include "host/estimate/median.h"

#define LEVEL_SIGMAS 8.0
#define LEVEL_PART 0.02
#define WIDTH_PART 0.1

enum { SPREAD_SAMPLES = 256, HOLD_OFF_SAMPLES = 3, BLOCK = 64, LANES = 4 };
enum { READ_AHEAD = 1 << 21 }; /* bytes that come with a sample of a mapped file */

struct source {
	struct axes axes;
	double rest_g[AXES_MAX];
	double level_g, hold_off_s;
	struct event_list *all;
};

/* A shock that is not over yet. */
struct shock {
	bool open;
	size_t peak;
	double peak_g;
	double first_s, last_s; /* when it was outside the level */
};

static bool events_value_at(const struct source *source, size_t k, double *value_g)
{
	double value[AXES_MAX];

	if (!axes_read(&source->axes, k, source->rest_g, value))
		return false;
	*value_g = axes_value(&source->axes, value);
	return true;
}

/* ---- rest and level ---- */

/* Median of a channel and the standard deviation of its noise. */
static void rest_of(const struct channel *channel, double *rest_g, double *noise_g)
{
	size_t step = channel->count / SPREAD_SAMPLES + 1, n = 0;
	double work[SPREAD_SAMPLES];

	for (size_t k = 0; k < channel->count; k += step) {
		if (isfinite(channel->value_g[k]))
			work[n++] = channel->value_g[k];
		mapped_seen(step < RECORD_PART ? step * sizeof(double) : READ_AHEAD);
	}
	*rest_g = 0;
	*noise_g = 0;
	if (n == 0)
		return;
	*rest_g = median_find(work, n);
	for (size_t i = 0; i < n; i++)
		work[i] = fabs(work[i] - *rest_g);
	*noise_g = MAD_TO_SIGMA * median_find(work, n);
}

typedef double lanes __attribute__((vector_size(LANES * sizeof(double))));
typedef int64_t lane_masks __attribute__((vector_size(LANES * sizeof(int64_t))));

/* Values side by side: the larger distance from rest of each lane; a NAN is never larger. */
static inline __attribute__((always_inline)) void events_further(lanes *most, const double *value_g,
                                                                 double rest_g)
{
	lanes value, distance;
	lane_masks below, larger;

	memcpy(&value, value_g, sizeof(value));
	distance = value - rest_g;
	below = distance < 0;
	distance = (lanes)(((lane_masks)distance & ~below) | ((lane_masks)-distance & below));
	larger = distance > *most;
	*most = (lanes)(((lane_masks)distance & larger) | ((lane_masks)*most & ~larger));
}

/* The largest distance from rest between two instants, the samples beside them included. */
WIDE static double events_reach(const struct channel *channel, double from_s, double until_s, double rest_g)
{
	double first = floor((from_s - channel->start_s) * channel->rate_hz);
	double last = ceil((until_s - channel->start_s) * channel->rate_hz);
	size_t k = first > 0 ? (size_t)first : 0, end = channel->count;
	lanes most = {0};
	double largest = 0;

	if (last < 0)
		return 0;
	if (last + 1 < (double)end)
		end = (size_t)last + 1;
	for (; k + LANES <= end; k += LANES) {
		events_further(&most, channel->value_g + k, rest_g);
		if (k % RECORD_PART < LANES)
			mapped_seen(RECORD_PART * sizeof(double));
	}
	for (unsigned i = 0; i < LANES; i++)
		largest = most[i] > largest ? most[i] : largest;
	for (; k < end; k++)
		if (fabs(channel->value_g[k] - rest_g) > largest)
			largest = fabs(channel->value_g[k] - rest_g);
	return largest;
}

/* No reading between two instants lies further from rest: the axes' own extremes together. */
static double bound(const struct source *source, double from_s, double until_s)
{
	double squares = 0;

	for (size_t i = 0; i < source->axes.count; i++) {
		double most = events_reach(source->axes.axis[i], from_s, until_s, source->rest_g[i]);

		squares += most * most;
	}
	return sqrt(squares);
}

static void set_level(struct source *source, const struct events_options *options)
{
	double noise, squares = 0, rate = source->axes.axis[0]->rate_hz;

	for (size_t i = 0; i < source->axes.count; i++) {
		rest_of(source->axes.axis[i], &source->rest_g[i], &noise);
		squares += noise * noise;
	}
	source->hold_off_s = fmax(options->hold_off_s > 0 ? options->hold_off_s : EVENTS_HOLD_OFF_S,
	                          HOLD_OFF_SAMPLES / rate);
	source->level_g = options->level_g;
	if (!(options->level_g > 0))
		source->level_g =
		        fmax(LEVEL_SIGMAS * sqrt(squares), LEVEL_PART * bound(source, -INFINITY, INFINITY));
}

/* ---- one shock ---- */

/* From the peak outward to where the value falls below a tenth of it: the last sample inside, and the instant
 * of the crossing. No further than a hold-off beyond the shock: a sensor that was turned round rests
 * elsewhere than before. */
static size_t events_edge(const struct source *source, const struct shock *shock, int step, double *time_s)
{
	double sign = shock->peak_g < 0 ? -1 : 1, inside = fabs(shock->peak_g), value;
	double level = WIDTH_PART * inside;
	size_t k = shock->peak, last = k, count = source->axes.axis[0]->count;

	while (step < 0 ? k > 0 : k + 1 < count) {
		k = step < 0 ? k - 1 : k + 1;
		if (axes_time(&source->axes, k) < shock->first_s - source->hold_off_s ||
		    axes_time(&source->axes, k) > shock->last_s + source->hold_off_s)
			break;
		if (!events_value_at(source, k, &value))
			continue;
		value *= sign;
		if (value < level) {
			double from = axes_time(&source->axes, last), to = axes_time(&source->axes, k);

			*time_s = from + (to - from) * (inside - level) / (inside - value);
			return last;
		}
		inside = value;
		last = k;
	}
	*time_s = axes_time(&source->axes, last);
	return last;
}

/* Over the samples from first to last, of each axis; a hole counts as the mean of the others. */
static double events_velocity(const struct source *source, size_t first, size_t last)
{
	double sum[AXES_MAX] = {0}, value[AXES_MAX];
	size_t n = 0;

	for (size_t k = first; k <= last; k++) {
		if (!axes_read(&source->axes, k, source->rest_g, value))
			continue;
		for (size_t i = 0; i < source->axes.count; i++)
			sum[i] += value[i];
		n++;
	}
	for (size_t i = 0; i < source->axes.count; i++)
		sum[i] *= UNITS_G_M_S2 * (double)(last - first + 1) /
		          ((double)n * source->axes.axis[0]->rate_hz);
	return axes_value(&source->axes, sum);
}

static void events_refine(const struct source *source, const struct shock *shock, struct event *event)
{
	size_t k = shock->peak;
	double before, after, bend, shift;

	event->peak_g = shock->peak_g;
	event->time_s = axes_time(&source->axes, k);
	if (k == 0 || k + 1 == source->axes.axis[0]->count || !events_value_at(source, k - 1, &before) ||
	    !events_value_at(source, k + 1, &after))
		return;
	bend = before - 2 * shock->peak_g + after;
	if (!(fabs(bend) > 0))
		return;
	shift = 0.5 * (before - after) / bend;
	if (!(fabs(shift) <= 0.5))
		return;
	event->peak_g -= 0.25 * (before - after) * shift;
	event->time_s += shift / source->axes.axis[0]->rate_hz;
}

static void events_keep(struct events *events, const struct event *event)
{
	size_t place = events->count;

	events->found++;
	while (place > 0 && fabs(events->event[place - 1].peak_g) < fabs(event->peak_g))
		place--;
	if (place == EVENTS_MAX)
		return;
	if (events->count < EVENTS_MAX)
		events->count++;
	memmove(&events->event[place + 1], &events->event[place],
	        (events->count - 1 - place) * sizeof(*event));
	events->event[place] = *event;
}

static void events_list(struct event_list *list, const struct event *event)
{
	if (list->count == list->room) {
		size_t room = list->room > 0 ? 2 * list->room : 64;
		struct event *more = realloc(list->event, room * sizeof(*more));

		list->failed |= more == NULL;
		if (more == NULL)
			return;
		list->event = more;
		list->room = room;
	}
	list->event[list->count++] = *event;
}

static void events_finish(const struct source *source, struct shock *shock, struct events *events)
{
	struct event event = {.sensor = source->axes.count > 1};
	double from, to;
	size_t first, last;

	if (!shock->open)
		return;
	shock->open = false;
	memcpy(event.name, source->axes.name, sizeof(event.name));
	events_refine(source, shock, &event);
	first = events_edge(source, shock, -1, &from);
	last = events_edge(source, shock, +1, &to);
	event.duration_s = to - from;
	event.velocity_change_m_s = events_velocity(source, first, last);
	events_keep(events, &event);
	if (source->all != NULL)
		events_list(source->all, &event);
}

/* ---- all of them ---- */

/* Samples [from, until) of the clock. */
static void scan_block(const struct source *source, size_t from, size_t until, struct shock *shock,
                       struct events *events)
{
	for (size_t k = from; k < until; k++) {
		double time_s = axes_time(&source->axes, k), value;

		if (!events_value_at(source, k, &value) || fabs(value) <= source->level_g)
			continue;
		if (shock->open && time_s - shock->last_s > source->hold_off_s)
			events_finish(source, shock, events);
		if (!shock->open || fabs(value) > fabs(shock->peak_g)) {
			shock->peak = k;
			shock->peak_g = value;
		}
		if (!shock->open)
			shock->first_s = time_s;
		shock->open = true;
		shock->last_s = time_s;
	}
}

static void events_scan(const struct source *source, struct events *events)
{
	size_t count = source->axes.axis[0]->count;
	struct shock shock = {0};

	if (!(source->level_g > 0))
		return;
	for (size_t from = 0; from < count; from += BLOCK) {
		size_t until = count - from < BLOCK ? count : from + BLOCK;

		if (bound(source, axes_time(&source->axes, from), axes_time(&source->axes, until - 1)) >
		    source->level_g)
			scan_block(source, from, until, &shock, events);
	}
	events_finish(source, &shock, events);
}

int events_find(const struct record *record, const struct events_options *options, struct events *events)
{
	struct axes *axes = malloc((record->channel_count + 1) * sizeof(*axes));
	size_t count;

	if (!axes)
		return DT_E_MEMORY;
	memset(events, 0, sizeof(*events));
	count = axes_find(record, axes);
	for (size_t i = 0; i < count; i++) {
		struct source source = {.axes = axes[i], .all = options->all};

		set_level(&source, options);
		events_scan(&source, events);
	}
	free(axes);
	return options->all != NULL && options->all->failed ? DT_E_MEMORY : 0;
}
