/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/command/stretch.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/base/number.h"
#include "host/command/command.h"

int stretch_take_window(const struct option_table *table, const char *name, const char *text, void *window)
{
	double *window_s = window, from, to;
	char head[NUMBER_CHARS + 8];
	const char *colon = strchr(text, ':');

	if (colon != NULL && colon - text < (int)sizeof(head)) {
		snprintf(head, sizeof(head), "%.*s", (int)(colon - text), text);
		if (number_read(head, -1e9, 1e9, &from) && number_read(colon + 1, -1e9, 1e9, &to) &&
		    from < to) {
			window_s[0] = from;
			window_s[1] = to;
			return OPTIONS_READ;
		}
	}
	return option_wrong(table, "--%s is '%s', expected FROM:TO in seconds", name, text);
}

/* Beyond so many samples a result of all of them takes gigabytes, and is about one shock of many. */
static const size_t WHOLE_MOST = 1 << 24;

bool stretch_is_twofold(const struct stretch *stretch)
{
	return stretch->every_shock + (stretch->shock > 0) + !isnan(stretch->window_s[0]) > 1;
}

struct stretching {
	const struct record *record;
	int (*each)(struct record *cut, void *context);
	void *context;
};

static int stretch_cut(const struct stretching *stretching, double from_s, double to_s, unsigned shock,
                       unsigned shocks)
{
	struct record cut;
	int code, result = shock_window_cut(stretching->record, from_s, to_s, &cut);

	if (result != 0) {
		command_error("%s: %g s to %g s: %s", stretching->record->file, from_s, to_s,
		              result == DT_E_EMPTY ? "no samples there" : error_text(result));
		return COMMAND_INPUT;
	}
	cut.shock = shock;
	cut.shocks = shocks;
	code = stretching->each(&cut, stretching->context);
	record_free(&cut);
	return code;
}

static int stretch_shocks(const struct stretching *stretching, unsigned wanted,
                          const struct events_options *events)
{
	struct shock_windows windows;
	int code = COMMAND_DONE;

	if (shock_windows_find(stretching->record, events, &windows) != 0) {
		command_error("%s: %s", stretching->record->file, error_text(DT_E_MEMORY));
		return COMMAND_INPUT;
	}
	if (wanted > windows.count)
		command_error("%s: no shock %u, %zu are there", stretching->record->file, wanted,
		              windows.count);
	else if (windows.count == 0)
		command_error("%s: no shock in it", stretching->record->file);
	if (windows.count == 0 || wanted > windows.count)
		code = COMMAND_INPUT;
	for (size_t i = 0; i < windows.count && !interrupt_came(); i++) {
		const struct shock_window *w = &windows.window[i];
		int one;

		if (wanted > 0 && wanted != i + 1)
			continue;
		one = stretch_cut(stretching, w->from_s, w->to_s, (unsigned)i + 1, (unsigned)windows.count);
		code = one != COMMAND_DONE ? one : code;
	}
	shock_windows_free(&windows);
	return code;
}

static bool is_too_long(const struct record *record)
{
	size_t samples = 0;

	for (size_t i = 0; i < record->channel_count; i++)
		samples += record->channels[i].count;
	return samples > WHOLE_MOST;
}

int stretch_each(struct record *record, const struct stretch *stretch, const struct events_options *events,
                 int (*each)(struct record *cut, void *context), void *context)
{
	struct stretching stretching = {record, each, context};

	if (stretch->every_shock || stretch->shock > 0)
		return stretch_shocks(&stretching, stretch->shock, events);
	if (!isnan(stretch->window_s[0]))
		return stretch_cut(&stretching, stretch->window_s[0], stretch->window_s[1], 0, 0);
	if (stretch->whole || !is_too_long(record))
		return each(record, context);
	command_error("%s: too long for one result, so one for each shock, as with --every-shock",
	              record->file);
	return stretch_shocks(&stretching, 0, events);
}
