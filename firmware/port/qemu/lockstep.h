/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_PORT_QEMU_LOCKSTEP_H
#define DT_FIRMWARE_PORT_QEMU_LOCKSTEP_H
/*
 * The firmware core in lockstep with a simulated tower (common/sensorbus.h): what of the port needs no
 * processor. lockstep.c also defines the functions of port.h that deal with outputs, time and CAN.
 *
 * Time is virtual: at each of the 16 sample instants of a millisecond one request and its answer; all that
 * the core then does, it does at that instant, rounded up to the next whole us, as in the posix port. An
 * output edge that is planned for a time carries that us, whenever the next request goes.
 *
 * Context: interrupt, but for lockstep_boot. The functions of port.h exclude interrupts where they must.
 */
#include <stddef.h>

#include "firmware/port.h"

enum {
	LOCKSTEP_GONE = 1, /* the other end has ended the run */
	LOCKSTEP_INSTANTS = 16,
};

/* Which samples the instant takes: SENSORBUS_X, SENSORBUS_YZ, and both where a tick begins. */
unsigned lockstep_group(unsigned instant);

/* After a reset, interrupts off: a new machine, and app_init. */
void lockstep_boot(enum port_reset cause, bool bus_classic);

/* Request and answer; 0, LOCKSTEP_GONE or DT_E_*. Then, if 0, what the answer brought goes to the core. */
DT_MUST_USE int lockstep_exchange(unsigned instant);
void lockstep_deliver(void);

/* The core has asked for a restart. */
bool lockstep_reset_wanted(void);

/* The two pipes, from the board: all bytes; 0, LOCKSTEP_GONE or DT_E_*. */
DT_MUST_USE int board_write(const void *bytes, size_t count);
DT_MUST_USE int board_read(void *bytes, size_t count);

/* From the board: no interrupt from here on; the argument of board_release, which ends it. May be nested. */
uint32_t board_hold(void);
void board_release(uint32_t before);

#endif
