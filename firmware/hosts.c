/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "firmware/hosts.h"

#include "common/memory.h"

void hosts_init(struct hosts *hosts, const struct parameters *parameters, volatile uint32_t *counters)
{
	memset(hosts, 0, sizeof(*hosts));
	hosts->parameters = parameters;
	hosts->counters = counters;
}

/* Where the session is, else the first free place, else HOSTS_MAX. */
static unsigned place_of(const struct hosts *hosts, uint32_t session)
{
	unsigned place = HOSTS_MAX;

	for (unsigned i = HOSTS_MAX; i-- > 0;) {
		if (hosts->host[i].session == session)
			return i;
		if (hosts->host[i].session == 0)
			place = i;
	}
	return place;
}

void hosts_heard(struct hosts *hosts, uint32_t tick_ms, uint32_t session, bool hash_good)
{
	unsigned i = place_of(hosts, session);

	if (i == HOSTS_MAX)
		return;
	hosts->host[i].session = session;
	hosts->host[i].heard_ms = tick_ms;
	hosts->host[i].hash_good = hash_good;
}

void hosts_tick(struct hosts *hosts, uint32_t tick_ms)
{
	uint32_t timeout_ms = hosts->parameters->value[WIRE_PARAMETER_host_timeout_ms];

	for (unsigned i = 0; i < HOSTS_MAX; i++)
		if (hosts->host[i].session != 0 && tick_ms - hosts->host[i].heard_ms > timeout_ms) {
			hosts->host[i].session = 0;
			hosts->counters[WIRE_COUNTER_host_heartbeats_lost]++;
		}
}

bool hosts_here(const struct hosts *hosts, uint32_t session)
{
	for (unsigned i = 0; i < HOSTS_MAX; i++)
		if (hosts->host[i].session != 0 && hosts->host[i].hash_good &&
		    (session == 0 || hosts->host[i].session == session))
			return true;
	return false;
}

static bool has_session(const struct hosts *hosts, unsigned i, uint16_t low)
{
	return hosts->host[i].session != 0 && (uint16_t)hosts->host[i].session == low;
}

bool hosts_hash_differs(const struct hosts *hosts, uint16_t low)
{
	for (unsigned i = 0; i < HOSTS_MAX; i++)
		if (has_session(hosts, i, low) && !hosts->host[i].hash_good)
			return true;
	return false;
}

int hosts_find(const struct hosts *hosts, uint16_t low, uint32_t answer, uint32_t nonce,
               uint32_t parameters_crc32, uint32_t *session)
{
	int result = DT_E_SESSION;

	for (unsigned i = 0; i < HOSTS_MAX; i++) {
		if (!has_session(hosts, i, low) || !hosts->host[i].hash_good)
			continue;
		if (wire_answer(nonce, hosts->host[i].session, parameters_crc32) == answer) {
			*session = hosts->host[i].session;
			return 0;
		}
		result = DT_E_PARAMETERS;
	}
	return result;
}
