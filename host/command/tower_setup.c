/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/command/tower_setup.h"

#include <math.h>
#include <stdio.h>

#include "common/wire_table.h"
#include "host/command/command.h"

enum { HEAR_MS = 5000 }; /* a tower sends two thousand frames a second */

/* It will be in a state that takes parameters by itself, in a moment. */
static bool passing(unsigned state)
{
	return state == WIRE_STATE_BOOT || state == WIRE_STATE_UPLOADED;
}

static int stopped(char message[SESSION_MESSAGE_MAX])
{
	snprintf(message, SESSION_MESSAGE_MAX, "interrupted, nothing was released");
	return COMMAND_REFUSED;
}

int tower_setup_hear(struct session *session, char message[SESSION_MESSAGE_MAX])
{
	const struct session_view *view = session_view(session);
	int64_t start_ms = session_now_ms();

	while (!view->seen || !view->hash_known || passing(view->state)) {
		int result = session_poll(session, 50);

		if (command_interrupted())
			return stopped(message);
		if (result == 0 && session_now_ms() - start_ms > HEAR_MS)
			result = DT_E_TIMEOUT;
		if (result != 0) {
			snprintf(message, SESSION_MESSAGE_MAX, "no tower heard: %s", error_text(result));
			return COMMAND_LINK;
		}
	}
	if (view->hash_agrees)
		return COMMAND_DONE;
	snprintf(message, SESSION_MESSAGE_MAX, "the tower's wire hash is %08x, ours is %08x: %s",
	         view->wire_hash, wire_hash(), error_text(DT_E_HASH));
	return COMMAND_REFUSED;
}

int tower_setup_write(struct session *session, const struct scene *scene, char message[SESSION_MESSAGE_MAX])
{
	const struct {
		enum wire_parameter_number number;
		double value;
	} parameters[] = {
	        {WIRE_PARAMETER_gate_upper_um, scene->tower_gate_upper_m * 1e6},
	        {WIRE_PARAMETER_gate_lower_um, scene->tower_gate_lower_m * 1e6},
	        {WIRE_PARAMETER_separation_um, scene->tower_separation_m * 1e6},
	        {WIRE_PARAMETER_dampers_um, scene->tower_dampers_m * 1e6},
	        {WIRE_PARAMETER_dropout_us, scene->tower_magnet_dropout_s * 1e6},
	        {WIRE_PARAMETER_range_counts, scene->sensor_range_g * WIRE_COUNTS_PER_G},
	};

	for (size_t i = 0; i < sizeof(parameters) / sizeof(parameters[0]); i++) {
		int result = session_set_parameter(session, parameters[i].number,
		                                   (uint32_t)llround(parameters[i].value));

		if (result == DT_E_UNKNOWN)
			return COMMAND_DONE; /* over LCM: the bridge has set them */
		if (result != 0 && command_interrupted())
			return stopped(message);
		if (result != 0) {
			snprintf(message, SESSION_MESSAGE_MAX, "the tower refuses %s = %.0f: %s",
			         wire_parameters[parameters[i].number].name, parameters[i].value,
			         error_text(result));
			return result == DT_E_STATE || result == DT_E_RANGE ? COMMAND_REFUSED : COMMAND_LINK;
		}
	}
	return COMMAND_DONE;
}
