/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Scenario files: what they say arrives, and every mistake is named with its line.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "hil/scenario.h"
#include "hil/tower.h"
#include "tests/unit/scratch.h"

/* Three lines more than the body has: a mistake in its first line is in line 4. */
#define HEAD "title = T\n[run]\nscene = common/scenes/geometry-1.ini\n"
#define TAIL "[expect]\nend = READY\nfault = NONE\nemcy = -\nmarks = -\n"

static char message[SCENARIO_MESSAGE_MAX];

static int read_text(struct scenario *scenario, const char *text)
{
	char file[SCRATCH_MAX];
	int fd = mkstemp(scratch_name(file, "scenario")), result;
	FILE *out = fdopen(fd, "w");

	assert_non_null(out);
	fputs(text, out);
	fclose(out);
	message[0] = '\0';
	result = scenario_read(scenario, file, message);
	unlink(file);
	return result;
}

static void good(struct scenario *scenario, const char *body)
{
	char text[2000];

	snprintf(text, sizeof(text), "%s%s%s", HEAD, body, TAIL);
	if (read_text(scenario, text) != 0)
		fail_msg("%s", message);
}

static void says_what_the_file_says(void **state)
{
	struct scenario s;

	(void)state;
	good(&s, "angle_deg = 30\nseed = 9\n[bus]\nloss = 0.05\n[operator]\ndrops = 2\n"
	         "[parameters]\ndropout_us = 9000\n[scene]\nnoise_g = 2.5\n"
	         "[counters]\nframes_unknown = 3\nblocks_resent = 1..7\n[expect]\nseparation_mm = -1.5..2\n"
	         "path = BOOT, SAFE READY\nrefused = TOKEN STATE\naborts = 0x06090031\n");
	assert_string_equal(s.title, "T");
	assert_string_equal(s.scene_file, "common/scenes/geometry-1.ini");
	assert_true(s.run_angle_deg == 30 && s.run_seed == 9 && s.bus_loss == 0.05 && s.operator_drops == 2);
	assert_int_equal(s.parameter_count, 1);
	assert_int_equal(s.parameter[0].index, 0x2004);
	assert_int_equal(s.parameter[0].value, 9000);
	assert_true(s.counter[WIRE_COUNTER_frames_unknown].min == 3 &&
	            s.counter[WIRE_COUNTER_frames_unknown].max == 3);
	assert_true(s.counter[WIRE_COUNTER_blocks_resent].min == 1 &&
	            s.counter[WIRE_COUNTER_blocks_resent].max == 7);
	assert_true(s.result[SCENARIO_separation_mm].min == -1.5 &&
	            s.result[SCENARIO_separation_mm].max == 2);
	assert_int_equal(s.path.count, 3);
	assert_int_equal(s.path.item[2], WIRE_STATE_READY);
	assert_int_equal(s.refused.item[0], DT_E_TOKEN);
	assert_int_equal(s.aborts.item[0], 0x06090031);
	assert_int_equal(s.end.item[0], WIRE_STATE_READY);
	assert_true(s.emcy.given && s.emcy.count == 0);
}

/* Paths are long. */
static void lists_go_on(void **state)
{
	struct scenario s;

	(void)state;
	good(&s, "[expect]\npath = BOOT SAFE\npath = READY\nchecks = TRIGGER OPEN_S1\nreplies = -\npath = "
	         "ARMED\n");
	assert_int_equal(s.path.count, 4);
	for (int i = 0; i < 4; i++)
		assert_int_equal(s.path.item[i], WIRE_STATE_BOOT + i);
	assert_int_equal(s.checks.count, 2);
	assert_int_equal(1 << s.checks.item[0], WIRE_CHECK_TRIGGER);
	assert_int_equal(1 << s.checks.item[1], WIRE_CHECK_OPEN_S1);
	assert_true(s.replies.given && s.replies.count == 0);
}

/* A file that says nothing of them expects no loss, no refusal, one complete drop. */
static void silence_means_nominal(void **state)
{
	struct scenario s;

	(void)state;
	good(&s, "");
	for (unsigned i = 0; i < WIRE_COUNTERS; i++) {
		if (i == WIRE_COUNTER_frames_sent || i == WIRE_COUNTER_frames_received)
			continue;
		assert_true(s.counter[i].min == 0 && s.counter[i].max == 0);
	}
	assert_true(s.result[SCENARIO_complete].min == 1 && s.result[SCENARIO_complete].max == 1);
	assert_true(s.result[SCENARIO_unsafe].min == 0 && s.result[SCENARIO_unsafe].max == 0);
	assert_true(isnan(s.result[SCENARIO_separation_mm].min));
	assert_false(s.path.given);
}

static void reads_events(void **state)
{
	struct scenario s;
	static const uint8_t set[8] = {0x23, 0x04, 0x20, 0, 0x10, 0x27, 0, 0};

	(void)state;
	good(&s, "[at]\nfault = door_open at ARMED +0.25\nsend = release 0x1234 at 1.5\n"
	         "send = set dropout_us 10000 at READY\nsend = frame 000#0201 at FALLING\n"
	         "bus = off 0.2 at BRAKED\nhost = silent 3 at 0\nreset = watchdog at BOOT +0.01\n"
	         "bus = burst 50 at BRAKED\nrepair = door_open at FAULT_HELD\nsend = abort at SAFE\n"
	         "hang = main_loop at SAFE +0.5\n");
	assert_int_equal(s.event_count, 11);
	assert_int_equal(s.event[10].action, EVENT_HANG);
	assert_true(s.event[10].time_s == 0.5);
	assert_int_equal(s.event[0].action, EVENT_FAULT);
	assert_int_equal(s.event[0].number, TOWER_DOOR_OPEN);
	assert_int_equal(s.event[0].state, WIRE_STATE_ARMED);
	assert_true(s.event[0].time_s == 0.25);
	assert_int_equal(s.event[0].line, 5);
	assert_int_equal(s.event[1].state, EVENT_AT_TIME);
	assert_true(s.event[1].time_s == 1.5);
	assert_int_equal(s.event[1].action, EVENT_VERB);
	assert_int_equal(s.event[1].command.op, WIRE_OP_RELEASE);
	assert_int_equal(s.event[1].command.sequence, 0x81);
	assert_int_equal(s.event[1].command.argument, 0x1234);
	assert_true(s.event[1].forged && !s.event[1].second);
	assert_int_equal(s.event[2].frame.id, 0x601);
	assert_memory_equal(s.event[2].frame.data, set, sizeof(set));
	assert_int_equal(s.event[3].frame.id, 0);
	assert_int_equal(s.event[3].frame.length, 2);
	assert_int_equal(s.event[4].action, EVENT_BUS_OFF);
	assert_true(s.event[4].duration_s == 0.2);
	assert_int_equal(s.event[5].action, EVENT_HOST_SILENT);
	assert_int_equal(s.event[6].action, EVENT_RESET);
	assert_int_equal(s.event[6].number, 2);
	assert_int_equal(s.event[7].number, 50);
	assert_int_equal(s.event[8].action, EVENT_REPAIR);
	assert_int_equal(s.event[9].command.op, WIRE_OP_ABORT);
	assert_false(s.event[9].forged || s.event[9].second);
}

static void reads_events_of_the_tower_and_of_other_hosts(void **state)
{
	static const struct event known[] = {
	        {.action = EVENT_GLITCH, .number = 0, .pulses = 3},
	        {.action = EVENT_GLITCH, .number = 1, .pulses = 1000},
	        {.action = EVENT_DROPOUT, .duration_s = 0.02},
	        {.action = EVENT_FRICTION, .value = 7.5},
	        {.action = EVENT_SPIKE, .number = 0, .value = 300},
	        {.action = EVENT_SPIKE, .number = 1, .value = -80},
	        {.action = EVENT_LET_GO},
	        {.action = EVENT_HOST_SECOND, .duration_s = 2},
	        {.action = EVENT_HOST_REPLAY, .duration_s = 3},
	        {.action = EVENT_HOST_FORGE, .duration_s = 4},
	        {.action = EVENT_BUS_PASSIVE, .duration_s = 0.5},
	        {.action = EVENT_RESET, .number = 4},
	        {.action = EVENT_FAULT, .number = TOWER_FRAME_JAMMED},
	        {.action = EVENT_VERB, .second = true, .command = {.op = WIRE_OP_ARM}},
	        {.action = EVENT_VERB,
	         .second = true,
	         .forged = true,
	         .command = {.op = WIRE_OP_ARM, .argument = 7}},
	};
	struct scenario s;

	(void)state;
	good(&s,
	     "[at]\ngate = upper 3 at 1\ngate = lower 1000 at 1\ndropout = 0.02 at 1\nfriction = 7.5 at 1\n"
	     "spike = s1 300 at 1\nspike = s2 -80 at 1\nlet_go = product at 1\nhost = second 2 at 1\n"
	     "host = replay 3 at 1\nhost = forge 4 at 1\nbus = passive 0.5 at 1\nreset = pin at 1\n"
	     "fault = frame_jammed at 1\nsend = arm second at 1\nsend = arm second 7 at 1\n");
	assert_int_equal(s.event_count, sizeof(known) / sizeof(known[0]));
	for (unsigned i = 0; i < s.event_count; i++) {
		assert_int_equal(s.event[i].action, known[i].action);
		assert_int_equal(s.event[i].number, known[i].number);
		assert_int_equal(s.event[i].pulses, known[i].pulses);
		assert_true(s.event[i].duration_s == known[i].duration_s);
		assert_true(s.event[i].value == known[i].value);
		assert_int_equal(s.event[i].command.op, known[i].command.op);
		assert_int_equal(s.event[i].command.argument, known[i].command.argument);
		assert_int_equal(s.event[i].second, known[i].second);
		assert_int_equal(s.event[i].forged, known[i].forged);
	}
}

/* The longest there is, and what comes with it. */
static void reads_a_frame_of_64_bytes(void **state)
{
	struct scenario s;
	char body[400];

	(void)state;
	snprintf(body, sizeof(body), "[at]\nsend = frame 181##1%0126d7F at FAULT_MOVING +0.123456\n", 0);
	good(&s, body);
	assert_int_equal(s.event[0].frame.length, 64);
	assert_int_equal(s.event[0].frame.data[63], 0x7F);
	assert_int_equal(s.event[0].state, WIRE_STATE_FAULT_MOVING);
}

static void names_the_line_of_a_mistake(void **state)
{
	static const struct {
		const char *body, *text;
	} bad[] = {
	        {"angle_deg = 5\n", ":4: angle_deg = '5', expected a number from 10 to 80"},
	        {"seed = x\n", ":4: seed = 'x', expected a number"},
	        {"speed = 1\n", ":4: unknown key 'speed' in [run]"},
	        {"scene = twice\n", ":4: scene is given twice"},
	        {"[nowhere]\nx = 1\n", ":5: unknown key 'x' in [nowhere]"},
	        {"[bus]\nloss = 1.5\n", ":5: loss = '1.5', expected a number from 0 to 1"},
	        {"[bus]\nloss = nan\n", ":5: loss = 'nan', expected"},
	        {"[scene]\nweight = 1\n", ":5: the scene has no 'weight'"},
	        {"[scene]\nnoise_g = -1\n", ":5: noise_g = '-1', expected"},
	        {"[parameters]\nnothing = 1\n", ":5: nothing = '1', expected a parameter"},
	        {"[parameters]\ndropout_us = 1.5\n", ":5: dropout_us = '1.5', expected a parameter"},
	        {"[counters]\nnothing = 1\n", ":5: wire.def has no counter 'nothing'"},
	        {"[counters]\nframes_unknown = 2..1\n", ":5: frames_unknown = '2..1', expected a number or"},
	        {"[counters]\nframes_unknown =\n", ":5: frames_unknown = '', expected"},
	        {"[expect]\nnothing = 1\n", ":5: unknown key 'nothing' in [expect]"},
	        {"[expect]\nimpacts = 1..\n", ":5: impacts = '1..', expected"},
	        {"[expect]\npath = BOOT NOWHERE\n", ":5: path: no such name or number as 'NOWHERE'"},
	        {"[expect]\npath = -\n", ":5: path has 0 entries, expected 1 to 64"},
	        {"[expect]\nrefused =\n", ":5: refused is empty, expected - for nothing"},
	        {"[expect]\naborts = many\n", ":5: aborts: no such name or number as 'many'"},
	        {"[expect]\nend = SAFE READY\n", ":5: end has 2 entries, expected 1 to 1"},
	        {"[expect]\nend = SAFE\nend = READY\n", ":6: end has 2 entries, expected 1 to 1"},
	        {"[expect]\nchecks = LATCH NOTHING\n", ":5: checks: no such name or number as 'NOTHING'"},
	        {"[at]\nhang = interrupt at 1\n", ":5: 'hang = interrupt at 1' is no event"},
	        {"[at]\nfault = nothing at 1\n", ":5: 'fault = nothing at 1' is no event"},
	        {"[at]\nfault = door_open at NOWHERE\n", ":5: 'door_open at NOWHERE', expected ... at STATE"},
	        {"[at]\nfault = door_open\n", ":5: 'door_open', expected ... at STATE"},
	        {"[at]\nfault = door_open at ARMED 0.1\n", ":5: 'door_open at ARMED 0.1', expected"},
	        {"[at]\nsend = jump at 1\n", ":5: 'send = jump at 1' is no event"},
	        {"[at]\nsend = arm 5000000000 at 1\n", ":5: 'send = arm 5000000000 at 1' is no event"},
	        {"[at]\nsend = arm third at 1\n", ":5: 'send = arm third at 1' is no event"},
	        {"[at]\nsend = arm 1 2 at 1\n", ":5: 'send = arm 1 2 at 1' is no event"},
	        {"[at]\ngate = middle 1 at 1\n", ":5: 'gate = middle 1 at 1' is no event"},
	        {"[at]\ngate = upper at 1\n", ":5: 'gate = upper at 1' is no event"},
	        {"[at]\ndropout = 0.051 at 1\n", ":5: 'dropout = 0.051 at 1' is no event"},
	        {"[at]\nhost = replay at 1\n", ":5: 'host = replay at 1' is no event"},
	        {"[at]\nsend = frame 12345#00 at 1\n", ":5: 'send = frame 12345#00 at 1' is no event"},
	        {"[at]\nbus = off at 1\n", ":5: 'bus = off at 1' is no event"},
	        {"[at]\nreset = button at 1\n", ":5: 'reset = button at 1' is no event"},
	        {"no equals sign\n", ":4: not a [section] or key = value"},
	};

	(void)state;
	for (unsigned i = 0; i < sizeof(bad) / sizeof(bad[0]); i++) {
		struct scenario s = {.title = "before"};
		char text[2000];

		snprintf(text, sizeof(text), "%s%s%s", HEAD, bad[i].body, TAIL);
		assert_true(read_text(&s, text) < 0);
		if (strstr(message, bad[i].text) == NULL)
			fail_msg("expected \"%s\" in \"%s\"", bad[i].text, message);
		assert_string_equal(s.title, "before");
	}
}

static void names_what_is_missing(void **state)
{
	static const char *const texts[][2] = {
	        {"[run]\nscene = x\n" TAIL, "title is missing"},
	        {"title = T\n" TAIL, "[run] scene is missing"},
	        {HEAD "[expect]\nfault = NONE\nemcy = -\nmarks = -\n", "[expect] end is missing"},
	        {HEAD "[expect]\nend = READY\nemcy = -\nmarks = -\n", "[expect] fault is missing"},
	        {HEAD "[expect]\nend = READY\nfault = NONE\nmarks = -\n", "[expect] emcy is missing"},
	        {HEAD "[expect]\nend = READY\nfault = NONE\nemcy = -\n", "[expect] marks is missing"},
	};
	struct scenario s;

	(void)state;
	for (unsigned i = 0; i < sizeof(texts) / sizeof(texts[0]); i++) {
		assert_true(read_text(&s, texts[i][0]) < 0);
		if (strstr(message, texts[i][1]) == NULL)
			fail_msg("expected \"%s\" in \"%s\"", texts[i][1], message);
	}
	assert_int_equal(read_text(&s, HEAD "[expect]\nend = READY\nfault = NONE\nemcy = -\ncaptures = 0\n"),
	                 0);
	assert_int_equal(read_text(&s, HEAD "safety = 1\n"), 0); /* nothing but what must never be */
	assert_false(s.end.given);
	assert_true(isnan(s.result[SCENARIO_done].min) && isnan(s.counter[0].min));
	assert_true(s.result[SCENARIO_unsafe].max == 0 && s.result[SCENARIO_unbraked].max == 0);
	assert_int_equal(scenario_read(&s, "/nowhere.ini", message), DT_E_SYSTEM);
}

/* Longer than inih reads at once: it must not become two. */
static void refuses_a_line_that_is_too_long(void **state)
{
	struct scenario s;
	char text[2000];

	(void)state;
	snprintf(text, sizeof(text), "%stitle2 = %0300d\n%s", HEAD, 0, TAIL);
	assert_true(read_text(&s, text) < 0);
	assert_non_null(strstr(message, ":4: a line longer than"));
}

static void keeps_lists_within_bounds(void **state)
{
	char text[4000];
	struct scenario s;
	size_t used = (size_t)snprintf(text, sizeof(text), "%s[at]\n", HEAD);

	(void)state;
	for (unsigned i = 0; i < EVENTS_MAX + 1; i++)
		used += (size_t)snprintf(text + used, sizeof(text) - used, "send = abort at 1\n");
	snprintf(text + used, sizeof(text) - used, "%s", TAIL);
	assert_true(read_text(&s, text) < 0);
	assert_non_null(strstr(message, ":69: only 64 events"));
}

static void puts_its_values_into_the_scene(void **state)
{
	char text[SCENE_MESSAGE_MAX];
	struct scenario s;
	struct scene scene;

	(void)state;
	good(&s, "angle_deg = 31\n[scene]\nfriction = 0.5\n");
	assert_int_equal(scenario_scene(&s, &scene, text), 0);
	assert_true(scene.drop_angle_deg == 31 && scene.contact_friction == 0.5);
	good(&s, "[scene]\ngate_upper_m = 0.75\n");
	assert_true(scenario_scene(&s, &scene, text) < 0);
	assert_non_null(strstr(text, ", changed by [scene]: the gates are not in order"));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(says_what_the_file_says),
	        cmocka_unit_test(lists_go_on),
	        cmocka_unit_test(silence_means_nominal),
	        cmocka_unit_test(reads_events),
	        cmocka_unit_test(reads_events_of_the_tower_and_of_other_hosts),
	        cmocka_unit_test(reads_a_frame_of_64_bytes),
	        cmocka_unit_test(names_the_line_of_a_mistake),
	        cmocka_unit_test(names_what_is_missing),
	        cmocka_unit_test(refuses_a_line_that_is_too_long),
	        cmocka_unit_test(keeps_lists_within_bounds),
	        cmocka_unit_test(puts_its_values_into_the_scene),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
