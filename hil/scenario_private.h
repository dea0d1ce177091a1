/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HIL_SCENARIO_PRIVATE_H
#define DT_HIL_SCENARIO_PRIVATE_H
/*
 * What the scenario's own files share: scenario.c is the file and its numbers, scenario_events.c reads [at],
 * scenario_expect.c [expect] and [counters].
 */
#include "common/scenes/settings.h"
#include "hil/scenario.h"

enum {
	SCENARIO_WORDS_MAX = 40,
	SCENARIO_EVENT_MAX = 240, /* characters of an event: one with a frame of 64 bytes fits */
};

struct scenario_reading {
	struct settings settings;
	struct scenario scenario;
};

/* One event from the words of [at] in front of "at"; false when they are none. sequence is that of a command
 * it may send. Its time is left alone. */
bool scenario_parse_action(unsigned count, char **words, uint8_t sequence, struct event *event);
extern const char scenario_actions[]; /* what it knows, for messages */

/* As settings' entry, of their sections. */
int scenario_read_event(struct scenario_reading *reading, const char *name, const char *value);
int scenario_read_expectation(struct scenario_reading *reading, const char *name, const char *value);
int scenario_read_counter(struct scenario_reading *reading, const char *name, const char *value);

/* Everything as expected of a file that says nothing. */
void scenario_expect_nominal(struct scenario *scenario);

/* Nothing but what must never be. */
void scenario_expect_safety(struct scenario *scenario);

/* ---- pieces of text ---- */

/* Decimal, or hexadecimal with 0x. */
bool scenario_parse_whole(const char *text, unsigned long max, unsigned long *number);

/* The limits are the firmware's business. */
bool scenario_parse_parameter(const char *name, const char *value, struct scenario_parameter *parameter);

/* Cuts text, in place, at spaces and commas; returns the words, at most SCENARIO_WORDS_MAX. */
unsigned scenario_split(char *text, char *words[SCENARIO_WORDS_MAX]);

/* Index of the name, -1 if there is none. */
int scenario_find(const char *name, unsigned count, const char *(*name_of)(unsigned));

#endif
