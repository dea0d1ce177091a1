/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/wire_table.h"
#include "host/command/command.h"
#include "host/command/session.h"

static const char help[] =
        "usage: droptower ctl [--link URL] status|arm|release TOKEN|abort|clear|set NAME VALUE|get "
        "[NAME]\n"
        "\n"
        "  status         state, checks, faults and every counter\n"
        "  arm            prints the token that release needs within 10 s\n"
        "  release TOKEN  opens the latch: the product falls\n"
        "  abort          never asks, never refused\n"
        "  clear          out of a fault whose cause is gone\n"
        "  set NAME VALUE a parameter, until the tower starts again: bus_mode (0 CAN FD, 1 classic CAN), "
        "data_kbit_s,\n"
        "                 trigger_counts, ...; a name that is none lists them\n"
        "  get [NAME]     what a parameter is, without NAME every one\n"
        "\n"
        "The tower arms only while a host keeps its heartbeat going: run 'droptower bridge' beside.\n"
        "--link is unix:PATH, can:IF, slcan:DEV or udpm://...; default $DROPTOWER_LINK, else can:can0.\n";

enum { STATUS_WAIT_MS = 1500, COUNTERS_WAIT_MS = 5000 };

static void print_status(const struct session_view *view)
{
	printf("state    %s\nfault    %s%s%s%s\ndrop     %u\n", wire_state_name(view->state),
	       wire_fault_name(view->fault), view->fault != 0 ? ": " : "",
	       view->fault != 0 ? wire_fault_text(view->fault) : "",
	       view->state == WIRE_STATE_FAULT_HELD ? "; 'droptower ctl clear' when its cause is gone" : "",
	       view->drop_id);
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

	while (!command_interrupted() && (!view->seen || (counters && !all_counters(view)))) {
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

static int refused(const char *verb, int result, const struct session_view *view)
{
	command_error("%s: %s (state %s)", verb, error_text(result), wire_state_name(view->state));
	for (unsigned i = 0; i < WIRE_CHECKS; i++)
		if ((view->checks >> i & 1u) != 0)
			command_error("  %s: %s", wire_check_name(i), wire_check_text(i));
	return result == DT_E_TIMEOUT || result == DT_E_LINK || result == DT_E_CLOSED ? COMMAND_LINK
	                                                                              : COMMAND_REFUSED;
}

static int act(struct session *session, const char *verb, uint16_t token)
{
	static const struct {
		const char *verb;
		enum wire_op op;
	} verbs[] = {{"arm", WIRE_OP_ARM},
	             {"release", WIRE_OP_RELEASE},
	             {"abort", WIRE_OP_ABORT},
	             {"clear", WIRE_OP_CLEAR}};
	const struct session_view *view = session_view(session);

	if (strcmp(verb, "arm") == 0)
		token = session_token();
	for (size_t i = 0; i < sizeof(verbs) / sizeof(verbs[0]); i++) {
		int result;

		if (strcmp(verb, verbs[i].verb) != 0)
			continue;
		result = session_command(session, verbs[i].op, token);
		if (result != 0) {
			if (result != DT_E_TIMEOUT)
				(void)wait_for_status(session, false);
			return refused(verb, result, view);
		}
		if (strcmp(verb, "arm") == 0)
			printf("%u\n", token);
		return COMMAND_DONE;
	}
	return COMMAND_USAGE;
}

static int not_over_lcm(const char *verb)
{
	command_error("%s: over LCM parameters are the bridge's business, expected --link to the bus", verb);
	return COMMAND_LINK;
}

static int set(struct session *session, enum wire_parameter_number number, uint32_t value)
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
	return refused("set", result, session_view(session));
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
	uint16_t token;                    /* of release */
	enum wire_parameter_number number; /* of set and get */
	bool all;                          /* of get */
	uint32_t value;
};

static int parse_token(const char *text, uint16_t *token)
{
	char *end;
	unsigned long value = strtoul(text, &end, 10);

	if (text[0] < '0' || text[0] > '9' || *end != '\0' || value < 1 || value > UINT16_MAX)
		return command_usage("ctl", "token '%s', expected the number that arm printed", text);
	*token = (uint16_t)value;
	return COMMAND_DONE;
}

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
	if (!command_is_number(words[1], parameter->min, parameter->max, &value) || value > floor(value))
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
	if (strcmp(words[0], "release") == 0) {
		if (count < 2)
			return command_usage("ctl", "release needs the token that arm printed");
		code = parse_token(words[1], &order->token);
		taken = 2;
	} else if (strcmp(words[0], "set") == 0) {
		code = parse_set(words + 1, count - 1, order);
		taken = 3;
	} else if (strcmp(words[0], "get") == 0) {
		order->all = count < 2;
		code = order->all ? COMMAND_DONE : parse_parameter("get", words[1], &order->number);
		taken = 2;
	} else if (!known) {
		return command_usage("ctl",
		                     "no verb '%s', expected status, arm, release, abort, clear, set or get",
		                     words[0]);
	}
	if (code == COMMAND_DONE && count > taken)
		code = command_usage("ctl", "'%s' is too much", words[taken]);
	return code;
}

/* ---- the order of things ---- */

static int carry_out(struct session *session, const char *url, const struct order *order)
{
	int result;

	if (strcmp(order->verb, "set") == 0)
		return set(session, order->number, order->value);
	if (strcmp(order->verb, "get") == 0)
		return get(session, order->all ? 0 : order->number,
		           order->all ? WIRE_PARAMETERS - 1 : order->number);
	if (strcmp(order->verb, "status") != 0)
		return act(session, order->verb, order->token);
	result = wait_for_status(session, true);
	if (result != 0) {
		command_error("%s: no tower heard: %s", url, error_text(result));
		return COMMAND_LINK;
	}
	print_status(session_view(session));
	return COMMAND_DONE;
}

static int with_session(const char *url, const struct order *order)
{
	struct session_options options = {.passive = true};
	char message[SESSION_MESSAGE_MAX];
	struct session *session = session_open(url, &options, message);
	int code;

	if (session == NULL) {
		command_error("%s", message);
		return COMMAND_LINK;
	}
	code = carry_out(session, url, order);
	session_close(session);
	return code;
}

int command_ctl(int argc, char **argv)
{
	static const struct option options[] = {
	        {"link", required_argument, NULL, 'l'}, {"help", no_argument, NULL, 'h'}, {0}};
	const char *url = getenv("DROPTOWER_LINK");
	struct order order = {0};
	int option, code;

	opterr = 0;
	while ((option = getopt_long(argc, argv, "h", options, NULL)) != -1) {
		if (option == 'h') {
			fputs(help, stdout);
			return COMMAND_DONE;
		}
		if (option != 'l')
			return command_option("ctl", argv[optind - 1]);
		url = optarg;
	}
	code = parse_order(argv + optind, argc - optind, &order);
	if (code != COMMAND_DONE)
		return code;
	command_catch_signals();
	return with_session(url != NULL ? url : "can:can0", &order);
}
