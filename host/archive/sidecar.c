/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Sidecars written from the index. sidecar_read.c reads them.
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "host/archive/chain.h"
#include "host/archive/sidecar.h"
#include "common/base/text.h"

#define SERIES_COLUMNS "s.scene, s.name, c.name, s.angle_deg, s.height_m, s.planned, s.created"
#define SERIES_TABLES " FROM series s JOIN campaigns c ON c.id = s.campaign_id "
enum { SERIES_COLUMN_COUNT = 7 };

static void sidecar_put_series(FILE *out, sqlite3_stmt *s)
{
	fprintf(out, "%s" SIDECAR_MARK "format = 1\nseries = %s\ncampaign = %s\n", sql_text(s, 0),
	        sql_text(s, 1), sql_text(s, 2));
	fprintf(out, "angle_deg = %.15g\nheight_m = %.15g\nplanned = %d\ncreated = %s\n",
	        sqlite3_column_double(s, 3), sqlite3_column_double(s, 4), sqlite3_column_int(s, 5),
	        sql_text(s, 6));
}

static void sidecar_put_drop(FILE *out, sqlite3_stmt *s)
{
	static const char *const keys[] = {"drop",   "state", "time",  "operator", "note",     "decision",
	                                   "reason", "raw",   "bytes", "sha256",   "simulated"};

	for (int i = 0; i < (int)(sizeof(keys) / sizeof(keys[0])); i++)
		fprintf(out, "%s = %s\n", keys[i], sql_text(s, SERIES_COLUMN_COUNT + i));
}

/* One line "key = a<tab>b..." for each row. */
static int sidecar_put_rows(struct archive *archive, FILE *out, const char *key, const char *text,
                            int64_t drop)
{
	sqlite3_stmt *s;
	int result = sql_query(archive, &s, text, "i", drop);

	if (result != 0)
		return result;
	while ((result = sql_step(archive, s)) > 0)
		for (int i = 0, columns = sqlite3_column_count(s); i < columns; i++)
			fprintf(out, "%s%s%s", i == 0 ? key : "\t", sql_text(s, i),
			        i + 1 == columns ? "\n" : "");
	sqlite3_finalize(s);
	return result;
}

/* "result = TIME<tab>VERSION<tab>BYTES<tab>SHA-256" for each; the hash is of what the index has, which is
 * what the file beside the log should be. */
static int put_results(struct archive *archive, FILE *out, int64_t drop)
{
	char hash[DIGEST_CHARS];
	sqlite3_stmt *s;
	int result = sql_query(
	        archive, &s,
	        "SELECT r.time, v.name, t.json FROM results r JOIN versions v ON v.id = r.version_id"
	        " JOIN texts t ON t.result_id = r.id WHERE r.drop_id = ? ORDER BY r.id",
	        "i", drop);

	if (result != 0)
		return result;
	while ((result = sql_step(archive, s)) > 0) {
		const char *json = sql_text(s, 2);

		digest_of(json, strlen(json), hash);
		fprintf(out, "result = %s\t%s\t%zu\t%s\n", sql_text(s, 0), sql_text(s, 1), strlen(json),
		        hash);
	}
	sqlite3_finalize(s);
	return result;
}

static int put_history(struct archive *archive, FILE *out, int64_t drop)
{
	int result = put_results(archive, out, drop);

	return result != 0
	               ? result
	               : sidecar_put_rows(archive, out, "event = ",
	                                  "SELECT time, what, operator, text FROM events WHERE drop_id = ?"
	                                  " ORDER BY id",
	                                  drop);
}

static int sidecar_refuse_file(struct archive *archive, const char *path)
{
	return archive_refuse(archive, DT_E_SYSTEM, "%.500s: %s", path, strerror(errno));
}

/* On the disk beside its place, then in the chain, then in its place: whatever moment the power fails, the
 * chain's last entry of a path is the hash of the file or of what stands beside it. */
static int sidecar_put(struct archive *archive, const char *file, const char *text, size_t size,
                       const struct chain_place *place)
{
	char path[ARCHIVE_PATH_MAX], hash[DIGEST_CHARS];
	int result;

	snprintf(path, sizeof(path), "%s/%.200s", archive->folder, file);
	if (durable_folders(path) != 0 || durable_stage(path, text, size) != 0)
		return sidecar_refuse_file(archive, path);
	digest_of(text, size, hash);
	result = chain_enter(archive, place, file, (int64_t)size, hash);
	if (result == 0 && durable_publish(path) != 0)
		result = sidecar_refuse_file(archive, path);
	return result;
}

void sidecar_name(const char *raw, char file[ARCHIVE_NAME_MAX + 64])
{
	const char *dot = strrchr(raw, '.');

	snprintf(file, ARCHIVE_NAME_MAX + 64, "%.*s.ini", dot != NULL ? (int)(dot - raw) : (int)strlen(raw),
	         raw);
}

int sidecar_drop(struct archive *archive, const char *file, int64_t *row)
{
	char stem[ARCHIVE_NAME_MAX + 64];

	snprintf(stem, sizeof(stem), "%.*s.", (int)(strrchr(file, '.') - file), file);
	return sql_number(archive, row, "SELECT id FROM drops WHERE raw >= ?1 AND raw < ?1 || '~'", "s",
	                  stem);
}

/* ---- its text ---- */

/* The row is there. drop: its row, 0 of a series. */
static int sidecar_text(struct archive *archive, sqlite3_stmt *s, int64_t drop,
                        const struct chain_place *place, struct text *text)
{
	int result = 0;

	if (text_open(text) != 0)
		return archive_refuse(archive, DT_E_MEMORY, "%s", error_text(DT_E_MEMORY));
	sidecar_put_series(text->out, s);
	if (drop != 0) {
		sidecar_put_drop(text->out, s);
		result = put_history(archive, text->out, drop);
	}
	fprintf(text->out, "entry = %lld\nprevious = %s\n", (long long)place->number, place->head);
	if (text_close(text, result) == 0)
		return 0;
	return result != 0 ? result : archive_refuse(archive, DT_E_MEMORY, "%s", error_text(DT_E_MEMORY));
}

/* 1 with the row, to be finalized; 0 when there is none. */
static int select_row(struct archive *archive, const char *text, int64_t id, sqlite3_stmt **s)
{
	int result = sql_query(archive, s, text, "i", id);

	if (result != 0)
		return result;
	result = sql_step(archive, *s);
	if (result <= 0)
		sqlite3_finalize(*s);
	return result;
}

static const char of_drop[] = "SELECT " SERIES_COLUMNS ", d.number, d.state, d.time, d.operator, d.note,"
                              " d.decision, d.reason, d.raw, d.bytes, d.sha256, d.simulated" SERIES_TABLES
                              "JOIN drops d ON d.series_id = s.id WHERE d.id = ?";
static const char of_series[] = "SELECT " SERIES_COLUMNS SERIES_TABLES "WHERE s.id = ?";

static int text_of(struct archive *archive, const char *query, int64_t id, bool drop,
                   const struct chain_place *place, struct text *text)
{
	sqlite3_stmt *s;
	int result = select_row(archive, query, id, &s);

	if (result <= 0)
		return result < 0 ? result : archive_refuse(archive, DT_E_UNKNOWN, "no such row");
	result = sidecar_text(archive, s, drop ? id : 0, place, text);
	sqlite3_finalize(s);
	return result;
}

int sidecar_text_of_drop(struct archive *archive, int64_t drop, const struct chain_place *place,
                         struct text *text)
{
	return text_of(archive, of_drop, drop, true, place, text);
}

int sidecar_text_of_series(struct archive *archive, int64_t series, const struct chain_place *place,
                           struct text *text)
{
	return text_of(archive, of_series, series, false, place, text);
}

/* ---- written ---- */

/* The row is there; writes what to says, "raw/..." with any ending. */
static int sidecar_write_out(struct archive *archive, sqlite3_stmt *s, const char *to, int64_t drop)
{
	char file[ARCHIVE_NAME_MAX + 64];
	struct chain_place place;
	struct text text;
	int result = chain_next(archive, &place);

	if (result == 0)
		result = sidecar_text(archive, s, drop, &place, &text);
	if (result != 0)
		return result;
	sidecar_name(to, file);
	result = sidecar_put(archive, file, text.bytes, text.size, &place);
	free(text.bytes);
	if (result == 0 && drop != 0)
		result =
		        sql_run(archive, "UPDATE drops SET entry = ? WHERE id = ?", "ii", place.number, drop);
	return result;
}

int sidecar_write_drop(struct archive *archive, int64_t drop)
{
	char to[ARCHIVE_NAME_MAX + 64];
	sqlite3_stmt *s;
	int result = select_row(archive, of_drop, drop, &s);

	if (result <= 0)
		return result;
	snprintf(to, sizeof(to), "%s", sql_text(s, SERIES_COLUMN_COUNT + 7));
	result = sidecar_write_out(archive, s, to, drop);
	sqlite3_finalize(s);
	return result;
}

int sidecar_write_series(struct archive *archive, int64_t series)
{
	char to[ARCHIVE_NAME_MAX + 64];
	sqlite3_stmt *s;
	int result = select_row(archive, of_series, series, &s);

	if (result <= 0)
		return result;
	snprintf(to, sizeof(to), "raw/%.4s/%s/series.ini", sql_text(s, 6), sql_text(s, 1));
	result = sidecar_write_out(archive, s, to, 0);
	sqlite3_finalize(s);
	return result;
}
