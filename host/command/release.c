/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/command/release.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "common/wire_table.h"
#include "host/command/command.h"
#include "host/command/terminal.h"
#include "host/session/tower_setup.h"

enum {
	READY_STATUSES = 60 * SESSION_STATUSES_HZ, /* unattended: somebody may have to close a door */
	QUIET_MS = 1000,                           /* a tower that just heard of us has red checks */
};

static const uint32_t GUARDS = WIRE_CHECK_ESTOP | WIRE_CHECK_DOOR | WIRE_CHECK_LATCH | WIRE_CHECK_PRODUCT;

static void __attribute__((format(printf, 2, 3)))
release_say(const struct release *release, const char *format, ...)
{
	char line[200];
	va_list arguments;

	va_start(arguments, format);
	vsnprintf(line, sizeof(line), format, arguments);
	va_end(arguments);
	release->say(release->user, line);
}

int release_consent(const char *command, bool unattended)
{
	static const char word[] = "unattended";
	char line[80];

	if (!unattended && !terminal_there()) {
		command_error("%s: no terminal to ask at; --unattended drops without asking", command);
		return COMMAND_REFUSED;
	}
	if (!unattended || !terminal_there())
		return COMMAND_DONE;
	if (terminal_line("The product will fall without another question. Type 'unattended' to go on: ",
	                  line, sizeof(line)) &&
	    strcmp(line, word) == 0)
		return COMMAND_DONE;
	command_error("%s: not confirmed, nothing was released", command);
	return COMMAND_REFUSED;
}

/* ---- what is told ---- */

static void tell_checks(struct release *release, uint32_t checks)
{
	for (unsigned i = 0; i < WIRE_CHECKS; i++)
		if ((checks >> i & 1u) != 0)
			release_say(release, "check     %-10s %s", wire_check_name(i), wire_check_text(i));
	release->checks = checks;
}

/* As they change: a red one that was not, and what is left when one has become green. */
static void follow_checks(struct release *release)
{
	const struct session_view *view = session_view(release->session);
	uint32_t checks = view->checks & ~(uint32_t)(WIRE_CHECK_SETTLE | WIRE_CHECK_ACKNOWLEDGE);

	if (checks == release->checks || view->state != WIRE_STATE_SAFE ||
	    session_now_ms() - release->start_ms < QUIET_MS)
		return;
	if (checks == 0)
		release_say(release, "checks    all green");
	tell_checks(release, checks);
}

static enum release_phase phase_of(const struct session_view *view)
{
	if (view->state == WIRE_STATE_ARMED && view->armed)
		return session_now_ms() < view->release_from_ms ? RELEASE_WARNING : RELEASE_ARMED;
	if (view->state == WIRE_STATE_READY)
		return RELEASE_READY;
	if (view->state == WIRE_STATE_SAFE && (view->checks & WIRE_CHECK_ACKNOWLEDGE) != 0 &&
	    (view->checks & GUARDS) == 0)
		return RELEASE_GUARD;
	return RELEASE_WAIT;
}

/* The key that leads on; 0: none does. */
static int release_key_of(enum release_phase phase)
{
	static const char keys[] = {[RELEASE_GUARD] = 'c', [RELEASE_READY] = 'a', [RELEASE_ARMED] = 'r'};

	return (size_t)phase < sizeof(keys) ? keys[phase] : 0;
}

static void release_enter(struct release *release, enum release_phase phase)
{
	static const char *const prompts[] = {
	        [RELEASE_GUARD] = "a guard was open. Nobody in the tower, nothing in its way? c acknowledges",
	        [RELEASE_READY] = "a arms, with horn and lamp; any other key ends this",
	        [RELEASE_ARMED] = "r releases: the product falls. Any other key disarms",
	        [RELEASE_WAIT] = NULL,
	};
	const struct session_view *view = session_view(release->session);

	if (phase < RELEASE_WARNING && release->phase >= RELEASE_WARNING)
		release_say(release, "disarmed  by the tower");
	release->phase = phase;
	release->pressed = false;
	if (phase == RELEASE_READY)
		release_say(release, "ready     all checks green");
	if (phase == RELEASE_WARNING)
		release_say(release, "armed     the warning is on, %.1f s",
		            (double)(view->release_from_ms - session_now_ms()) / 1000.0);
	if (release->unattended)
		return;
	terminal_forget();
	if (release_key_of(phase) != 0)
		release_say(release, "key       %s", prompts[phase]);
}

/* ---- its ends ---- */

static bool unanswered(int result)
{
	return result == DT_E_TIMEOUT || result == DT_E_CLOSED || result == DT_E_LINK;
}

/* By the person: what is armed, or may be, is disarmed. */
static int release_stop(struct release *release, bool asked_to_arm)
{
	const struct session_view *view = session_view(release->session);
	bool armed = asked_to_arm || view->armed || view->state == WIRE_STATE_ARMED;
	int result = armed ? session_command(release->session, WIRE_OP_ABORT) : 0;

	return result == 0 ? command_stopped() : command_link_failed("abort", result);
}

static int release_refused(struct release *release, int result)
{
	char difference[SESSION_MESSAGE_MAX];

	if (session_view(release->session)->two_towers)
		command_error("two towers on this bus: their clocks disagree, expected one");
	else
		command_error("the tower refuses: %s", error_text(result));
	if (result == DT_E_PARAMETERS && tower_setup_difference(release->session, difference))
		command_error("  %s", difference);
	tell_checks(release, session_view(release->session)->checks);
	if (session_view(release->session)->armed)
		result = session_command(release->session, WIRE_OP_ABORT) == 0 ? result : DT_E_TIMEOUT;
	return unanswered(result) ? COMMAND_LINK : COMMAND_REFUSED;
}

/* A verb is on its way: its outcome shows in a status or two. Refused because something has just changed, it
 * is tried again. */
static int release_sent(struct release *release, int result)
{
	release->look_at = session_view(release->session)->statuses + 2;
	return result == 0 || result == DT_E_STATE || result == DT_E_CHECKS
	               ? COMMAND_DONE
	               : release_refused(release, result);
}

/* Unattended what only our own silence has caused is cleared: nothing has fallen, and nobody else will. */
static int held(struct release *release)
{
	const struct session_view *view = session_view(release->session);

	if (view->fault == WIRE_FAULT_NONE)
		return COMMAND_DONE; /* blocks are faster than the status that names it */
	if (release->unattended && view->fault == WIRE_FAULT_HOST_LOST) {
		if (view->statuses < release->look_at)
			return COMMAND_DONE;
		release_say(release, "lost      %s", wire_fault_text(view->fault));
		return release_sent(release, session_command(release->session, WIRE_OP_CLEAR));
	}
	command_error("the tower holds a fault: %s; 'droptower ctl clear' when its cause is gone",
	              wire_fault_text(view->fault));
	return COMMAND_REFUSED;
}

/* ---- the verbs ---- */

static int release_acknowledge(struct release *release)
{
	int result = session_command(release->session, WIRE_OP_CLEAR);

	if (result == 0)
		release_say(release, "cleared   acknowledged");
	return release_sent(release, result);
}

static int release_arm(struct release *release)
{
	int result = session_command(release->session, WIRE_OP_ARM);

	if (interrupt_came())
		return release_stop(release, true);
	return release_sent(release, result);
}

static int release_let_fall(struct release *release)
{
	int result = session_command(release->session, WIRE_OP_RELEASE);

	release->pressed = result == DT_E_EARLY; /* the tower's clock is behind ours: soon again */
	release->look_at = session_view(release->session)->statuses + 1;
	if (release->pressed)
		return COMMAND_DONE;
	release->released = result == 0 || unanswered(result); /* it may have worked */
	if (result == DT_E_STATE && release->unattended)
		return COMMAND_DONE; /* it has disarmed: why is seen in its next status */
	/* an interrupted release may have worked: what follows aborts it and looks */
	if (result != 0 && !interrupt_came())
		return release_refused(release, result);
	release_say(release, "released");
	return COMMAND_DONE;
}

static int release_act(struct release *release)
{
	switch (release->phase) {
	case RELEASE_GUARD:
		return release_acknowledge(release);
	case RELEASE_READY:
		return release_arm(release);
	case RELEASE_ARMED:
		return release_let_fall(release);
	case RELEASE_HEARD:
	case RELEASE_WAIT:
	case RELEASE_WARNING:
		break;
	}
	return COMMAND_DONE;
}

static int hear_key(struct release *release)
{
	const struct session_view *view = session_view(release->session);
	int wanted = release_key_of(release->phase), key;

	if (release->pressed)
		return view->statuses >= release->look_at ? release_act(release) : COMMAND_DONE;
	if (release->unattended)
		return wanted != 0 && view->statuses >= release->look_at ? release_act(release)
		                                                         : COMMAND_DONE;
	key = terminal_key();
	if (key == 0)
		return COMMAND_DONE;
	if (key == wanted)
		return release_act(release);
	if (release->phase == RELEASE_WARNING && key == release_key_of(RELEASE_ARMED)) {
		release_say(release, "early     the warning is not over yet");
		return COMMAND_DONE;
	}
	return release_stop(release, false);
}

static int release_turn(struct release *release)
{
	const struct session_view *view = session_view(release->session);
	int result = session_poll(release->session, 20);
	enum release_phase phase;

	if (interrupt_came())
		return release_stop(release, false);
	if (result != 0)
		return command_link_failed("waiting for the checks", result);
	if (view->two_towers)
		return release_refused(release, DT_E_STATE);
	if (view->state == WIRE_STATE_FAULT_HELD)
		return held(release);
	follow_checks(release);
	phase = phase_of(view);
	if (phase != release->phase)
		release_enter(release, phase);
	if (release->unattended &&
	    session_is_over(release->session, release->from_statuses + READY_STATUSES)) {
		command_error("not released within %d s", READY_STATUSES / SESSION_STATUSES_HZ);
		return release_refused(release, DT_E_CHECKS);
	}
	return hear_key(release);
}

int release_ask(struct release *release)
{
	int code = COMMAND_DONE;

	release->start_ms = session_now_ms();
	release->from_statuses = session_view(release->session)->statuses;
	if (!release->unattended && terminal_open() != 0) {
		command_error("standard input: no keys can be read");
		return COMMAND_REFUSED;
	}
	while (code == COMMAND_DONE && !release->released)
		code = release_turn(release);
	terminal_close();
	return code;
}
