/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CONSOLE_HOLD_H
#define DT_HOST_CONSOLE_HOLD_H
/*
 * Who holds the arm: one console at a time, for as long as it keeps saying so. A page that hangs, is closed
 * or falls asleep loses it by itself. One thread.
 */
#include <stdbool.h>
#include <stdint.h>

enum { HOLD_CONSOLE_MAX = 64, HOLD_MS = 6000 };

struct hold {
	char console[HOLD_CONSOLE_MAX + 1]; /* "": nobody */
	int64_t until_ms;
};

bool hold_taken(struct hold *hold, int64_t now_ms);
bool hold_mine(struct hold *hold, const char *console, int64_t now_ms);

/* Takes or renews; false when another console holds it. */
bool hold_take(struct hold *hold, const char *console, int64_t now_ms);
/* Gives it back, when it is this console's. */
void hold_give(struct hold *hold, const char *console);

#endif
