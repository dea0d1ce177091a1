/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <errno.h>
#include <linux/can/error.h>
#include <stdio.h>
#include <string.h>
#include <sys/random.h>
#include <time.h>
#include <unistd.h>

#include "common/link/link.h"
#include "firmware/app.h"
#include "firmware/port/lockstep.h"
#include "firmware/port/posix/posix.h"

enum { LATE_MS = 50 };

static struct {
	struct link *link; /* NULL: frames ride in the exchange */
	int link_error;
	enum port_bus link_bus;
	uint32_t kicked_us; /* the watchdog */
	bool bitten;
	bool realtime;
} port;

/* ---- what the core calls ---- */

static int send_on_link(const struct frame *frame)
{
	int result = link_send(port.link, frame);

	if (result != 0 && result != DT_E_FULL)
		port.link_error = result;
	return result == 0 ? 0 : DT_E_FULL;
}

int port_can_send(const struct frame *frame)
{
	if (port.link == NULL)
		return lockstep_can_send(frame);
	return lockstep_can_open() ? send_on_link(frame) : DT_E_FULL;
}

/* What an error frame of SocketCAN says; one that says nothing of the state leaves it as it was. */
static enum port_bus state_told(const struct frame *frame)
{
	uint8_t controller = frame->id & CAN_ERR_CRTL ? frame->data[1] : 0;

	if (frame->id & CAN_ERR_BUSOFF)
		port.link_bus = PORT_BUS_OFF;
	else if (controller & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE))
		port.link_bus = PORT_BUS_PASSIVE;
	else if (frame->id & CAN_ERR_RESTARTED || controller & CAN_ERR_CRTL_ACTIVE)
		port.link_bus = PORT_BUS_ACTIVE;
	return port.link_bus;
}

static int receive_from_link(struct frame *frame)
{
	int result = link_receive(port.link, frame, 0);

	if (result < 0)
		port.link_error = result;
	if (result == 1 && (frame->flags & FRAME_ERROR) != 0) {
		lockstep_can_link(1, state_told(frame));
		return 0;
	}
	if (result == 1 && port.link_bus == PORT_BUS_OFF) /* what is heard on the bus is not off it */
		lockstep_can_link(0, port.link_bus = PORT_BUS_ACTIVE);
	return result == 1;
}

int port_can_receive(struct frame *frame)
{
	return port.link != NULL ? receive_from_link(frame) : lockstep_can_receive(frame);
}

/* Without the clock a run repeats, the numbers drawn in it too. */
int port_random(uint32_t *value)
{
	uint32_t drawn = lockstep_random();

	if (port.realtime && getrandom(&drawn, sizeof(drawn), 0) != (ssize_t)sizeof(drawn))
		return DT_E_SYSTEM;
	*value = drawn;
	return 0;
}

void port_watchdog_kick(void)
{
	/* A process that really hangs stops the virtual time with it: whoever waits for it is its watchdog.
	 */
	port.kicked_us = port_time_us();
}

void port_lock(void)
{
	/* One thread: nothing interrupts app_poll. */
}

void port_unlock(void)
{
}

uint32_t lockstep_hold(void)
{
	return 0;
}

void lockstep_release(uint32_t before)
{
	(void)before;
}

/* ---- time ---- */

static void poll(void)
{
	if (!lockstep_hung())
		app_poll();
	else if (port_time_us() - port.kicked_us >= LOCKSTEP_WATCHDOG_MS * 1000)
		port.bitten = true;
}

/* 0, LOCKSTEP_GONE or DT_E_*. */
static int run_instant(unsigned instant)
{
	int result = lockstep_exchange(instant);

	if (result != 0)
		return result;
	if (lockstep_deliver())
		lockstep_control();
	poll();
	return port.link_error;
}

/* What a busy machine has kept from us is made up for, but not more than LATE_MS of it: made up at once, half
 * a second would be one in which the host is silent. */
static void skip_lost(struct timespec *next)
{
	struct timespec now;
	int64_t late_ms;

	clock_gettime(CLOCK_MONOTONIC, &now);
	late_ms = (int64_t)(now.tv_sec - next->tv_sec) * 1000 + (now.tv_nsec - next->tv_nsec) / 1000000;
	if (late_ms <= LATE_MS)
		return;
	*next = now;
	next->tv_nsec -= LATE_MS * 1000000L;
	if (next->tv_nsec < 0) {
		next->tv_nsec += 1000000000L;
		next->tv_sec--;
	}
}

static void wait_for(struct timespec *next)
{
	skip_lost(next);
	next->tv_nsec += 1000000L;
	if (next->tv_nsec >= 1000000000L) {
		next->tv_nsec -= 1000000000L;
		next->tv_sec++;
	}
	while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, next, NULL) == EINTR) {
	}
}

static void boot_process(enum port_reset cause, uint8_t kept, const struct posix_options *options)
{
	port.kicked_us = 0;
	port.bitten = false;
	lockstep_boot(cause, kept, options->classic, port.link == NULL);
}

static int run(const struct posix_options *options)
{
	struct timespec next;
	int result = 0;

	clock_gettime(CLOCK_MONOTONIC, &next);
	port.realtime = options->realtime;
	boot_process(options->cause, options->kept, options);
	while (result == 0) {
		for (unsigned i = 0;
		     i < LOCKSTEP_INSTANTS && result == 0 && !lockstep_reset_wanted() && !port.bitten; i++)
			result = run_instant(i);
		if (port.bitten || lockstep_reset_wanted())
			boot_process(port.bitten ? PORT_RESET_WATCHDOG : PORT_RESET_COMMAND, lockstep_kept(),
			             options);
		if (options->realtime)
			wait_for(&next);
	}
	return result;
}

static int complain(const char *what, const char *detail)
{
	fprintf(stderr, "droptower-firmware: %s: %s\n", what, detail);
	return POSIX_EXIT_LINK;
}

static int open_all(const struct posix_options *options)
{
	char message[256];
	int result;

	if (options->can != NULL) {
		port.link = link_open(options->can, LINK_READ_WRITE, message, sizeof(message));
		if (port.link == NULL)
			return complain("no CAN link", message);
	}
	result = pipes_open(options->bus, message, sizeof(message));
	return result == 0 ? 0 : complain(options->bus, message);
}

int posix_run(const struct posix_options *options)
{
	int result = open_all(options);

	if (result != 0)
		return result;
	result = run(options);
	if (port.link_error != 0)
		return complain(link_url(port.link), error_text(port.link_error));
	if (result != LOCKSTEP_GONE)
		return complain(options->bus, error_text(result));
	if (link_close(port.link) != 0)
		return complain(options->can, "could not be closed");
	return 0;
}
