/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_COMMAND_ARCHIVED_H
#define DT_HOST_COMMAND_ARCHIVED_H
/*
 * What commands do with drops in an archive. Errors are printed; returns are COMMAND_* exit codes.
 */
#include "host/archive/archive.h"
#include "host/record/record.h"

/* --archive, else $DROPTOWER_ARCHIVE, else ./archive. */
const char *archived_folder(const char *given);

/* Who sits at it, when nobody says so: $USER, else the login's name; "" when there is none, which no
 * archive takes. */
const char *archived_operator(const char *given);

/* Prints the archive's message; returns COMMAND_INPUT. */
int archived_failed(const struct archive *archive);

enum { ARCHIVED_SCENE_MAX = 48 };

/* A name under which this program and its children can read the scene of a series as a file, as long as this
 * one runs: it stays open for a command that ends with its drop. */
int archived_scene_file(struct archive *archive, const char *series, char file[ARCHIVED_SCENE_MAX]);

/* The record of SERIES/NUMBER from its log, which is verified; goes by its place in the archive's folder.
 * fault: a result that is not what was recorded, as archive_open_log has it; NULL: refused, too. 0 or DT_E_*
 * with one line in message. */
DT_MUST_USE int archived_read(struct archive *archive, const char *drop, struct record *record,
                              char fault[ARCHIVE_MESSAGE_MAX], char message[ARCHIVE_MESSAGE_MAX]);

/* What an archive knows of the drop whose log this file is, where it is one of an archive: date, operator,
 * scene, serial numbers, whether it was simulated. Nothing is told when it is none. */
void archived_origin(const char *file, struct record *record);

/* As archived_analyse, with what is wrong in message, and 0 or DT_E_*. */
DT_MUST_USE int archived_result(struct archive *archive, const char *series, unsigned number,
                                const char *chain, char fault[ARCHIVE_MESSAGE_MAX],
                                char message[ARCHIVE_MESSAGE_MAX]);

/* Analyses SERIES/NUMBER from its log and keeps the result under this program's version. A log that cannot be
 * analysed stays, without a result; one that is not what was recorded is refused. chain: the sensors' files
 * in place of the scene's; NULL: those, and a drop whose newest result had such files is refused without. */
int archived_analyse(struct archive *archive, const char *series, unsigned number, const char *chain);

#endif
