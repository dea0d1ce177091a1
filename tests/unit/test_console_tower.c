/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The console's tower thread against a fake tower: what arms, disarms and aborts, and how a tower is set up.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "common/wire_table.h"
#include "host/console/tower.h"
#include "tests/unit/fake_page.h"
#include "tests/unit/fake_tower.h"

enum { TRIES = 10 }; /* how often a host repeats what is not answered */

static void arming_needs_a_series(void **state)
{
	char text[512];

	(void)state;
	fake_page_wait(fake_page_is_heard);
	assert_int_equal(fake_page_say(tower_arm, "{}", text), 409);
	assert_non_null(strstr(text, "series"));
	assert_int_equal(fake_tower_heard(WIRE_OP_ARM), 0);
	assert_int_equal(fake_page_say(tower_select, "{\"series\":\"other\"}", text), 404);
	assert_int_equal(fake_page_say(tower_select, "{}", text), 400);
	assert_int_equal(fake_page_say(tower_simulate, "{\"line\":\"fault estop\"}", text), 404);
}

static void a_refused_arm_leaves_no_drop(void **state)
{
	char text[512];

	(void)state;
	fake_page_select_box();
	assert_int_equal(fake_tower.parameters, FAKE_TOWER_PARAMETERS);
	fake_tower_behave(0, DT_E_HASH, true);
	assert_int_equal(fake_page_say(tower_arm, "{}", text), 409);
	assert_non_null(strstr(text, error_text(DT_E_HASH)));
	fake_page_wait(fake_page_is_idle);
	assert_int_equal(fake_page_archived().count, 0);
}

static void a_wrong_token_leaves_it_armed(void **state)
{
	char text[512], body[64];
	unsigned token;

	(void)state;
	fake_page_select_box();
	token = fake_page_arm();
	snprintf(body, sizeof(body), "{\"token\":%u}", token ^ 1u);
	assert_int_equal(fake_page_say(tower_release, body, text), 409);
	assert_non_null(strstr(text, error_text(DT_E_TOKEN)));
	assert_int_equal(fake_page_wait(fake_page_is_armed).phase, TOWER_ARMED);
	assert_false(console.at_rest);
	assert_int_equal(fake_page_say(tower_arm, "{}", text), 409); /* one at a time */
	assert_int_equal(fake_page_say(tower_select, "{\"series\":\"box\"}", text), 409);
	fake_page_release(token);
	fake_page_wait_recorded("box/1");
}

static void disarmed_without_a_release_leaves_no_drop(void **state)
{
	struct tower_view idle;

	(void)state;
	fake_page_select_box();
	(void)fake_page_arm();
	assert_true(fake_page_wait(fake_page_is_armed).armed_until_ms > session_now_ms());
	pthread_mutex_lock(&fake_tower.lock);
	fake_tower.state = WIRE_STATE_READY; /* its time is over */
	pthread_mutex_unlock(&fake_tower.lock);
	idle = fake_page_wait(fake_page_is_idle);
	assert_true(idle.armed_until_ms == 0);
	assert_true(console.at_rest);
	assert_string_equal(idle.trouble, "");
	(void)fake_page_arm();
	fake_page_must(tower_abort, "{}");
	fake_page_wait(fake_page_is_idle);
	assert_int_equal(fake_tower_heard(WIRE_OP_ABORT), 1);
	tower_disarm(console.tower); /* there is nothing to */
	(void)fake_page_arm();
	assert_int_equal(fake_tower_heard(WIRE_OP_ABORT), 1);
	tower_disarm(console.tower);
	fake_page_wait(fake_page_is_idle);
	assert_int_equal(fake_tower_heard(WIRE_OP_ABORT), 2);
	assert_int_equal(fake_page_archived().count, 0);
}

/* The link stalls right behind the reply to ARM: the last that was heard is a tower at rest. */
static void an_arm_outlasts_a_silence(void **state)
{
	(void)state;
	fake_page_select_box();
	pthread_mutex_lock(&fake_tower.lock);
	fake_tower.dumb = true;
	pthread_mutex_unlock(&fake_tower.lock);
	(void)fake_page_arm();
	usleep(300000);
	pthread_mutex_lock(&fake_tower.lock);
	fake_tower.dumb = false;
	pthread_mutex_unlock(&fake_tower.lock);
	fake_page_wait(fake_page_is_armed);
	fake_page_must(tower_abort, "{}");
	fake_page_wait(fake_page_is_idle);
}

/* By the order of things: an ARM that is not answered is repeated TRIES times unless it is given up. */
static void abort_does_not_wait_for_an_unanswered_arm(void **state)
{
	struct fake_page_asked armed, aborted, released;
	unsigned arms = 0, last, count;
	char text[512];

	(void)state;
	fake_page_select_box();
	fake_tower_behave(1u << WIRE_OP_ARM, 0, true);
	fake_page_ask(&armed, tower_arm, "{}");
	fake_page_wait_heard(WIRE_OP_ARM, 1);
	fake_page_ask(&released, tower_release, "{\"token\":7}"); /* void as well: asked for before */
	fake_page_ask(&aborted, tower_abort, "{}");
	for (unsigned i = 0; i < 3; i++)
		fake_page_wait_answer();
	assert_int_equal(fake_page_take_answer(&armed, text), 409);
	assert_string_equal(text, "{\"error\":\"aborted\"}");
	assert_int_equal(fake_page_take_answer(&released, text), 409);
	assert_string_equal(text, "{\"error\":\"aborted\"}");
	assert_int_equal(fake_page_take_answer(&aborted, text), 200);
	pthread_mutex_lock(&fake_tower.lock);
	while (arms < fake_tower.heard_count && fake_tower.heard[arms] == WIRE_OP_ARM)
		arms++;
	last = fake_tower.heard[arms];
	count = fake_tower.heard_count;
	pthread_mutex_unlock(&fake_tower.lock);
	assert_true(arms >= 1 && arms < TRIES);
	assert_int_equal(last, WIRE_OP_ABORT);
	assert_int_equal(count, arms + 1);
	fake_page_wait(fake_page_is_idle);
	fake_tower_behave(0, 0, true);
	fake_page_release(fake_page_arm()); /* and nothing of it stays behind */
	fake_page_wait_recorded("box/1");
	assert_int_equal(fake_page_archived().count, 1);
}

/* An ARM that waits behind something else is not sent after the ABORT that was asked for later. */
static void an_arm_from_before_an_abort_is_void(void **state)
{
	struct fake_page_asked cleared, armed, aborted;
	char text[512];

	(void)state;
	fake_page_select_box();
	fake_tower_behave(1u << WIRE_OP_CLEAR, 0, true);
	fake_page_ask(&cleared, tower_clear, "{}");
	fake_page_wait_heard(WIRE_OP_CLEAR, 1);
	fake_page_ask(&armed, tower_arm, "{}");
	fake_page_ask(&aborted, tower_abort, "{}");
	for (unsigned i = 0; i < 3; i++)
		fake_page_wait_answer();
	assert_int_equal(fake_page_take_answer(&cleared, text), 409);
	assert_int_equal(fake_page_take_answer(&armed, text), 409);
	assert_string_equal(text, "{\"error\":\"aborted\"}");
	assert_int_equal(fake_page_take_answer(&aborted, text), 200);
	assert_int_equal(fake_tower_heard(WIRE_OP_ARM), 0);
	assert_int_equal(fake_page_archived().count, 0);
}

/* CLEARs that the tower does not answer; each holds the tower's thread for a while. */
static void fill_queue(struct fake_page_asked *cleared, unsigned count)
{
	fake_page_select_box();
	fake_tower_behave(1u << WIRE_OP_CLEAR, 0, true);
	for (unsigned i = 0; i < count; i++)
		fake_page_ask(&cleared[i], tower_clear, "{}");
}

static void abort_goes_past_a_full_queue(void **state)
{
	enum { MANY = 200 };
	static struct fake_page_asked cleared[MANY];
	struct fake_page_asked aborted;
	char text[512];

	(void)state;
	fill_queue(cleared, MANY);
	fake_page_ask(&aborted, tower_abort, "{}");
	for (unsigned i = 0; i < MANY + 1; i++)
		fake_page_wait_answer();
	assert_int_equal(fake_page_take_answer(&cleared[0], text), 409);
	assert_int_equal(fake_page_take_answer(&cleared[MANY - 1], text), 503);
	assert_int_equal(fake_page_take_answer(&aborted, text), 200);
	for (unsigned i = 1; i < MANY - 1; i++)
		(void)fake_page_take_answer(&cleared[i], text);
	assert_int_equal(fake_tower_heard(WIRE_OP_ABORT), 1);
}

static bool is_open(const struct tower_view *view)
{
	return view->open;
}

static void abort_goes_to_a_tower_that_was_never_heard(void **state)
{
	(void)state;
	pthread_mutex_lock(&fake_tower.lock);
	fake_tower.dumb = true;
	pthread_mutex_unlock(&fake_tower.lock);
	fake_page_wait(is_open);
	fake_page_must(tower_abort, "{}");
	assert_int_equal(fake_tower_heard(WIRE_OP_ABORT), 1);
}

static void a_tower_that_starts_again_is_set_up_again(void **state)
{
	int64_t until_ms = session_now_ms() + FAKE_PAGE_WAIT_MS;
	unsigned parameters = 0;

	(void)state;
	fake_page_select_box();
	pthread_mutex_lock(&fake_tower.lock);
	fake_tower.parameters = 0;
	fake_tower.boots = true;
	pthread_mutex_unlock(&fake_tower.lock);
	while (parameters < FAKE_TOWER_PARAMETERS && session_now_ms() < until_ms) {
		fake_page_nap();
		pthread_mutex_lock(&fake_tower.lock);
		parameters = fake_tower.parameters;
		pthread_mutex_unlock(&fake_tower.lock);
	}
	assert_int_equal(parameters, FAKE_TOWER_PARAMETERS);
	fake_page_wait(fake_page_is_set_up);
}

/* geometry-2A's dampers, above what its product falls on. */
#define DAMPERS_ABOVE_M 0.094

static void a_tower_is_set_up_from_any_height_for_any_other(void **state)
{
	char text[512];

	(void)state;
	fake_page_wait(fake_page_is_heard);
	for (size_t i = 0; fake_page_heights[i].height_m < 5; i++) {
		double wanted_um = (fake_page_heights[i].height_m - DAMPERS_ABOVE_M) * 1e6;

		snprintf(text, sizeof(text), "{\"series\":\"%s\"}", fake_page_heights[i].series);
		fake_page_must(tower_select, text);
		fake_page_wait(fake_page_is_set_up);
		assert_float_equal(fake_tower.values.value[WIRE_PARAMETER_dampers_um], wanted_um, 1);
	}
}

static bool is_blocked(const struct tower_view *view)
{
	return view->session.state == WIRE_STATE_READY && view->blocked &&
	       strstr(view->trouble, "gate_lower_um") != NULL;
}

static void what_no_tower_can_have_is_refused_with_its_range(void **state)
{
	unsigned before;
	char text[512];

	(void)state;
	fake_page_select_box();
	before = fake_tower.parameters;
	assert_int_equal(fake_page_say(tower_select, "{\"series\":\"five\"}", text), 409);
	assert_non_null(strstr(text, "10000 to 2400000 um"));
	assert_int_equal(fake_tower.parameters, before);
	fake_page_wait(is_blocked); /* green, and yet the page must not call it ready */
}

static void the_end_aborts_what_is_armed(void **state)
{
	(void)state;
	fake_page_select_box();
	(void)fake_page_arm();
	assert_int_equal(fake_page_archived().count, 0);
	assert_int_equal(fake_tower_heard(WIRE_OP_ABORT), 1);
}

static bool waits_for_tower(const struct job *job)
{
	const struct job *waiting;

	pthread_mutex_lock(&console.tower_queue.lock);
	waiting = console.tower_queue.first;
	while (waiting != NULL && waiting != job)
		waiting = waiting->next;
	pthread_mutex_unlock(&console.tower_queue.lock);
	return waiting != NULL;
}

/* Verbs that wait behind others when the thread ends; what they carry is given back. */
static void the_end_refuses_what_waits(void **state)
{
	enum { MANY = 20 };
	struct fake_page_asked cleared[MANY], armed, selected;
	int64_t until_ms = session_now_ms() + FAKE_PAGE_WAIT_MS;
	char text[512];

	(void)state;
	fill_queue(cleared, MANY);
	fake_page_ask(&armed, tower_arm, "{}");
	fake_page_ask(&selected, tower_select, "{\"series\":\"box\"}");
	while (!waits_for_tower(&selected.job) && session_now_ms() < until_ms)
		fake_page_nap();
	assert_true(waits_for_tower(&armed.job));
	assert_int_equal(fake_page_archived().count, 0);
	for (unsigned i = 0; i < MANY + 2; i++)
		fake_page_wait_answer();
	assert_int_equal(fake_page_take_answer(&armed, text), 503);
	assert_string_equal(text, "{\"error\":\"the console is ending\"}");
	assert_int_equal(fake_page_take_answer(&selected, text), 503);
	for (unsigned i = 0; i < MANY; i++)
		(void)fake_page_take_answer(&cleared[i], text);
	assert_int_equal(fake_tower_heard(WIRE_OP_ARM), 0);
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, fake_page_set_up, fake_page_tear_down)
	const struct CMUnitTest tests[] = {
	        TEST(arming_needs_a_series),
	        TEST(a_refused_arm_leaves_no_drop),
	        TEST(a_wrong_token_leaves_it_armed),
	        TEST(disarmed_without_a_release_leaves_no_drop),
	        TEST(an_arm_outlasts_a_silence),
	        TEST(abort_does_not_wait_for_an_unanswered_arm),
	        TEST(an_arm_from_before_an_abort_is_void),
	        TEST(abort_goes_past_a_full_queue),
	        TEST(abort_goes_to_a_tower_that_was_never_heard),
	        TEST(a_tower_that_starts_again_is_set_up_again),
	        TEST(a_tower_is_set_up_from_any_height_for_any_other),
	        TEST(what_no_tower_can_have_is_refused_with_its_range),
	        TEST(the_end_aborts_what_is_armed),
	        TEST(the_end_refuses_what_waits),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
