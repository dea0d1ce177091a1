/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_HDF5_H
#define DT_HOST_RECORD_HDF5_H
/*
 * HDF5 files, through the program droptower-hdf5 that stands beside this one: it turns HDF5 into our CSV and
 * back, standard input to standard output. A program of its own because the library is optional, because
 * loading it costs every start of droptower several milliseconds, and because a file that crashes the library
 * then ends the helper and not the reader. host/hdf5/README.md tells the layout.
 */
#include <stdio.h>

#include "host/record/source.h"

/* The signature is at 0, or behind somebody's head of 512, 1024, 2048 ... bytes. */
bool hdf5_is(const struct source *source);

/* Of ours, which names its channels itself, or of others (tree.h). Without the helper DT_E_UNKNOWN, and
 * message says what to install. */
DT_MUST_USE int read_hdf5(struct record *record, const struct source *source, const char *columns,
                          char message[READ_MESSAGE_MAX]);

/* As every writer, file being named in message only. */
DT_MUST_USE int write_hdf5(const struct record *record, FILE *out, const char *file,
                           char message[READ_MESSAGE_MAX]);

#endif
