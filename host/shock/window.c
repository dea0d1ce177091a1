/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/shock/window.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "host/base/mapped.h"

static const double BEFORE_MOST_S = 0.25, AFTER_MOST_S = 1, PAUSE_PART = 0.25;

static int window_compare(const void *a, const void *b)
{
	const struct shock_window *x = a, *y = b;

	return (x->event.time_s > y->event.time_s) - (x->event.time_s < y->event.time_s);
}

/* What several channels see at once becomes one. */
static size_t window_merge(struct shock_window *window, size_t count, double hold_off_s)
{
	size_t kept = 0;

	for (size_t i = 0; i < count; i++)
		if (kept > 0 && window[i].event.time_s - window[kept - 1].to_s <= hold_off_s) {
			struct shock_window *one = &window[kept - 1];

			one->to_s = window[i].event.time_s; /* the last of the group until it is placed */
			if (fabs(window[i].event.peak_g) > fabs(one->event.peak_g))
				one->event = window[i].event;
		} else {
			window[kept] = window[i];
			window[kept].to_s = window[i].event.time_s;
			kept++;
		}
	return kept;
}

static void window_place(struct shock_window *window, size_t count)
{
	for (size_t i = 0; i < count; i++) {
		double before_s = BEFORE_MOST_S;

		if (i > 0)
			before_s = fmin(before_s,
			                PAUSE_PART * (window[i].event.time_s - window[i - 1].event.time_s));
		window[i].from_s = window[i].event.time_s - before_s;
	}
	for (size_t i = 0; i < count; i++) {
		window[i].to_s = window[i].event.time_s + AFTER_MOST_S;
		if (i + 1 < count)
			window[i].to_s = fmin(window[i].to_s, window[i + 1].from_s);
	}
}

int shock_windows_find(const struct record *record, const struct events_options *options,
                       struct shock_windows *windows)
{
	struct events_options all = *options;
	struct events events;
	struct event_list list = {.event = NULL};
	struct shock_window *window;
	size_t count;
	int result;

	all.all = &list;
	result = events_find(record, &all, &events);
	window = result == 0 ? calloc(list.count + 1, sizeof(*window)) : NULL;
	if (window == NULL) {
		free(list.event);
		return DT_E_MEMORY;
	}
	count = list.count;
	for (size_t i = 0; i < count; i++)
		window[i].event = list.event[i];
	free(list.event);
	qsort(window, count, sizeof(*window), window_compare);
	count = window_merge(window, count,
	                     options->hold_off_s > 0 ? options->hold_off_s : EVENTS_HOLD_OFF_S);
	window_place(window, count);
	*windows = (struct shock_windows){.window = window, .count = count};
	return 0;
}

void shock_windows_free(struct shock_windows *windows)
{
	free(windows->window);
	*windows = (struct shock_windows){.window = NULL};
}

static int cut_channel(const struct channel *channel, double from_s, double to_s, struct record *cut)
{
	double first = ceil((from_s - channel->start_s) * channel->rate_hz - 1e-6);
	double last = floor((to_s - channel->start_s) * channel->rate_hz + 1e-6);
	size_t from = first > 0 ? (size_t)first : 0, until = channel->count;
	struct channel *part;

	if (last + 1 < (double)until)
		until = last >= 0 ? (size_t)last + 1 : 0;
	if (from + 2 > until)
		return 0;
	part = record_add_room(cut, channel->name, channel->rate_hz, until - from);
	if (part == NULL)
		return DT_E_MEMORY;
	part->start_s = channel->start_s + (double)from / channel->rate_hz;
	part->range_g = channel->range_g;
	part->flags = channel->flags;
	memcpy(part->value_g, channel->value_g + from, (until - from) * sizeof(*part->value_g));
	memcpy(part->sample, channel->sample + from, until - from);
	mapped_seen(MAPPED_STEP); /* megabytes come with the first sample */
	return 0;
}

int shock_window_cut(const struct record *record, double from_s, double to_s, struct record *cut)
{
	int result = 0;

	record_init(cut);
	memcpy(cut->file, record->file, sizeof(cut->file));
	memcpy(cut->format, record->format, sizeof(cut->format));
	memcpy(cut->read_as, record->read_as, sizeof(cut->read_as));
	for (size_t i = 0; i < record->channel_count && result == 0; i++)
		result = cut_channel(&record->channels[i], from_s, to_s, cut);
	if (result == 0 && cut->channel_count == 0)
		result = DT_E_EMPTY;
	if (result != 0)
		record_free(cut);
	else
		record_finish(cut);
	return result;
}
