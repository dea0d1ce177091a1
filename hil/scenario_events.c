/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <stdio.h>
#include <string.h>

#include "common/base/number.h"
#include "common/link/candump.h"
#include "common/wire_table.h"
#include "hil/scenario_private.h"
#include "hil/tower.h"

enum {
	SEQUENCE_FROM = 0x80, /* of commands that [at] sends: the script counts from 0 */
	SDO_WRITE = 0x23,
};

static const char *fault_of_tower(unsigned i)
{
	return tower_fault_name((enum tower_fault)i);
}

static bool parse_fault(unsigned count, char **words, struct event *event)
{
	int fault = count == 2 ? scenario_find(words[1], TOWER_FAULTS, fault_of_tower) : -1;

	event->action = strcmp(words[0], "fault") == 0 ? EVENT_FAULT : EVENT_REPAIR;
	event->number = (unsigned)fault;
	return fault >= 0;
}

static bool parse_frame(const char *text, struct frame *frame)
{
	char line[CANDUMP_LINE_MAX];
	unsigned column;
	int length = snprintf(line, sizeof(line), "(0.0) can0 %s", text);

	return length < (int)sizeof(line) && candump_parse(line, (size_t)length, frame, &column) == 1;
}

static bool parse_verb(unsigned count, char **words, uint8_t sequence, struct event *event)
{
	struct wire_command command = {.sequence = sequence};
	unsigned at = 2;
	unsigned long argument = 0;

	for (unsigned op = 1; command.op == 0 && op <= UINT8_MAX; op++)
		if (strcasecmp(words[1], wire_op_name(op)) == 0)
			command.op = (uint8_t)op;
	event->action = EVENT_VERB;
	event->second = at < count && strcmp(words[at], "second") == 0;
	at += event->second;
	event->forged = at < count;
	if (command.op == 0 || count > at + 1 ||
	    (event->forged && !scenario_parse_whole(words[at], UINT32_MAX, &argument)))
		return false;
	command.argument = (uint32_t)argument;
	event->command = command;
	return true;
}

/* send abort | send release second 0x1234 | send set NAME VALUE | send frame 000#0201 */
static bool parse_send(unsigned count, char **words, uint8_t sequence, struct event *event)
{
	struct scenario_parameter parameter;

	event->action = EVENT_SEND;
	if (count == 3 && strcmp(words[1], "frame") == 0)
		return parse_frame(words[2], &event->frame);
	if (count != 4 || strcmp(words[1], "set") != 0)
		return count >= 2 && parse_verb(count, words, sequence, event);
	if (!scenario_parse_parameter(words[2], words[3], &parameter))
		return false;
	wire_pack_sdo(&event->frame, WIRE_ID_SDO_REQUEST,
	              &(struct wire_sdo){SDO_WRITE, parameter.index, 0, parameter.value});
	return true;
}

static bool parse_bus(unsigned count, char **words, struct event *event)
{
	static const struct {
		const char *key, *name;
		enum event_action action;
	} spans[] = {
	        {"bus", "silent", EVENT_BUS_SILENT},   {"bus", "blocked", EVENT_BUS_BLOCKED},
	        {"bus", "off", EVENT_BUS_OFF},         {"bus", "babble", EVENT_BUS_BABBLE},
	        {"bus", "passive", EVENT_BUS_PASSIVE}, {"bus", "burst", EVENT_BUS_BURST},
	        {"host", "silent", EVENT_HOST_SILENT}, {"host", "second", EVENT_HOST_SECOND},
	        {"host", "replay", EVENT_HOST_REPLAY}, {"host", "forge", EVENT_HOST_FORGE},
	};
	unsigned long frames;

	for (unsigned i = 0; count == 3 && i < sizeof(spans) / sizeof(spans[0]); i++) {
		if (strcmp(words[0], spans[i].key) != 0 || strcmp(words[1], spans[i].name) != 0)
			continue;
		event->action = spans[i].action;
		if (event->action != EVENT_BUS_BURST)
			return number_read(words[2], 0.001, 60, &event->duration_s);
		if (!scenario_parse_whole(words[2], 1000000, &frames))
			return false;
		event->number = (unsigned)frames;
		return true;
	}
	return false;
}

static bool parse_reset(unsigned count, char **words, struct event *event)
{
	static const char *const causes[] = {"power_on", "command", "watchdog", "brown_out", "pin"};

	event->action = EVENT_RESET;
	for (unsigned i = 0; count == 2 && i < sizeof(causes) / sizeof(causes[0]); i++)
		if (strcmp(words[1], causes[i]) == 0) {
			event->number = i;
			return true;
		}
	return false;
}

static bool parse_hang(unsigned count, char **words, struct event *event)
{
	event->action = EVENT_HANG;
	return count == 2 && strcmp(words[1], "main_loop") == 0;
}

static bool parse_gate(unsigned count, char **words, struct event *event)
{
	static const char *const gates[] = {"upper", "lower"};
	unsigned long pulses = 1;

	event->action = EVENT_GLITCH;
	for (unsigned gate = 0; count == 3 && gate < 2; gate++)
		if (strcmp(words[1], gates[gate]) == 0 && scenario_parse_whole(words[2], 1000, &pulses)) {
			event->number = gate;
			event->pulses = (unsigned)pulses;
			return true;
		}
	return false;
}

static bool parse_dropout(unsigned count, char **words, struct event *event)
{
	event->action = EVENT_DROPOUT;
	return count == 2 && number_read(words[1], 0.002, 0.05, &event->duration_s);
}

static bool parse_friction(unsigned count, char **words, struct event *event)
{
	event->action = EVENT_FRICTION;
	return count == 2 && number_read(words[1], 0, 1000, &event->value);
}

static bool parse_spike(unsigned count, char **words, struct event *event)
{
	event->action = EVENT_SPIKE;
	event->number = count == 3 && strcmp(words[1], "s2") == 0;
	return count == 3 && (event->number == 1 || strcmp(words[1], "s1") == 0) &&
	       number_read(words[2], -2000, 2000, &event->value);
}

static bool parse_let_go(unsigned count, char **words, struct event *event)
{
	event->action = EVENT_LET_GO;
	return count == 2 && strcmp(words[1], "product") == 0;
}

const char scenario_actions[] =
        "fault FAULT, repair FAULT, send VERB [second] [ARGUMENT], send set NAME VALUE, send frame ID#DATA, "
        "bus silent|blocked|off|passive|babble SECONDS, bus burst N, host silent|second|replay|forge "
        "SECONDS, "
        "gate upper|lower PULSES, dropout SECONDS, friction N, spike s1|s2 G, let_go product, reset "
        "power_on|command|watchdog|brown_out|pin, hang "
        "main_loop";

bool scenario_parse_action(unsigned count, char **words, uint8_t sequence, struct event *event)
{
	static const struct {
		const char *word;
		bool (*parse)(unsigned count, char **words, struct event *event);
	} actions[] = {{"fault", parse_fault},       {"repair", parse_fault}, {"reset", parse_reset},
	               {"hang", parse_hang},         {"gate", parse_gate},    {"dropout", parse_dropout},
	               {"friction", parse_friction}, {"spike", parse_spike},  {"let_go", parse_let_go}};

	if (strcmp(words[0], "send") == 0)
		return parse_send(count, words, sequence, event);
	for (size_t i = 0; i < sizeof(actions) / sizeof(actions[0]); i++)
		if (strcmp(words[0], actions[i].word) == 0)
			return actions[i].parse(count, words, event);
	return parse_bus(count, words, event);
}

/* "at STATE", "at STATE +SECONDS" or "at SECONDS" */
static bool parse_when(unsigned count, char **words, struct event *event)
{
	if (count < 2 || count > 3 || strcmp(words[0], "at") != 0)
		return false;
	event->state = scenario_find(words[1], WIRE_STATES, wire_state_name);
	if (event->state >= 0)
		return count == 2 || (words[2][0] == '+' && number_read(words[2] + 1, 0, 60, &event->time_s));
	event->state = EVENT_AT_TIME;
	return count == 2 && number_read(words[1], 0, 60, &event->time_s);
}

int scenario_read_event(struct scenario_reading *reading, const char *name, const char *value)
{
	struct scenario *scenario = &reading->scenario;
	struct event event = {.line = reading->settings.line};
	char text[SCENARIO_EVENT_MAX];
	char *words[SCENARIO_WORDS_MAX];
	unsigned count, what = 0;

	if (scenario->event_count == EVENTS_MAX)
		return settings_fail(&reading->settings, DT_E_FULL, "only %d events in a scenario",
		                     EVENTS_MAX);
	if (snprintf(text, sizeof(text), "%s %s", name, value) >= (int)sizeof(text))
		return settings_fail(&reading->settings, DT_E_FORMAT,
		                     "the event is longer than %zu characters", sizeof(text) - 1);
	count = scenario_split(text, words);
	while (what < count && strcmp(words[what], "at") != 0)
		what++;
	if (!scenario_parse_action(what, words, (uint8_t)(SEQUENCE_FROM + scenario->event_count), &event))
		return settings_fail(&reading->settings, DT_E_FORMAT,
		                     "'%.60s = %.100s' is no event (hil/scenarios/README.md lists them)",
		                     name, value);
	if (!parse_when(count - what, words + what, &event))
		return settings_fail(&reading->settings, DT_E_FORMAT,
		                     "'%.100s', expected ... at STATE [+SECONDS] or ... at SECONDS", value);
	scenario->event[scenario->event_count++] = event;
	return 1;
}
