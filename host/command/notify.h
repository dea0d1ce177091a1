/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_COMMAND_NOTIFY_H
#define DT_HOST_COMMAND_NOTIFY_H
/*
 * What a service tells systemd, sd_notify(3) without its library: datagrams to $NOTIFY_SOCKET. Where there is
 * none, nothing happens; a message that cannot be sent is no error, systemd then acts on its absence.
 */

/* "READY=1", "STOPPING=1" */
void notify(const char *state);

/* Call it all the time while work goes on: sends WATCHDOG=1 as often as $WATCHDOG_USEC asks for. */
void notify_alive(void);

#endif
