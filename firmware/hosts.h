/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_HOSTS_H
#define DT_FIRMWARE_HOSTS_H
/*
 * The hosts that are heard. Each program that can command draws a session number and tells it in its
 * heartbeat; commands name the low half of it. A host is here until its heartbeat has been missing for
 * host_timeout_ms. While HOSTS_MAX are here a further one is not taken up: those that are here stay.
 *
 * Context: hosts_tick control, the rest main between port_lock and port_unlock, or control.
 */
#include <stdbool.h>
#include <stdint.h>

#include "firmware/parameter.h"

enum { HOSTS_MAX = 4 };

struct hosts {
	const struct parameters *parameters;
	volatile uint32_t *counters;
	struct {
		uint32_t session; /* 0: nobody */
		uint32_t heard_ms;
		bool hash_good;
	} host[HOSTS_MAX];
};

void hosts_init(struct hosts *hosts, const struct parameters *parameters, volatile uint32_t *counters);

/* A heartbeat of a session, which is not 0; hash_good: built from our wire.def. */
void hosts_heard(struct hosts *hosts, uint32_t tick_ms, uint32_t session, bool hash_good);

/* Every tick: forgets who is silent, and counts it. */
void hosts_tick(struct hosts *hosts, uint32_t tick_ms);

/* This session, or with session 0 any, is here and has our wire.def. */
bool hosts_here(const struct hosts *hosts, uint32_t session);

/* A host with this low half is here, but with another wire.def. */
bool hosts_hash_differs(const struct hosts *hosts, uint16_t low);

/* Who of those with this low half answers the nonce so: 0 and *session; DT_E_SESSION when none is here,
 * DT_E_PARAMETERS when the answer is of another nonce or parameter set. */
DT_MUST_USE int hosts_find(const struct hosts *hosts, uint16_t low, uint32_t answer, uint32_t nonce,
                           uint32_t parameters_crc32, uint32_t *session);

#endif
