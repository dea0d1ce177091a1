/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_REPORT_LABORATORY_H
#define DT_HOST_REPORT_LABORATORY_H
/*
 * A laboratory's profile for one report, from an .ini file: who, for whom, what, how. Its keys
 * stand in laboratory.def; the sensors have files of their own (host/sensor). Dates are YYYY-MM-DD.
 */
#include <stdbool.h>

#include "common/scenes/settings.h"

enum { LABORATORY_TEXT_MAX = 190 };

enum laboratory_field {
#define LABORATORY_FIELD(section, key, ...) LABORATORY_##section##_##key,
#include "host/report/laboratory.def"
#undef LABORATORY_FIELD
	LABORATORY_FIELDS
};

struct laboratory_row {
	const char *section, *key, *clause;
	bool needed;
	const char *label;
};
extern const struct laboratory_row laboratory_rows[LABORATORY_FIELDS];

struct laboratory {
	char text[LABORATORY_FIELDS][LABORATORY_TEXT_MAX + 1]; /* "" is not given */
};

/* 0, or DT_E_* with "FILE:LINE: ..." in message. */
DT_MUST_USE int laboratory_read(struct laboratory *laboratory, const char *file,
                                char message[SETTINGS_MESSAGE_MAX]);

/* How many needed fields are not given. */
unsigned laboratory_missing(const struct laboratory *laboratory);

#endif
