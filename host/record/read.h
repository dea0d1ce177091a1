/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_READ_H
#define DT_HOST_RECORD_READ_H
/*
 * A file to a record, whatever its format: candump text, LCM event log, our CSV, a universal file (dataset
 * 58), HDF5 of ours, or delimited text with the columns named by the user. The format is found from the
 * content, not from the file's name.
 *
 * columns, as on the command line: "time:ms,fixture:g,board:-g,-" names one entry per column: name:unit;
 * '-' in front of the unit flips the sign; a lone '-' skips. Units: s ms us for time; g m/s2 for channels,
 * the latter as m/s^2 and with a raised 2, too. Blanks around names, units and entries are left out. The
 * first column named "time" is the time; without one, give "name:unit@RATE_HZ". Needed for foreign text,
 * refused for our own formats. NULL otherwise.
 *
 * 0, or DT_E_* with a one-line explanation in message: "T04.txt:17: 5 columns, expected 6". *record is
 * initialised by the call and must be freed only after success.
 */
#include "host/record/record.h"

enum { READ_MESSAGE_MAX = 512 };

DT_MUST_USE int read_record(struct record *record, const char *file, const char *columns,
                            char message[READ_MESSAGE_MAX]);

#endif
