/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_UFF58_TEXT_H
#define DT_HOST_RECORD_UFF58_TEXT_H
/*
 * The text of a universal file: its lines, the fields in their fixed columns, and head and numbers of a
 * dataset 58, as they stand there. What becomes of them is read_uff58's business.
 *
 * A text borrows its source. What is wrong is told in the text's message; returns are 0 or DT_E_*.
 */
#include "host/record/uff58.h"

struct uff58_text {
	const struct source *source;
	struct source_line line; /* the one read last */
	char *message;
};

#define UFF58_REFUSE(text, code, ...) \
	source_refuse((text)->message, code, (text)->source->file, (text)->line.number, __VA_ARGS__)

enum { UFF58_ID_LINES = 5 };

/* The head of one dataset. */
struct uff58_head {
	uint64_t line; /* of the first identification */
	char id[UFF58_ID_LINES][UFF58_ID_CHARS + 1];
	int function, node, direction; /* record 6 */
	int precision;                 /* record 7 */
	size_t count;
	bool even;
	double start, step;
	char time_unit[21]; /* record 8 */
	int quantity;       /* record 9 */
	char unit[21];
};

/* The characters of a field without the blanks around it; "" where the line has ended. */
void uff58_take(const struct source_line *line, size_t first, size_t width, char *field, size_t size);

/* The line that begins and ends a dataset. */
bool uff58_is_delimiter(const struct source_line *line);

/* what: is expected there. */
DT_MUST_USE int uff58_next_line(struct uff58_text *text, const char *what);

/* To the end of the dataset. */
DT_MUST_USE int uff58_skip_dataset(struct uff58_text *text);

DT_MUST_USE int uff58_read_head(struct uff58_text *text, struct uff58_head *head);

/* What the first line of a dataset 58b says of its numbers. */
struct uff58_binary {
	bool big;
	size_t bytes; /* behind the head's lines */
};

/* Of the line read last. Other than IEEE numbers behind eleven lines are refused. */
DT_MUST_USE int uff58_read_binary(struct uff58_text *text, struct uff58_binary *binary);

/* As uff58_read_data, of the bytes behind the head; evenly spaced only. */
DT_MUST_USE int uff58_read_bytes(struct uff58_text *text, const struct uff58_head *head,
                                 const struct uff58_binary *binary, double *value);

/* Behind the bytes, wherever the line read last was. */
void uff58_skip_bytes(struct uff58_text *text, size_t data, const struct uff58_binary *binary);

/* head->count values; time_s only for uneven spacing, else NULL. */
DT_MUST_USE int uff58_read_data(struct uff58_text *text, const struct uff58_head *head, double *value,
                                double *time_s);

#endif
