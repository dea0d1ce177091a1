/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_BATCH_STORE_H
#define DT_HOST_BATCH_STORE_H
/*
 * The folder of a batch. What is in it is whole or not there: each file is written beside its place and
 * renamed, by any number of programs at once.
 *
 *     FOLDER/settings          what the results depend on beside the recordings: one set in a folder
 *     FOLDER/parts/ab/KEY      the results of one file, by its content
 *     FOLDER/known/RUN         which file has which content (input.h)
 *     FOLDER/results.jsonl ... the union (collect.h)
 *
 * A part is lines of JSON, then "said TEXT" for each line of complaint without the file's name, then
 * "end RESULTS EXIT SHA256" over all before. It is not forced to the disk one by one: after a loss of power
 * one that is not whole is none, and is made again.
 */
#include <limits.h>
#include <stdbool.h>
#include <stddef.h>

#include "common/error.h"

enum { STORE_MESSAGE_MAX = 512, STORE_FOLDER_MAX = PATH_MAX - 256 };

struct store {
	char folder[STORE_FOLDER_MAX];
};

struct part {
	char *bytes; /* the results, a line each; then what was said, a line each */
	size_t size; /* of the results */
	const char *said;
	size_t said_size;
	unsigned long results;
	int code; /* exit code of the analysis */
};

/* Makes the folder and its settings, or looks whether it has the same. 0, or DT_E_* told in message. */
DT_MUST_USE int store_open(struct store *store, const char *folder, const char *settings,
                           char message[STORE_MESSAGE_MAX]);

/* FOLDER/NAME */
void store_path(const struct store *store, const char *name, char path[PATH_MAX]);

/* The part of that key, to be freed by part_free; false where there is none that is whole. */
bool store_get(const struct store *store, const char *key, struct part *part);
void part_free(struct part *part);

/* Puts results and complaints in their place; what is there is replaced. 0, or DT_E_SYSTEM with errno. */
DT_MUST_USE int store_put(const struct store *store, const char *key, const struct part *part);

#endif
