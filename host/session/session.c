/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/session/session.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>

#include "common/link/link.h"
#include "common/wire_table.h"
#include "host/base/interrupt.h"
#include "host/session/journal.h"
#include "host/session/session_private.h"

enum { SILENT_MS = 20000 };

/* Never 0. */
static int draw_number(uint32_t *number)
{
	*number = 0;
	while (*number == 0)
		if (getrandom(number, sizeof(*number), 0) != sizeof(*number))
			return DT_E_SYSTEM;
	return 0;
}

struct session *session_open(const char *url, const struct session_options *options,
                             char message[SESSION_MESSAGE_MAX])
{
	struct session *session = calloc(1, sizeof(*session));

	if (session == NULL) {
		snprintf(message, SESSION_MESSAGE_MAX, "%s", error_text(DT_E_MEMORY));
		return NULL;
	}
	session->options = *options;
	if (draw_number(&session->view.session) != 0) {
		snprintf(message, SESSION_MESSAGE_MAX, "no random number for the session");
		free(session);
		return NULL;
	}
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
	session->log_failed = false;
}

void session_log_frame(struct session *session, const struct frame *frame)
{
	if (session->options.log != NULL && link_send(session->options.log, frame) != 0)
		session->log_failed = true;
}

void session_hold(struct session *session, bool hold)
{
	session->hold = hold;
}

int session_accept(struct session *session)
{
	return session->how->accept(session);
}

int session_poll(struct session *session, int timeout_ms)
{
	int result = session->how->poll(session, timeout_ms);

	return result == 0 && session->log_failed ? DT_E_SYSTEM : result;
}

const struct session_view *session_view(const struct session *session)
{
	return &session->view;
}

int session_command(struct session *session, enum wire_op op)
{
	int result = session->how->command(session, op);
	const struct session_options *options = &session->options;

	if (options->program != NULL)
		journal_write(&(struct journal_line){.program = options->program,
		                                     .who = options->operator_name,
		                                     .session = session->view.session,
		                                     .verb = wire_op_name(op),
		                                     .refusal = result != 0 ? error_text(result) : NULL});
	return result;
}

bool session_cancelled(struct session *session)
{
	const struct session_options *options = &session->options;

	return interrupt_came() || (options->cancelled != NULL && options->cancelled(options->user));
}

int session_read_parameters(struct session *session)
{
	struct session_view *view = &session->view;
	uint32_t value[WIRE_PARAMETERS];

	for (unsigned i = 0; i < WIRE_PARAMETERS; i++) {
		int result = session_get_parameter(session, (enum wire_parameter_number)i, &value[i]);

		if (result != 0)
			return result;
	}
	memcpy(view->parameters, value, sizeof(value));
	view->parameters_known = true;
	return 0;
}

int session_set_parameter(struct session *session, enum wire_parameter_number number, uint32_t value)
{
	int result = session->how->set_parameter(session, number, value);

	if (result == 0)
		session->view.parameters[number] = value;
	return result;
}

int session_get_parameter(struct session *session, enum wire_parameter_number number, uint32_t *value)
{
	return session->how->get_parameter(session, number, value);
}

int session_take_drop(struct session *session, struct record *record)
{
	return session->how->take_drop(session, record);
}

bool session_drops(unsigned state)
{
	return wire_state_moving(state) || state == WIRE_STATE_CAPTURED;
}

bool session_at_rest(unsigned state)
{
	return !session_drops(state) && state != WIRE_STATE_ARMED && state != WIRE_STATE_UPLOADED;
}

bool session_is_over(const struct session *session, uint64_t statuses)
{
	const struct session_view *view = &session->view;

	return view->statuses >= statuses || session_now_ms() - view->status_ms > SILENT_MS;
}

int64_t session_now_ms(void)
{
	return link_now_us() / 1000;
}
