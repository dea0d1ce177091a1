/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_PORT_POSIX_POSIX_H
#define DT_FIRMWARE_PORT_POSIX_POSIX_H
/*
 * The posix port: the firmware core in lockstep (firmware/port/lockstep.h) with a plant behind two FIFOs.
 * One thread; the core's "interrupts" are calls between two calls of app_poll, so lock has nothing to do.
 */
#include <stdbool.h>
#include <stddef.h>

#include "firmware/port.h"

enum {
	POSIX_EXIT_LINK = 4,
};

struct posix_options {
	const char *bus; /* prefix of the two FIFOs */
	const char *can; /* a link's URL, or NULL */
	bool realtime;
	bool classic; /* the bus carries no CAN FD */
	enum port_reset cause;
	uint8_t kept; /* by the firmware before the reset */
};

/* The two pipes of the exchange (lockstep_write, lockstep_read): pipes.c, or whoever brings others. 0, or an
 * error told in message. */
DT_MUST_USE int pipes_open(const char *bus, char *message, size_t size);

/* Runs until the other end is gone or says stop. Returns the exit code; what is wrong goes to stderr. */
int posix_run(const struct posix_options *options);

#endif
