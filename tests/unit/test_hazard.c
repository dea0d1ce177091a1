/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What must never be: a run without fault counts nothing, and each of the ways to go wrong is counted once.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "hil/hazard.h"

#define GOOD                                                                                           \
	(WIRE_IO_LATCH_CLOSED | WIRE_IO_PRODUCT_HELD | WIRE_IO_DAMPERS_ENGAGED | WIRE_IO_DOOR_CLOSED | \
	 WIRE_IO_ESTOP_CLEAR | WIRE_IO_SUPPLY_GOOD)
#define AWAY (GOOD & ~WIRE_IO_LATCH_CLOSED)
#define FREE (AWAY & ~WIRE_IO_PRODUCT_HELD)

/* By hand: from the latch at 3 s down to the dampers in 0.8 m, sqrt(2 * 0.8 / 9.80665) s. */
#define DAMPERS_M 0.8
#define RELEASED_S 3.0
#define DOWN_S 3.41792

static struct hazard hazard;
static struct tower_truth truth;

static void sample_until(double *time_s, double until_s, uint16_t inputs, unsigned captures)
{
	for (; *time_s < until_s; *time_s += 0.0001) {
		hazard_sample(&hazard, inputs, captures, &truth, *time_s);
		captures = 0;
	}
}

static void say(uint8_t state, double time_s)
{
	hazard_state(&hazard, state, &truth, time_s);
	for (int i = 0; i < 5; i++)
		hazard_block(&hazard, state, hazard.outputs);
}

/* What a run does otherwise than a good one. */
struct slip {
	bool not_acknowledged, short_warning, no_warning, unasked, magnet_early, relief_late,
	        relief_on_dead_gates, frame_hangs, coils_at_rest, warning_at_rest, falls_early;
	uint16_t open_at_release, open_in_fall, open_below;
};

static unsigned run(const struct slip *slip)
{
	double now = 0;

	memset(&truth, 0, sizeof(truth));
	truth.latch_open_s = truth.frame_down_s = truth.separation_s = NAN;
	hazard_init(&hazard, DAMPERS_M);
	hazard_edge(&hazard, WIRE_IO_MAGNET_HOLD, true, false, 0);
	sample_until(&now, 0.5, GOOD, 0);
	say(WIRE_STATE_SAFE, now);
	if (!slip->not_acknowledged)
		hazard_acknowledged(&hazard);
	sample_until(&now, 1.5, GOOD, 0);
	say(WIRE_STATE_READY, now);
	sample_until(&now, 1.6, GOOD, 0);
	if (slip->falls_early)
		truth.separation_s = now;
	if (slip->magnet_early)
		hazard_edge(&hazard, WIRE_IO_MAGNET_HOLD, false, false, now);
	sample_until(&now, slip->short_warning ? 2.1 : 1.9, GOOD, 0);
	if (!slip->no_warning)
		hazard_edge(&hazard, WIRE_IO_WARNING, true, false, now);
	say(WIRE_STATE_ARMED, now);
	sample_until(&now, RELEASED_S, GOOD & (uint16_t)~slip->open_at_release, 0);
	hazard_edge(&hazard, WIRE_IO_LATCH_OPEN, true, !slip->unasked, RELEASED_S);
	hazard_edge(&hazard, WIRE_IO_DAMPERS_RELIEVE, true, !slip->unasked, RELEASED_S);
	truth.latch_open_s = RELEASED_S + 0.012;
	truth.frame_away = true;
	say(WIRE_STATE_FALLING, now);
	sample_until(&now, 3.2, AWAY, 1);
	sample_until(&now, 3.38, AWAY & (uint16_t)~slip->open_in_fall, slip->relief_on_dead_gates ? 0 : 2);
	hazard_edge(&hazard, WIRE_IO_MAGNET_HOLD, false, false, now);
	hazard_edge(&hazard, WIRE_IO_LATCH_OPEN, false, false, now);
	say(WIRE_STATE_SEPARATED, now);
	sample_until(&now, slip->relief_on_dead_gates ? 3.408 : DOWN_S, FREE, 0);
	if (!slip->frame_hangs) {
		truth.frame_down_s = DOWN_S;
		truth.frame_away = false;
	}
	truth.frame_moving = true;
	sample_until(&now, slip->relief_late ? DOWN_S + 0.002 : DOWN_S + 0.0005,
	             FREE & (uint16_t)~slip->open_below, 0);
	truth.frame_moving = false;
	hazard_edge(&hazard, WIRE_IO_DAMPERS_RELIEVE, false, false, now);
	hazard_edge(&hazard, WIRE_IO_WARNING, false, false, now);
	say(WIRE_STATE_BRAKED, now);
	sample_until(&now, 4, FREE | WIRE_IO_FRAME_DOWN, 0);
	say(WIRE_STATE_CAPTURED, now);
	if (slip->coils_at_rest)
		hazard_edge(&hazard, WIRE_IO_LATCH_OPEN, true, true, 4);
	if (slip->warning_at_rest)
		hazard_edge(&hazard, WIRE_IO_WARNING, true, true, 4);
	return hazard_count(&hazard);
}

static void a_good_drop_counts_nothing(void **state)
{
	(void)state;
	assert_int_equal(run(&(struct slip){0}), 0);
	assert_null(hazard.first);
	assert_int_equal(hazard.unbraked, 0);
}

static void a_frame_without_brakes_is_counted_apart(void **state)
{
	(void)state;
	run(&(struct slip){.relief_late = true});
	assert_int_equal(hazard.unbraked, 1);
	assert_int_equal(run(&(struct slip){.open_below = WIRE_IO_DAMPERS_ENGAGED}), 0);
	assert_int_equal(hazard.unbraked, 1);
	run(&(struct slip){.relief_late = true, .open_below = WIRE_IO_ESTOP_CLEAR}); /* its contacts brake */
	assert_int_equal(hazard.unbraked, 0);
}

static void each_slip_is_counted_once(void **state)
{
	static const struct {
		struct slip slip;
		const char *what;
		unsigned count;
	} known[] = {
	        {{.not_acknowledged = true}, "READY with a guard lost", 1},
	        {{.short_warning = true}, "before the warning", 1},
	        {{.no_warning = true},
	         "no warning while armed",
	         3},                                            /* armed; then the latch; falling goes on */
	        {{.unasked = true}, "latch opened unasked", 3}, /* and the relief, and the frame falls */
	        {{.magnet_early = true}, "magnet off with the frame at height", 1},
	        {{.relief_late = true}, "after the frame met them", 1},
	        {{.frame_hangs = true}, "motion ended", 1},
	        {{.falls_early = true}, "nobody had released", 1},
	        {{.open_at_release = WIRE_IO_SUPPLY_GOOD}, "with a guard open", 1},
	        {{.open_at_release = WIRE_IO_DAMPERS_ENGAGED}, "with a guard open", 1},
	        {{.open_in_fall = WIRE_IO_DOOR_CLOSED}, "with door or emergency stop open", 1},
	        {{.open_in_fall = WIRE_IO_ESTOP_CLEAR}, "with door or emergency stop open", 1},
	};

	(void)state;
	for (size_t i = 0; i < sizeof(known) / sizeof(known[0]); i++) {
		unsigned count = run(&known[i].slip);

		if (known[i].slip.no_warning) /* told in blocks, and by the latch */
			assert_in_range(count, 2, known[i].count);
		else
			assert_int_equal(count, known[i].count);
		if (strstr(hazard.first, known[i].what) == NULL)
			fail_msg("expected \"%s\" in \"%s\"", known[i].what, hazard.first);
	}
	assert_int_equal(run(&(struct slip){.coils_at_rest = true}),
	                 1 + 1); /* after the warning, and left on */
	assert_int_equal(run(&(struct slip){.warning_at_rest = true}), 1);
}

/* With both gates seen the relief may go on to the dampers; with one it ends where a free fall would. */
static void relief_ends_by_the_clock(void **state)
{
	(void)state;
	assert_int_equal(run(&(struct slip){.relief_on_dead_gates = true}), 1);
	assert_non_null(strstr(hazard.first, "beyond the free fall"));
}

/* Lost in READY for longer than it takes to see: it must go, and stay away until somebody acknowledges. */
static void a_lost_guard_wants_an_acknowledgement(void **state)
{
	static const uint16_t guards[] = {WIRE_IO_LATCH_CLOSED, WIRE_IO_PRODUCT_HELD, WIRE_IO_DOOR_CLOSED,
	                                  WIRE_IO_ESTOP_CLEAR};

	(void)state;
	for (size_t i = 0; i < sizeof(guards) / sizeof(guards[0]); i++)
		for (int acknowledged = 0; acknowledged < 2; acknowledged++) {
			double now = 0;

			memset(&truth, 0, sizeof(truth));
			truth.latch_open_s = truth.frame_down_s = truth.separation_s = NAN;
			hazard_init(&hazard, DAMPERS_M);
			sample_until(&now, 0.5, GOOD, 0);
			hazard_acknowledged(&hazard);
			say(WIRE_STATE_READY, now);
			sample_until(&now, 0.504, GOOD & (uint16_t)~guards[i], 0); /* too short to be seen */
			sample_until(&now, 1, GOOD, 0);
			assert_int_equal(hazard_count(&hazard), 0);
			sample_until(&now, 1.01, GOOD & (uint16_t)~guards[i], 0);
			say(WIRE_STATE_SAFE, now);
			hazard_acknowledged(&hazard); /* with the guard open it is none */
			sample_until(&now, 2, GOOD, 0);
			if (acknowledged)
				hazard_acknowledged(&hazard);
			say(WIRE_STATE_READY, now);
			sample_until(&now, 2.1, GOOD, 0);
			assert_int_equal(hazard_count(&hazard), !acknowledged);
		}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(a_good_drop_counts_nothing),
	        cmocka_unit_test(a_frame_without_brakes_is_counted_apart),
	        cmocka_unit_test(each_slip_is_counted_once),
	        cmocka_unit_test(relief_ends_by_the_clock),
	        cmocka_unit_test(a_lost_guard_wants_an_acknowledgement),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
