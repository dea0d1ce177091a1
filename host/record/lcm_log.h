/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_LCM_LOG_H
#define DT_HOST_RECORD_LCM_LOG_H
/*
 * LCM event logs: events of a 28-byte big-endian header (sync word, event number, time, length of channel
 * name, length of data), the name, the data. The library's reader ends at the first bad byte; this one
 * looks for the next sync word and counts. (LCM, eventlog.c)
 *
 * The log is walked through a log that the caller opens and closes.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "host/record/log_file.h"

enum { LCM_LOG_CHANNEL_MAX = 63 };

/* The channel of the event behind a drop message of ours: no message, SEAL_WORD and the SHA-256 of that
 * message. Logs are put one behind the other and logged again; the two stay together. */
#define LCM_LOG_SEAL "DT_SEAL"

/* The channel of the event between the two, where more is known of the drop: no message, a line "name value"
 * for each (metadata.h). The seal is then of both, one behind the other. */
#define LCM_LOG_ORIGIN "DT_ORIGIN"

struct lcm_log_event {
	int64_t time_us; /* since the epoch */
	char channel[LCM_LOG_CHANNEL_MAX + 1];
	const uint8_t *data; /* in the log's window; NULL of an event beyond what that holds */
	size_t size;
	bool cut;    /* the end of the log has cut it: data is what is there. Counted as skipped */
	uint64_t at; /* where in the log it begins; it ends where the walk is */
};

/* Where a walk is; start with a zeroed one, or at and end where it goes. */
struct lcm_log_walk {
	uint64_t at, end; /* end 0: the log's */
	uint64_t events;
	uint64_t skipped; /* stretches of bytes that are no event */
};

/* A sync word stands in the first 64 KiB: a log may have lost its beginning, and no text holds one. */
bool lcm_log_is(struct log_file *log);

/* The next event; false at the end. */
bool lcm_log_next(struct log_file *log, struct lcm_log_walk *walk, struct lcm_log_event *event);

#endif
