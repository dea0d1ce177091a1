/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_COMMAND_RELEASE_H
#define DT_HOST_COMMAND_RELEASE_H
/*
 * From a tower that was heard to a product that falls, as a person wants it: `run` and `ctl arm` share it.
 * The checks are listed as they change; one key acknowledges that guards were open, one arms, one releases
 * when the warning is over. Any other key, Ctrl-C, or a terminal that goes ends it, and disarms.
 *
 * Unattended the same steps are taken without a key: by somebody who said so, or with a tower of our own that
 * is simulated.
 */
#include <stdbool.h>
#include <stdint.h>

#include "host/session/session.h"

enum release_phase {
	RELEASE_HEARD,
	RELEASE_WAIT,
	RELEASE_GUARD,
	RELEASE_READY,
	RELEASE_WARNING,
	RELEASE_ARMED
};

struct release {
	/* given */
	struct session *session;
	bool unattended;
	void (*say)(void *user, const char *line); /* one line of progress */
	void *user;
	/* told */
	bool released; /* something falls, or may: RELEASE was sent and not refused */
	/* its own; zero */
	enum release_phase phase;
	int64_t start_ms;
	uint64_t from_statuses;
	uint64_t look_at; /* statuses: no verb before so many were heard */
	uint32_t checks;  /* told */
	bool pressed;     /* RELEASE is wanted; the tower found it early */
};

/* Before anything is done: unattended needs a typed word when somebody is there, attended a terminal to ask
 * at. Returns a COMMAND_* code, the reason printed. */
int release_consent(const char *command, bool unattended);

/* Returns COMMAND_DONE when the tower has taken RELEASE, or was interrupted after it was sent; else the
 * reason is printed and nothing is armed. */
int release_ask(struct release *release);

#endif
