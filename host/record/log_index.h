/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_LOG_INDEX_H
#define DT_HOST_RECORD_LOG_INDEX_H
/*
 * LOG.index: what a walk of a large log found, so that one capture of it is read without the others. A text
 * file beside the log. It is believed only when it is whole (a SHA-256 at its end), made by this version of
 * the program, and of this log: size, time of change and a SHA-256 of head and tail. It only says where to
 * look: whoever reads a capture compares what comes with what the index said.
 *
 * A log below LOG_INDEX_LEAST bytes has none, and a folder that cannot be written is no error.
 */
#include <stdio.h>

#include "common/base/text.h"
#include "host/record/log_walk.h"

enum { LOG_INDEX_LEAST = 1 << 20 };

/* The index of a log if there is one to believe, in it or beside it, else NULL. Closed with fclose. */
FILE *log_index_open(struct log_file *log);

/* Calls the visitor for all that it holds, without records. 0, what the visitor returned, or DT_E_FORMAT. */
DT_MUST_USE int log_index_visit(FILE *index, const struct log_file *log, const struct log_visitor *visitor);

/* log_walk of all of the log, which leaves an index where one belongs. */
DT_MUST_USE int log_index_walk(struct log_file *log, struct log_visitor *visitor,
                               struct log_contents *contents, char message[READ_MESSAGE_MAX]);

/* What blocks.h is to take with the log: 0 with text->bytes to be freed, NULL for a log that needs none. */
DT_MUST_USE int log_index_text(struct log_file *log, struct text *text, char message[READ_MESSAGE_MAX]);

#endif
