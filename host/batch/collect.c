/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/batch/collect.h"

#include <errno.h>
#include <math.h>
#include <sqlite3.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/base/text.h"
#include "host/base/atomic_file.h"
#include "host/base/durable.h"
#include "host/base/put.h"
#include "host/batch/columns.h"

enum sheet_name { DROPS, CHANNELS, MESSAGES, SHEETS };

static const char *const names[SHEETS] = {"drops", "channels", "messages"};

/* Columns of their own, in this order. */
enum { AT_FILE, AT_SHA256, AT_LOG_NUMBER, AT_SHOCK, AT_DROP_ID, AT_FLAGS, AT_FORMAT };
enum { AT_CHANNEL = AT_DROP_ID };
enum { AT_EXIT = AT_SHA256, AT_MESSAGE };

/* One table in its forms. */
struct sheet {
	struct batch_columns columns;
	struct table csv;
	struct atomic_file atomic;
	bool open; /* whole */
	sqlite3_stmt *insert;
};

struct collecting {
	const struct store *store;
	unsigned forms;
	struct collected *collected;
	char *message;
	struct atomic_file jsonl;
	bool jsonl_open;
	sqlite3 *database;
	char database_path[PATH_MAX];
	char path[SHEETS + 1][PATH_MAX]; /* whole keeps them */
	struct sheet sheet[SHEETS];
};

static int fail(struct collecting *c, int code, const char *file, const char *why)
{
	snprintf(c->message, STORE_MESSAGE_MAX, "%.300s: %.150s", file, why);
	return code;
}

/* ---- what the tables are ---- */

static void shape(struct collecting *c)
{
	struct batch_columns *drops = &c->sheet[DROPS].columns, *channels = &c->sheet[CHANNELS].columns,
	                     *messages = &c->sheet[MESSAGES].columns;

	for (int i = DROPS; i <= CHANNELS; i++) {
		batch_columns_own(&c->sheet[i].columns, "file", true);
		batch_columns_own(&c->sheet[i].columns, "sha256", true);
		batch_columns_own(&c->sheet[i].columns, "log_number", false);
		batch_columns_own(&c->sheet[i].columns, "shock", false);
	}
	batch_columns_own(drops, "drop_id", false);
	batch_columns_own(drops, "record_flags", true);
	batch_columns_own(drops, "format", true);
	batch_columns_add(drops, "");
	batch_columns_own(channels, "channel", true);
	batch_columns_own(channels, "record_flags", true);
	batch_columns_add(channels, "channels");
	batch_columns_own(messages, "file", true);
	batch_columns_own(messages, "exit", false);
	batch_columns_own(messages, "message", true);
}

/* ---- opening ---- */

static int open_csv(struct collecting *c, int i)
{
	struct sheet *sheet = &c->sheet[i];
	char name[32];
	int result;

	snprintf(name, sizeof(name), "%s.csv", names[i]);
	store_path(c->store, name, c->path[i]);
	result = atomic_file_open(&sheet->atomic, c->path[i], c->message, STORE_MESSAGE_MAX);
	if (result != 0)
		return result;
	sheet->open = true;
	sheet->csv = (struct table){.out = sheet->atomic.out, .format = TABLE_CSV};
	table_begin(&sheet->csv, sheet->columns.column, sheet->columns.count);
	return 0;
}

static int open_jsonl(struct collecting *c)
{
	int result;

	store_path(c->store, "results.jsonl", c->path[SHEETS]);
	result = atomic_file_open(&c->jsonl, c->path[SHEETS], c->message, STORE_MESSAGE_MAX);
	c->jsonl_open = result == 0;
	return result;
}

static int refuse_database(struct collecting *c)
{
	return fail(c, DT_E_SYSTEM, c->database_path,
	            c->database != NULL ? sqlite3_errmsg(c->database) : error_text(DT_E_MEMORY));
}

static int put_columns(const struct sheet *sheet, const char *head, const char *each, struct text *text)
{
	int result = text_open(text);

	if (result != 0)
		return result;
	fputs(head, text->out);
	for (size_t i = 0; i < sheet->columns.count; i++)
		fprintf(text->out, each, i > 0 ? ", " : "", sheet->columns.name[i]);
	fputc(')', text->out);
	return text_close(text, 0);
}

static int make_table(struct collecting *c, int i)
{
	struct sheet *sheet = &c->sheet[i];
	char head[64];
	struct text text;
	int result;

	snprintf(head, sizeof(head), "CREATE TABLE %s (", names[i]);
	if (put_columns(sheet, head, "%s\"%s\"", &text) != 0)
		return fail(c, DT_E_MEMORY, c->database_path, error_text(DT_E_MEMORY));
	result = sqlite3_exec(c->database, text.bytes, NULL, NULL, NULL);
	free(text.bytes);
	if (result != SQLITE_OK)
		return refuse_database(c);
	snprintf(head, sizeof(head), "INSERT INTO %s VALUES (", names[i]);
	if (put_columns(sheet, head, "%s?", &text) != 0)
		return fail(c, DT_E_MEMORY, c->database_path, error_text(DT_E_MEMORY));
	result = sqlite3_prepare_v2(c->database, text.bytes, -1, &sheet->insert, NULL);
	free(text.bytes);
	return result == SQLITE_OK ? 0 : refuse_database(c);
}

/* Beside its place, where nobody else sees it: no journal, no waiting for the disk before it is whole. */
static int open_database(struct collecting *c)
{
	int result = 0;
	char name[64];

	snprintf(name, sizeof(name), "results.sqlite.%ld.part", (long)getpid());
	store_path(c->store, name, c->database_path);
	unlink(c->database_path);
	if (sqlite3_open(c->database_path, &c->database) != SQLITE_OK ||
	    sqlite3_exec(c->database, "PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; BEGIN", NULL,
	                 NULL, NULL) != SQLITE_OK)
		return refuse_database(c);
	for (int i = 0; i < SHEETS && result == 0; i++)
		result = make_table(c, i);
	return result;
}

static int collect_open(struct collecting *c)
{
	int result = 0;

	shape(c);
	if (c->forms & COLLECT_JSONL)
		result = open_jsonl(c);
	for (int i = 0; i < SHEETS && result == 0; i++)
		if (i == MESSAGES || (c->forms & COLLECT_CSV))
			result = open_csv(c, i);
	return result == 0 && (c->forms & COLLECT_SQLITE) ? open_database(c) : result;
}

/* ---- rows ---- */

static int put_in_database(struct collecting *c, struct sheet *sheet)
{
	for (size_t i = 0; i < sheet->columns.count; i++) {
		const struct cell *cell = &sheet->columns.cell[i];
		int at = (int)i + 1;

		if (sheet->columns.column[i].kind == TABLE_WORDS)
			sqlite3_bind_text(sheet->insert, at, cell->words, -1, SQLITE_STATIC);
		else if (isfinite(cell->number))
			sqlite3_bind_double(sheet->insert, at, cell->number);
		else
			sqlite3_bind_null(sheet->insert, at);
	}
	if (sqlite3_step(sheet->insert) != SQLITE_DONE)
		return refuse_database(c);
	sqlite3_reset(sheet->insert);
	return 0;
}

static int row(struct collecting *c, struct sheet *sheet)
{
	if (sheet->open)
		table_row(&sheet->csv, sheet->columns.cell);
	return sheet->insert != NULL ? put_in_database(c, sheet) : 0;
}

static const cJSON *member(const cJSON *object, const char *key)
{
	return cJSON_GetObjectItemCaseSensitive(object, key);
}

static void own_words(struct sheet *sheet, int at, const char *words)
{
	sheet->columns.cell[at].words = words;
}

/* The columns that say whose row it is. */
static void whose(struct sheet *sheet, const cJSON *result, const char *file, const char *sha256)
{
	own_words(sheet, AT_FILE, file);
	own_words(sheet, AT_SHA256, sha256);
	cell_number(&sheet->columns, AT_LOG_NUMBER, member(result, "drop"), "log_number");
	cell_number(&sheet->columns, AT_SHOCK, member(result, "shock"), "number");
	cell_words(&sheet->columns, AT_FLAGS, result, "flags");
}

static int put_rows(struct collecting *c, const cJSON *result, const char *file, const char *sha256)
{
	struct sheet *drops = &c->sheet[DROPS], *channels = &c->sheet[CHANNELS];
	const cJSON *channel = NULL;
	int error;

	whose(drops, result, file, sha256);
	cell_number(&drops->columns, AT_DROP_ID, member(result, "drop"), "drop_id");
	cell_words(&drops->columns, AT_FORMAT, result, "format");
	batch_columns_fill(&drops->columns, result);
	error = row(c, drops);
	whose(channels, result, file, sha256);
	cJSON_ArrayForEach(channel, member(result, "channels"))
	{
		cell_words(&channels->columns, AT_CHANNEL, channel, "name");
		batch_columns_fill(&channels->columns, channel);
		if (error == 0)
			error = row(c, channels);
	}
	return error;
}

/* A line of a part, by the name that the file has here. */
static int put_line(struct collecting *c, const char *line, const char *file, const char *sha256)
{
	struct builder b = {.failed = false};
	cJSON *head = cJSON_CreateObject();
	char *text;

	b.failed = head == NULL;
	put_text(&b, head, "file", file);
	put_text(&b, head, "sha256", sha256);
	text = b.failed ? NULL : cJSON_PrintUnformatted(head);
	cJSON_Delete(head);
	if (text == NULL)
		return fail(c, DT_E_MEMORY, file, error_text(DT_E_MEMORY));
	text[strlen(text) - 1] = '\0';
	/* behind {"file":"...", the line is what it was */
	line += strlen("{\"file\":\"");
	while (*line != '"')
		line += *line == '\\' ? 2 : 1;
	fprintf(c->jsonl.out, "%s%s", text, line + 1);
	cJSON_free(text);
	return 0;
}

static int collect_line(struct collecting *c, char *line, const char *file, const char *sha256)
{
	bool tables = (c->forms & (COLLECT_CSV | COLLECT_SQLITE)) != 0;
	size_t length = strcspn(line, "\n");
	char end = line[length + 1];
	cJSON *result = NULL;
	int error = 0;

	line[length + 1] = '\0'; /* the part is ours */
	if (strncmp(line, "{\"file\":\"", 9) != 0 || (tables && (result = cJSON_Parse(line)) == NULL))
		error = fail(c, DT_E_FORMAT, file, "its part of the results is no JSON of droptower");
	if (error == 0 && c->jsonl_open)
		error = put_line(c, line, file, sha256);
	if (error == 0 && tables)
		error = put_rows(c, result, file, sha256);
	cJSON_Delete(result);
	line[length + 1] = end;
	c->collected->results++;
	return error;
}

static int collect_message(struct collecting *c, const char *file, int code, const char *text, size_t length)
{
	struct sheet *sheet = &c->sheet[MESSAGES];
	struct cell *cell = &sheet->columns.cell[AT_MESSAGE];

	own_words(sheet, AT_FILE, file);
	sheet->columns.cell[AT_EXIT].number = code;
	snprintf(cell->text, sizeof(cell->text), "%.*s", (int)length, text);
	cell->words = cell->text;
	return row(c, sheet);
}

static int collect_part(struct collecting *c, struct part *part, const struct input *input)
{
	char sha256[65];
	int error = 0;

	snprintf(sha256, sizeof(sha256), "%.64s", input->noted.key);
	for (size_t at = 0; at < part->size && error == 0; at += strcspn(part->bytes + at, "\n") + 1)
		error = collect_line(c, part->bytes + at, input->path, sha256);
	for (size_t at = 0; at < part->said_size && error == 0;) {
		const char *line = part->said + at;
		size_t length = strcspn(line, "\n");

		error = collect_message(c, input->path, part->code, line + 5, length - 5);
		at += length + 1;
	}
	return error;
}

static int collect_input(struct collecting *c, const struct input *input)
{
	const char *why = input->noted.message != NULL ? input->noted.message : "no result";
	struct part part;
	int error;

	if (input->noted.key[0] == '\0' || !store_get(c->store, input->noted.key, &part)) {
		c->collected->refused++;
		return collect_message(c, input->path, input->noted.code, why, strlen(why));
	}
	error = collect_part(c, &part, input);
	part_free(&part);
	return error;
}

/* ---- closing ---- */

static int close_database(struct collecting *c, int error)
{
	char place[PATH_MAX];

	if (c->database == NULL)
		return error;
	for (int i = 0; i < SHEETS; i++)
		sqlite3_finalize(c->sheet[i].insert);
	if (error == 0 && sqlite3_exec(c->database, "COMMIT", NULL, NULL, NULL) != SQLITE_OK)
		error = refuse_database(c);
	sqlite3_close(c->database);
	store_path(c->store, "results.sqlite", place);
	if (error == 0 &&
	    (durable_sync(c->database_path) != 0 || durable_replace(c->database_path, place) != 0))
		error = fail(c, DT_E_SYSTEM, place, strerror(errno));
	if (error != 0)
		unlink(c->database_path);
	return error;
}

static int close_stream(struct collecting *c, struct atomic_file *atomic, int error)
{
	char unsaid[STORE_MESSAGE_MAX];

	return atomic_file_close(atomic, error, error == 0 ? c->message : unsaid, STORE_MESSAGE_MAX);
}

static int collect_close(struct collecting *c, int error)
{
	for (int i = 0; i < SHEETS; i++)
		if (c->sheet[i].open) {
			if (table_end(&c->sheet[i].csv) != 0 && error == 0)
				error = fail(c, DT_E_MEMORY, c->path[i], error_text(DT_E_MEMORY));
			error = close_stream(c, &c->sheet[i].atomic, error);
		}
	if (c->jsonl_open)
		error = close_stream(c, &c->jsonl, error);
	return close_database(c, error);
}

static int by_content(const void *a, const void *b)
{
	const struct input *one = a, *other = b;
	int order = strcmp(one->noted.key, other->noted.key);

	return order != 0 ? order : strcmp(one->path, other->path);
}

int collect(const struct store *store, struct inputs *inputs, unsigned forms, struct collected *collected,
            char message[STORE_MESSAGE_MAX])
{
	struct collecting *c = calloc(1, sizeof(*c));
	int error;

	*collected = (struct collected){.results = 0};
	if (c == NULL) {
		snprintf(message, STORE_MESSAGE_MAX, "%s", error_text(DT_E_MEMORY));
		return DT_E_MEMORY;
	}
	c->store = store;
	c->forms = forms;
	c->collected = collected;
	c->message = message;
	qsort(inputs->input, inputs->count, sizeof(*inputs->input), by_content);
	error = collect_open(c);
	for (size_t i = 0; i < inputs->count && error == 0; i++) {
		const char *key = inputs->input[i].noted.key;

		collected->copies +=
		        i > 0 && key[0] != '\0' && strcmp(inputs->input[i - 1].noted.key, key) == 0;
		error = collect_input(c, &inputs->input[i]);
	}
	error = collect_close(c, error);
	free(c);
	return error;
}
