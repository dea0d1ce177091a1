/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_READ_H
#define DT_HOST_RECORD_READ_H
/*
 * A file to a record, whatever its format: candump text, LCM event log, our CSV, a universal file (dataset
 * 58), HDF5 of ours, or delimited text with the columns named by the user. The format is found from the
 * content, not from the file's name.
 *
 * columns, as on the command line: "time:ms,fixture:g,board:-g,-" names one entry per column: name:unit;
 * '-' in front of the unit flips the sign; a lone '-' skips. Units: s ms us ns for time, clock for h:m:s and
 * dates with it; g kg (kilo-g) mg m/s2 ft/s2 and others for channels (unit.h), g*FACTOR, mV/(10.2mV/g) by a
 * sensitivity. Blanks around names, units and entries are left out. The first column named "time" is the
 * time; without one, give "name:unit@RATE_HZ". "@PATH" is a profile (profile.h). NULL: foreign text tells its
 * columns itself (sniff.h) or is refused; our own formats do, and refuse others.
 *
 * Whatever the format, the file may be compressed by gzip, zstd, xz, lz4 or bzip2 (unpack.h).
 *
 * 0, or DT_E_* with a one-line explanation in message: "T04.txt:17: 5 columns, expected 6". *record is
 * initialised by the call and must be freed only after success.
 */
#include "host/record/record.h"

struct log_capture;
struct log_visitor;

enum { READ_MESSAGE_MAX = 512 };

/* A log of several drops is refused: DT_E_ARGUMENT. */
DT_MUST_USE int read_record(struct record *record, const char *file, const char *columns,
                            char message[READ_MESSAGE_MAX]);

/* The drop of that number in its log, from 1; read_list tells what they are. 0: as read_record. Of a large
 * log an index beside it is used, or made (log_index.h). */
DT_MUST_USE int read_nth(struct record *record, const char *file, const char *columns, unsigned number,
                         char message[READ_MESSAGE_MAX]);

/* Calls each for every drop of a log, or once for any other recording, which has no capture (NULL). *record
 * belongs to who is called; it is NULL when no block of the drop is held. What each returns ends it if it is
 * not 0, and is returned. A recording without a drop is refused. */
DT_MUST_USE int read_each(const char *file, const char *columns,
                          int (*each)(void *context, const struct log_capture *capture,
                                      struct record *record),
                          void *context, char message[READ_MESSAGE_MAX]);

/* Calls the visitor for all that a log holds (log_walk.h), without records; a drop in another format is a
 * capture, too. */
DT_MUST_USE int read_list(const char *file, struct log_visitor *visitor, char message[READ_MESSAGE_MAX]);

#endif
