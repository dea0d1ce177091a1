/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_COLUMNS_H
#define DT_HOST_RECORD_COLUMNS_H
/*
 * What --columns says: one entry per column of a text file, "time:ms,fixture:g,board:-g,-". The syntax is
 * told in read.h.
 */
#include "host/record/read.h"
#include "host/record/unit.h"

enum { COLUMNS_MAX = 256 };

enum column_kind {
	COLUMN_SKIP,
	COLUMN_TIME,
	COLUMN_CHANNEL,
};

struct column {
	enum column_kind kind;
	char name[32];
	const struct unit *unit;
	double divisor;  /* number in the file / divisor = s or g, with the sign asked for */
	bool has_factor; /* "g*10": the user says how many units a number is */
	bool is_clock;   /* h:m:s, with a date or without; divisor 1 */
};

struct columns {
	struct column column[COLUMNS_MAX];
	size_t count;
	size_t channels;
	bool has_time;
	double rate_hz; /* 0 = not said */
};

/* 0 or DT_E_ARGUMENT with a line in message. */
DT_MUST_USE int columns_parse(struct columns *columns, const char *text, char message[READ_MESSAGE_MAX]);

/* The same as text, as much as fits. */
void columns_text(const struct columns *columns, char *text, size_t size);

#endif
