/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_LCM_LOG_H
#define DT_HOST_RECORD_LCM_LOG_H
/*
 * LCM event logs: events of a 28-byte big-endian header (sync word, event number, time, length of channel
 * name, length of data), the name, the data. The library's reader ends at the first bad byte; this one
 * looks for the next sync word and counts. (LCM, eventlog.c)
 *
 * The log is walked in memory: a source that the caller loads and frees.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "host/record/source.h"

enum { LCM_LOG_CHANNEL_MAX = 63 };

struct lcm_log_event {
	int64_t time_us; /* since the epoch */
	char channel[LCM_LOG_CHANNEL_MAX + 1];
	const uint8_t *data;
	size_t size;
};

/* Where a walk is; start with a zeroed one. */
struct lcm_log_walk {
	size_t at;
	uint64_t events;
	uint64_t skipped; /* stretches of bytes that are no event */
};

/* A sync word stands in the first 64 KiB: a log may have lost its beginning, and no text holds one. */
bool lcm_log_is(const struct source *source);

/* The next event; false at the end. */
bool lcm_log_next(const struct source *source, struct lcm_log_walk *walk, struct lcm_log_event *event);

#endif
