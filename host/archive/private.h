/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ARCHIVE_PRIVATE_H
#define DT_HOST_ARCHIVE_PRIVATE_H
/*
 * What the files of this folder share: the open archive, statements, and sidecars. Every function that fails
 * has written archive->message.
 */
#include <sqlite3.h>
#include <stdio.h>

#include "host/archive/archive.h"

struct archive {
	char *folder;
	sqlite3 *index;
	int lock; /* shared by writers, exclusive to who rebuilds; -1: reading */
	char message[ARCHIVE_MESSAGE_MAX];
	struct archive_mark *mark; /* of drops, where the index could not take them */
	int64_t marked;            /* marks that changed since it was opened, in the index or here */
	size_t marks;
	char unread[ARCHIVE_MESSAGE_MAX]; /* the first file that a proof could not read; "" none */
};

struct archive_mark {
	int64_t drop;
	bool missing;
	char fault[ARCHIVE_MESSAGE_MAX];
};

/* Writes the message and returns code. */
__attribute__((format(printf, 3, 4))) int archive_refuse(struct archive *archive, int code,
                                                         const char *format, ...);

/* ---- statements: types is one letter for each value, s text (NULL allowed), i int64_t, d double (NAN: null)
 * ---- */

/* Prepares and binds; to be finalized after success. */
DT_MUST_USE int sql_query(struct archive *archive, sqlite3_stmt **statement, const char *text,
                          const char *types, ...);

/* Binds a text to a column of a statement that sql_query has prepared; the statement stays the caller's. */
DT_MUST_USE int sql_bind_text(struct archive *archive, sqlite3_stmt *statement, int column, const char *text);

/* 1 with a row, 0 after the last, DT_E_*. */
DT_MUST_USE int sql_step(struct archive *archive, sqlite3_stmt *statement);

/* Runs one statement to its end. */
DT_MUST_USE int sql_run(struct archive *archive, const char *text, const char *types, ...);

/* Runs a script. */
DT_MUST_USE int sql_script(struct archive *archive, const char *text);

/* The first value of the first row; DT_E_EMPTY without a message when there is no row. */
DT_MUST_USE int sql_number(struct archive *archive, int64_t *number, const char *text, const char *types,
                           ...);

/* Never NULL. */
const char *sql_text(sqlite3_stmt *statement, int column);

/* The first drop that a query for SERIES/NUMBER by one text finds: 1 with it, 0 when there is none, or
 * DT_E_*. */
DT_MUST_USE int archive_first_drop(struct archive *archive, const char *query, const char *text,
                                   char drop[ARCHIVE_NAME_MAX + 16]);

/* A damaged or unreachable index, in words. */
int sql_refuse(struct archive *archive);

DT_MUST_USE int archive_start(struct archive *archive); /* a transaction for writing */
/* The same for a change, after what a writer left that died has been put right. */
DT_MUST_USE int archive_change(struct archive *archive);
/* Commits when result is 0, else takes everything back; returns result or what committing said. */
DT_MUST_USE int archive_end(struct archive *archive, int result);

/* Opens FOLDER/NAME and makes or migrates the schema. */
DT_MUST_USE int index_open(struct archive *archive, const char *name, enum archive_mode mode);
/* Whether the index that is there is a file, and not an empty one beside raw files; opens nothing. */
DT_MUST_USE int index_look(struct archive *archive);
DT_MUST_USE int schema_upgrade(struct archive *archive);

/* An archive without an index yet, with its folder locked. */
DT_MUST_USE int archive_lock(struct archive *archive, bool exclusive);

/* ---- names ---- */

enum { ARCHIVE_TIME_CHARS = 24 };
void archive_time(char text[ARCHIVE_TIME_CHARS], int64_t time_s);
DT_MUST_USE int archive_check_name(struct archive *archive, const char *what, const char *name);
DT_MUST_USE int archive_check_names(struct archive *archive, const char *series, const char *campaign);
/* A text that is not blank. */
DT_MUST_USE int archive_check_operator(struct archive *archive, const char *name);
DT_MUST_USE int archive_check_text(struct archive *archive, const char *what, const char *text);

/* Whether a name ends as a log's does. */
bool archive_is_log(const char *name);

struct archive_place {
	int64_t drop, series;
	char name[ARCHIVE_NAME_MAX + 1];
	unsigned number;
	char raw[ARCHIVE_NAME_MAX + 64];
	bool recorded;
};
/* A recorder holds a lock on its log as long as it lives. */
bool archive_is_recording(const struct archive *archive, const char *raw);

/* "SERIES/NUMBER" to its row. */
DT_MUST_USE int archive_locate(struct archive *archive, const char *drop, struct archive_place *place);

/* As archive_each_drop, of each drop only what means are made of: series, number, decision, values, not_ok,
 * and of sha256 whether there is one. */
DT_MUST_USE int archive_each_numbers(struct archive *archive, const struct archive_filter *filter,
                                     int (*each)(void *context, const struct archive_drop *drop),
                                     void *context);

/* ---- rows; the sidecars stand in sidecar.h ---- */

#define SIDECAR_SECTION "[archive]"

/* Puts a series, and its campaign when that is new, into the index alone. */
DT_MUST_USE int series_insert(struct archive *archive, const char *name, const char *campaign,
                              const char *text, const struct scene *scene, int64_t planned,
                              const char *created, int64_t *row);

/* A change of SERIES/NUMBER by somebody: change_look at its files, which are read from end to end, and at
 * what is to be written; change_start of a transaction; the change, with what was wrong by proof_log;
 * change_end, which writes the sidecar again if result is 0 and ends the transaction. */
DT_MUST_USE int change_look(struct archive *archive, const char *drop, const char *operator_name,
                            const char *text, char fault[ARCHIVE_MESSAGE_MAX]);
DT_MUST_USE int change_start(struct archive *archive, const char *drop, struct archive_place *place);
DT_MUST_USE int change_end(struct archive *archive, const struct archive_place *place, int result);

/* Something that was decided, noted or found of a drop, into the index alone. */
DT_MUST_USE int event_insert(struct archive *archive, int64_t drop, const char *what,
                             const char *operator_name, const char *text);

/* Puts the JSON of a result that was recorded into the index alone, as archive_result would have.
 * DT_E_FORMAT: json is none of ours. */
DT_MUST_USE int result_restore(struct archive *archive, int64_t drop, const char *when, const char *version,
                               const char *json);

/* A scene from its text. */
DT_MUST_USE int scene_of_text(struct archive *archive, const char *name, const char *text, double angle_deg,
                              struct scene *scene);

#endif
