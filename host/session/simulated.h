/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_SESSION_SIMULATED_H
#define DT_HOST_SESSION_SIMULATED_H
/*
 * A simulated tower for a command that was given no link: droptower-bench, found beside this program, on a
 * bus of its own in a temporary directory.
 */
#include <stdbool.h>
#include <stdint.h>
#include <sys/types.h>

#include "common/link/temporary.h"

struct simulated {
	pid_t pid;
	struct temporary folder;
	char url[112];     /* of its bus */
	char control[112]; /* its control socket */
};

/* arguments: what to hand to the bench besides --link, --control and --ready-fd, NULL-terminated, at most 32.
 * 0, or -1 with one line in message. Waits until the bus is open. The thread that calls it keeps it alive:
 * the bench ends with that thread. */
int simulated_start(struct simulated *tower, const char *const *arguments, char *message, unsigned size);

/* It has not ended by itself. */
bool simulated_alive(struct simulated *tower);

/* Ends it, by force when it takes longer than 5 s, and removes its folder. */
void simulated_stop(struct simulated *tower);

#endif
