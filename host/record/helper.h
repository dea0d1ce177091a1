/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_HELPER_H
#define DT_HOST_RECORD_HELPER_H
/*
 * A program of ours that stands beside this one and turns files of one library, standard input to standard
 * output. A program of its own because the library is optional, because loading it costs every start of
 * droptower several milliseconds, and because a file that crashes the library then ends the helper and not
 * the reader.
 */
#include <stdio.h>

#include "common/base/process.h"
#include "host/record/read.h"
#include "host/record/source.h"

struct helper {
	const char *program, *format; /* "droptower-hdf5", "HDF5" */
	const char *packages;         /* what it is built with: "libhdf5-dev and pkg-config" */
};

/* Its verb "read" on the source; what it gave is in streams, to be closed after success. Without it
 * DT_E_UNKNOWN, and message says what to install. */
DT_MUST_USE int helper_read(const struct helper *helper, const struct source *source,
                            struct process_streams *streams, char message[READ_MESSAGE_MAX]);

/* Its verb "write": our CSV of the record to what it gives, all of it to out. */
DT_MUST_USE int helper_write(const struct helper *helper, const struct record *record, FILE *out,
                             const char *file, char message[READ_MESSAGE_MAX]);

/* The main of such a program: `PROGRAM read`, a file of the library to standard output, and `PROGRAM write`,
 * our CSV to one. Its exit code; read and write have said what is wrong where they give no 0. */
int helper_serve(int argc, char **argv, const char *program, int (*read)(const struct source *source),
                 int (*write)(const struct record *record));

#endif
