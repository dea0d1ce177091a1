/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/console/hold.h"

#include <stdio.h>
#include <string.h>

bool hold_taken(struct hold *hold, int64_t now_ms)
{
	if (now_ms >= hold->until_ms)
		hold->console[0] = '\0';
	return hold->console[0] != '\0';
}

bool hold_mine(struct hold *hold, const char *console, int64_t now_ms)
{
	return hold_taken(hold, now_ms) && strcmp(hold->console, console) == 0;
}

bool hold_take(struct hold *hold, const char *console, int64_t now_ms)
{
	if (console[0] == '\0' || (hold_taken(hold, now_ms) && strcmp(hold->console, console) != 0))
		return false;
	snprintf(hold->console, sizeof(hold->console), "%s", console);
	hold->until_ms = now_ms + HOLD_MS;
	return true;
}

void hold_give(struct hold *hold, const char *console)
{
	if (strcmp(hold->console, console) == 0)
		hold->console[0] = '\0';
}
