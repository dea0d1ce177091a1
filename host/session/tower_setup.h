/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_SESSION_TOWER_SETUP_H
#define DT_HOST_SESSION_TOWER_SETUP_H
/*
 * A scene's tower into the tower's parameters: `run` does it before a drop, `bridge` when it is given a
 * scene.
 */
#include "common/scenes/scene.h"
#include "common/wire.h"
#include "host/session/session.h"

enum { TOWER_SETTINGS = 6 };

struct tower_setting {
	enum wire_parameter_number number;
	double value; /* of the wire, not rounded */
};

/* The parameters that a scene gives a tower. */
void tower_setup_settings(const struct scene *scene, struct tower_setting settings[TOWER_SETTINGS]);

/* Waits until the tower is heard, speaks our wire and has done its self-test. 0, or DT_E_* with one line in
 * message: DT_E_HASH, DT_E_STATE when it was interrupted, or an error of the link. */
DT_MUST_USE int tower_setup_hear(struct session *session, char message[SESSION_MESSAGE_MAX]);

/* Writes the parameters, in an order in which the tower takes them: it refuses a place that is not in order
 * with the others that it has. A scene whose gates are in no order, and what no tower can have, is refused
 * before anything is written. Over LCM nothing is written. Then the tower's whole set is read: it is the one
 * that ARM will name. 0, or DT_E_* with one line in message: DT_E_RANGE, DT_E_STATE, DT_E_PARAMETERS when
 * another writes as well, or an error of the link. */
DT_MUST_USE int tower_setup_write(struct session *session, const struct scene *scene,
                                  char message[SESSION_MESSAGE_MAX]);

/* After DT_E_PARAMETERS: the first parameter that is not what the session believes, in words. False when the
 * tower does not tell, or there is none. */
bool tower_setup_difference(struct session *session, char message[SESSION_MESSAGE_MAX]);

#endif
