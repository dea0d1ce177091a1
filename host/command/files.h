/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_COMMAND_FILES_H
#define DT_HOST_COMMAND_FILES_H
/*
 * The files that words of a command line stand for: a file itself, of a folder its files in the order of
 * their names (not those of its folders, hidden ones, profiles and indexes), of a pattern (* ? []) in the
 * last part of a path the files that match.
 */
#include <stdbool.h>
#include <stddef.h>

#include "host/record/read.h"

struct files {
	char **file;
	size_t count, room;
	int named; /* words that were files themselves */
};

/* A COMMAND_* code; errors were printed, and there is nothing to free then. */
int files_expand(struct files *files, char **words, int count);
void files_free(struct files *files);

/* One more; false without memory. */
bool files_add(struct files *files, const char *path);

/* One file's record, as read_nth has it; a COMMAND_* code, the error printed. */
int files_read(struct record *record, const char *file, const char *columns, unsigned drop);

#endif
