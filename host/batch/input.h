/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_BATCH_INPUT_H
#define DT_HOST_BATCH_INPUT_H
/*
 * The recordings of a batch, and which content each has. A key is the SHA-256 of a file's content, and where
 * an import.ini beside it says how it is read, or channels of ISO 13499 lie beside it, a dash and a SHA-256
 * of those.
 *
 * So that a content is not read again to know it, a run notes what it found: a line
 *
 *     KEY SIZE MTIME_NS CTIME_NS NOTED_S EXIT TAB MESSAGE TAB PATH
 *
 * in FOLDER/known/RUN, written at once. It is believed of a file that has this size and these times, if it
 * was noted two seconds after the last of them or more: a file may change twice within one tick of its
 * system's clock. Of its own run's lines a run believes all. MESSAGE is why there is no result, or nothing.
 */
#include <stdint.h>
#include <stdio.h>
#include <sys/stat.h>

#include "host/batch/store.h"

enum { INPUT_KEY_CHARS = 130 };

struct input {
	char *path;
	int64_t bytes;
	struct noted {
		char key[INPUT_KEY_CHARS]; /* "" where none is known */
		int64_t size, mtime_ns, ctime_ns, noted_s;
		int code;
		char *message; /* NULL: there are results */
	} noted;
};

struct inputs {
	struct input *input; /* by path, each once */
	size_t count;
	int64_t bytes;
};

/* Of paths those of shard `shard` of `shards`, counted from 1. To be freed in any case. 0 or DT_E_MEMORY. */
DT_MUST_USE int inputs_take(struct inputs *inputs, char *const *path, size_t count, unsigned shard,
                            unsigned shards);
void inputs_free(struct inputs *inputs);

/* Reads what runs have noted; lines of the run of that name are believed whatever the time. */
DT_MUST_USE int inputs_recall(struct inputs *inputs, const struct store *store, const char *run);

/* Whether what is noted is this file's, as it is now. */
bool input_is_noted(const struct input *input);

/* Key, size and times of the file as it is now: from its content. 0, or DT_E_SYSTEM with errno. */
DT_MUST_USE int input_look(const struct input *input, struct noted *noted);

/* Whether it still has that size and these times. */
bool input_stayed(const struct input *input, const struct noted *noted);

/* Appends the line; message NULL: none. 0 or an errno. */
int input_note(int fd, const struct input *input, const struct noted *noted, int code, const char *message);

#endif
