/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/read.h"

#include <stdio.h>
#include <string.h>

#include "host/record/hdf5.h"
#include "host/record/lcm_codec.h"
#include "host/record/log_index.h"
#include "host/record/seal.h"
#include "host/record/source.h"
#include "host/record/table_data.h"
#include "host/record/uff58.h"
#include "host/record/unpack.h"

#define NETCDF "a NetCDF file of the classic format: nccopy -k nc4 makes HDF5 of it"
#define PEAK_TRACE "a CAN trace of PEAK (TRC): save it as ASC or candump text"

enum { PART_BYTES = 1024 };

/* Letters that a text could begin with count only where what no text has stands behind them, or a word of the
 * kind's own in the first part of the file. */
static const struct {
	size_t at;
	const char *magic;
	size_t length;
	const char *name;
	const char *word; /* NULL: the magic is enough */
	size_t word_length;
} kinds[] = {
        {0, "PK\3\4", 4, "a zip archive or a spreadsheet: unpack it, or save the sheet as CSV", NULL, 0},
        {0, "\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", 8,
         "a spreadsheet or other Office file: save the sheet as CSV", NULL, 0},
        {257, "ustar\0", 6, "a tar archive: unpack it", NULL, 0},
        {257, "ustar  \0", 8, "a tar archive: unpack it", NULL, 0},
        {0, "7z\xbc\xaf\x27\x1c", 6, "a 7z archive: unpack it", NULL, 0},
        {0, "CDF\1", 4, NETCDF, NULL, 0},
        {0, "CDF\2", 4, NETCDF, NULL, 0},
        {0, "CDF\5", 4, NETCDF, NULL, 0},
        {0, "ARROW1\0\0", 8, "an Arrow file: export it as CSV", NULL, 0},
        {0, "\x1a\x45\xdf\xa3", 4,
         "an EBML file, but no recording of enDAQ (IDE), whose document type is mide", NULL, 0},
        {0, "MDF     ", 8, "an MDF file of ASAM: export it as CSV", "\0", 1},
        {0, "UnFinMF ", 8, "an MDF file of ASAM that was not finished: finish it, and export it as CSV", "\0",
         1},
        {0, ";$FILEVERSION=", 14, PEAK_TRACE, NULL, 0},
        {0, ";##", 3, PEAK_TRACE, "+-current number in actual sample", 33},
        {0, "%PDF-1.", 7, "a PDF", NULL, 0},
        {0, "%PDF-2.", 7, "a PDF", NULL, 0},
        {0, "\x89PNG\r\n\x1a\n", 8, "a picture", NULL, 0},
        {0, "PAR1\x15", 5, "a Parquet file: export it as CSV", NULL, 0},
        {0, "SQLite format 3\0", 16, "an SQLite database: droptower series reads an archive", NULL, 0},
        {0, "{", 1, "JSON: it is no recording", "\":", 2},
};

static bool is_kind(const struct source *source, size_t i)
{
	const size_t part = source->size < PART_BYTES ? source->size : PART_BYTES;

	return source->size >= kinds[i].at + kinds[i].length &&
	       memcmp(source->bytes + kinds[i].at, kinds[i].magic, kinds[i].length) == 0 &&
	       (kinds[i].word == NULL ||
	        memmem(source->bytes, part, kinds[i].word, kinds[i].word_length) != NULL);
}

static int kind_refuse(const struct source *source, char message[READ_MESSAGE_MAX])
{
	for (size_t i = 0; i < sizeof(kinds) / sizeof(kinds[0]); i++)
		if (is_kind(source, i))
			return source_refuse(message, DT_E_UNKNOWN, source->file, 0, "this is %s",
			                     kinds[i].name);
	return 0;
}

/* ---- what is no log ---- */

int read_refuse_columns(const char *file, char message[READ_MESSAGE_MAX])
{
	return source_refuse(message, DT_E_ARGUMENT, file, 0,
	                     "this format names its channels itself, expected no --columns");
}

/* Without names and units of ours. */
static int read_foreign(struct record *record, struct source *source, const char *columns, char *message)
{
	table_reader *reader = table_reader_of(source);
	struct table_data table = {.format = NULL};
	int error;

	if (reader == NULL) {
		error = kind_refuse(source, message);
		return error ? error : read_delimited(record, source, columns, message);
	}
	error = reader(&table, source, message);
	if (!error)
		error = table_data_record(&table, record, source, columns, message);
	table_data_free(&table);
	return error;
}

static int read_dispatch(struct record *record, struct source *source, const char *columns,
                         char message[READ_MESSAGE_MAX])
{
	int (*reader)(struct record *, const struct source *, char *) = NULL;
	int sealed, result;

	if (!mat_is(source) && hdf5_is(source))
		return read_hdf5(record, source, columns, message);
	if (read_csv_is(source))
		reader = read_csv;
	else if (uff58_is(source))
		reader = read_uff58;
	if (!reader)
		return read_foreign(record, source, columns, message);
	if (columns)
		return read_refuse_columns(source->file, message);
	sealed = reader == read_csv || reader == read_uff58 ? seal_check(source, message) : 0;
	if (sealed < 0)
		return sealed;
	result = reader(record, source, message);
	if (result == 0 && sealed > 0)
		record->file_sealed = true;
	return result;
}

/* The one recording of the log, which a pipe has left in memory. */
static int read_one_record(struct record *record, struct log_file *log, const char *columns, char *message)
{
	struct source source = log->whole;
	int error = 0;

	log->whole = (struct source){0};
	if (source.bytes == NULL)
		error = source_load(&source, log->file, log->expected, message);
	if (!error && log->blocks != NULL)
		error = unpack(&source, message);
	if (!error)
		error = read_dispatch(record, &source, columns, message);
	if (!error)
		strcpy(record->file, log->file);
	source_free(&source);
	return error;
}

/* ---- the drops of a log ---- */

static int open_recording(struct log_file *log, const char *file, const char *columns, char *message)
{
	enum { NAME_MAX_BYTES = sizeof(((struct record *)NULL)->file) };
	int error;

	if (strlen(file) >= NAME_MAX_BYTES)
		return source_refuse(message, DT_E_ARGUMENT, file, 0,
		                     "name of %zu bytes, expected less than %d", strlen(file),
		                     (int)NAME_MAX_BYTES);
	error = log_file_open(log, file, "a recording", message);
	if (error || columns == NULL || !log_is(log))
		return error;
	log_file_close(log);
	return read_refuse_columns(file, message);
}

static int refuse_empty(struct log_file *log, const struct log_contents *contents, char *message)
{
	if (strcmp(log_format(log), "lcm") == 0)
		return source_refuse(message, DT_E_EMPTY, log->file, 0,
		                     "no message of a drop tower in %llu events, %llu refused as damaged or "
		                     "of another version, expected %s or %s as this version writes them",
		                     (unsigned long long)contents->frames,
		                     (unsigned long long)contents->refused, LCM_CODEC_DROP, LCM_CODEC_BLOCK);
	if (contents->frames == 0 && contents->refused)
		return source_refuse(message, DT_E_FORMAT, log->file, contents->first_refused,
		                     "no frame from column %u on, expected \"(seconds) interface id#data\"",
		                     contents->column);
	return source_refuse(message, DT_E_EMPTY, log->file, 0, "no block of a drop tower in %llu frames",
	                     (unsigned long long)contents->frames);
}

static void name_record(struct log_file *log, const struct log_capture *capture, struct record *record)
{
	char damage[BLOCKS_MESSAGE_MAX];

	strcpy(record->file, log->file);
	strcpy(record->format, log_format(log));
	if (log_file_damage(log, capture->from, capture->to, damage) > 0)
		snprintf(record->read_as, sizeof(record->read_as), "log in blocks; %s", damage);
	record->log_number = capture->alone ? 0 : capture->number;
}

struct each {
	struct log_file *log;
	int (*each)(void *context, const struct log_capture *capture, struct record *record);
	void *context;
};

static int pass_on(void *context, const struct log_capture *capture, struct record *record)
{
	struct each *each = context;

	if (record != NULL)
		name_record(each->log, capture, record);
	return each->each(each->context, capture, record);
}

static int each_of_log(struct each *each, char *message)
{
	struct log_visitor visitor = {.context = each, .wanted = LOG_EVERY, .capture = pass_on};
	struct log_contents contents;
	int result = log_walk(each->log, 0, each->log->size, &visitor, &contents, message);

	return result == 0 && contents.captures == 0 ? refuse_empty(each->log, &contents, message) : result;
}

int read_each(const char *file, const char *columns,
              int (*each)(void *context, const struct log_capture *capture, struct record *record),
              void *context, char message[READ_MESSAGE_MAX])
{
	struct log_file log;
	struct each of = {.log = &log, .each = each, .context = context};
	struct record record;
	int result = open_recording(&log, file, columns, message);

	if (result)
		return result;
	if (log_is(&log)) {
		result = each_of_log(&of, message);
	} else {
		result = read_one_record(&record, &log, columns, message);
		if (result == 0)
			result = each(context, NULL, &record);
	}
	log_file_close(&log);
	return result;
}

/* ---- one of them ---- */

struct found {
	unsigned wanted; /* 0: the only one with a block */
	bool found;
	struct log_capture capture;
	bool has_record;
	struct record record;
	unsigned all, held;          /* captures, and those with a block */
	struct log_visitor *visitor; /* of a search for the only one: with a second, no more samples */
};

static void read_keep(struct found *found, const struct log_capture *capture, struct record *record)
{
	found->found = true;
	found->capture = *capture;
	found->has_record = record != NULL;
	if (record != NULL)
		found->record = *record;
}

static int read_find(void *context, const struct log_capture *capture, struct record *record)
{
	struct found *found = context;

	found->all++;
	found->held += capture->counters.blocks > 0;
	if (found->wanted != 0 ? capture->number == found->wanted
	                       : found->held == 1 && capture->counters.blocks > 0)
		read_keep(found, capture, record);
	else if (record != NULL)
		record_free(record);
	if (found->visitor != NULL && found->held > 1)
		found->visitor->wanted = 0;
	return 0;
}

static void read_forget(struct found *found)
{
	if (found->has_record)
		record_free(&found->record);
	*found = (struct found){.wanted = found->wanted};
}

/* The bytes that the index names, if what they hold is what it says. */
static bool read_span(struct log_file *log, struct found *found)
{
	const struct log_capture indexed = found->capture;
	struct found span = {.wanted = 1};
	struct log_visitor visitor = {.context = &span, .wanted = 1, .capture = read_find};
	struct log_contents contents;
	char message[READ_MESSAGE_MAX];
	int error = log_walk(log, indexed.from, indexed.to, &visitor, &contents, message);

	if (error || !span.found || !log_capture_equal(&span.capture, &indexed)) {
		read_forget(&span);
		return false;
	}
	read_keep(found, &indexed, span.has_record ? &span.record : NULL);
	if (!found->has_record)
		return true;
	/* of a log in blocks the index may be older than the damage */
	if (log->blocks == NULL || found->record.counters.corrupt < indexed.counters.corrupt)
		found->record.counters.corrupt = indexed.counters.corrupt;
	if (found->record.time_s == log_capture_time_s(&span.capture)) /* no other is told */
		found->record.time_s = log_capture_time_s(&indexed);
	return true;
}

static bool find_in_index(struct log_file *log, struct found *found)
{
	struct log_visitor visitor = {.context = found, .capture = read_find};
	FILE *index = log_index_open(log);
	bool done = false;

	if (index == NULL)
		return false;
	if (log_index_visit(index, log, &visitor) == 0)
		done = !found->found || read_span(log, found);
	fclose(index);
	if (!done)
		read_forget(found);
	return done;
}

static int read_find_drop(struct log_file *log, struct found *found, char *message)
{
	struct log_visitor visitor = {.context = found, .wanted = found->wanted, .capture = read_find};
	struct log_contents contents;
	int error;

	if (find_in_index(log, found))
		return 0;
	error = log_index_walk(log, &visitor, &contents, message);
	return error == 0 && contents.captures == 0 ? refuse_empty(log, &contents, message) : error;
}

static int find_only(struct log_file *log, struct found *found, char *message)
{
	struct log_visitor visitor = {.context = found, .wanted = LOG_EVERY, .capture = read_find};
	struct log_contents contents;
	int error;

	found->visitor = &visitor;
	error = log_walk(log, 0, log->size, &visitor, &contents, message);
	if (error == 0 && found->held > 1)
		return source_refuse(
		        message, DT_E_ARGUMENT, log->file, 0,
		        "%u drops, expected one: 'droptower analyze --list' shows them, --drop N "
		        "takes one",
		        found->all);
	return error == 0 && found->held == 0 ? refuse_empty(log, &contents, message) : error;
}

static int read_of_log(struct record *record, struct log_file *log, unsigned number, char *message)
{
	struct found found = {.wanted = number};
	int error = number != 0 ? read_find_drop(log, &found, message) : find_only(log, &found, message);

	if (error == 0 && !found.found)
		error = source_refuse(message, DT_E_ARGUMENT, log->file, 0,
		                      found.all == 1 ? "no drop %u, %u is there" : "no drop %u, %u are there",
		                      number, found.all);
	if (error == 0 && !found.has_record)
		error = source_refuse(message, DT_E_EMPTY, log->file, 0, "drop %u: no block of it", number);
	if (error != 0) {
		read_forget(&found);
		return error;
	}
	*record = found.record;
	name_record(log, &found.capture, record);
	return 0;
}

int read_nth(struct record *record, const char *file, const char *columns, unsigned number,
             char message[READ_MESSAGE_MAX])
{
	struct log_file log;
	int error = open_recording(&log, file, columns, message);

	if (error)
		return error;
	if (log_is(&log))
		error = read_of_log(record, &log, number, message);
	else if (number > 1)
		error = source_refuse(message, DT_E_ARGUMENT, file, 0, "no drop %u, 1 is there", number);
	else
		error = read_one_record(record, &log, columns, message);
	log_file_close(&log);
	return error;
}

int read_record(struct record *record, const char *file, const char *columns, char message[READ_MESSAGE_MAX])
{
	return read_nth(record, file, columns, 0, message);
}

/* ---- all of them, without samples ---- */

static int list_one(struct log_file *log, struct log_visitor *visitor, char *message)
{
	struct log_capture capture = {.number = 1, .alone = true, .to = log->size};
	struct record record;
	int error = read_one_record(&record, log, NULL, message);

	if (error)
		return error;
	if (!record.is_drop)
		error = source_refuse(message, DT_E_EMPTY, log->file, 0, "no drop of the tower");
	else
		log_capture_of_record(&record, &capture);
	record_free(&record);
	return error ? error : visitor->capture(visitor->context, &capture, NULL);
}

static int list_log(struct log_file *log, struct log_visitor *visitor, char *message)
{
	struct log_contents contents;
	FILE *index = log_index_open(log);
	int result;

	if (index == NULL) {
		result = log_index_walk(log, visitor, &contents, message);
		return result == 0 && contents.captures == 0 ? refuse_empty(log, &contents, message) : result;
	}
	result = log_index_visit(index, log, visitor);
	fclose(index);
	if (result == DT_E_FORMAT)
		source_refuse(message, result, log->file, 0, "its index holds a line that is none");
	return result;
}

int read_list(const char *file, struct log_visitor *visitor, char message[READ_MESSAGE_MAX])
{
	struct log_file log;
	int result = open_recording(&log, file, NULL, message);

	if (result)
		return result;
	result = log_is(&log) ? list_log(&log, visitor, message) : list_one(&log, visitor, message);
	log_file_close(&log);
	return result;
}
