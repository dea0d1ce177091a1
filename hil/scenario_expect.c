/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "common/base/number.h"
#include "common/wire_table.h"
#include "hil/scenario_private.h"

static const struct {
	const char *name;
	int code;
} errors[] = {
#define DT_ERROR(NAME, value, text) {#NAME, (value)},
#include "common/error.def"
#undef DT_ERROR
};
enum { ERRORS = sizeof(errors) / sizeof(errors[0]) };

static const char *scenario_expect_error_of(unsigned i)
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

/* "3" or "2..5". */
static bool parse_range(const char *text, struct scenario_range *range)
{
	const char *dots = strstr(text, "..");
	char first[40];
	struct scenario_range wanted;

	if (dots == NULL) {
		if (!number_read(text, -1e12, 1e12, &wanted.min))
			return false;
		wanted.max = wanted.min;
	} else {
		if ((size_t)(dots - text) >= sizeof(first))
			return false;
		memcpy(first, text, (size_t)(dots - text));
		first[dots - text] = '\0';
		if (!number_read(first, -1e12, 1e12, &wanted.min) ||
		    !number_read(dots + 2, wanted.min, 1e12, &wanted.max))
			return false;
	}
	*range = wanted;
	return true;
}

static int read_range(struct scenario_reading *reading, const char *name, const char *value,
                      struct scenario_range *range)
{
	if (!parse_range(value, range))
		return settings_fail(&reading->settings, DT_E_FORMAT,
		                     "%.60s = '%.60s', expected a number or a range such as 2..5", name,
		                     value);
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
        {"checks", offsetof(struct scenario, checks), WIRE_CHECKS, 0, WIRE_CHECKS, wire_check_name},
        {"marks", offsetof(struct scenario, marks), 16, 0, 16, mark_of},
        {"replies", offsetof(struct scenario, replies), WIRE_STATES, 0, SCENARIO_LIST_MAX, wire_state_name},
        {"refused", offsetof(struct scenario, refused), ERRORS, 0, SCENARIO_LIST_MAX,
         scenario_expect_error_of},
        {"aborts", offsetof(struct scenario, aborts), 0, 0, SCENARIO_LIST_MAX, NULL},
};
enum { LISTS = sizeof(lists) / sizeof(lists[0]) };

static bool parse_item(const struct list_kind *kind, const char *word, int32_t *item)
{
	unsigned long number;
	int index;

	if (kind->name_of == NULL) {
		if (!scenario_parse_whole(word, INT32_MAX, &number))
			return false;
		*item = (int32_t)number;
		return true;
	}
	index = scenario_find(word, kind->names, kind->name_of);
	*item = kind->name_of == scenario_expect_error_of && index >= 0 ? errors[index].code : index;
	return index >= 0;
}

/* One that is given again goes on. */
static int scenario_expect_read_list(struct scenario_reading *reading, const struct list_kind *kind,
                                     const char *value)
{
	struct scenario_list *list = (void *)((char *)&reading->scenario + kind->offset);
	char text[512];
	char *words[SCENARIO_WORDS_MAX];
	unsigned count;

	if (snprintf(text, sizeof(text), "%s", value) >= (int)sizeof(text))
		return settings_fail(&reading->settings, DT_E_FORMAT, "%s is too long", kind->key);
	count = scenario_split(text, words);
	if (count == 0)
		return settings_fail(&reading->settings, DT_E_FORMAT, "%s is empty, expected - for nothing",
		                     kind->key);
	if (count == 1 && strcmp(words[0], "-") == 0)
		count = 0;
	if (list->count + count < kind->count_min || list->count + count > kind->count_max)
		return settings_fail(&reading->settings, DT_E_FORMAT, "%s has %u entries, expected %u to %u",
		                     kind->key, list->count + count, kind->count_min, kind->count_max);
	for (unsigned i = 0; i < count; i++)
		if (!parse_item(kind, words[i], &list->item[list->count + i]))
			return settings_fail(&reading->settings, DT_E_FORMAT,
			                     "%s: no such name or number as '%.60s'", kind->key, words[i]);
	list->count += count;
	list->given = true;
	return 1;
}

int scenario_read_expectation(struct scenario_reading *reading, const char *name, const char *value)
{
	int result = scenario_find(name, SCENARIO_RESULTS, scenario_result_name);

	if (result >= 0)
		return read_range(reading, name, value, &reading->scenario.result[result]);
	for (unsigned i = 0; i < LISTS; i++)
		if (strcmp(name, lists[i].key) == 0)
			return scenario_expect_read_list(reading, &lists[i], value);
	return settings_fail(&reading->settings, DT_E_FORMAT, "unknown key '%.60s' in [expect]", name);
}

int scenario_read_counter(struct scenario_reading *reading, const char *name, const char *value)
{
	int counter = scenario_find(name, WIRE_COUNTERS, wire_counter_name);

	if (counter < 0)
		return settings_fail(&reading->settings, DT_E_FORMAT, "wire.def has no counter '%.60s'",
		                     name);
	return read_range(reading, name, value, &reading->scenario.counter[counter]);
}

void scenario_expect_nominal(struct scenario *scenario)
{
	for (unsigned i = 0; i < SCENARIO_RESULTS; i++)
		scenario->result[i] = results[i].initial;
	/* What the firmware sent and got is checked against the bench's own count, in the ledgers. */
	scenario->counter[WIRE_COUNTER_frames_sent] = (struct scenario_range){NAN, NAN};
	scenario->counter[WIRE_COUNTER_frames_received] = (struct scenario_range){NAN, NAN};
}

void scenario_expect_safety(struct scenario *scenario)
{
	const struct scenario_range nothing = {NAN, NAN};

	for (unsigned i = 0; i < LISTS; i++)
		((struct scenario_list *)(void *)((char *)scenario + lists[i].offset))->given = false;
	for (unsigned i = 0; i < SCENARIO_RESULTS; i++)
		if (i != SCENARIO_unsafe && i != SCENARIO_unbraked)
			scenario->result[i] = nothing;
	for (unsigned i = 0; i < WIRE_COUNTERS; i++)
		scenario->counter[i] = nothing;
}
