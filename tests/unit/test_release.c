/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A RELEASE that comes while main is at work: it waits for one frame to be packed and sent, not for two.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include "firmware/app.h"
#include "tests/unit/fake_port.h"
#include "tests/unit/firmware_by_hand.h"

static struct {
	struct frame release;
	unsigned places, at; /* where main may be interrupted: so far, and where it comes */
	unsigned sent_before;
	int waited_for; /* frames, -1: not yet released */
} late;

static void come(void)
{
	if (late.waited_for < 0 && late.places > late.at && (fake.outputs & WIRE_IO_LATCH_OPEN))
		late.waited_for = (int)(fake.sent_count - late.sent_before);
	if (late.places++ != late.at)
		return;
	late.sent_before = fake.sent_count;
	fake_receive(&late.release);
}

/* One tick's work of main with a RELEASE at its nth place; false: it has no such place. */
static bool release_at(unsigned place)
{
	struct wire_command command = {.op = WIRE_OP_RELEASE, .host = (uint16_t)FIRMWARE_SESSION};

	firmware_to_armed();
	firmware_wait_for_warning();
	command.argument = wire_answer(by_hand.nonce, 1, by_hand.parameters);
	wire_pack_command(&late.release, WIRE_ID_COMMAND, &command);
	late.places = 0;
	late.at = place;
	late.waited_for = -1;
	app_on_turn();
	app_on_tick();
	fake.interrupt = come;
	app_poll();
	if (late.places <= place)
		return false;
	if (late.waited_for < 0)
		app_poll();
	return true;
}

static void a_release_waits_for_one_frame(void **state)
{
	unsigned place = 0;

	(void)state;
	for (; release_at(place); place++) {
		assert_in_range(late.waited_for, 0, 1);
		assert_true(fake.outputs & WIRE_IO_LATCH_OPEN);
	}
	assert_in_range(place, 3, 1000); /* both blocks, and after them */
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(a_release_waits_for_one_frame),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
