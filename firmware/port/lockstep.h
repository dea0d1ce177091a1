/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_PORT_LOCKSTEP_H
#define DT_FIRMWARE_PORT_LOCKSTEP_H
/*
 * The firmware core in lockstep with a simulated tower (common/sensorbus.h): what the ports posix and qemu
 * have in common. lockstep.c also defines the functions of port.h that deal with outputs, time, the state of
 * the bus, what is kept over a reset, and port_reset.
 *
 * Time is virtual: at each of the 16 sample instants of a millisecond one answer, and a request where it has
 * not come ahead; all that the core then does, it does at that instant, rounded up to the next whole us. An
 * output edge that is planned for a time carries that us, whenever the next request goes.
 *
 * Context: lockstep_exchange and lockstep_deliver are the sample interrupts', lockstep_control the control
 * interrupt's, the rest main's. The functions of port.h exclude interrupts where they must. One instance,
 * static.
 */
#include <stddef.h>

#include "firmware/port.h"

enum {
	LOCKSTEP_GONE = 1, /* the other end has ended the run */
	LOCKSTEP_INSTANTS = 16,
	LOCKSTEP_WATCHDOG_MS = 50,
};

/* When the instant's samples are due, us after the tick, rounded down. */
unsigned lockstep_instant_us(unsigned instant);

/* After a reset, interrupts off: a new machine, and app_init. kept: what port_kept gives. ahead: main runs
 * once between any two instants, and frames come with answers only; answers then may come ahead. */
void lockstep_boot(enum port_reset cause, uint8_t kept, bool bus_classic, bool ahead);

/* The answer for the instant; 0, LOCKSTEP_GONE or DT_E_*. Then, if 0, the samples go to the core; true asks
 * for the control interrupt, which brings it what else came. */
DT_MUST_USE int lockstep_exchange(unsigned instant);
DT_MUST_USE bool lockstep_deliver(void);
void lockstep_control(void);

/* The core has asked for a restart; what it keeps over one now. */
bool lockstep_reset_wanted(void);
uint8_t lockstep_kept(void);

/* The other end's number of this instant, for port_random. */
uint32_t lockstep_random(void);

/* The bench wants to see the watchdog bite: app_poll is not to be called any more. */
bool lockstep_hung(void);

/* As port_can_send and port_can_receive: the frames ride in the exchange. What an answer brought waits until
 * it is received; what finds no place counts in port_can_errors, as with the board. */
DT_MUST_USE int lockstep_can_send(const struct frame *frame);
DT_MUST_USE int lockstep_can_receive(struct frame *frame);

/* For a port with a CAN link of its own. By the latest answer the bus takes frames; and what the link says:
 * errors since the call before, its state from the next answer on. */
bool lockstep_can_open(void);
void lockstep_can_link(uint32_t errors, enum port_bus state);

/* From the port, the two pipes: all bytes are written; at least one is read and added to *count. 0,
 * LOCKSTEP_GONE or DT_E_*. */
DT_MUST_USE int lockstep_write(const void *bytes, size_t count);
DT_MUST_USE int lockstep_read(void *bytes, size_t size, size_t *count);

/* From the port: no interrupt from here on; the argument of lockstep_release, which ends it. May be nested.
 */
uint32_t lockstep_hold(void);
void lockstep_release(uint32_t before);

#endif
