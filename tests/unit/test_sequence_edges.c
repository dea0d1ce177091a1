/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The sequence at its limits: the outputs of every state from any outputs before, the plan to the last digit,
 * each time one microsecond on either side of a decision. States are set by hand to get at them.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <string.h>

#include "firmware/sequence.h"
#include "tests/unit/fake_port.h"

#define STATE(NAME) WIRE_STATE_##NAME

enum {
	TOKEN = 0x5A17,
	CRC = 0xC0FFEE,
	MAGNET = WIRE_IO_MAGNET_HOLD,
	RELIEVE = WIRE_IO_DAMPERS_RELIEVE,
};

static struct sequence sequence;
static struct parameters parameters;
static uint32_t counters[WIRE_COUNTERS];
static uint32_t now_ms;
static uint16_t checks;
static bool clocks_good;

static void boot(void)
{
	fake_init();
	memset(counters, 0, sizeof(counters));
	parameters_init(&parameters);
	now_ms = 5000;
	fake_time(now_ms * 1000);
	checks = 0;
	clocks_good = true;
	sequence_init(&sequence, &parameters, counters, PORT_RESET_POWER_ON);
}

/* As if it had just got there. */
static void be_in(uint8_t state)
{
	sequence.state = state;
	sequence.fault = state == STATE(FAULT_HELD) || state == STATE(FAULT_MOVING) ? WIRE_FAULT_DOOR
	                                                                            : WIRE_FAULT_NONE;
	sequence.token = state == STATE(ARMED) ? TOKEN : 0;
	sequence.tick_ms = sequence.entered_ms = sequence.released_ms = now_ms;
	sequence.released_us = now_ms * 1000;
	sequence.no_impact_ms = now_ms + SEQUENCE_NO_IMPACT_MS;
	sequence.triggered = false;
	sequence.moved = true;
	sequence.gates_seen = 0;
}

static struct sequence_view look(void)
{
	return (struct sequence_view){
	        .now_us = fake.now_us, .io = port_io(), .checks = checks, .clocks_good = clocks_good};
}

static void tick_at(uint32_t us)
{
	struct sequence_view view;

	fake_time(us);
	view = look();
	sequence_tick(&sequence, &view, us / 1000);
}

static int command(unsigned op, uint32_t argument)
{
	struct wire_command c = {.op = (uint8_t)op, .token = TOKEN, .argument = argument};
	struct sequence_view view = look();

	return sequence_command(&sequence, &view, &c, CRC);
}

/* ---- entering a state ---- */

static void tick_now(void)
{
	tick_at(now_ms * 1000);
}

static void turn_green(void)
{
	tick_now();
}

static void turn_red(void)
{
	checks = WIRE_CHECK_SENSOR_S1;
	tick_now();
}

static void arm(void)
{
	assert_int_equal(command(WIRE_OP_ARM, 0), 0);
}

static void release(void)
{
	assert_int_equal(command(WIRE_OP_RELEASE, 0), 0);
}

static void magnet_goes(void)
{
	fake.outputs = (uint16_t)((fake.outputs & ~MAGNET) | RELIEVE); /* or it would be braked at once */
	tick_now();
}

static void frame_down(void)
{
	fake.inputs |= WIRE_IO_FRAME_DOWN;
	tick_now();
}

static void full(void)
{
	sequence_full(&sequence);
}

static void accept(void)
{
	assert_int_equal(command(WIRE_OP_ACCEPT, CRC), 0);
}

static void fault(void)
{
	sequence_fault(&sequence, WIRE_FAULT_DOOR);
}

static void start(void)
{
	sequence_init(&sequence, &parameters, counters, PORT_RESET_POWER_ON);
}

/* What each state does to outputs that were all off and all on, by the design's section 4: latch 1, magnet 2,
 * dampers relieved 4, camera 8; and which of the two edges planned (magnet, dampers) it takes back. */
static const struct {
	uint8_t from, to;
	void (*event)(void);
	uint16_t after_off, after_on, planned;
} entries[] = {
        {STATE(SAFE), STATE(BOOT), start, 2, 2, 0},
        {STATE(READY), STATE(SAFE), turn_red, 2, 2, 0},
        {STATE(SAFE), STATE(READY), turn_green, 0, 2, 0},
        {STATE(READY), STATE(ARMED), arm, 0, 2, 0},
        {STATE(ARMED), STATE(FALLING), release, 13, 15, MAGNET | RELIEVE},
        {STATE(FALLING), STATE(SEPARATED), magnet_goes, 4, 12, MAGNET | RELIEVE},
        {STATE(SEPARATED), STATE(BRAKED), frame_down, 0, 10, 0},
        {STATE(BRAKED), STATE(CAPTURED), full, 0, 2, 0},
        {STATE(CAPTURED), STATE(UPLOADED), accept, 0, 2, 0},
        {STATE(READY), STATE(FAULT_HELD), fault, 0, 2, 0},
        {STATE(FALLING), STATE(FAULT_MOVING), fault, 0, 2, 0},
};

static void outputs_of_every_state(void **state)
{
	(void)state;
	for (size_t i = 0; i < sizeof(entries) / sizeof(entries[0]); i++) {
		for (unsigned on = 0; on < 2; on++) {
			boot();
			be_in(entries[i].from);
			fake.outputs = on ? 15 : 0;
			fake.planned = 15;
			for (unsigned bit = 0; bit < 4; bit++)
				fake.off_us[bit] = (now_ms + 1000) * 1000;
			entries[i].event();
			assert_int_equal(sequence.state, entries[i].to);
			assert_int_equal(fake.outputs, on ? entries[i].after_on : entries[i].after_off);
			/* the latch and the camera have no edges: what is noted there is none of ours */
			assert_int_equal(fake.planned, 9 | entries[i].planned);
		}
	}
}

static void numbers_that_are_no_state(void **state)
{
	(void)state;
	for (unsigned s = WIRE_STATES; s < 300; s++) {
		assert_false(sequence_moving(s));
		assert_false(sequence_separated(s));
	}
}

/* ---- the plan ---- */

static void set(uint32_t upper, uint32_t lower, uint32_t separation, uint32_t dampers, uint32_t slow)
{
	boot();
	parameters.value[WIRE_PARAMETER_gate_upper_um] = upper;
	parameters.value[WIRE_PARAMETER_gate_lower_um] = lower;
	parameters.value[WIRE_PARAMETER_separation_um] = separation;
	parameters.value[WIRE_PARAMETER_dampers_um] = dampers;
	parameters.value[WIRE_PARAMETER_slow_permille] = slow;
	sequence_plan(&sequence);
}

/* Worked out apart from the code, in whole numbers of any length: roots rounded down of travel x 2^32 and of
 * 2 s / g in us^2, with g 9.81 m/s^2. Falls of 49.05 and 196.2 mm take whole microseconds. */
static void the_plan_to_the_last_digit(void **state)
{
	static const struct {
		uint32_t upper, lower, separation, dampers, slow;
		struct sequence_plan plan;
	} cases[] = {
	        {200000,
	         700000,
	         780000,
	         800000,
	         30,
	         {2003895, 2488589, {403854, 755542}, 153860, 178543, 500000}},
	        {10000, 20000, 30000, 40000, 500, {12873609, 23726566, {90304, 127710}, 16359, 26449, 10000}},
	        {123457,
	         2390001,
	         2399999,
	         2400000,
	         1,
	         {45365, 45370, {317298, 1396076}, 471961, 539660, 2266544}},
	        {49050,
	         196200,
	         441450,
	         784800,
	         1,
	         {16777214, 33554430, {200000, 400000}, 87500, 100050, 147150}},
	};

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		const struct sequence_plan *plan = &sequence.plan, *expected = &cases[i].plan;

		set(cases[i].upper, cases[i].lower, cases[i].separation, cases[i].dampers, cases[i].slow);
		assert_int_equal(plan->separation_q24, expected->separation_q24);
		assert_int_equal(plan->dampers_q24, expected->dampers_q24);
		assert_int_equal(plan->gate_limit_us[0], expected->gate_limit_us[0]);
		assert_int_equal(plan->gate_limit_us[1], expected->gate_limit_us[1]);
		assert_int_equal(plan->fast_us, expected->fast_us);
		assert_int_equal(plan->slow_us, expected->slow_us);
		assert_int_equal(plan->gate_distance_um, expected->gate_distance_um);
	}
}

/* Both gates, in FALLING, so far apart. */
static void gates(uint32_t between_us)
{
	be_in(STATE(FALLING));
	fake.outputs = 15;
	fake.planned = 0;
	sequence.marks = 0;
	sequence.frame_speed_mm_s = 0;
	sequence_gate(&sequence, 0, now_ms * 1000 + 1);
	sequence_gate(&sequence, 1, now_ms * 1000 + 1 + between_us);
}

/* Nearest to between x factor / 2^24, half a microsecond up: separation less the drop-out time, and dampers.
 */
static void edges_are_rounded_to_the_nearest_microsecond(void **state)
{
	static const struct {
		uint32_t between, separation, dampers;
	} cases[] = {
	        {175845, 21003, 26083}, {175846, 21003, 26083}, {175847, 21003, 26084},
	        {175848, 21004, 26084}, {160001, 19111, 23733}, {170003, 20305, 25217},
	        {170011, 20306, 25218},
	};

	(void)state;
	boot();
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		uint32_t lower_us = now_ms * 1000 + 1 + cases[i].between;

		gates(cases[i].between);
		assert_int_equal(fake.off_us[1] - lower_us, cases[i].separation - 8000);
		assert_int_equal(fake.off_us[2] - lower_us, cases[i].dampers);
	}
}

static void times_between_the_gates(void **state)
{
	(void)state;
	boot();
	gates(153859);
	assert_int_equal(sequence.state, STATE(FAULT_MOVING));
	assert_int_equal(fake.planned, 0); /* and nothing else comes of it */
	assert_int_equal(sequence.frame_speed_mm_s, 0);
	assert_int_equal(sequence.marks, WIRE_MARK_FAULT);
	gates(153860);
	assert_int_equal(sequence.state, STATE(FALLING));
	assert_int_equal(fake.planned, MAGNET | RELIEVE);
	assert_int_equal(sequence.frame_speed_mm_s, 3249); /* 500 mm in 153.860 ms */
	gates(178543);
	assert_int_equal(sequence.marks, 0);
	gates(178544);
	assert_int_equal(sequence.marks, WIRE_MARK_SLOW_FRAME);
	assert_int_equal(counters[WIRE_COUNTER_gates_missed], 1);
}

/* Gates that close together are refused above, and yet the speed has its place of 16 bits. */
static void a_speed_too_large_to_tell(void **state)
{
	(void)state;
	boot();
	sequence.plan.fast_us = 0;
	gates(7630);
	assert_int_equal(sequence.frame_speed_mm_s, 65530);
	gates(7629);
	assert_int_equal(sequence.frame_speed_mm_s, 65535);
	gates(1000);
	assert_int_equal(sequence.frame_speed_mm_s, 65535);
}

static void gates_out_of_a_fall_mean_nothing(void **state)
{
	(void)state;
	for (uint8_t s = 0; s < WIRE_STATES; s++) {
		if (s == STATE(FALLING))
			continue;
		boot();
		be_in(s);
		fake.planned = 0;
		sequence_gate(&sequence, 0, now_ms * 1000);
		sequence_gate(&sequence, 1, now_ms * 1000 + 175845);
		assert_int_equal(sequence.state, s);
		assert_int_equal(sequence.gates_seen, 0);
		assert_int_equal(fake.planned, 0);
		assert_int_equal(counters[WIRE_COUNTER_gates_missed], 0);
	}
}

/* ---- times in the fall ---- */

static void a_gate_is_late_from_the_next_microsecond_on(void **state)
{
	static const uint32_t limit_us[2] = {403854, 755542};

	(void)state;
	for (uint8_t gate = 0; gate < 2; gate++) {
		boot();
		be_in(STATE(FALLING));
		fake.inputs &= (uint16_t)~WIRE_IO_LATCH_CLOSED;
		sequence.gates_seen = gate;
		tick_at(now_ms * 1000 + limit_us[gate]);
		assert_int_equal(sequence.state, STATE(FALLING));
		tick_at(now_ms * 1000 + limit_us[gate] + 1);
		assert_int_equal(sequence.fault, WIRE_FAULT_GATES);
	}
}

static void a_frame_stands_still_from_the_next_microsecond_on(void **state)
{
	(void)state;
	boot();
	be_in(STATE(FAULT_MOVING));
	sequence.moved = false;
	tick_at(now_ms * 1000 + 755542);
	assert_int_equal(sequence.state, STATE(FAULT_MOVING));
	tick_at(now_ms * 1000 + 755543);
	assert_int_equal(sequence.state, STATE(FAULT_HELD));
}

static void an_open_latch_is_a_frame_that_moved(void **state)
{
	(void)state;
	for (unsigned closed = 0; closed < 2; closed++) {
		boot();
		be_in(STATE(FALLING));
		sequence.moved = false;
		fake.outputs = 15;
		if (!closed)
			fake.inputs &= (uint16_t)~WIRE_IO_LATCH_CLOSED;
		tick_now();
		assert_int_equal(sequence.moved, !closed);
	}
}

static void braked_by_either(void **state)
{
	static const struct {
		uint16_t outputs, inputs;
		uint8_t to;
	} cases[] = {
	        {RELIEVE | WIRE_IO_LATCH_OPEN, 0, STATE(SEPARATED)},
	        {WIRE_IO_LATCH_OPEN | WIRE_IO_CAMERA | MAGNET, 0, STATE(BRAKED)},
	        {RELIEVE, WIRE_IO_FRAME_DOWN, STATE(BRAKED)},
	        {RELIEVE, 0, STATE(SEPARATED)},
	};

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		boot();
		be_in(STATE(SEPARATED));
		fake.outputs = cases[i].outputs;
		fake.inputs |= cases[i].inputs;
		tick_now();
		assert_int_equal(sequence.state, cases[i].to);
	}
}

/* ---- at rest ---- */

static void a_release_begins_anew(void **state)
{
	(void)state;
	boot();
	be_in(STATE(ARMED));
	sequence.marks = 0xFFFF;
	sequence.frame_speed_mm_s = 1234;
	sequence.gates_seen = 2;
	sequence.triggered = sequence.moved = true;
	release();
	assert_int_equal(sequence.marks, 0);
	assert_int_equal(sequence.frame_speed_mm_s, 0);
	assert_int_equal(sequence.gates_seen, 0);
	assert_false(sequence.triggered || sequence.moved);
}

static void safe_is_not_armed_even_when_all_is_green(void **state)
{
	(void)state;
	boot();
	be_in(STATE(SAFE));
	assert_int_equal(command(WIRE_OP_ARM, 0), DT_E_CHECKS);
	assert_int_equal(sequence.token, 0);
}

static void a_crc_is_looked_at_where_there_is_a_capture(void **state)
{
	(void)state;
	for (uint8_t s = 0; s < WIRE_STATES; s++) {
		boot();
		be_in(s);
		assert_int_equal(command(WIRE_OP_ACCEPT, CRC ^ 1),
		                 s == STATE(CAPTURED) ? DT_E_CORRUPT : DT_E_STATE);
		assert_int_equal(sequence.state, s);
	}
}

/* The clocks are judged at boot and when a fault is cleared. */
static void clocks_at_rest(void **state)
{
	(void)state;
	boot();
	be_in(STATE(READY));
	clocks_good = false;
	tick_at((now_ms + 1000) * 1000);
	assert_int_equal(sequence.state, STATE(READY));
	assert_int_equal(sequence.fault, WIRE_FAULT_NONE);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(outputs_of_every_state),
	        cmocka_unit_test(numbers_that_are_no_state),
	        cmocka_unit_test(the_plan_to_the_last_digit),
	        cmocka_unit_test(edges_are_rounded_to_the_nearest_microsecond),
	        cmocka_unit_test(times_between_the_gates),
	        cmocka_unit_test(a_speed_too_large_to_tell),
	        cmocka_unit_test(gates_out_of_a_fall_mean_nothing),
	        cmocka_unit_test(a_gate_is_late_from_the_next_microsecond_on),
	        cmocka_unit_test(a_frame_stands_still_from_the_next_microsecond_on),
	        cmocka_unit_test(an_open_latch_is_a_frame_that_moved),
	        cmocka_unit_test(braked_by_either),
	        cmocka_unit_test(a_release_begins_anew),
	        cmocka_unit_test(safe_is_not_armed_even_when_all_is_green),
	        cmocka_unit_test(a_crc_is_looked_at_where_there_is_a_capture),
	        cmocka_unit_test(clocks_at_rest),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
