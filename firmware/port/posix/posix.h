/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_PORT_POSIX_POSIX_H
#define DT_FIRMWARE_PORT_POSIX_POSIX_H
/*
 * The posix port: the firmware core in lockstep with a plant behind two FIFOs (common/sensorbus.h).
 * One thread; the core's "interrupts" are calls between two calls of app_poll, so lock has nothing to do.
 *
 * Time is virtual. At each of the 16 sample instants of a millisecond the port sends a request and gets the
 * answer; all that the core then does, it does at that instant, rounded up to the next whole us. An output
 * edge that is planned for a time is made at that us, whenever the next request comes.
 */
#include <stdbool.h>

#include "firmware/port.h"

enum {
	POSIX_EXIT_USAGE = 2,
	POSIX_EXIT_LINK = 4,
};

struct posix_options {
	const char *bus; /* prefix of the two FIFOs */
	const char *can; /* a link's URL, or NULL */
	bool realtime;
	bool classic; /* the bus carries no CAN FD */
	enum port_reset cause;
};

/* Runs until the other end is gone or says stop. Returns the exit code; what is wrong goes to stderr. */
int posix_run(const struct posix_options *options);

#endif
