/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CONSOLE_STATE_H
#define DT_HOST_CONSOLE_STATE_H
/*
 * What the page always shows, as JSON (README.md has its form), without who holds the arm: that differs from
 * page to page.
 */
#include <cjson/cJSON.h>

#include "host/console/live.h"
#include "host/console/tower.h"
#include "host/console/work.h"

struct state {
	struct tower_view tower;
	struct work_view work;
	struct live_view live;
};

/* Both views are of now; live's ages count from then, too. */
void state_look(struct state *state, struct tower *tower, struct work *work, struct live *live);

/* Something that a technician must see at once is not the same: not ages, rates or counters. */
bool state_changed(const struct state *before, const struct state *now);

/* To be deleted; NULL or not all of it without memory. */
cJSON *state_tree(const struct state *state);

/* The same as text. To be freed; NULL without memory. */
char *state_json(const struct state *state);

#endif
