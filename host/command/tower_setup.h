/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_COMMAND_TOWER_SETUP_H
#define DT_HOST_COMMAND_TOWER_SETUP_H
/*
 * A scene's tower into the tower's parameters: `run` does it before a drop, `bridge` when it is given a
 * scene.
 */
#include "common/scenes/scene.h"
#include "host/command/session.h"

/* Waits until the tower is heard, speaks our wire and has done its self-test. Returns a COMMAND_* code;
 * errors were printed. */
int tower_setup_hear(struct session *session);

/* Writes the parameters; over LCM there is nothing to do. Returns a COMMAND_* code; errors were printed. */
int tower_setup_write(struct session *session, const struct scene *scene);

#endif
