/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_TREE_H
#define DT_HOST_RECORD_TREE_H
/*
 * What a file of named arrays holds (MAT, HDF5 of others), as its helper tells it: numbers, texts and what is
 * neither, each at a path like "test/board/acc". What is said of one array stands below its own path
 * ("test/board/acc/units": an attribute), what is said of several beside or above them ("test/fs": a field).
 *
 * From there to columns:
 *
 *     column  a vector of two numbers and more; each column of a matrix. Samples go down, or along the
 *             dimension that has as many as the time beside it, or more than there may be columns; a matrix
 *             of which both or neither is true is left out
 *     name    its own text "name" or "label"; of a matrix "names", "labels", "channels" ... with one for
 *             each; else the last of its path, or all of it where two are alike
 *     unit    "unit" or "units" of the array itself or named with it ("acc_units"); that of a folder goes to
 *             its only array, or to those that are named as accelerations
 *     rate    "fs", "sample rate", "dt" ... of the array itself, beside it or above it, the nearest; its unit
 *             in the name, in its own "units", or open (assume.h)
 *     start   "start_s", "t0_s" or "wf_start_offset", found as a rate is
 *     time    a vector that is named so; one that is there twice is taken once
 *
 * A factor or offset beside numbers, elements of an array of structs without names, and a column of a matrix
 * without names that only increases could be read in two ways: refused unless --columns says.
 *
 * A helper's bytes: the head, then for each entry its struct, its path with a NUL, and its data.
 */
#include <stdio.h>

#include "host/record/table_data.h"

#define TREE_HEAD "droptower tree 1\n"

enum tree_kind { TREE_NUMBERS, TREE_TEXT, TREE_OTHER };

struct tree_entry {
	uint64_t rows, columns;    /* of numbers */
	uint64_t bytes;            /* of data: doubles; a text of lines; what it is, in words */
	uint32_t path_bytes, kind; /* with the NUL; enum tree_kind */
	uint32_t single, by_rows;  /* numbers had 24 bits; the columns of a row stand together */
};

/* Puts an entry out; 0 or DT_E_SYSTEM. */
DT_MUST_USE int tree_put(FILE *out, const char *path, struct tree_entry entry, const void *data);
DT_MUST_USE int tree_put_text(FILE *out, const char *path, enum tree_kind kind, const char *text);

/* Whether that is what a helper gave. */
bool tree_is(const char *bytes, size_t size);

/* The columns of a helper's bytes; format goes to the record. */
DT_MUST_USE int read_tree(struct table_data *table, const char *format, const char *bytes, size_t size,
                          const struct source *source, char message[READ_MESSAGE_MAX]);

/* The same of all that a stream of process.h holds. */
DT_MUST_USE int read_tree_of(struct table_data *table, const char *format, int fd,
                             const struct source *source, char message[READ_MESSAGE_MAX]);

#endif
