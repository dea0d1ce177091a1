/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_SESSION_SESSION_PRIVATE_H
#define DT_HOST_SESSION_SESSION_PRIVATE_H
/*
 * What session.c asks of a way to the tower. Two of them: session_can.c and session_lcm.c. A way keeps
 * its own state behind `way` and updates `view`.
 */
#include "host/session/session.h"

struct session;

struct session_way {
	int (*open)(struct session *session, const char *url, char message[SESSION_MESSAGE_MAX]);
	void (*close)(struct session *session);
	int (*poll)(struct session *session, int timeout_ms);
	int (*command)(struct session *session, enum wire_op op);
	int (*set_parameter)(struct session *session, enum wire_parameter_number number, uint32_t value);
	int (*get_parameter)(struct session *session, enum wire_parameter_number number, uint32_t *value);
	int (*take_drop)(struct session *session, struct record *record);
};

struct session {
	const struct session_way *how;
	void *way;
	struct session_options options;
	struct session_view view;
	bool hold, keep;
};

/* Nobody wants what is under way any longer: Ctrl-C or an ABORT came. ABORT itself is always wanted. */
bool session_cancelled(struct session *session);

extern const struct session_way session_can, session_lcm;

#endif
