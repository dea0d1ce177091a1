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
	int (*accept)(struct session *session);
};

struct session {
	const struct session_way *how;
	void *way;
	struct session_options options;
	struct session_view view;
	bool hold, log_failed;
};

/* Nobody wants what is under way any longer: Ctrl-C or an ABORT came. ABORT itself is always wanted. */
bool session_cancelled(struct session *session);

/* Appends frame to the log, if there is one. What comes of it is no matter of a command that is under way:
 * session_poll tells. */
void session_log_frame(struct session *session, const struct frame *frame);

extern const struct session_way session_can, session_lcm;

#endif
