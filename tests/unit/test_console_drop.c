/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The console's tower and archive threads against a fake tower: what becomes of a drop.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include "common/wire_table.h"
#include "host/console/tower.h"
#include "tests/unit/fake_page.h"
#include "tests/unit/fake_tower.h"

static void a_drop_is_collected_and_kept(void **state)
{
	char text[512], log[400];
	struct fake_page_found found;
	struct stat file;

	(void)state;
	pthread_mutex_lock(&fake_tower.lock);
	fake_tower.hole = 37;
	pthread_mutex_unlock(&fake_tower.lock);
	fake_page_select_box();
	assert_int_equal(fake_page_say(tower_release, "{\"token\":1}", text), 409); /* nothing is armed */
	fake_page_release(fake_page_arm());
	fake_page_wait_recorded("box/1");
	assert_string_equal(fake_page_wait(fake_page_is_idle).trouble, "");
	assert_true(fake_tower.resends > 0);
	assert_true(fake_tower_heard(WIRE_OP_ACCEPT) >= 1); /* twice, if the tower asked again meanwhile */
	assert_int_equal(fake_tower_heard(WIRE_OP_DISCARD), 0);
	fake_page_wait(fake_page_is_ready);
	fake_page_release(fake_page_arm());
	fake_page_wait_recorded("box/2");
	found = fake_page_archived();
	assert_int_equal(found.count, 2);
	assert_string_equal(found.state, "recorded");
	assert_string_equal(found.note, "");
	snprintf(log, sizeof(log), "%s/%s", fake_page_archive, found.raw);
	assert_int_equal(stat(log, &file), 0);
	assert_true(file.st_size > 1000 * 64);
}

static void an_abort_in_motion_is_kept_with_its_note(void **state)
{
	struct fake_page_found found;

	(void)state;
	fake_page_begin_to_fall();
	fake_page_must(tower_abort, "{}");
	fake_page_wait_recorded("box/1");
	found = fake_page_archived();
	assert_int_equal(found.count, 1);
	assert_string_equal(found.state, "recorded");
	assert_string_equal(found.note, "aborted in motion");
}

static void a_fault_in_motion_is_kept_with_its_text(void **state)
{
	struct fake_page_found found;

	(void)state;
	fake_page_begin_to_fall();
	pthread_mutex_lock(&fake_tower.lock);
	fake_tower.fault = WIRE_FAULT_DOOR;
	fake_tower.state = WIRE_STATE_FAULT_MOVING;
	fake_tower.fall_due = true;
	pthread_mutex_unlock(&fake_tower.lock);
	fake_page_wait_recorded("box/1");
	found = fake_page_archived();
	assert_string_equal(found.note, wire_fault_text(WIRE_FAULT_DOOR));
}

static void a_release_without_a_capture_leaves_a_word(void **state)
{
	struct tower_view view;
	struct fake_page_found found;

	(void)state;
	fake_page_begin_to_fall();
	pthread_mutex_lock(&fake_tower.lock);
	fake_tower.state = WIRE_STATE_READY;
	pthread_mutex_unlock(&fake_tower.lock);
	view = fake_page_wait(fake_page_is_ready);
	assert_string_equal(view.trouble, "nothing was captured: the frame did not move");
	found = fake_page_archived();
	assert_int_equal(found.count, 1);
	assert_string_equal(found.state, "interrupted");
	assert_string_equal(found.note, view.trouble);
}

static bool holds_drop(const struct tower_view *view)
{
	return view->session.state == WIRE_STATE_CAPTURED && strstr(view->trouble, "holds a drop") != NULL;
}

static void a_drop_from_before_waits_for_a_series(void **state)
{
	struct fake_page_found found;
	int64_t until_ms;
	unsigned ends;

	(void)state;
	fake_page_wait(holds_drop);
	until_ms = session_now_ms() + FAKE_PAGE_WAIT_MS;
	for (ends = fake_tower.ends; fake_tower.ends < ends + 50;) { /* time enough to collect it */
		if (session_now_ms() > until_ms)
			fail_msg("the tower holds nothing any longer");
		fake_page_nap();
	}
	assert_int_equal(fake_tower_heard(WIRE_OP_ACCEPT) + fake_tower_heard(WIRE_OP_DISCARD), 0);
	fake_page_must(tower_select, "{\"series\":\"box\"}");
	fake_page_wait_recorded("box/1");
	fake_page_wait_heard(WIRE_OP_ACCEPT, 1);
	found = fake_page_archived();
	assert_int_equal(found.count, 1);
	assert_string_equal(found.state, "recorded");
	assert_string_equal(found.note, "was still in the tower from an earlier run");
}

static bool is_broken(const struct tower_view *view)
{
	return !view->open && strstr(view->trouble, "no such directory") != NULL;
}

static void a_drop_survives_the_loss_of_the_link(void **state)
{
	char elsewhere[80];
	struct fake_page_found found;

	(void)state;
	snprintf(elsewhere, sizeof(elsewhere), "%s/gone", fake_page_directory);
	fake_page_begin_to_fall();
	fake_tower_leave();
	assert_int_equal(rename(fake_page_bus, elsewhere), 0);
	fake_page_wait(is_broken);
	assert_int_equal(mkdir(fake_page_bus, 0700), 0);
	fake_tower.parameters = 0;
	fake_tower_fall_unseen();
	fake_tower_join(fake_page_url);
	fake_page_wait_recorded("box/1");
	fake_page_wait(fake_page_is_set_up);
	assert_int_equal(fake_tower.parameters,
	                 FAKE_TOWER_PARAMETERS); /* a tower that was away may have started again */
	fake_page_release(fake_page_arm());
	fake_page_wait(fake_page_is_moving);
	fake_page_must(tower_abort, "{}");
	fake_page_wait_recorded("box/2");
	found = fake_page_archived();
	assert_int_equal(found.count, 2);
}

/* No file of this process can become longer than bytes; 0: any can. */
static void limit_files(rlim_t bytes)
{
	struct rlimit limit;

	signal(SIGXFSZ, SIG_IGN);
	assert_int_equal(getrlimit(RLIMIT_FSIZE, &limit), 0);
	limit.rlim_cur = bytes > 0 ? bytes : limit.rlim_max;
	assert_int_equal(setrlimit(RLIMIT_FSIZE, &limit), 0);
}

static bool is_kept_by_the_tower(const struct tower_view *view)
{
	return fake_page_is_idle(view) && view->session.state == WIRE_STATE_CAPTURED && view->blocked &&
	       strstr(view->trouble, "not on the disk") != NULL;
}

/* Neither in its log nor in the archive nor anywhere: the tower must not forget it. */
static void what_no_disk_took_is_not_accepted(void **state)
{
	unsigned token, ends, accepted;
	struct fake_page_found found;
	char text[512];
	int status;

	(void)state;
	fake_page_select_box();
	token = fake_page_arm();
	limit_files(50000); /* a third of the drop */
	fake_page_release(token);
	fake_page_wait(is_kept_by_the_tower);
	ends = atomic_load(&fake_tower.ends);
	while (atomic_load(&fake_tower.ends) < ends + 5) /* nor when the tower asks for it */
		fake_page_nap();
	accepted = fake_tower_heard(WIRE_OP_ACCEPT);
	assert_int_equal(fake_page_say(tower_arm, "{}", text), 409);
	limit_files(0);
	status = fake_page_say(tower_select, "{\"series\":\"box\"}", text);
	assert_int_equal(accepted, 0);
	assert_int_equal(status, 200);
	fake_page_wait_heard(WIRE_OP_ACCEPT, 1);
	fake_page_wait(fake_page_is_ready);
	found = fake_page_archived();
	assert_int_equal(found.count, 2);
	assert_string_equal(found.state, "recorded");
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, fake_page_set_up, fake_page_tear_down)
	const struct CMUnitTest tests[] = {
	        TEST(a_drop_is_collected_and_kept),
	        TEST(an_abort_in_motion_is_kept_with_its_note),
	        TEST(a_fault_in_motion_is_kept_with_its_text),
	        TEST(a_release_without_a_capture_leaves_a_word),
	        cmocka_unit_test_setup_teardown(a_drop_from_before_waits_for_a_series,
	                                        fake_page_set_up_holding, fake_page_tear_down),
	        TEST(a_drop_survives_the_loss_of_the_link),
	        TEST(what_no_disk_took_is_not_accepted),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
