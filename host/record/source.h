/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_SOURCE_H
#define DT_HOST_RECORD_SOURCE_H
/*
 * A file as the readers see it: its bytes in memory, walked line by line, and the one form in which all
 * of them refuse it: "FILE:LINE: what is wrong, what was expected".
 *
 * The bytes of a large file are mapped, those of any other, and of a pipe, are a copy (host/base/mapped.h).
 * They belong to the source until source_free.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "host/record/read.h"

struct source {
	const char *file;     /* as given */
	const char *expected; /* of it, for its refusal */
	char *bytes;          /* not terminated */
	size_t size;
	size_t lines;   /* line ends, once encoding_settle has counted them */
	void *mapped;   /* what bytes lie in, when they must not be written to; else NULL */
	int descriptor; /* of what is mapped: a file of that name, or what was made of it */
};

struct source_line {
	const char *text; /* not terminated */
	size_t length;    /* without line end: \n, \r\n or \r\r\n */
	uint64_t number;  /* from 1 */
	size_t next;      /* where the next line begins */
};

/* 0, or an error told in message, with nothing to free. An empty file is refused. expected: "a recording". */
DT_MUST_USE int source_load(struct source *source, const char *file, const char *expected,
                            char message[READ_MESSAGE_MAX]);
void source_free(struct source *source);

/* Whether a zero byte is among the first 64, as in no text: a magic of letters alone may be a word. */
bool source_is_binary(const char *head, size_t length);

/* The name by which another process can open it. */
enum { SOURCE_PATH_MAX = 32 };
const char *source_path(char path[SOURCE_PATH_MAX], int descriptor);

/* What a file holds that was made of it, in place of its bytes. 0, or an error told in message: it is as it
 * was, then. */
DT_MUST_USE int source_remake(struct source *source, int fd, char message[READ_MESSAGE_MAX]);

/* Other bytes in place of its own, from mapped_array. */
void source_replace(struct source *source, char *bytes, size_t size);

/* Steps from line to line; start with a zeroed *line. */
bool source_next_line(const struct source *source, struct source_line *line);

/* Writes "FILE:LINE: text" (no line when 0) and returns code. */
__attribute__((format(printf, 5, 6))) int source_refuse(char message[READ_MESSAGE_MAX], int code,
                                                        const char *file, uint64_t line, const char *format,
                                                        ...);

/* The same where memory was not there. */
int source_no_memory(char message[READ_MESSAGE_MAX], const char *file);

/* Of a format that needs none. */
int read_refuse_columns(const char *file, char message[READ_MESSAGE_MAX]);

/* The formats that are no logs. Each fills *record, initialised by the call, except for its file name.
 * Delimited text becomes UTF-8 in its source; without columns it must tell them itself (sniff.h). */
bool read_csv_is(const struct source *source);
DT_MUST_USE int read_csv(struct record *record, const struct source *source, char message[READ_MESSAGE_MAX]);
DT_MUST_USE int read_delimited(struct record *record, struct source *source, const char *columns,
                               char message[READ_MESSAGE_MAX]);

#endif
