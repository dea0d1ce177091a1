/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/session/tower_setup.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/wire_table.h"
#include "host/base/interrupt.h"

enum { HEAR_MS = 5000 }; /* a tower sends two thousand frames a second */

/* It will be in a state that takes parameters by itself, in a moment. */
static bool passing(unsigned state)
{
	return state == WIRE_STATE_BOOT || state == WIRE_STATE_UPLOADED;
}

static int tower_setup_stopped(char message[SESSION_MESSAGE_MAX])
{
	snprintf(message, SESSION_MESSAGE_MAX, "interrupted, nothing was released");
	return DT_E_STATE;
}

int tower_setup_hear(struct session *session, char message[SESSION_MESSAGE_MAX])
{
	const struct session_view *view = session_view(session);
	int64_t start_ms = session_now_ms();

	while (!view->seen || !view->hash_known || passing(view->state)) {
		int result = session_poll(session, 50);

		if (interrupt_came())
			return tower_setup_stopped(message);
		if (result == 0 && session_now_ms() - start_ms > HEAR_MS)
			result = DT_E_TIMEOUT;
		if (result != 0) {
			snprintf(message, SESSION_MESSAGE_MAX, "no tower heard: %s", error_text(result));
			return result;
		}
	}
	if (view->hash_agrees)
		return 0;
	snprintf(message, SESSION_MESSAGE_MAX, "the tower's wire hash is %08x, ours is %08x: %s",
	         view->wire_hash, wire_hash(), error_text(DT_E_HASH));
	return DT_E_HASH;
}

void tower_setup_settings(const struct scene *scene, struct tower_setting settings[TOWER_SETTINGS])
{
	const struct tower_setting all[TOWER_SETTINGS] = {
	        {WIRE_PARAMETER_gate_upper_um, scene->tower_gate_upper_m * 1e6},
	        {WIRE_PARAMETER_gate_lower_um, scene->tower_gate_lower_m * 1e6},
	        {WIRE_PARAMETER_separation_um, scene->tower_separation_m * 1e6},
	        {WIRE_PARAMETER_dampers_um, scene->tower_dampers_m * 1e6},
	        {WIRE_PARAMETER_dropout_us, scene->tower_magnet_dropout_s * 1e6},
	        {WIRE_PARAMETER_range_counts, scene->sensor_range_g * WIRE_COUNTS_PER_G},
	};

	memcpy(settings, all, sizeof(all));
}

/* The first that the tower could not have whatever the others are; NULL: none. */
static const struct tower_setting *out_of_range(const struct tower_setting *settings, size_t count)
{
	for (size_t i = 0; i < count; i++) {
		const struct wire_parameter_info *parameter = &wire_parameters[settings[i].number];
		double value = round(settings[i].value);

		if (!(value >= parameter->min && value <= parameter->max))
			return &settings[i];
	}
	return NULL;
}

/* Writes what the tower takes. What does not agree with the others that it still has is moved to the front:
 * count is how many those are. Another refusal ends it, with that setting at the front. */
static int write_round(struct session *session, struct tower_setting *settings, size_t *count)
{
	size_t left = 0;

	for (size_t i = 0; i < *count; i++) {
		int result = session_set_parameter(session, settings[i].number,
		                                   (uint32_t)llround(settings[i].value));

		if (result == DT_E_RANGE) {
			settings[left++] = settings[i];
		} else if (result != 0) {
			settings[0] = settings[i];
			return result;
		}
	}
	*count = left;
	return 0;
}

/* In rounds, until all are written or a round has moved nothing. */
static int tower_setup_write_all(struct session *session, struct tower_setting *settings, size_t count)
{
	size_t before = count + 1;
	int result = 0;

	while (result == 0 && count > 0 && count < before) {
		before = count;
		result = write_round(session, settings, &count);
	}
	return result == 0 && count > 0 ? DT_E_RANGE : result;
}

static int tower_setup_refused(const struct tower_setting *setting, int result,
                               char message[SESSION_MESSAGE_MAX])
{
	const struct wire_parameter_info *parameter = &wire_parameters[setting->number];

	if (out_of_range(setting, 1) != NULL)
		snprintf(message, SESSION_MESSAGE_MAX,
		         "the tower cannot have %s = %.0f, expected %u to %u %s", parameter->name,
		         setting->value, parameter->min, parameter->max, parameter->unit);
	else if (result == DT_E_RANGE)
		snprintf(message, SESSION_MESSAGE_MAX,
		         "the tower cannot have %s = %.0f beside its other parameters, expected upper gate, "
		         "lower gate, separation and dampers in this order",
		         parameter->name, setting->value);
	else
		snprintf(message, SESSION_MESSAGE_MAX, "the tower refuses %s = %.0f: %s", parameter->name,
		         setting->value, error_text(result));
	return result;
}

/* The set that ARM will name; what was written is in it, or another writes as well. */
static int read_back(struct session *session, const struct tower_setting *settings, size_t count,
                     char message[SESSION_MESSAGE_MAX])
{
	const struct session_view *view = session_view(session);
	int result = session_read_parameters(session);

	if (result != 0 && interrupt_came())
		return tower_setup_stopped(message);
	if (result != 0) {
		snprintf(message, SESSION_MESSAGE_MAX, "the tower's parameters cannot be read: %s",
		         error_text(result));
		return result;
	}
	for (size_t i = 0; i < count; i++) {
		uint32_t value = view->parameters[settings[i].number];

		if (value == (uint32_t)llround(settings[i].value))
			continue;
		snprintf(message, SESSION_MESSAGE_MAX, "the tower has %s = %u just after %.0f was written",
		         wire_parameters[settings[i].number].name, value, settings[i].value);
		return DT_E_PARAMETERS;
	}
	return 0;
}

int tower_setup_write(struct session *session, const struct scene *scene, char message[SESSION_MESSAGE_MAX])
{
	struct tower_setting wanted[TOWER_SETTINGS],
	        settings[TOWER_SETTINGS]; /* these in the order in which they are left */
	const struct tower_setting *beyond;
	size_t count = TOWER_SETTINGS;
	char wrong[SCENE_MESSAGE_MAX];
	int result = scene_check_tower(scene, scene->name, wrong);

	if (result != 0) {
		snprintf(message, SESSION_MESSAGE_MAX, "%.*s", SESSION_MESSAGE_MAX - 1, wrong);
		return result;
	}
	tower_setup_settings(scene, wanted);
	beyond = out_of_range(wanted, count);
	if (beyond != NULL)
		return tower_setup_refused(beyond, DT_E_RANGE, message);
	memcpy(settings, wanted, sizeof(settings));
	result = tower_setup_write_all(session, settings, count);
	if (result == DT_E_UNKNOWN) /* over LCM: the bridge has set them */
		return 0;
	if (result == 0)
		return read_back(session, wanted, count, message);
	return interrupt_came() ? tower_setup_stopped(message)
	                        : tower_setup_refused(&settings[0], result, message);
}

bool tower_setup_difference(struct session *session, char message[SESSION_MESSAGE_MAX])
{
	const struct session_view *view = session_view(session);

	for (unsigned i = 0; i < WIRE_PARAMETERS; i++) {
		uint32_t value;

		if (session_get_parameter(session, (enum wire_parameter_number)i, &value) != 0)
			return false;
		if (value == view->parameters[i])
			continue;
		snprintf(message, SESSION_MESSAGE_MAX, "the tower has %s = %u, expected %u %s",
		         wire_parameters[i].name, value, view->parameters[i], wire_parameters[i].unit);
		return true;
	}
	return false;
}
