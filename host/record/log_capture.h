/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_LOG_CAPTURE_H
#define DT_HOST_RECORD_LOG_CAPTURE_H
/*
 * What is known of one capture without its samples, and where in its log it stands. Plain values, no memory.
 */
#include <stdbool.h>
#include <stdint.h>

#include "common/wire.h"
#include "host/record/record.h"

/* The tower's parameters as far as the log tells them: read, or written and acknowledged, since the tower
 * started. */
struct log_capture_parameters {
	bool known[WIRE_PARAMETERS];
	uint32_t value[WIRE_PARAMETERS];
};

struct log_capture {
	unsigned number;   /* in its log, from 1; counts what never ended, too */
	bool alone;        /* there is no other in the log */
	uint64_t from, to; /* bytes of the log that hold it: [from, to) */
	int64_t time_us;   /* of the log when it ended, or of the last frame when it never did */

	/* what a record says, too */
	bool ended; /* a capture end or drop message is there; without it, a drop that only began */
	uint16_t drop_id, marks;
	uint32_t first_tick_ms, last_tick_ms;
	uint32_t crc32; /* as sent */
	uint16_t frame_speed_mm_s;
	bool crc_agrees;
	bool seal_known, seal_agrees;
	uint32_t seal; /* as sent; it covers all that the capture end says, and so the parameters */
	struct record_counters counters;

	struct log_capture_parameters parameters;
};

enum { LOG_CAPTURE_KEY_CHARS = 80 };

/* Sets what a record of a drop says; the rest is left alone. */
void log_capture_of_record(const struct record *record, struct log_capture *capture);

/* Blocks that the window should have, and that are not held. */
uint32_t log_capture_blocks(const struct log_capture *capture);
uint32_t log_capture_missing(const struct log_capture *capture);

/* When it was, in seconds since 1970; 0: the log counts from elsewhere. */
int64_t log_capture_time_s(const struct log_capture *capture);

/* Whether both say the same of the same capture: all of the second part but corrupt frames, which depend on
 * how much of the log was read. */
bool log_capture_equal(const struct log_capture *a, const struct log_capture *b);

/* What tells a capture from every other, whatever file it comes in: drop number, ticks and the CRC-32 of its
 * samples as the tower sent it; without a capture end the SHA-256 of the samples held. */
void log_capture_key(const struct record *record, char key[LOG_CAPTURE_KEY_CHARS]);

#endif
