/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_COMMON_SCENES_SETTINGS_H
#define DT_COMMON_SCENES_SETTINGS_H
/*
 * The front of every .ini file: reads it entry by entry and says what is wrong in one line, "FILE:LINE: what,
 * expected what". What the entries mean is the caller's. Linux side only.
 *
 * A reader puts struct settings first in a struct of its own, sets file, message and entry, and calls
 * settings_read; entry gets the same pointer back and returns 1, or what settings_fail returned. No heap.
 */
#include <stdbool.h>
#include <stdio.h>

#include "common/error.h"

enum { SETTINGS_MESSAGE_MAX = 512 };

struct settings {
	const char *file;
	char *message; /* of SETTINGS_MESSAGE_MAX */
	int (*entry)(struct settings *settings, const char *section, const char *name, const char *value);
	/* the reader's own */
	FILE *in;
	int line;   /* of the present entry */
	int result; /* of settings_fail */
};

/* 0, or DT_E_* with the message written. */
DT_MUST_USE int settings_read(struct settings *settings);

/* Ends the reading; returns 0 for entry to return. */
__attribute__((format(printf, 3, 4))) int settings_fail(struct settings *settings, int code,
                                                        const char *format, ...);

/* The same for what belongs to no line: returns code. */
__attribute__((format(printf, 3, 4))) int settings_refuse(const struct settings *settings, int code,
                                                          const char *format, ...);

#endif
