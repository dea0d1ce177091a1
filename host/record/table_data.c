/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/table_data.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/base/mapped.h"
#include "host/record/assume.h"
#include "host/record/ide.h"
#include "host/record/profile.h"
#include "host/record/sniff.h"
#include "host/record/timebase.h"

/* A rate the user gives may be off the file's by this part. */
static const double RATE_PART = 0.01;

/* ---- numbers ---- */

size_t bytes_size(enum bytes_kind kind)
{
	static const size_t sizes[] = {1, 1, 2, 2, 3, 4, 4, 8, 8, 4, 8};

	return sizes[kind];
}

uint64_t bytes_whole(const char *at, size_t size, bool big)
{
	uint64_t value = 0;

	for (size_t i = 0; i < size; i++)
		value = value << 8 | (unsigned char)at[big ? i : size - 1 - i];
	return value;
}

double bytes_value(const char *at, enum bytes_kind kind, bool big)
{
	uint64_t bits = bytes_whole(at, bytes_size(kind), big);
	uint32_t low = (uint32_t)bits;
	float single;
	double value;

	switch (kind) {
	case BYTES_F32:
		memcpy(&single, &low, sizeof(single));
		return (double)single;
	case BYTES_F64:
		memcpy(&value, &bits, sizeof(value));
		return value;
	case BYTES_I8:
		return (double)(int8_t)bits;
	case BYTES_I16:
		return (double)(int16_t)bits;
	case BYTES_I24:
		return (double)((int32_t)(low << 8) / 256);
	case BYTES_I32:
		return (double)(int32_t)low;
	case BYTES_I64:
		return (double)(int64_t)bits;
	default:
		return (double)bits;
	}
}

/* ---- a table ---- */

struct table_column *table_data_view(struct table_data *table, size_t count, struct bytes_view view)
{
	struct table_column *more = realloc(table->column, (table->count + 1) * sizeof(*more));

	if (more == NULL)
		return NULL;
	table->column = more;
	more[table->count] = (struct table_column){.count = count, .view = view};
	return &more[table->count++];
}

struct table_column *table_data_add(struct table_data *table, size_t count)
{
	double *value = mapped_array(count, sizeof(*value));
	const struct bytes_view view = {
	        (const char *)value, sizeof(*value), BYTES_F64, __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__, 0, 0};
	struct table_column *column = value != NULL ? table_data_view(table, count, view) : NULL;

	if (column != NULL)
		column->value = value;
	else
		mapped_free(value);
	return column;
}

/* A power of two divides as its inverse multiplies. */
static void table_column_scale(const struct bytes_view *view, size_t count, double *value)
{
	int exponent;
	bool whole = frexp(view->full, &exponent) <= 0.5;
	double part = 1 / view->full, zero = view->zero;

	if (!(view->full > 0))
		return;
	for (size_t k = 0; k < count && whole; k++)
		value[k] = (value[k] - zero) * part;
	for (size_t k = 0; k < count && !whole; k++)
		value[k] = (value[k] - zero) / view->full;
}

#define TAKE(type)                                                \
	for (size_t k = 0; k < count; k++) {                      \
		type number;                                      \
                                                                  \
		memcpy(&number, at + k * stride, sizeof(number)); \
		value[k] = (double)number;                        \
	}

void table_column_take(const struct table_column *column, size_t from, size_t count, double *value)
{
	const struct bytes_view *view = &column->view;
	const char *at = view->data + from * view->stride;
	const size_t stride = view->stride;

	if (view->kind == BYTES_F64 && view->big == (__BYTE_ORDER__ == __ORDER_BIG_ENDIAN__)) {
		TAKE(double)
	} else if (view->kind == BYTES_F32 && view->big == (__BYTE_ORDER__ == __ORDER_BIG_ENDIAN__)) {
		TAKE(float)
	} else if (view->kind == BYTES_I16 && view->big == (__BYTE_ORDER__ == __ORDER_BIG_ENDIAN__)) {
		TAKE(int16_t)
	} else {
		for (size_t k = 0; k < count; k++)
			value[k] = bytes_value(at + k * stride, view->kind, view->big);
	}
	table_column_scale(view, count, value);
	mapped_seen(count * stride);
}

void table_data_free(struct table_data *table)
{
	for (size_t i = 0; i < table->count; i++)
		mapped_free(table->column[i].value);
	free(table->column);
	source_free(&table->made);
	*table = (struct table_data){.format = NULL};
}

/* ---- to a record ---- */

struct making {
	const struct table_data *table;
	const struct source *source;
	struct record *record;
	struct columns columns;
	struct timebase timebase;
	bool sniffed;
	size_t time; /* column; beyond the last: none */
	char *message;
};

static size_t part_of(size_t count, size_t from)
{
	return count - from < RECORD_PART ? count - from : RECORD_PART;
}

static int make_time(struct making *making)
{
	const struct column *spec = &making->columns.column[making->time];
	const struct table_column *column = &making->table->column[making->time];
	double *time_s = mapped_array(column->count, sizeof(*time_s)), largest = 0;
	struct timebase_fault fault;
	int error = 0;

	if (time_s == NULL)
		return source_no_memory(making->message, making->source->file);
	for (size_t k = 0; k < column->count; k++) {
		if (k % RECORD_PART == 0)
			table_column_take(column, k, part_of(column->count, k), time_s + k);
		time_s[k] /= spec->divisor;
		largest = fmax(largest, fabs(time_s[k]));
		if (!isfinite(time_s[k]))
			error = source_refuse(making->message, DT_E_FORMAT, making->source->file, 0,
			                      "time of row %zu is no number", k + 1);
	}
	if (!error && column->count < 2)
		error = source_refuse(making->message, DT_E_FORMAT, making->source->file, 0,
		                      "%zu rows, expected more", column->count);
	if (!error) {
		error = timebase_find(time_s, column->count,
		                      largest * (column->exact ? DBL_EPSILON : (double)FLT_EPSILON), 0,
		                      &making->timebase, &fault);
		if (error)
			source_refuse(making->message, error, making->source->file, 0, "row %zu: %s",
			              fault.row + 1, error == DT_E_MEMORY ? error_text(error) : fault.why);
	}
	mapped_free(time_s);
	return error;
}

static int refuse_rate(const struct making *making, const struct table_column *column)
{
	return source_refuse(making->message, DT_E_FORMAT, making->source->file, 0,
	                     "tells a rate of %.9g Hz, but --columns %.9g Hz, expected one", column->rate_hz,
	                     making->columns.rate_hz);
}

/* By the time column; what tells a rate of its own, and has no time beside it, is not. */
static bool is_timed(const struct making *making, const struct table_column *column)
{
	return making->time < making->table->count &&
	       (!making->sniffed || column->timed || !(column->rate_hz > 0));
}

static int make_channel(struct making *making, size_t i)
{
	const struct column *spec = &making->columns.column[i];
	const struct table_column *column = &making->table->column[i];
	bool timed = is_timed(making, column), open = column->rate_open && !making->sniffed;
	double rate_hz = timed                         ? 1 / making->timebase.step_s
	                 : making->columns.rate_hz > 0 ? making->columns.rate_hz
	                 : open                        ? 0
	                                               : column->rate_hz;
	struct channel *channel;

	if (column->rate_hz > 0 && !column->rate_open && making->columns.rate_hz > 0 &&
	    fabs(column->rate_hz / making->columns.rate_hz - 1) > RATE_PART)
		return refuse_rate(making, column);
	if (!(rate_hz > 0) || !isfinite(rate_hz))
		return source_refuse(
		        making->message, DT_E_ARGUMENT, making->source->file, 0,
		        "tells no rate and has no time column, expected --columns \"%s:g@RATE_HZ\"",
		        spec->name);
	if (column->count < 2 || (timed && column->count != making->table->column[making->time].count))
		return source_refuse(
		        making->message, DT_E_FORMAT, making->source->file, 0,
		        "%s has %zu samples, expected as many as there are times, and two or more",
		        spec->name, column->count);
	channel = record_add_room(making->record, spec->name, rate_hz, column->count);
	if (channel == NULL)
		return source_no_memory(making->message, making->source->file);
	channel->start_s = timed ? 0 : column->start_s;
	channel->flags = (timed ? making->timebase.uneven : column->uneven) ? RECORD_FLAG_UNEVEN : 0;
	for (size_t k = 0; k < column->count; k++) {
		bool good;

		if (k % RECORD_PART == 0)
			table_column_take(column, k, part_of(column->count, k), channel->value_g + k);
		record_seen(k, sizeof(double) + 1);
		channel->value_g[k] /= spec->divisor;
		good = isfinite(channel->value_g[k]);
		channel->value_g[k] = good ? channel->value_g[k] : NAN;
		channel->sample[k] = good ? 0 : column->gaps ? SAMPLE_LOST : SAMPLE_BAD;
	}
	if (timed && timebase_spread(&making->timebase, channel) != 0)
		return source_no_memory(making->message, making->source->file);
	return 0;
}

static int make_all(struct making *making)
{
	int error = 0;

	making->time = making->table->count;
	for (size_t i = 0; i < making->columns.count; i++)
		if (making->columns.column[i].kind == COLUMN_TIME)
			making->time = i;
	if (making->time < making->table->count)
		error = make_time(making);
	for (size_t i = 0; i < making->columns.count && !error; i++)
		if (making->columns.column[i].kind == COLUMN_CHANNEL)
			error = make_channel(making, i);
	timebase_free(&making->timebase);
	return error;
}

/* ---- what the table tells of itself ---- */

/* A rate told beside a time column is that of its steps; an open one in some unit. The times are divided by
 * divisor. */
static bool rate_agrees(const struct table_column *column, double step_s)
{
	double part = column->rate_hz * step_s;

	for (double unit = 1; unit <= (column->rate_open ? 1e6 : 1); unit *= 1e3)
		if (fabs(part * unit - 1) <= RATE_PART)
			return true;
	return false;
}

/* The unit of a time column that tells none, where a rate tells it. */
static double divisor_by_rate(const struct making *making)
{
	double step = making->timebase.step_s;

	for (size_t i = 0; i < making->table->count; i++) {
		const struct table_column *column = &making->table->column[i];

		for (double divisor = 1;
		     column->timed && column->rate_hz > 0 && !column->rate_open && divisor < 1e10;
		     divisor *= 1e3)
			if (fabs(column->rate_hz * step / divisor - 1) <= RATE_PART)
				return divisor;
	}
	return 0;
}

static void apply_assumed(struct making *making, const struct assumed *assumed, bool to_timed)
{
	struct record *record = making->record;
	struct channel *channel = record->channels;
	char *text = record->read_as;
	size_t used = strlen(text);

	if (assumed->unit != NULL)
		snprintf(text + used, sizeof(record->read_as) - used, "; assumed: %s in %s",
		         to_timed ? "time" : "rate", assumed->unit);
	for (size_t i = 0; i < making->columns.count; i++) {
		const struct table_column *column = &making->table->column[i];

		if (making->columns.column[i].kind != COLUMN_CHANNEL)
			continue;
		if (to_timed ? is_timed(making, column) : !is_timed(making, column) && column->rate_open) {
			channel->rate_hz *= assumed->divisor;
			channel->flags |= assumed->unit != NULL ? RECORD_FLAG_ASSUMED : 0;
		}
		channel++;
	}
}

static int settle_time_unit(struct making *making)
{
	struct assumed assumed = {.divisor = divisor_by_rate(making)};
	int error = assumed.divisor > 0 ? 0
	                                : assume_unit(&assumed, making->record, making->timebase.step_s,
	                                              false, making->source->file, making->message);

	if (error)
		return error;
	apply_assumed(making, &assumed, true);
	making->timebase.step_s /= assumed.divisor;
	return 0;
}

/* The rates that tell no unit are one number. */
static int settle_rate_unit(struct making *making)
{
	double rate = 0;
	struct assumed assumed;
	int error;

	for (size_t i = 0; i < making->columns.count; i++) {
		const struct table_column *column = &making->table->column[i];

		if (making->columns.column[i].kind != COLUMN_CHANNEL || !column->rate_open ||
		    is_timed(making, column))
			continue;
		if (rate > 0 && fabs(column->rate_hz / rate - 1) > 1e-9)
			return source_refuse(making->message, DT_E_FORMAT, making->source->file, 0,
			                     "rates %.9g and %.9g tell no unit, expected --columns", rate,
			                     column->rate_hz);
		rate = column->rate_hz;
	}
	if (!(rate > 0))
		return 0;
	error = assume_unit(&assumed, making->record, 1 / rate, true, making->source->file, making->message);
	if (!error)
		apply_assumed(making, &assumed, false);
	return error;
}

static int refuse_doubt(const struct making *making, const struct table_column *column)
{
	struct columns *columns = malloc(sizeof(*columns));
	char spec[200] = "";

	if (columns != NULL) {
		*columns = making->columns;
		columns->rate_hz = columns->has_time ? 0 : column->rate_hz;
		columns_text(columns, spec, sizeof(spec));
	}
	free(columns);
	return source_refuse(making->message, DT_E_FORMAT, making->source->file, 0,
	                     "%s: %s, expected --columns, as \"%s\"", column->name, column->doubt, spec);
}

static int check_told(const struct making *making)
{
	for (size_t i = 0; i < making->columns.count; i++) {
		const struct table_column *column = &making->table->column[i];

		if (making->columns.column[i].kind != COLUMN_CHANNEL)
			continue;
		if (column->doubt[0] != '\0')
			return refuse_doubt(making, column);
		if (making->record->channel_count > 0 && column->rate_hz > 0 && is_timed(making, column) &&
		    !rate_agrees(column, making->timebase.step_s))
			return source_refuse(
			        making->message, DT_E_FORMAT, making->source->file, 0,
			        "%s: tells a rate of %.9g Hz, but its time column steps by %.9g s "
			        "(%.9g Hz), expected one: --columns with time:s, or name:g@%.9g",
			        column->name, column->rate_hz, making->timebase.step_s,
			        1 / making->timebase.step_s, column->rate_hz);
	}
	return 0;
}

static int sniff_table(struct making *making, struct sniff *sniff, struct piece *units)
{
	const struct table_data *table = making->table;
	bool has_rate = true;

	for (size_t i = 0; i < table->count; i++) {
		sniff->name[i] = (struct piece){table->column[i].name, strlen(table->column[i].name)};
		units[i] = (struct piece){table->column[i].unit, strlen(table->column[i].unit)};
		has_rate &= table->column[i].rate_hz > 0 && !table->column[i].timed;
	}
	return sniff_names(sniff, table->count, units, has_rate, making->source->file, making->message);
}

static int make_told(struct making *making, const struct sniff *sniff)
{
	char *text = making->record->read_as;
	int error;

	making->columns = sniff->columns;
	sniff_tell(sniff, NULL, text, sizeof(making->record->read_as));
	if (making->table->left_out[0] != '\0')
		snprintf(text + strlen(text), sizeof(making->record->read_as) - strlen(text), "; left out %s",
		         making->table->left_out);
	error = check_told(making);
	if (!error)
		error = make_all(making);
	if (!error && sniff->time_unit_open)
		error = settle_time_unit(making);
	if (!error)
		error = settle_rate_unit(making);
	return error ? error : check_told(making);
}

static int make_sniffed(struct making *making)
{
	struct sniff *sniff = calloc(1, sizeof(*sniff));
	struct piece *units = calloc(making->table->count + 1, sizeof(*units));
	size_t used;
	int error =
	        sniff == NULL || units == NULL ? source_no_memory(making->message, making->source->file) : 0;

	making->sniffed = true;
	if (!error) {
		error = sniff_table(making, sniff, units);
		used = strlen(making->message);
		if (error && making->table->left_out[0] != '\0')
			snprintf(making->message + used, READ_MESSAGE_MAX - used, "; left out %s",
			         making->table->left_out);
	}
	if (!error)
		error = make_told(making, sniff);
	free(sniff);
	free(units);
	return error;
}

static int make_named(struct making *making, const char *columns)
{
	int error = columns_parse(&making->columns, columns, making->message);

	if (!error && making->columns.count != making->table->count)
		error = source_refuse(making->message, DT_E_FORMAT, making->source->file, 0,
		                      "%zu columns, expected %zu as --columns says", making->table->count,
		                      making->columns.count);
	return error ? error : make_all(making);
}

static int make_by(struct making *making, const char *columns)
{
	struct profile *profile;
	int error = profile_of(&profile, making->source->file, columns, making->message);

	if (!error && profile != NULL)
		columns = profile->columns;
	if (!error)
		error = columns != NULL ? make_named(making, columns) : make_sniffed(making);
	if (!error && profile != NULL)
		snprintf(making->record->read_as, sizeof(making->record->read_as),
		         "profile %.100s says: %.250s", profile->path, profile->columns);
	free(profile);
	return error;
}

int table_data_record(const struct table_data *table, struct record *record, const struct source *source,
                      const char *columns, char message[READ_MESSAGE_MAX])
{
	struct record filled;
	struct making *making = calloc(1, sizeof(*making));
	int error;

	if (making == NULL)
		return source_no_memory(message, source->file);
	*making = (struct making){.table = table, .source = source, .record = &filled, .message = message};
	record_init(&filled);
	if (table->count == 0 || table->count > COLUMNS_MAX)
		error = source_refuse(message, DT_E_FORMAT, source->file, 0, "%zu columns, expected 1 to %d",
		                      table->count, COLUMNS_MAX);
	else
		error = make_by(making, columns);
	free(making);
	if (error) {
		record_free(&filled);
		return error;
	}
	strcpy(filled.format, table->format);
	record_begin_at_zero(&filled);
	record_finish(&filled);
	*record = filled;
	return 0;
}

table_reader *table_reader_of(const struct source *source)
{
	static const struct {
		const char *magic;
		size_t length;
		table_reader *reader;
	} readers[] = {{"\x93NUMPY", 6, read_npy},
	               {"RIFF", 4, read_wav},
	               {"RF64", 4, read_wav},
	               {"TDSm", 4, read_tdms}};

	for (size_t i = 0; i < sizeof(readers) / sizeof(readers[0]); i++)
		if (source->size > readers[i].length &&
		    memcmp(source->bytes, readers[i].magic, readers[i].length) == 0 &&
		    source_is_binary(source->bytes, source->size))
			return readers[i].reader;
	return ide_is(source)   ? read_ide
	       : at2_is(source) ? read_at2
	       : mme_is(source) ? read_mme
	       : mat_is(source) ? read_mat
	                        : NULL;
}
