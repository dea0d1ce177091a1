/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_SESSION_LOOPBACK_H
#define DT_HOST_SESSION_LOOPBACK_H
/*
 * LCM receives on every interface of the machine, whatever the time to live it sends with. Here its socket is
 * told to take only what this machine sent itself, unless the URL says ttl=1 or more: then what is sent
 * leaves the machine, and what comes from outside is taken.
 *
 * The kernel does it (socket(7), SO_ATTACH_FILTER): packets on the loopback interface pass, and on any other
 * those that are the kernel's own copy of a multicast sent here. No source address is believed.
 */
#include <stdbool.h>

#include "common/error.h"

/* Whether an LCM URL (udpm://GROUP:PORT?ttl=N...) keeps to this machine. */
bool loopback_only(const char *url);

/* Confines the UDP sockets of this process that are bound to the URL's port. 0, or DT_E_SYSTEM: there is
 * none, or the kernel refuses. */
DT_MUST_USE int loopback_confine(const char *url);

#endif
