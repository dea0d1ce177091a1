/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_TABLE_DATA_H
#define DT_HOST_RECORD_TABLE_DATA_H
/*
 * Numbers of a binary file as columns, before it is known what they are: with names, units and rates where
 * the file tells them. One road from there to a record, with --columns, a profile, or what the file tells
 * (sniff.h).
 *
 * Memory belongs to the table: table_data_free.
 */
#include "host/record/columns.h"
#include "host/record/source.h"

/* Numbers as they stand in files. */
enum bytes_kind {
	BYTES_I8,
	BYTES_U8,
	BYTES_I16,
	BYTES_U16,
	BYTES_I24,
	BYTES_I32,
	BYTES_U32,
	BYTES_I64,
	BYTES_U64,
	BYTES_F32,
	BYTES_F64
};

/* Numbers that stay where they are: k at data + k * stride, of which zero is taken and which full divides. */
struct bytes_view {
	const char *data; /* at any address */
	size_t stride;
	enum bytes_kind kind;
	bool big; /* the highest byte first */
	double zero, full;
};

struct table_column {
	char name[64], unit[32]; /* "" where not told */
	double rate_hz, start_s; /* rate 0 where not told */
	bool rate_open;          /* the rate tells no unit: as if in Hz */
	bool timed;              /* a time column stands beside it, which a rate must agree with */
	bool uneven;             /* samples lie up to half a step off their grid */
	bool gaps;               /* what is no number was not recorded */
	bool exact;              /* doubles in the file: times are good to their last bits */
	char doubt[100];         /* why it needs --columns if it is a channel; "" where it does not */
	size_t count;
	struct bytes_view view; /* of count numbers: of the file, or of value */
	double *value;          /* [count], the table's own; NULL where the file has them */
};

struct table_data {
	const char *format; /* of the record: "npy" */
	struct table_column *column;
	size_t count;
	char left_out[120]; /* what the file holds besides, told in read_as */
	struct source made; /* what a helper made of the file, where views point into that */
};

/* Another column with room for values of its own; NULL without memory. The pointer is valid until the next
 * call. */
struct table_column *table_data_add(struct table_data *table, size_t count);
void table_data_free(struct table_data *table);

/* The same of numbers that outlive the table, full 0 for 1. */
struct table_column *table_data_view(struct table_data *table, size_t count, struct bytes_view view);

/* So many numbers of a column, from one on. */
void table_column_take(const struct table_column *column, size_t from, size_t count, double *value);

/* *record is initialised by the call. */
DT_MUST_USE int table_data_record(const struct table_data *table, struct record *record,
                                  const struct source *source, const char *columns,
                                  char message[READ_MESSAGE_MAX]);

/* The formats that end as a table: NumPy array, WAV, TDMS, ground motion of PEER, ISO 13499, MAT, IDE. NULL
 * where it is none. */
typedef int table_reader(struct table_data *table, const struct source *source,
                         char message[READ_MESSAGE_MAX]);
table_reader *table_reader_of(const struct source *source);
table_reader read_npy, read_wav, read_tdms, read_at2, read_mme, read_mat, read_ide;
bool at2_is(const struct source *source);
bool mme_is(const struct source *source);
bool mat_is(const struct source *source);

size_t bytes_size(enum bytes_kind kind);
double bytes_value(const char *at, enum bytes_kind kind, bool big);
uint64_t bytes_whole(const char *at, size_t size, bool big);

#endif
