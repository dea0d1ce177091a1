/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_HEADER_H
#define DT_HOST_RECORD_HEADER_H
/*
 * What delimited text says of its columns above its first row of numbers: names, units in or below them. They
 * are held against what the user says, which they must not contradict.
 *
 * Lines are borrowed from the source.
 */
#include "host/record/cells.h"
#include "host/record/columns.h"
#include "host/record/source.h"

struct header {
	struct cells names, units; /* count 0: there is no such line */
	uint64_t names_line, units_line;
	struct cells work;
};

/* Takes a line that is no row of numbers, a comment too, for names or units if it has one for each column. */
void header_offer(struct header *header, struct cells_style style, const struct columns *columns,
                  const struct source_line *line);

/* Refuses a unit that is not the one the user names. DT_E_FORMAT with a message. */
DT_MUST_USE int header_check(const struct header *header, const struct columns *columns, const char *file,
                             char message[READ_MESSAGE_MAX]);

/* The same for a unit that is known from elsewhere. */
DT_MUST_USE int header_check_unit(const struct columns *columns, size_t i, struct piece said,
                                  const struct unit *unit, const char *file, uint64_t line,
                                  char message[READ_MESSAGE_MAX]);

/* Whether two channels have one name in the file. */
bool header_has_twins(const struct header *header, const struct columns *columns);

#endif
