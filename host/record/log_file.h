/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_LOG_FILE_H
#define DT_HOST_RECORD_LOG_FILE_H
/*
 * A log of any size through a window of constant memory: bytes by their place in the file. What is no regular
 * file (a pipe) cannot be gone back in and is held whole, as a source. A log in blocks is read as the log
 * that it is of.
 *
 * log_file_open, log_file_get, log_file_close. What is returned points into the window, until the next call.
 */
#include "host/record/blocks.h"
#include "host/record/source.h"

struct log_file {
	const char *file;      /* as given */
	const char *expected;  /* of it, for its refusal */
	uint64_t begin, size;  /* where what it says begins, and ends when it was opened */
	struct source whole;   /* of what is no regular file; else bytes is NULL */
	struct blocks *blocks; /* or NULL; begin, size and places are of what stands in them */
	int descriptor;
	char *window;
	uint64_t at; /* place of its first byte */
	size_t held, room;
	int failed; /* errno of a read, ENODATA when the file became shorter */
	enum {
		LOG_UNKNOWN,
		LOG_LCM,
		LOG_OTHER
	} kind; /* lcm_log_is's answer, for whom the window need not go back */
};

/* The most that log_file_get may be asked for. */
enum { LOG_FILE_MOST = 1 << 24 };

/* 0, or an error told in message, with nothing to close. An empty file is refused. expected: "a recording".
 */
DT_MUST_USE int log_file_open(struct log_file *log, const char *file, const char *expected,
                              char message[READ_MESSAGE_MAX]);
void log_file_close(struct log_file *log);

/* At least want bytes from offset on, fewer only at the end of the file; how many in *held. */
const char *log_file_get(struct log_file *log, uint64_t offset, size_t want, size_t *held);

/* 0, or what reading said, told in message. */
DT_MUST_USE int log_file_error(const struct log_file *log, char message[READ_MESSAGE_MAX]);

/* How many damaged blocks were met within these bytes; message says which, without the file. */
unsigned log_file_damage(const struct log_file *log, uint64_t from, uint64_t to,
                         char message[BLOCKS_MESSAGE_MAX]);

/* Where a line is. */
struct log_line {
	const char *text; /* not terminated */
	size_t length;    /* without line end; of a line beyond LOG_LINE_MAX so many */
	uint64_t number;  /* from 1, counted from where the walk began */
	uint64_t at, next;
};
enum { LOG_LINE_MAX = 1 << 16 };

/* Steps from line to line up to the byte end; start with a zeroed *line, or next where to begin. */
bool log_file_next_line(struct log_file *log, uint64_t end, struct log_line *line);

#endif
