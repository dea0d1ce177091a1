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
	SESSION = 0x5A17C0DE,
	NONCE = 0x01234567,
	CRC = 0xC0FFEE,
	MAGNET = WIRE_IO_MAGNET_HOLD,
	RELIEVE = WIRE_IO_DAMPERS_RELIEVE,
};

static const uint32_t SET = 0x89ABCDEF;

#define GATE_US (now_ms * 1000 + 350000) /* plausible for both gates */

static struct sequence sequence;
static struct parameters parameters;
static uint32_t counters[WIRE_COUNTERS];
static uint32_t now_ms;
static uint32_t checks;
static struct hosts hosts;

static void boot(void)
{
	fake_init();
	memset(counters, 0, sizeof(counters));
	parameters_init(&parameters);
	now_ms = 5000;
	fake_time(now_ms * 1000);
	checks = 0;
	hosts_init(&hosts, &parameters, counters);
	hosts_heard(&hosts, now_ms, SESSION, true);
	sequence_init(&sequence, &parameters, counters, PORT_RESET_POWER_ON);
	sequence_plan(&sequence);
}

/* As if it had just got there. */
static void be_in(uint8_t state)
{
	sequence.state = state;
	sequence.fault = state == STATE(FAULT_HELD) || state == STATE(FAULT_MOVING) ? WIRE_FAULT_DOOR
	                                                                            : WIRE_FAULT_NONE;
	sequence.session = state == STATE(ARMED) ? SESSION : 0;
	sequence.nonce = state == STATE(ARMED) ? NONCE : 0;
	sequence.release_key =
	        state == STATE(ARMED) ? wire_answer(NONCE, sequence_next_drop(&sequence), SET) : 0;
	sequence.parameters_crc32 = SET;
	sequence.acknowledged = sequence.settled = true;
	sequence.tick_ms = sequence.released_ms = now_ms;
	sequence.entered_ms = state == STATE(ARMED) ? now_ms - 1000 : now_ms;
	sequence.times = (struct fall_times){.released_us = now_ms * 1000, .dropout_us = 8000};
	sequence.io = 0;
	sequence.no_impact_ms = now_ms + SEQUENCE_NO_IMPACT_MS;
	sequence.triggered = false;
	sequence.moved = true;
}

static struct sequence_view look(void)
{
	return (struct sequence_view){
	        .now_us = fake.now_us, .io = port_io(), .known = UINT16_MAX, .checks = checks};
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
	struct sequence_order order = {
	        .command = {.op = (uint8_t)op, .host = (uint16_t)SESSION, .argument = argument},
	        .hosts = &hosts,
	        .capture_crc32 = CRC,
	        .parameters_crc32 = SET,
	        .dropout_us = 8000,
	        .nonce = NONCE,
	        .nonce_good = true,
	};
	struct sequence_view view = look();

	return sequence_command(&sequence, &view, &order);
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
	sequence.nonce = NONCE;
	sequence.challenged_ms = now_ms;
	assert_int_equal(command(WIRE_OP_ARM, wire_answer(NONCE, SESSION, SET)), 0);
}

static void release(void)
{
	assert_int_equal(command(WIRE_OP_RELEASE, wire_answer(NONCE, sequence_next_drop(&sequence), SET)), 0);
}

static void magnet_goes(void)
{
	fake.outputs = (uint16_t)((fake.outputs & ~MAGNET) | RELIEVE); /* or it would be braked at once */
	sequence.times.magnet_planned = true;
	tick_now();
}

static void frame_down(void)
{
	fake.inputs |= WIRE_IO_FRAME_DOWN;
	tick_now();
}

static void full(void)
{
	sequence.io = WIRE_IO_FRAME_DOWN;
	sequence_full(&sequence);
}

static void jam(void)
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
 * dampers relieved 4, camera 8, warning 16; and which of the two edges planned (magnet, dampers) it takes
 * back. */
static const struct {
	uint8_t from, to;
	void (*event)(void);
	uint16_t after_off, after_on, planned;
} entries[] = {
        {STATE(SAFE), STATE(BOOT), start, 2, 2, 0},
        {STATE(READY), STATE(SAFE), turn_red, 2, 2, 0},
        {STATE(SAFE), STATE(READY), turn_green, 0, 2, 0},
        {STATE(READY), STATE(ARMED), arm, 16, 18, 0},
        {STATE(ARMED), STATE(FALLING), release, 29, 31, MAGNET | RELIEVE},
        {STATE(FALLING), STATE(SEPARATED), magnet_goes, 20, 28, MAGNET | RELIEVE},
        {STATE(SEPARATED), STATE(BRAKED), frame_down, 0, 10, 0},
        {STATE(BRAKED), STATE(CAPTURED), full, 0, 2, 0},
        {STATE(BRAKED), STATE(KEEP_OUT), jam, 0, 2, 0},
        {STATE(KEEP_OUT), STATE(CAPTURED), frame_down, 0, 2, 0},
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
			fake.outputs = on ? 31 : 0;
			fake.planned = 31;
			for (unsigned bit = 0; bit < 5; bit++)
				fake.off_us[bit] = (now_ms + 1000) * 1000;
			entries[i].event();
			assert_int_equal(sequence.state, entries[i].to);
			assert_int_equal(fake.outputs, on ? entries[i].after_on : entries[i].after_off);
			/* latch, camera and warning have no edges: what is noted there is none of ours */
			assert_int_equal(fake.planned, 25 | entries[i].planned);
		}
	}
}

static void numbers_that_are_no_state(void **state)
{
	(void)state;
	for (unsigned s = WIRE_STATES; s < 300; s++) {
		assert_false(sequence_moving(s));
		assert_false(sequence_separated(s));
		assert_false(sequence_captured(s));
	}
}

static void separated_states(void **state)
{
	(void)state;
	for (unsigned s = 0; s < WIRE_STATES; s++)
		assert_int_equal(sequence_separated(s),
		                 s == STATE(SEPARATED) || s == STATE(BRAKED) || s == STATE(FAULT_MOVING));
}

/* The state before a reset is kept until BOOT is over: another reset shall still know of it. */
static void boot_keeps_the_state_before(void **state)
{
	(void)state;
	boot();
	fake.kept = STATE(READY);
	start();
	assert_int_equal(sequence.state, STATE(BOOT));
	assert_int_equal(fake.kept, STATE(READY));
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
	sequence_replan(&sequence);
	sequence_plan(&sequence);
}

/* Worked out apart from the code, in whole numbers of any length: roots rounded down of travel x 2^32 and of
 * 2 s / g in us^2, with g 9.80665 m/s^2, for the relief 9.84. */
static void the_plan_to_the_last_digit(void **state)
{
	static const struct {
		uint32_t upper, lower, separation, dampers, slow;
		struct fall_plan plan;
	} cases[] = {
	        {200000,
	         700000,
	         780000,
	         800000,
	         30,
	         {29308590,
	          54831351,
	          2003895,
	          2488589,
	          {176715, 330606},
	          {403922, 755672},
	          153890,
	          178573,
	          500000,
	          403238,
	          807846}},
	        {10000,
	         20000,
	         30000,
	         40000,
	         500,
	         {6553600,
	          9268190,
	          12873609,
	          23726566,
	          {39515, 55881},
	          {90320, 127730},
	          16366,
	          26455,
	          10000,
	          90166,
	          180640}},
	        {123457,
	         2390001,
	         2399999,
	         2400000,
	         1,
	         {23027022,
	          101316218,
	          45365,
	          45370,
	          {138841, 610887},
	          {317352, 1396314},
	          472045,
	          539752,
	          2266544,
	          698430,
	          1399232}},
	        {49050,
	         196200,
	         441450,
	         784800,
	         1,
	         {14514411,
	          29028823,
	          16777214,
	          33554430,
	          {87514, 175029},
	          {200034, 400068},
	          87514,
	          100067,
	          147150,
	          399389,
	          800136}},
	};

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		const struct fall_plan *plan = &sequence.plan, *expected = &cases[i].plan;

		set(cases[i].upper, cases[i].lower, cases[i].separation, cases[i].dampers, cases[i].slow);
		assert_int_equal(plan->separation_q24, expected->separation_q24);
		assert_int_equal(plan->dampers_q24, expected->dampers_q24);
		for (unsigned gate = 0; gate < 2; gate++) {
			assert_int_equal(plan->gate_first_us[gate], expected->gate_first_us[gate]);
			assert_int_equal(plan->gate_last_us[gate], expected->gate_last_us[gate]);
		}
		assert_int_equal(plan->upper_root, expected->upper_root);
		assert_int_equal(plan->lower_root, expected->lower_root);
		assert_int_equal(plan->relief_us, expected->relief_us);
		assert_int_equal(plan->end_us, expected->end_us);
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
	sequence_gate(&sequence, 0, GATE_US);
	sequence_gate(&sequence, 1, GATE_US + between_us);
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
		uint32_t lower_us = GATE_US + cases[i].between;

		gates(cases[i].between);
		assert_int_equal(fake.off_us[1] - lower_us, cases[i].separation - 8000);
		assert_int_equal(fake.off_us[2] - lower_us, cases[i].dampers);
	}
}

static void times_between_the_gates(void **state)
{
	(void)state;
	boot();
	gates(153889);
	assert_int_equal(sequence.state, STATE(FAULT_MOVING));
	assert_int_equal(fake.planned, 0); /* and nothing else comes of it */
	assert_int_equal(sequence.frame_speed_mm_s, 0);
	assert_int_equal(sequence.marks, WIRE_MARK_FAULT);
	gates(153890);
	assert_int_equal(sequence.state, STATE(FALLING));
	assert_int_equal(fake.planned, MAGNET | RELIEVE);
	assert_int_equal(sequence.times.gates, 2);
	assert_int_equal(sequence.frame_speed_mm_s, 3249); /* 500 mm in 153.890 ms */
	gates(178573);
	assert_int_equal(sequence.marks, 0);
	gates(178574);
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
		assert_int_equal(sequence.times.gates, 0);
		assert_int_equal(counters[WIRE_COUNTER_gates_ignored], 2);
		assert_int_equal(fake.planned, 0);
		assert_int_equal(counters[WIRE_COUNTER_gates_missed], 0);
	}
}

/* ---- times in the fall ---- */

static void a_gate_is_late_from_the_next_microsecond_on(void **state)
{
	static const uint32_t limit_us[2] = {403922, 755672};

	(void)state;
	for (uint8_t gate = 0; gate < 2; gate++) {
		boot();
		be_in(STATE(FALLING));
		fake.inputs &= (uint16_t)~WIRE_IO_LATCH_CLOSED;
		sequence.times.gates = gate;
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
	tick_at(now_ms * 1000 + 755672);
	assert_int_equal(sequence.state, STATE(FAULT_MOVING));
	tick_at(now_ms * 1000 + 755673);
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

static void a_gate_is_early_up_to_a_microsecond_before(void **state)
{
	(void)state;
	boot();
	be_in(STATE(FALLING));
	sequence_gate(&sequence, 0, now_ms * 1000 + 176714);
	assert_int_equal(sequence.times.gates, 0);
	sequence_gate(&sequence, 0, now_ms * 1000 + 176715);
	assert_int_equal(sequence.times.gates, 1);
	sequence_gate(&sequence, 1, now_ms * 1000 + 330605);
	assert_int_equal(sequence.times.gates, 1);
	sequence_gate(&sequence, 1, now_ms * 1000 + 330606);
	assert_int_equal(sequence.times.gates, 2);
	assert_int_equal(counters[WIRE_COUNTER_gates_ignored], 2);
}

static void a_fall_ends_from_the_next_microsecond_on(void **state)
{
	(void)state;
	boot();
	be_in(STATE(FALLING));
	fake.inputs &= (uint16_t)~WIRE_IO_LATCH_CLOSED;
	sequence.times.gates = 2;
	tick_at(now_ms * 1000 + 807846);
	assert_int_equal(sequence.state, STATE(FALLING));
	tick_at(now_ms * 1000 + 807847);
	assert_int_equal(sequence.fault, WIRE_FAULT_GATES);
}

static void no_separation_without_an_edge(void **state)
{
	(void)state;
	boot();
	be_in(STATE(FALLING));
	fake.inputs &= (uint16_t)~WIRE_IO_LATCH_CLOSED;
	fake.outputs = WIRE_IO_LATCH_OPEN | RELIEVE;
	tick_now();
	assert_int_equal(sequence.state, STATE(FALLING));
	sequence.times.magnet_planned = true;
	tick_now();
	assert_int_equal(sequence.state, STATE(SEPARATED));
}

static bool keeper_fell(uint8_t state, bool planned, uint32_t after_us)
{
	boot();
	be_in(state);
	fake.outputs = 0;
	sequence.times.magnet_planned = planned;
	sequence.times.magnet_off_us = now_ms * 1000;
	sequence_keeper(&sequence, now_ms * 1000 + after_us);
	return sequence.times.keeper_fell;
}

static void the_keeper_counts_behind_a_planned_edge_in_motion(void **state)
{
	(void)state;
	for (uint8_t s = 0; s < WIRE_STATES; s++) {
		bool moving = (s >= STATE(FALLING) && s <= STATE(BRAKED)) || s == STATE(FAULT_MOVING) ||
		              s == STATE(KEEP_OUT);

		assert_int_equal(keeper_fell(s, true, 8000), moving);
		assert_false(keeper_fell(s, false, 8000));
	}
	assert_true(keeper_fell(STATE(BRAKED), true, 0));
	assert_false(keeper_fell(STATE(BRAKED), true, UINT32_MAX));
}

/* ---- one input, one check ---- */

static void see(uint8_t state, uint32_t since_ms, uint16_t io, uint32_t red)
{
	struct sequence_view view;

	boot();
	view = (struct sequence_view){.now_us = fake.now_us, .io = io, .known = UINT16_MAX, .checks = red};
	be_in(state);
	sequence.entered_ms = now_ms - since_ms;
	sequence_tick(&sequence, &view, now_ms);
}

/* The latch's switch, or the dampers'; no other bit of the io word. */
static void what_tells_where_the_frame_is(void **state)
{
	(void)state;
	for (unsigned bit = 0; bit < 16; bit++) {
		uint16_t io = (uint16_t)(1u << bit);
		bool rests = io == WIRE_IO_LATCH_CLOSED || io == WIRE_IO_FRAME_DOWN;

		see(STATE(KEEP_OUT), 0, io, 0);
		assert_int_equal(sequence.state, rests ? STATE(CAPTURED) : STATE(KEEP_OUT));
		see(STATE(BOOT), 0, io, 0);
		assert_int_equal(sequence.state, rests ? STATE(BOOT) : STATE(FAULT_HELD));
	}
}

static void the_self_test_is_of_the_clocks(void **state)
{
	(void)state;
	for (unsigned bit = 0; bit < WIRE_CHECK_NUMBER_ACKNOWLEDGE; bit++) {
		uint32_t red = 1u << bit;

		see(STATE(BOOT), 100, WIRE_IO_LATCH_CLOSED, red);
		assert_int_equal(sequence.state, red == WIRE_CHECK_CLOCKS ? STATE(FAULT_HELD) : STATE(SAFE));
	}
}

static bool is_guard(uint32_t check)
{
	return check == WIRE_CHECK_ESTOP || check == WIRE_CHECK_DOOR || check == WIRE_CHECK_LATCH ||
	       check == WIRE_CHECK_PRODUCT;
}

static int clear_with(uint8_t state, uint32_t red)
{
	boot();
	be_in(state);
	if (state == STATE(FAULT_HELD))
		sequence.fault = WIRE_FAULT_MAGNET; /* whose cause is no check */
	sequence.acknowledged = false;
	checks = red;
	return command(WIRE_OP_CLEAR, 0);
}

static void what_clear_looks_at(void **state)
{
	(void)state;
	for (unsigned bit = 0; bit < WIRE_CHECK_NUMBER_ACKNOWLEDGE; bit++) {
		uint32_t red = 1u << bit;
		bool blind = red == WIRE_CHECK_CLOCKS;

		assert_int_equal(clear_with(STATE(SAFE), red), is_guard(red) ? DT_E_CHECKS : 0);
		assert_int_equal(sequence.acknowledged, !is_guard(red));
		assert_int_equal(clear_with(STATE(FAULT_HELD), red), blind ? DT_E_CHECKS : 0);
		assert_int_equal(sequence.acknowledged, !is_guard(red) && !blind);
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
	sequence.times.gates = 2;
	sequence.triggered = sequence.moved = true;
	release();
	assert_int_equal(sequence.marks, 0);
	assert_int_equal(sequence.frame_speed_mm_s, 0);
	assert_false(sequence.triggered || sequence.moved);
}

static void safe_is_not_armed_even_when_all_is_green(void **state)
{
	(void)state;
	boot();
	be_in(STATE(SAFE));
	assert_int_equal(command(WIRE_OP_ARM, wire_answer(0, SESSION, SET)), DT_E_CHECKS);
	assert_int_equal(sequence.session, 0);
}

static void crc_and_number_are_looked_at_where_there_is_a_capture(void **state)
{
	(void)state;
	for (uint8_t s = 0; s < WIRE_STATES; s++) {
		boot();
		be_in(s);
		assert_int_equal(command(WIRE_OP_ACCEPT, CRC ^ 1),
		                 s == STATE(CAPTURED) ? DT_E_CORRUPT : DT_E_STATE);
		assert_int_equal(command(WIRE_OP_DISCARD, sequence.drop_id + 1u),
		                 s == STATE(CAPTURED) ? DT_E_CORRUPT : DT_E_STATE);
		assert_int_equal(sequence.state, s);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(outputs_of_every_state),
	        cmocka_unit_test(numbers_that_are_no_state),
	        cmocka_unit_test(separated_states),
	        cmocka_unit_test(boot_keeps_the_state_before),
	        cmocka_unit_test(the_plan_to_the_last_digit),
	        cmocka_unit_test(edges_are_rounded_to_the_nearest_microsecond),
	        cmocka_unit_test(times_between_the_gates),
	        cmocka_unit_test(a_speed_too_large_to_tell),
	        cmocka_unit_test(gates_out_of_a_fall_mean_nothing),
	        cmocka_unit_test(a_gate_is_late_from_the_next_microsecond_on),
	        cmocka_unit_test(a_frame_stands_still_from_the_next_microsecond_on),
	        cmocka_unit_test(an_open_latch_is_a_frame_that_moved),
	        cmocka_unit_test(braked_by_either),
	        cmocka_unit_test(a_gate_is_early_up_to_a_microsecond_before),
	        cmocka_unit_test(a_fall_ends_from_the_next_microsecond_on),
	        cmocka_unit_test(no_separation_without_an_edge),
	        cmocka_unit_test(the_keeper_counts_behind_a_planned_edge_in_motion),
	        cmocka_unit_test(what_tells_where_the_frame_is),
	        cmocka_unit_test(the_self_test_is_of_the_clocks),
	        cmocka_unit_test(what_clear_looks_at),
	        cmocka_unit_test(a_release_begins_anew),
	        cmocka_unit_test(safe_is_not_armed_even_when_all_is_green),
	        cmocka_unit_test(crc_and_number_are_looked_at_where_there_is_a_capture),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
