/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/base/number.h"
#include "common/wire_table.h"
#include "host/command/command.h"
#include "host/command/release.h"
#include "host/session/tower_setup.h"

enum { STATUS_WAIT_MS = 1500, COUNTERS_WAIT_MS = 5000, FALL_MS = 20000 };

static void print_status(const struct session_view *view)
{
	printf("state    %s\nfault    %s%s%s%s\ndrop     %u\n", wire_state_name(view->state),
	       wire_fault_name(view->fault), view->fault != 0 ? ": " : "",
	       view->fault != 0 ? wire_fault_text(view->fault) : "",
	       view->state == WIRE_STATE_FAULT_HELD ? "; 'droptower ctl clear' when its cause is gone" : "",
	       view->drop_id);
	if (view->two_towers)
		printf("bus      two towers on it: their clocks disagree, expected one\n");
	if (view->checks == 0)
		printf("checks   all green\n");
	for (unsigned i = 0; i < WIRE_CHECKS; i++)
		if ((view->checks >> i & 1u) != 0)
			printf("check    %-9s %s\n", wire_check_name(i), wire_check_text(i));
	for (unsigned i = 0; i < WIRE_COUNTERS; i++)
		if (view->counter_known[i])
			printf("counter  %-22s %u\n", wire_counter_name(i), view->counters[i]);
}

static bool all_counters(const struct session_view *view)
{
	for (unsigned i = 0; i < WIRE_COUNTERS; i++)
		if (!view->counter_known[i])
			return false;
	return true;
}

static int wait_for_status(struct session *session, bool counters)
{
	const struct session_view *view = session_view(session);
	int64_t start_ms = session_now_ms();

	while (!interrupt_came() && (!view->seen || (counters && !all_counters(view)))) {
		int64_t waited_ms = session_now_ms() - start_ms;
		int result;

		if (waited_ms > (view->seen ? COUNTERS_WAIT_MS : STATUS_WAIT_MS))
			break;
		result = session_poll(session, 50);
		if (result != 0)
			return result;
	}
	return view->seen ? 0 : DT_E_TIMEOUT;
}

static int ctl_refused(const char *verb, int result, const struct session_view *view)
{
	command_error("%s: %s (state %s)", verb, error_text(result), wire_state_name(view->state));
	for (unsigned i = 0; i < WIRE_CHECKS; i++)
		if ((view->checks >> i & 1u) != 0)
			command_error("  %s: %s", wire_check_name(i), wire_check_text(i));
	return result == DT_E_TIMEOUT || result == DT_E_LINK || result == DT_E_CLOSED ? COMMAND_LINK
	                                                                              : COMMAND_REFUSED;
}

/* abort, clear */
static int ctl_act(struct session *session, const char *verb)
{
	bool abort = strcmp(verb, "abort") == 0;
	int result = session_command(session, abort ? WIRE_OP_ABORT : WIRE_OP_CLEAR);

	if (result == 0)
		return COMMAND_DONE;
	if (result != DT_E_TIMEOUT)
		(void)wait_for_status(session, false);
	return ctl_refused(verb, result, session_view(session));
}

/* ---- arm ---- */

static void ctl_say(void *user, const char *line)
{
	(void)user;
	fprintf(stderr, "%s\n", line);
}

/* Until it has come to rest; Ctrl-C brakes it. */
static int follow_fall(struct session *session)
{
	const struct session_view *view = session_view(session);
	int64_t start_ms = session_now_ms();
	uint32_t told = 1u << WIRE_STATE_ARMED;
	bool aborted = false;
	int result = 0;

	while (result == 0 && session_now_ms() - start_ms < FALL_MS) {
		result = session_poll(session, 50);
		if ((told >> view->state & 1u) == 0)
			fprintf(stderr, "%-9s %s\n", wire_state_name(view->state),
			        wire_state_text(view->state));
		told |= 1u << view->state;
		if (!wire_state_moving(view->state) && view->state != WIRE_STATE_ARMED)
			return aborted || view->state == WIRE_STATE_FAULT_HELD ? COMMAND_REFUSED
			                                                       : COMMAND_DONE;
		if (result == 0 && interrupt_came() && !aborted)
			result = session_command(session, WIRE_OP_ABORT);
		aborted |= interrupt_came() != 0;
	}
	return command_link_failed("following the fall", result != 0 ? result : DT_E_TIMEOUT);
}

static int ctl_arm(struct session *session, bool unattended)
{
	struct release release = {.session = session, .unattended = unattended, .say = ctl_say};
	const struct session_view *view = session_view(session);
	char message[SESSION_MESSAGE_MAX];
	int result = tower_setup_hear(session, message), code;

	if (result != 0)
		return command_tower_failed(result, message);
	result = session_read_parameters(session);
	if (result == 0)
		fprintf(stderr, "tower     separation at %u mm, dampers at %u mm, drop-out %.1f ms\n",
		        view->parameters[WIRE_PARAMETER_separation_um] / 1000,
		        view->parameters[WIRE_PARAMETER_dampers_um] / 1000,
		        view->parameters[WIRE_PARAMETER_dropout_us] / 1000.0);
	else if (result != DT_E_UNKNOWN) /* over LCM the bridge knows them */
		return command_link_failed("reading the tower's parameters", result);
	code = release_ask(&release);
	return code == COMMAND_DONE ? follow_fall(session) : code;
}

static int not_over_lcm(const char *verb)
{
	command_error("%s: over LCM parameters are the bridge's business, expected --link to the bus", verb);
	return COMMAND_LINK;
}

static int set_parameter(struct session *session, enum wire_parameter_number number, uint32_t value)
{
	const struct wire_parameter_info *parameter = &wire_parameters[number];
	int result = session_set_parameter(session, number, value);

	if (result == 0) {
		printf("%s %u\n", parameter->name, value);
		return COMMAND_DONE;
	}
	if (result == DT_E_UNKNOWN)
		return not_over_lcm("set");
	if (result == DT_E_RANGE) {
		command_error("set: the tower cannot have %s = %u beside its other parameters: %s",
		              parameter->name, value, parameter->doc);
		return COMMAND_REFUSED;
	}
	(void)wait_for_status(session, false);
	return ctl_refused("set", result, session_view(session));
}

/* From first to last. */
static int get(struct session *session, unsigned first, unsigned last)
{
	for (unsigned i = first; i <= last; i++) {
		uint32_t value;
		int result = session_get_parameter(session, (enum wire_parameter_number)i, &value);

		if (result == DT_E_UNKNOWN)
			return not_over_lcm("get");
		if (result != 0) {
			command_error("get: %s: %s", wire_parameters[i].name, error_text(result));
			return result == DT_E_EMPTY ? COMMAND_REFUSED : COMMAND_LINK;
		}
		printf("%s = %u\n", wire_parameters[i].name, value);
	}
	return COMMAND_DONE;
}

/* ---- words ---- */

struct order {
	const char *verb;
	enum wire_parameter_number number; /* of set and get */
	bool all;                          /* of get */
	uint32_t value;
};

static int parse_parameter(const char *verb, const char *name, enum wire_parameter_number *number)
{
	char names[24 * WIRE_PARAMETERS];
	size_t length = 0;

	for (unsigned i = 0; i < WIRE_PARAMETERS; i++) {
		if (strcmp(name, wire_parameters[i].name) == 0) {
			*number = (enum wire_parameter_number)i;
			return COMMAND_DONE;
		}
		length += (size_t)snprintf(names + length, sizeof(names) - length, " %s",
		                           wire_parameters[i].name);
	}
	return command_usage("ctl", "%s: no parameter '%s', expected one of%s", verb, name, names);
}

static int parse_set(char **words, int count, struct order *order)
{
	const struct wire_parameter_info *parameter;
	double value;
	int code;

	if (count < 2)
		return command_usage("ctl", "set: expected NAME VALUE");
	code = parse_parameter("set", words[0], &order->number);
	if (code != COMMAND_DONE)
		return code;
	parameter = &wire_parameters[order->number];
	if (!number_read(words[1], parameter->min, parameter->max, &value) || value > floor(value))
		return command_usage("ctl", "set: %s is '%s', expected a whole number from %u to %u%s%s (%s)",
		                     parameter->name, words[1], parameter->min, parameter->max,
		                     parameter->unit[0] != '\0' ? " " : "", parameter->unit, parameter->doc);
	order->value = (uint32_t)value;
	return COMMAND_DONE;
}

static int parse_order(char **words, int count, struct order *order)
{
	static const char *const plain[] = {"status", "arm", "abort", "clear"};
	int taken = 1, code = COMMAND_DONE;
	bool known = false;

	if (count == 0)
		return command_usage("ctl", "no verb given");
	order->verb = words[0];
	for (size_t i = 0; i < sizeof(plain) / sizeof(plain[0]); i++)
		known |= strcmp(words[0], plain[i]) == 0;
	if (strcmp(words[0], "set") == 0) {
		code = parse_set(words + 1, count - 1, order);
		taken = 3;
	} else if (strcmp(words[0], "get") == 0) {
		order->all = count < 2;
		code = order->all ? COMMAND_DONE : parse_parameter("get", words[1], &order->number);
		taken = 2;
	} else if (!known) {
		return command_usage("ctl", "no verb '%s', expected status, arm, abort, clear, set or get",
		                     words[0]);
	}
	if (code == COMMAND_DONE && count > taken)
		code = command_usage("ctl", "'%s' is too much", words[taken]);
	return code;
}

/* ---- the order of things ---- */

struct arguments {
	const char *url, *key;
	bool unattended;
};

static const struct option_row rows[] = {
        OPTION_TEXT("link", "URL", struct arguments, url,
                    "unix:PATH, can:IF, slcan:DEV or udpm://...; default $DROPTOWER_LINK, else can:can0"),
        OPTION_FLAG("unattended", struct arguments, unattended,
                    "arm without asking; on a terminal a typed word confirms it"),
        OPTION_TEXT("key", "FILE", struct arguments, key,
                    "with udpm://...: the key that the bridge takes commands with"),
};

static const struct option_table known_options = {
        .program = "droptower",
        .command = "ctl",
        .head = "usage: droptower ctl [--link URL] [--unattended] [--key FILE] status|arm|abort|clear|set "
                "NAME "
                "VALUE|get [NAME]\n"
                "\n"
                "  status         state, checks, faults and every counter\n"
                "  arm            stays as the host that arms: asks for a key to arm, when horn and lamp "
                "have warned "
                "for\n"
                "                 another to release, and follows the fall; any other key disarms. The drop "
                "stays "
                "in\n"
                "                 the tower for 'droptower bridge' beside, or the next 'droptower run'\n"
                "  abort          never asks, never refused\n"
                "  clear          acknowledges that a guard was open; out of a fault whose cause is gone\n"
                "  set NAME VALUE a parameter, until the tower starts again: bus_mode (0 CAN FD, 1 classic "
                "CAN), "
                "data_kbit_s,\n"
                "                 trigger_counts, ...; a name that is none lists them\n"
                "  get [NAME]     what a parameter is, without NAME every one\n"
                "\n",
        OPTION_ROWS(rows),
        .words = true,
};

static int ctl_carry_out(struct session *session, const struct arguments *arguments,
                         const struct order *order)
{
	int result;

	if (strcmp(order->verb, "set") == 0)
		return set_parameter(session, order->number, order->value);
	if (strcmp(order->verb, "get") == 0)
		return get(session, order->all ? 0 : order->number,
		           order->all ? WIRE_PARAMETERS - 1 : order->number);
	if (strcmp(order->verb, "arm") == 0)
		return ctl_arm(session, arguments->unattended);
	if (strcmp(order->verb, "status") != 0)
		return ctl_act(session, order->verb);
	result = wait_for_status(session, true);
	if (result != 0) {
		command_error("%s: no tower heard: %s", arguments->url, error_text(result));
		return COMMAND_LINK;
	}
	print_status(session_view(session));
	return COMMAND_DONE;
}

static int with_session(const struct arguments *arguments, const struct order *order)
{
	struct session_options options = {
	        .passive = strcmp(order->verb, "arm") != 0, .key = arguments->key, .program = "ctl"};
	char message[SESSION_MESSAGE_MAX];
	struct session *session = session_open(arguments->url, &options, message);
	int code;

	if (session == NULL) {
		command_error("%s", message);
		return COMMAND_LINK;
	}
	session_hold(session, true); /* whoever collects does it beside us */
	code = ctl_carry_out(session, arguments, order);
	session_close(session);
	return code;
}

int command_ctl(int argc, char **argv)
{
	struct arguments arguments = {.url = getenv("DROPTOWER_LINK")};
	struct order order = {0};
	int code = option_read(&known_options, &arguments, argc, argv);

	if (code != OPTIONS_READ)
		return code;
	code = parse_order(argv + optind, argc - optind, &order);
	if (code != COMMAND_DONE)
		return code;
	if (arguments.unattended && strcmp(order.verb, "arm") != 0)
		return command_usage("ctl", "--unattended goes with arm");
	if (arguments.url == NULL)
		arguments.url = "can:can0";
	interrupt_catch();
	if (strcmp(order.verb, "arm") == 0)
		code = release_consent("ctl", arguments.unattended);
	return code == COMMAND_DONE ? with_session(&arguments, &order) : code;
}
