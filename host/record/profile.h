/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_PROFILE_H
#define DT_HOST_RECORD_PROFILE_H
/*
 * A profile: how files of one origin are read, kept as an INI file and held against each of them.
 *
 *     [import]
 *     columns = time:ms,fixture:g,board:mV/(10.2mV/g),-
 *     separator = tab
 *     decimal = comma
 *     names = Time|Accel|IntAccel
 *
 * columns is as --columns has it. separator is tab, semicolon, comma, bar or blanks; without it, any. decimal
 * is comma or point; without it, as the lines look. names are those of the file's columns; a file with others
 * is refused.
 *
 * "@PATH" in place of --columns names one. Without --columns the file import.ini in the recording's folder is
 * one, for text and tables of other people.
 */
#include "host/record/cells.h"
#include "host/record/read.h"

enum { PROFILE_PATH_MAX = 4096, PROFILE_COLUMNS_MAX = 4096, PROFILE_NAMES_MAX = 1024 };

struct profile {
	char path[PROFILE_PATH_MAX];
	char columns[PROFILE_COLUMNS_MAX];
	struct cells_style style;
	char names[PROFILE_NAMES_MAX]; /* "" where any will do */
};

/* The profile that a recording is read by: of columns "@PATH" that one, without columns (NULL) the one beside
 * the file. *profile is NULL where there is none, else freed by the caller, after an error too. 0, or an
 * error told in message. */
DT_MUST_USE int profile_of(struct profile **profile, const char *file, const char *columns,
                           char message[READ_MESSAGE_MAX]);

/* Whether a profile that can be read lies beside a file, and its path. */
bool profile_beside(const char *file, char path[PROFILE_PATH_MAX]);

/* Names as a profile has them. */
void profile_names(const struct piece *name, size_t count, char names[PROFILE_NAMES_MAX]);

/* Writes what was understood of a text file, with columns instead of what it tells where they are not NULL.
 */
DT_MUST_USE int profile_save(const char *path, const char *file, const char *columns,
                             char message[READ_MESSAGE_MAX]);

#endif
