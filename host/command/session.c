/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/command/session.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <time.h>

#include "common/wire_table.h"
#include "host/command/command.h"
#include "host/command/session_private.h"

struct session *session_open(const char *url, const struct session_options *options,
                             char message[SESSION_MESSAGE_MAX])
{
	struct session *session = calloc(1, sizeof(*session));

	if (session == NULL) {
		snprintf(message, SESSION_MESSAGE_MAX, "%s", error_text(DT_E_MEMORY));
		return NULL;
	}
	session->options = *options;
	session->how = strncmp(url, "udpm:", 5) == 0 ? &session_lcm : &session_can;
	if (session->how->open(session, url, message) != 0) {
		free(session);
		return NULL;
	}
	return session;
}

void session_close(struct session *session)
{
	if (session == NULL)
		return;
	session->how->close(session);
	free(session);
}

void session_log(struct session *session, struct link *log)
{
	session->options.log = log;
}

void session_hold(struct session *session, bool hold)
{
	session->hold = hold;
}

int session_poll(struct session *session, int timeout_ms)
{
	return session->how->poll(session, timeout_ms);
}

const struct session_view *session_view(const struct session *session)
{
	return &session->view;
}

int session_command(struct session *session, enum wire_op op, uint16_t token)
{
	return session->how->command(session, op, token);
}

bool session_cancelled(struct session *session)
{
	const struct session_options *options = &session->options;

	return command_interrupted() || (options->cancelled != NULL && options->cancelled(options->user));
}

int session_set_parameter(struct session *session, enum wire_parameter_number number, uint32_t value)
{
	return session->how->set_parameter(session, number, value);
}

int session_get_parameter(struct session *session, enum wire_parameter_number number, uint32_t *value)
{
	return session->how->get_parameter(session, number, value);
}

int session_take_drop(struct session *session, struct record *record)
{
	return session->how->take_drop(session, record);
}

uint16_t session_token(void)
{
	uint16_t token = 0;

	while (token == 0)
		if (getrandom(&token, sizeof(token), 0) != sizeof(token))
			token = (uint16_t)(session_utime() | 1);
	return token;
}

bool session_drops(unsigned state)
{
	return wire_state_moving(state) || state == WIRE_STATE_CAPTURED;
}

bool session_at_rest(unsigned state)
{
	return !session_drops(state) && state != WIRE_STATE_ARMED && state != WIRE_STATE_UPLOADED;
}

int64_t session_now_ms(void)
{
	struct timespec now;

	clock_gettime(CLOCK_MONOTONIC, &now);
	return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

int64_t session_utime(void)
{
	struct timespec now;

	clock_gettime(CLOCK_REALTIME, &now);
	return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}
