/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The whole firmware from outside: its parameters, and the bus that they set up.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include "common/crc.h"
#include "common/segment.h"
#include "firmware/app.h"
#include "tests/unit/fake_port.h"
#include "tests/unit/firmware_by_hand.h"

static void parameters_by_sdo(void **state)
{
	static const struct {
		unsigned specifier, index, subindex;
		uint32_t value, answer;
		unsigned answer_specifier;
	} cases[] = {
	        {0x40, 0x2007, 0, 0, 960, 0x43},
	        {0x23, 0x2007, 0, 320, 0, 0x60},
	        {0x40, 0x2007, 0, 0, 320, 0x43},
	        {0x23, 0x2007, 0, 159, 0x06090032, 0x80},
	        {0x23, 0x2007, 0, 16001, 0x06090031, 0x80},
	        {0x23, 0x2007, 0, 160, 0, 0x60},
	        {0x23, 0x2007, 0, 16000, 0, 0x60},
	        {0x23, 0x2007, 0, 320, 0, 0x60},
	        {0x40, 0x2007, 0, 0, 320, 0x43},
	        {0x40, 0x1FFF, 0, 0, 0x06020000, 0x80},
	        {0x23, 0x2015, 0, 1, 0x06020000, 0x80},
	        {0x23, 0x2010, 0, 999, 0x06090032, 0x80}, /* settle and warning can only be lengthened */
	        {0x23, 0x2011, 0, 999, 0x06090032, 0x80},
	        {0x23, 0x2011, 0, 9001, 0x06040043, 0x80}, /* a second of 10 s has to be left */
	        {0x23, 0x2011, 0, 9000, 0, 0x60},
	        {0x23, 0x2009, 0, 9999, 0x06040043, 0x80},
	        {0x23, 0x2011, 0, 1000, 0, 0x60},
	        {0x23, 0x2009, 0, 2000, 0, 0x60},
	        {0x23, 0x200E, 0, 2, 0x06090031, 0x80},
	        {0x40, 0x200F, 0, 0, 5000, 0x43},
	        {0x23, 0x200F, 0, 1999, 0x06090032, 0x80},
	        {0x23, 0x200F, 0, 8001, 0x06090031, 0x80},
	        {0x23, 0x200F, 0, 4000, 0x06090030, 0x80}, /* none of 2, 5, 8 Mbit/s */
	        {0x23, 0x200F, 0, 2000, 0, 0x60},
	        {0x23, 0x200F, 0, 8000, 0, 0x60},
	        {0x40, 0x200F, 0, 0, 8000, 0x43},
	        {0x40, 0x2007, 1, 0, 0x06090011, 0x80},
	        {0x2F, 0x2007, 0, 1, 0x05040001, 0x80},
	        {0x23, 0x2000, 0, 690001, 0x06040043, 0x80}, /* gates 10 mm apart */
	        {0x23, 0x2000, 0, 690000, 0, 0x60},
	        {0x23, 0x2002, 0, 700000, 0x06040043, 0x80}, /* separation below the lower gate */
	        {0x23, 0x2002, 0, 800001, 0x06040043, 0x80}, /* and not below the dampers */
	        {0x23, 0x2002, 0, 800000, 0, 0x60},
	        {0x23, 0x2005, 0, 113, 0x06040043, 0x80}, /* with 400 after the trigger more than 512 */
	        {0x23, 0x2005, 0, 112, 0, 0x60},
	};

	(void)state;
	firmware_to_ready();
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct wire_sdo m =
		        firmware_sdo(cases[i].specifier, cases[i].index, cases[i].subindex, cases[i].value);

		if (m.specifier != cases[i].answer_specifier || m.value != cases[i].answer)
			fail_msg("case %zu: %#x %#x, expected %#x %#x", i, m.specifier, m.value,
			         cases[i].answer_specifier, cases[i].answer);
	}
}

static void abort_of_a_transfer_needs_no_answer(void **state)
{
	struct frame frame;

	(void)state;
	firmware_to_ready();
	wire_pack_sdo(&frame, WIRE_ID_SDO_REQUEST, &(struct wire_sdo){.specifier = 0x80, .index = 0x2007});
	fake_receive(&frame);
	firmware_forget_frames();
	firmware_run(2);
	assert_int_equal(fake_count(WIRE_ID_SDO_REPLY), 0);
	assert_int_equal(firmware_counter(WIRE_COUNTER_frames_malformed), 0);
}

static void parameters_are_not_written_while_armed(void **state)
{
	(void)state;
	firmware_to_armed();
	assert_int_equal(firmware_sdo(0x23, 0x2007, 0, 320).value, 0x08000022);
	assert_int_equal(firmware_sdo(0x40, 0x2007, 0, 0).value, 960);
	firmware_to_falling();
	assert_int_equal(firmware_sdo(0x23, 0x2007, 0, 320).value, 0x08000022);
	firmware_to_captured();
	assert_int_equal(firmware_sdo(0x23, 0x2007, 0, 320).value, 0x08000022);
	assert_int_equal(firmware_order(WIRE_OP_DISCARD, 1).result, 0);
	firmware_power_on(PORT_RESET_WATCHDOG);
	firmware_run(10);
	assert_int_equal(firmware_sdo(0x23, 0x2007, 0, 320).specifier, 0x60);
}

static void new_parameters_move_the_edges(void **state)
{
	uint32_t start_us;

	(void)state;
	firmware_to_ready();
	/* the fall is planned with the set before, and the wrong key refused */
	assert_int_equal(firmware_order(WIRE_OP_ARM, 0).result, DT_E_PARAMETERS);
	assert_int_equal(firmware_sdo(0x23, 0x2004, 0, 0).specifier, 0x60);
	assert_int_equal(firmware_sdo(0x23, 0x2002, 0, 750000).specifier, 0x60);
	firmware_fall(1);
	start_us = fake.now_us;
	firmware_run(5); /* until the latch is seen open */
	app_on_gate(0, start_us + 200000);
	app_on_gate(1, start_us + 375000);
	/* (sqrt .75 - sqrt .7) / (sqrt .7 - sqrt .2) = .0293654 / .3894464 = .0754029, of 175 ms: 13.1955 ms
	 */
	assert_in_range(fake.off_us[1] - start_us, 388194, 388197);
}

static void bus_off_is_counted_and_told(void **state)
{
	struct wire_emcy emcy;

	(void)state;
	firmware_to_ready();
	fake.bus = PORT_BUS_OFF;
	fake.bus_errors = 17;
	firmware_run(5);
	fake.bus = PORT_BUS_ACTIVE;
	firmware_forget_frames();
	firmware_run(5);
	assert_int_equal(wire_unpack_emcy(firmware_last(WIRE_ID_EMCY), &emcy), 0);
	assert_int_equal(emcy.code, 0x8140);
	assert_int_equal(fake_count(WIRE_ID_EMCY), 1);
	assert_true(fake_count(WIRE_ID_BLOCK_S1) > 5); /* the waiting ones too */
	assert_int_equal(firmware_counter(WIRE_COUNTER_bus_offs), 1);
	assert_int_equal(firmware_counter(WIRE_COUNTER_bus_errors), 17);
	assert_true(firmware_counter(WIRE_COUNTER_frames_deferred) > 0);
	assert_int_equal(firmware_counter(WIRE_COUNTER_frames_dropped), 0);
	firmware_to_armed();
	fake.bus = PORT_BUS_OFF;
	firmware_run(2);
	fake.bus = PORT_BUS_ACTIVE;
	firmware_forget_frames();
	firmware_run(5);
	assert_int_equal(fake_count(WIRE_ID_EMCY), 1);
	assert_int_equal(firmware_status().fault, WIRE_FAULT_BUS_OFF);
}

/* It can still be sent, so it is told at once, and once for each spell. */
static void error_passive_is_counted_and_told(void **state)
{
	struct wire_emcy emcy;

	(void)state;
	firmware_to_armed();
	firmware_forget_frames();
	fake.bus = PORT_BUS_PASSIVE;
	firmware_run(50);
	assert_int_equal(fake_count(WIRE_ID_EMCY), 1);
	assert_int_equal(wire_unpack_emcy(firmware_last(WIRE_ID_EMCY), &emcy), 0);
	assert_int_equal(emcy.code, 0x8120);
	assert_int_equal(emcy.error_register, 0x11);
	assert_int_equal(firmware_status().state, WIRE_STATE_ARMED);
	assert_int_equal(firmware_status().fault, WIRE_FAULT_NONE);
	fake.bus = PORT_BUS_ACTIVE;
	firmware_run(2);
	fake.bus = PORT_BUS_PASSIVE;
	firmware_run(2);
	assert_int_equal(firmware_counter(WIRE_COUNTER_bus_passives), 2);
	assert_int_equal(firmware_counter(WIRE_COUNTER_bus_offs), 0);
}

static void bus_is_set_up_at_reset(void **state)
{
	(void)state;
	firmware_power_on(PORT_RESET_POWER_ON);
	assert_int_equal(fake.setups, 1);
	assert_false(fake.classic);
	assert_int_equal(fake.data_kbit_s, 5000);
}

static void bus_follows_its_parameters(void **state)
{
	(void)state;
	firmware_to_ready();
	assert_int_equal(firmware_sdo(0x23, 0x200F, 0, 8000).specifier, 0x60);
	assert_int_equal(fake.data_kbit_s, 8000);
	assert_false(fake.classic);
	assert_int_equal(firmware_sdo(0x23, 0x200E, 0, 1).specifier, 0x60);
	assert_true(fake.classic);
	assert_int_equal(fake.setups, 3);
	assert_int_equal(firmware_sdo(0x23, 0x2007, 0, 320).specifier, 0x60); /* not the bus's */
	assert_int_equal(firmware_sdo(0x23, 0x200E, 0, 1).specifier, 0x60);   /* nothing new */
	assert_int_equal(fake.setups, 3);
	fake.no_setup = true;
	assert_int_equal(firmware_sdo(0x23, 0x200E, 0, 0).value, 0x06060000);
	assert_int_equal(firmware_sdo(0x40, 0x200E, 0, 0).value, 1); /* as it was */
	firmware_forget_frames();
	firmware_run(10);
	assert_int_equal(fake_count(WIRE_ID_BLOCK_S1), 0);
	fake.no_setup = false;
	assert_int_equal(firmware_sdo(0x23, 0x200E, 0, 0).specifier, 0x60);
	firmware_run(10);
	assert_in_range(fake_count(WIRE_ID_BLOCK_S1), 9, 10);
	firmware_to_armed();
	assert_int_equal(firmware_sdo(0x23, 0x200E, 0, 1).value, 0x08000022);
	assert_int_equal(fake.setups, 1);
}

/* The port is asked again as long as it refuses everything, but not in motion. */
static void refused_bus_is_asked_for_again(void **state)
{
	(void)state;
	firmware_power_on(PORT_RESET_POWER_ON);
	fake_init();
	fake.no_setup = true;
	app_init(PORT_RESET_POWER_ON);
	fake.can_full = true;
	firmware_run(50);
	assert_int_equal(fake.setups, 0);
	fake.no_setup = false;
	firmware_run(2);
	assert_int_equal(fake.setups, 1);
	assert_true(fake.classic);
	firmware_run(200);
	assert_int_equal(fake.setups, 1);
	firmware_power_on(PORT_RESET_POWER_ON);
	fake_init();
	fake.no_setup = true;
	app_init(PORT_RESET_POWER_ON);
	firmware_run(250);
	firmware_acknowledge();
	firmware_fall(1);
	fake.no_setup = false;
	firmware_run(100);
	assert_int_equal(fake.setups, 0);
	firmware_separate();
	firmware_run(30);
	by_hand.s2x = 2000;
	firmware_run(1);
	by_hand.s2x = 0;
	firmware_run(405);
	assert_int_equal(fake.setups, 1);
}

/* All frames of one identifier, put together; -1 where what came is no whole message. */
static unsigned collect(uint32_t id, struct frame *messages, unsigned room)
{
	struct segment_join join = {0};
	unsigned count = 0;

	for (unsigned i = 0; i < fake.sent_count; i++) {
		const struct frame *whole = NULL;

		assert_true((fake.sent[i].flags & FRAME_FD) == 0 && fake.sent[i].length <= 8);
		if (fake.sent[i].id == id)
			whole = segment_feed(&join, &fake.sent[i]);
		if (whole != NULL && count < room)
			messages[count++] = *whole;
	}
	assert_int_equal(join.incomplete, 0);
	return count;
}

static void classic_drop(void)
{
	static struct frame s1[64], s2[64], ends[64];
	struct wire_capture_end end;
	uint32_t crc = CRC32_INIT;

	assert_int_equal(firmware_sdo(0x23, 0x2005, 0, 10).specifier, 0x60); /* a short window */
	assert_int_equal(firmware_sdo(0x23, 0x2006, 0, 40).specifier, 0x60);
	firmware_forget_frames();
	firmware_fall(1);
	firmware_separate();
	firmware_run(30);
	assert_int_equal(fake_count(WIRE_ID_BLOCK_S1), 0);
	firmware_forget_frames();
	by_hand.s2x = 2000;
	firmware_run(1);
	by_hand.s2x = 0;
	for (unsigned ms = 0; ms < 220; ms++) { /* 1 Mbit/s takes 7.4 such frames a ms */
		fake.can_room = 7;
		firmware_run_ms();
	}
	assert_true(collect(WIRE_ID_CAPTURE_END, ends, 64) >= 1);
	assert_int_equal(wire_unpack_capture_end(&ends[0], &end), 0);
	assert_int_equal(end.last_tick_ms - end.first_tick_ms + 1, 50);
	assert_int_equal(collect(WIRE_ID_RESENT_S1, s1, 64), 50);
	assert_int_equal(collect(WIRE_ID_RESENT_S2, s2, 64), 50);
	for (unsigned i = 0; i < 50; i++) {
		assert_int_equal(wire_check_block(&s1[i]), 0);
		crc = crc32(crc, s1[i].data + 10, 54);
		crc = crc32(crc, s2[i].data + 10, 54);
	}
	assert_int_equal(crc, end.crc32);
	fake.can_room = UINT32_MAX;
	firmware_run(20);
	firmware_forget_frames();
	firmware_ask(2, end.first_tick_ms + 7, 1);
	firmware_run(3);
	assert_int_equal(collect(WIRE_ID_RESENT_S2, s1, 64), 1);
	assert_memory_equal(s1[0].data, s2[7].data, 64);
	assert_int_equal(firmware_order(WIRE_OP_ACCEPT, end.crc32).result, 0);
	firmware_run(300);
	assert_int_equal(firmware_status().state, WIRE_STATE_SAFE);
	assert_int_equal(firmware_counter(WIRE_COUNTER_frames_dropped), 0);
	assert_int_equal(firmware_counter(WIRE_COUNTER_blocks_resent), 101);
}

static void classic_bus_uploads_after_the_drop(void **state)
{
	(void)state;
	firmware_to_ready();
	assert_int_equal(firmware_sdo(0x23, 0x200E, 0, 1).specifier, 0x60);
	classic_drop();
	firmware_power_on(PORT_RESET_POWER_ON);
	fake_init(); /* a controller without FD */
	fake.no_fd = true;
	app_init(PORT_RESET_POWER_ON);
	firmware_run(250);
	firmware_acknowledge();
	assert_int_equal(firmware_status().state, WIRE_STATE_READY);
	assert_int_equal(firmware_sdo(0x40, 0x200E, 0, 0).value, 1);
	assert_int_equal(firmware_sdo(0x23, 0x200E, 0, 0).value, 0x06060000);
	classic_drop();
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(parameters_by_sdo),
	        cmocka_unit_test(abort_of_a_transfer_needs_no_answer),
	        cmocka_unit_test(parameters_are_not_written_while_armed),
	        cmocka_unit_test(new_parameters_move_the_edges),
	        cmocka_unit_test(bus_off_is_counted_and_told),
	        cmocka_unit_test(error_passive_is_counted_and_told),
	        cmocka_unit_test(bus_is_set_up_at_reset),
	        cmocka_unit_test(bus_follows_its_parameters),
	        cmocka_unit_test(refused_bus_is_asked_for_again),
	        cmocka_unit_test(classic_bus_uploads_after_the_drop),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
