/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "hil/scenario.h"

#include <errno.h>
#include <ini.h>
#include <math.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/link/candump.h"
#include "common/wire_table.h"
#include "hil/tower.h"

enum {
	WORDS_MAX = 40,
	TOKEN = 0x5A5A,       /* the script's */
	SEQUENCE_FROM = 0x80, /* of commands that [at] sends: the script counts from 0 */
	SDO_WRITE = 0x23,
};

struct reading {
	struct scenario scenario;
	FILE *in;
	const char *file;
	int line; /* of the text inih looks at */
	char *message;
	int result;
};

/* ---- saying what is wrong ---- */

/* 0: inih's word for "stop here". */
__attribute__((format(printf, 3, 4))) static int fail(struct reading *reading, int code, const char *format,
                                                      ...)
{
	int used =
	        snprintf(reading->message, SCENARIO_MESSAGE_MAX, "%.200s:%d: ", reading->file, reading->line);
	va_list arguments;

	va_start(arguments, format);
	vsnprintf(reading->message + used, SCENARIO_MESSAGE_MAX - (size_t)used, format, arguments);
	va_end(arguments);
	reading->result = code;
	return 0;
}

static int fail_number(struct reading *reading, const char *what, const char *text, double min, double max)
{
	return fail(reading, DT_E_RANGE, "%.60s = '%.60s', expected a number from %g to %g", what, text, min,
	            max);
}

/* ---- pieces of text ---- */

static bool parse_number(const char *text, double min, double max, double *number)
{
	char *end;
	double value = strtod(text, &end);

	if (end == text || *end != '\0' || !(value >= min && value <= max)) /* NaN fails too */
		return false;
	*number = value;
	return true;
}

static bool parse_whole(const char *text, unsigned long max, unsigned long *number)
{
	char *end;
	unsigned long value;

	errno = 0;
	value = strtoul(text, &end, 0);
	if (*text < '0' || *text > '9' || *end != '\0' || errno != 0 || value > max)
		return false;
	*number = value;
	return true;
}

/* Cuts text, in place, at spaces and commas; returns the words, at most WORDS_MAX. */
static unsigned split(char *text, char *words[WORDS_MAX])
{
	unsigned count = 0;
	char *rest = NULL;

	for (char *word = strtok_r(text, " ,\t", &rest); word != NULL && count < WORDS_MAX;
	     word = strtok_r(NULL, " ,\t", &rest))
		words[count++] = word;
	return count;
}

/* Index of the name, -1 if there is none. */
static int find(const char *name, unsigned count, const char *(*name_of)(unsigned))
{
	for (unsigned i = 0; i < count; i++)
		if (strcmp(name, name_of(i)) == 0)
			return (int)i;
	return -1;
}

static const char *fault_of_tower(unsigned i)
{
	return tower_fault_name((enum tower_fault)i);
}

static const struct {
	const char *name;
	int code;
} errors[] = {
#define DT_ERROR(NAME, value, text) {#NAME, (value)},
#include "common/error.def"
#undef DT_ERROR
};
enum { ERRORS = sizeof(errors) / sizeof(errors[0]) };

static const char *error_of(unsigned i)
{
	return errors[i].name;
}

const char *scenario_error_name(int error)
{
	for (unsigned i = 0; i < ERRORS; i++)
		if (errors[i].code == error)
			return errors[i].name;
	return "?";
}

static const struct {
	const char *name;
	struct scenario_range initial;
} results[SCENARIO_RESULTS] = {
#define SCENARIO_RESULT(name, min, max, doc) {#name, {(min), (max)}},
#include "hil/scenario.def"
};

const char *scenario_result_name(unsigned result)
{
	return result < SCENARIO_RESULTS ? results[result].name : "?";
}

/* ---- [run] [bus] [operator] [scene] [parameters] ---- */

static const struct number {
	const char *section, *name;
	size_t offset;
	double min, max, initial;
} numbers[] = {
#define SCENARIO_NUMBER(section, key, min, max, initial, doc) \
	{#section, #key, offsetof(struct scenario, section##_##key), min, max, initial},
#include "hil/scenario.def"
};
enum { NUMBERS = sizeof(numbers) / sizeof(numbers[0]) };

static double *number_in(struct scenario *scenario, const struct number *number)
{
	return (double *)(void *)((char *)scenario + number->offset);
}

static const struct {
	const char *name;
	size_t offset;
	double min, max;
} scene_keys[] = {
#define SCENE_KEY(section, key, min, max, initial, doc) \
	{#key, offsetof(struct scene, section##_##key), min, max},
#include "common/scenes/scene.def"
#undef SCENE_KEY
};
enum { SCENE_KEYS = sizeof(scene_keys) / sizeof(scene_keys[0]) };

static int read_text(struct reading *reading, const char *name, const char *value, char *to, size_t size)
{
	if (to[0] != '\0')
		return fail(reading, DT_E_FORMAT, "%s is given twice", name);
	if (value[0] == '\0' || strlen(value) >= size)
		return fail(reading, DT_E_FORMAT, "%s is empty or too long", name);
	memcpy(to, value, strlen(value) + 1);
	return 1;
}

static int read_number(struct reading *reading, const char *section, const char *name, const char *value)
{
	for (unsigned i = 0; i < NUMBERS; i++) {
		const struct number *number = &numbers[i];

		if (strcmp(section, number->section) != 0 || strcmp(name, number->name) != 0)
			continue;
		if (!parse_number(value, number->min, number->max, number_in(&reading->scenario, number)))
			return fail_number(reading, name, value, number->min, number->max);
		return 1;
	}
	return fail(reading, DT_E_FORMAT, "unknown key '%.60s' in [%.60s]", name, section);
}

static int read_override(struct reading *reading, const char *name, const char *value)
{
	struct scenario *scenario = &reading->scenario;

	for (unsigned i = 0; i < SCENE_KEYS; i++) {
		struct scenario_override *to = &scenario->override[scenario->override_count];

		if (strcmp(name, scene_keys[i].name) != 0)
			continue;
		if (scenario->override_count == SCENARIO_OVERRIDES_MAX)
			return fail(reading, DT_E_FULL, "only %d values of the scene can be changed",
			            SCENARIO_OVERRIDES_MAX);
		if (!parse_number(value, scene_keys[i].min, scene_keys[i].max, &to->value))
			return fail_number(reading, name, value, scene_keys[i].min, scene_keys[i].max);
		to->offset = scene_keys[i].offset;
		scenario->override_count++;
		return 1;
	}
	return fail(reading, DT_E_FORMAT, "the scene has no '%.60s' (common/scenes/scene.def)", name);
}

/* The limits are the firmware's business. */
static bool parse_parameter(const char *name, const char *value, struct scenario_parameter *parameter)
{
	unsigned long number;

	for (unsigned i = 0; i < WIRE_PARAMETERS; i++) {
		if (strcmp(name, wire_parameters[i].name) != 0)
			continue;
		if (!parse_whole(value, UINT32_MAX, &number))
			return false;
		*parameter = (struct scenario_parameter){wire_parameters[i].index, (uint32_t)number};
		return true;
	}
	return false;
}

static int read_parameter(struct reading *reading, const char *name, const char *value)
{
	struct scenario *scenario = &reading->scenario;

	if (scenario->parameter_count == SCENARIO_PARAMETERS_MAX)
		return fail(reading, DT_E_FULL, "only %d parameters can be written", SCENARIO_PARAMETERS_MAX);
	if (!parse_parameter(name, value, &scenario->parameter[scenario->parameter_count]))
		return fail(reading, DT_E_FORMAT,
		            "%.60s = '%.60s', expected a parameter of wire.def and a whole number", name,
		            value);
	scenario->parameter_count++;
	return 1;
}

/* ---- [at] ---- */

static bool parse_fault(unsigned count, char **words, struct event *event)
{
	int fault = count == 2 ? find(words[1], TOWER_FAULTS, fault_of_tower) : -1;

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
	struct wire_command command = {.sequence = sequence, .token = TOKEN};
	unsigned long token = TOKEN;

	for (unsigned op = 1; command.op == 0 && op <= UINT8_MAX; op++)
		if (strcasecmp(words[1], wire_op_name(op)) == 0)
			command.op = (uint8_t)op;
	if (command.op == 0 || count > 3 || (count == 3 && !parse_whole(words[2], UINT16_MAX, &token)))
		return false;
	command.token = (uint16_t)token;
	wire_pack_command(&event->frame, WIRE_ID_COMMAND, &command);
	return true;
}

/* send abort | send release 0x1234 | send set NAME VALUE | send frame 000#0201 */
static bool parse_send(unsigned count, char **words, uint8_t sequence, struct event *event)
{
	struct scenario_parameter parameter;

	event->action = EVENT_SEND;
	if (count == 3 && strcmp(words[1], "frame") == 0)
		return parse_frame(words[2], &event->frame);
	if (count != 4 || strcmp(words[1], "set") != 0)
		return count >= 2 && parse_verb(count, words, sequence, event);
	if (!parse_parameter(words[2], words[3], &parameter))
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
	        {"bus", "silent", EVENT_BUS_SILENT}, {"bus", "blocked", EVENT_BUS_BLOCKED},
	        {"bus", "off", EVENT_BUS_OFF},       {"bus", "babble", EVENT_BUS_BABBLE},
	        {"bus", "burst", EVENT_BUS_BURST},   {"host", "silent", EVENT_HOST_SILENT},
	};
	unsigned long frames;

	for (unsigned i = 0; count == 3 && i < sizeof(spans) / sizeof(spans[0]); i++) {
		if (strcmp(words[0], spans[i].key) != 0 || strcmp(words[1], spans[i].name) != 0)
			continue;
		event->action = spans[i].action;
		if (event->action != EVENT_BUS_BURST)
			return parse_number(words[2], 0.001, 60, &event->duration_s);
		if (!parse_whole(words[2], 1000000, &frames))
			return false;
		event->number = (unsigned)frames;
		return true;
	}
	return false;
}

static bool parse_reset(unsigned count, char **words, struct event *event)
{
	static const char *const causes[] = {"power_on", "command", "watchdog", "brown_out"};

	event->action = EVENT_RESET;
	for (unsigned i = 0; count == 2 && i < sizeof(causes) / sizeof(causes[0]); i++)
		if (strcmp(words[1], causes[i]) == 0) {
			event->number = i;
			return true;
		}
	return false;
}

static bool parse_action(unsigned count, char **words, uint8_t sequence, struct event *event)
{
	if (strcmp(words[0], "fault") == 0 || strcmp(words[0], "repair") == 0)
		return parse_fault(count, words, event);
	if (strcmp(words[0], "send") == 0)
		return parse_send(count, words, sequence, event);
	if (strcmp(words[0], "reset") == 0)
		return parse_reset(count, words, event);
	return parse_bus(count, words, event);
}

/* "at STATE", "at STATE +SECONDS" or "at SECONDS" */
static bool parse_when(unsigned count, char **words, struct event *event)
{
	if (count < 2 || count > 3 || strcmp(words[0], "at") != 0)
		return false;
	event->state = find(words[1], WIRE_STATES, wire_state_name);
	if (event->state >= 0)
		return count == 2 ||
		       (words[2][0] == '+' && parse_number(words[2] + 1, 0, 60, &event->time_s));
	event->state = EVENT_AT_TIME;
	return count == 2 && parse_number(words[1], 0, 60, &event->time_s);
}

static int read_event(struct reading *reading, const char *name, const char *value)
{
	struct scenario *scenario = &reading->scenario;
	struct event event = {.line = reading->line};
	char text[160];
	char *words[WORDS_MAX];
	unsigned count, what = 0;

	if (scenario->event_count == EVENTS_MAX)
		return fail(reading, DT_E_FULL, "only %d events in a scenario", EVENTS_MAX);
	if (snprintf(text, sizeof(text), "%s %s", name, value) >= (int)sizeof(text))
		return fail(reading, DT_E_FORMAT, "the event is longer than %zu characters",
		            sizeof(text) - 1);
	count = split(text, words);
	while (what < count && strcmp(words[what], "at") != 0)
		what++;
	if (!parse_action(what, words, (uint8_t)(SEQUENCE_FROM + scenario->event_count), &event))
		return fail(reading, DT_E_FORMAT,
		            "'%.60s = %.100s' is no event (hil/scenarios/README.md lists them)", name, value);
	if (!parse_when(count - what, words + what, &event))
		return fail(reading, DT_E_FORMAT,
		            "'%.100s', expected ... at STATE [+SECONDS] or ... at SECONDS", value);
	scenario->event[scenario->event_count++] = event;
	return 1;
}

/* ---- [expect] [counters] ---- */

/* "3" or "2..5". */
static bool parse_range(const char *text, struct scenario_range *range)
{
	const char *dots = strstr(text, "..");
	char first[40];
	struct scenario_range wanted;

	if (dots == NULL) {
		if (!parse_number(text, -1e12, 1e12, &wanted.min))
			return false;
		wanted.max = wanted.min;
	} else {
		if ((size_t)(dots - text) >= sizeof(first))
			return false;
		memcpy(first, text, (size_t)(dots - text));
		first[dots - text] = '\0';
		if (!parse_number(first, -1e12, 1e12, &wanted.min) ||
		    !parse_number(dots + 2, wanted.min, 1e12, &wanted.max))
			return false;
	}
	*range = wanted;
	return true;
}

static int read_range(struct reading *reading, const char *name, const char *value,
                      struct scenario_range *range)
{
	if (!parse_range(value, range))
		return fail(reading, DT_E_FORMAT,
		            "%.60s = '%.60s', expected a number or a range such as 2..5", name, value);
	return 1;
}

static const char *mark_of(unsigned bit)
{
	return wire_mark_name(bit);
}

/* Each kind of list: how an item is written, and how many an expectation has. */
static const struct list_kind {
	const char *key;
	size_t offset;
	unsigned names, count_min, count_max;
	const char *(*name_of)(unsigned); /* NULL: whole numbers */
} lists[] = {
        {"end", offsetof(struct scenario, end), WIRE_STATES, 1, 1, wire_state_name},
        {"fault", offsetof(struct scenario, fault), WIRE_FAULTS, 1, 1, wire_fault_name},
        {"emcy", offsetof(struct scenario, emcy), WIRE_FAULTS, 0, SCENARIO_LIST_MAX, wire_fault_name},
        {"path", offsetof(struct scenario, path), WIRE_STATES, 1, SCENARIO_LIST_MAX, wire_state_name},
        {"marks", offsetof(struct scenario, marks), 16, 0, 16, mark_of},
        {"replies", offsetof(struct scenario, replies), WIRE_STATES, 0, SCENARIO_LIST_MAX, wire_state_name},
        {"refused", offsetof(struct scenario, refused), ERRORS, 0, SCENARIO_LIST_MAX, error_of},
        {"aborts", offsetof(struct scenario, aborts), 0, 0, SCENARIO_LIST_MAX, NULL},
};
enum { LISTS = sizeof(lists) / sizeof(lists[0]) };

static bool parse_item(const struct list_kind *kind, const char *word, int32_t *item)
{
	unsigned long number;
	int index;

	if (kind->name_of == NULL) {
		if (!parse_whole(word, INT32_MAX, &number))
			return false;
		*item = (int32_t)number;
		return true;
	}
	index = find(word, kind->names, kind->name_of);
	*item = kind->name_of == error_of && index >= 0 ? errors[index].code : index;
	return index >= 0;
}

static int read_list(struct reading *reading, const struct list_kind *kind, const char *value)
{
	struct scenario_list *list = (void *)((char *)&reading->scenario + kind->offset);
	char text[512];
	char *words[WORDS_MAX];
	unsigned count;

	if (list->given)
		return fail(reading, DT_E_FORMAT, "%s is given twice", kind->key);
	if (snprintf(text, sizeof(text), "%s", value) >= (int)sizeof(text))
		return fail(reading, DT_E_FORMAT, "%s is too long", kind->key);
	count = split(text, words);
	if (count == 1 && strcmp(words[0], "-") == 0)
		count = 0;
	else if (count == 0)
		return fail(reading, DT_E_FORMAT, "%s is empty, expected - for nothing", kind->key);
	if (count < kind->count_min || count > kind->count_max)
		return fail(reading, DT_E_FORMAT, "%s has %u entries, expected %u to %u", kind->key, count,
		            kind->count_min, kind->count_max);
	for (unsigned i = 0; i < count; i++)
		if (!parse_item(kind, words[i], &list->item[i]))
			return fail(reading, DT_E_FORMAT, "%s: no such name or number as '%.60s'", kind->key,
			            words[i]);
	list->count = count;
	list->given = true;
	return 1;
}

static int read_expectation(struct reading *reading, const char *name, const char *value)
{
	int result = find(name, SCENARIO_RESULTS, scenario_result_name);

	if (result >= 0)
		return read_range(reading, name, value, &reading->scenario.result[result]);
	for (unsigned i = 0; i < LISTS; i++)
		if (strcmp(name, lists[i].key) == 0)
			return read_list(reading, &lists[i], value);
	return fail(reading, DT_E_FORMAT, "unknown key '%.60s' in [expect]", name);
}

static int read_counter(struct reading *reading, const char *name, const char *value)
{
	int counter = find(name, WIRE_COUNTERS, wire_counter_name);

	if (counter < 0)
		return fail(reading, DT_E_FORMAT, "wire.def has no counter '%.60s'", name);
	return read_range(reading, name, value, &reading->scenario.counter[counter]);
}

/* ---- the file ---- */

/* fgets for inih that counts the lines: Debian's build does not tell the handler where it is. */
static char *read_line(char *text, int size, void *user)
{
	struct reading *reading = user;

	if (fgets(text, size, reading->in) == NULL)
		return NULL;
	reading->line++;
	if (strchr(text, '\n') == NULL && !feof(reading->in)) { /* inih would take the rest for a new line */
		fail(reading, DT_E_FORMAT, "a line longer than %d characters", size - 2);
		return NULL;
	}
	return text;
}

static int read_entry(void *user, const char *section, const char *name, const char *value)
{
	struct reading *reading = user;
	struct scenario *scenario = &reading->scenario;

	if (reading->result != 0)
		return 0;
	if (section[0] == '\0' && strcmp(name, "title") == 0)
		return read_text(reading, name, value, scenario->title, sizeof(scenario->title));
	if (strcmp(section, "run") == 0 && strcmp(name, "scene") == 0)
		return read_text(reading, name, value, scenario->scene_file, sizeof(scenario->scene_file));
	if (strcmp(section, "scene") == 0)
		return read_override(reading, name, value);
	if (strcmp(section, "parameters") == 0)
		return read_parameter(reading, name, value);
	if (strcmp(section, "at") == 0)
		return read_event(reading, name, value);
	if (strcmp(section, "expect") == 0)
		return read_expectation(reading, name, value);
	if (strcmp(section, "counters") == 0)
		return read_counter(reading, name, value);
	return read_number(reading, section, name, value);
}

static void begin(struct scenario *scenario)
{
	for (unsigned i = 0; i < NUMBERS; i++)
		*number_in(scenario, &numbers[i]) = numbers[i].initial;
	for (unsigned i = 0; i < SCENARIO_RESULTS; i++)
		scenario->result[i] = results[i].initial;
	/* What the firmware sent and got is checked against the bench's own count, in the ledgers. */
	scenario->counter[WIRE_COUNTER_frames_sent] = (struct scenario_range){NAN, NAN};
	scenario->counter[WIRE_COUNTER_frames_received] = (struct scenario_range){NAN, NAN};
}

static int complete(struct reading *reading)
{
	const struct scenario *scenario = &reading->scenario;
	const char *missing = NULL;

	if (scenario->title[0] == '\0')
		missing = "title";
	else if (scenario->scene_file[0] == '\0')
		missing = "[run] scene";
	else if (!scenario->end.given)
		missing = "[expect] end";
	else if (!scenario->fault.given)
		missing = "[expect] fault";
	else if (!scenario->emcy.given)
		missing = "[expect] emcy";
	else if (!scenario->marks.given && !(scenario->result[SCENARIO_captures].max <= 0))
		missing = "[expect] marks";
	if (missing == NULL)
		return 0;
	snprintf(reading->message, SCENARIO_MESSAGE_MAX, "%.200s: %s is missing", reading->file, missing);
	return DT_E_FORMAT;
}

int scenario_read(struct scenario *scenario, const char *file, char message[SCENARIO_MESSAGE_MAX])
{
	struct reading reading = {.file = file, .message = message};
	int result;

	begin(&reading.scenario);
	reading.in = fopen(file, "re");
	if (reading.in == NULL) {
		snprintf(message, SCENARIO_MESSAGE_MAX, "%.300s: %s", file, strerror(errno));
		return DT_E_SYSTEM;
	}
	result = ini_parse_stream(read_line, &reading, read_entry, &reading);
	fclose(reading.in);
	if (reading.result != 0)
		return reading.result;
	if (result != 0) {
		snprintf(message, SCENARIO_MESSAGE_MAX, "%.300s:%d: not a [section] or key = value", file,
		         result);
		return DT_E_FORMAT;
	}
	result = complete(&reading);
	if (result == 0)
		*scenario = reading.scenario;
	return result;
}

int scenario_scene(const struct scenario *scenario, struct scene *scene, char message[SCENE_MESSAGE_MAX])
{
	struct scene wanted;
	int result = scene_read(&wanted, scenario->scene_file, message);

	if (result != 0)
		return result;
	if (!isnan(scenario->run_angle_deg))
		wanted.drop_angle_deg = scenario->run_angle_deg;
	for (unsigned i = 0; i < scenario->override_count; i++)
		*(double *)(void *)((char *)&wanted + scenario->override[i].offset) =
		        scenario->override[i].value;
	result = scene_check(&wanted, scenario->scene_file, message);
	if (result == 0)
		*scene = wanted;
	return result;
}
