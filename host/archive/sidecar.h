/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ARCHIVE_SIDECAR_H
#define DT_HOST_ARCHIVE_SIDECAR_H
/*
 * The .ini beside each log: the scene as it was given, then what the index knows. Each is entered in the
 * chain, and says as which entry and behind which head.
 */
#include "host/archive/chain.h"

#define SIDECAR_MARK "\n; ---- what the archive knows of it ----\n" SIDECAR_SECTION "\n"

/* Of a log. */
void sidecar_name(const char *raw, char file[ARCHIVE_NAME_MAX + 64]);

/* The other way: the row of the drop that has this sidecar; DT_E_EMPTY without a message when none has. */
DT_MUST_USE int sidecar_drop(struct archive *archive, const char *file, int64_t *row);

/* ---- writing, within a transaction ---- */

/* Writes FOLDER/raw/.../NNNN.ini of a drop, or .../series.ini, from the index. */
DT_MUST_USE int sidecar_write_drop(struct archive *archive, int64_t drop);
DT_MUST_USE int sidecar_write_series(struct archive *archive, int64_t series);

/* What they write of a drop, and of a series, at that place; text is open until text_close. */
struct text;
DT_MUST_USE int sidecar_text_of_drop(struct archive *archive, int64_t drop, const struct chain_place *place,
                                     struct text *text);
DT_MUST_USE int sidecar_text_of_series(struct archive *archive, int64_t series,
                                       const struct chain_place *place, struct text *text);

/* ---- reading ---- */

struct sidecar {
	const char *file, *scene;
	char *line, *end; /* lines of the archive's section, each with a NUL behind */
};

/* Splits text in place; sidecar->file is set. DT_E_FORMAT: none of ours. */
DT_MUST_USE int sidecar_split(struct archive *archive, struct sidecar *sidecar, char *text);

/* The value of the first line with this key, "" when there is none. */
const char *sidecar_value(const struct sidecar *sidecar, const char *key);

/* The same from *at on, which begins at sidecar->line and moves behind it. */
const char *sidecar_next(const struct sidecar *sidecar, const char *key, const char **at);

/* A line "result = ..."; bytes -1 and hash "" where it was written before there were hashes. */
struct sidecar_result {
	char time[ARCHIVE_TIME_CHARS], version[ARCHIVE_NAME_MAX + 1], hash[DIGEST_CHARS];
	int64_t bytes;
};
bool sidecar_result(const char *text, struct sidecar_result *result);

/* Whether it is named as that of a drop: raw/YEAR/SERIES/NUMBER.ini. */
bool sidecar_is_of_drop(const char *path);

/* FOLDER/raw/.../NNNN.VERSION.json of the sidecar file, or of the log raw. */
void sidecar_json_path(const struct archive *archive, const char *file, const char *version,
                       char path[ARCHIVE_PATH_MAX]);

/* Puts what file (in the folder) says into the index, and a drop's row into *drop, else 0. 1: all but a
 * result that could not be used, message says why. */
DT_MUST_USE int sidecar_read(struct archive *archive, const char *file, int64_t *drop);

#endif
