/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/unit/fake_page.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>
#include <semaphore.h>

#include "common/wire_table.h"
#include "host/console/tower.h"
#include "host/console/work.h"
#include "tests/unit/fake_tower.h"
#include "tests/unit/scratch.h"

char fake_page_directory[64], fake_page_bus[96], fake_page_url[128], fake_page_archive[96];
struct console console;

static char message[ARCHIVE_MESSAGE_MAX];
static sem_t answered;

const struct fake_page_height fake_page_heights[] = {
        {"mid", 1.0}, {"top", 2.49}, {"low", 0.3}, {"high", 2.0}, {"lower", 0.5}, {"five", 5.0}, {NULL, 0}};

static void make_archive(void)
{
	struct archive *archive = archive_open(fake_page_archive, ARCHIVE_CREATE, message);

	assert_non_null(archive);
	assert_int_equal(
	        archive_new_series(archive, "box", "c", "common/scenes/geometry-2A.ini", 25, NAN, NULL, 5),
	        0);
	for (size_t i = 0; fake_page_heights[i].series != NULL; i++)
		assert_int_equal(archive_new_series(archive, fake_page_heights[i].series, "c",
		                                    "common/scenes/geometry-2A.ini", 25,
		                                    fake_page_heights[i].height_m, NULL, 1),
		                 0);
	archive_close(archive);
}

void fake_page_open(void)
{
	static const char *const scenes[] = {"common/scenes/geometry-2A.ini", NULL};
	struct work_options work = {.archive = fake_page_archive, .operator_name = "me", .scenes = scenes};
	struct tower_options tower = {.link = fake_page_url};
	char why[SESSION_MESSAGE_MAX];

	console = (struct console){.live = live_create()};
	job_queue_init(&console.tower_queue);
	job_queue_init(&console.work_queue);
	console.work = work_start(&console, &work, message);
	assert_non_null(console.work);
	console.tower = tower_start(&console, &tower, why);
	assert_non_null(console.tower);
}

void fake_page_close(void)
{
	tower_stop(console.tower);
	work_stop(console.work);
	live_destroy(console.live);
	job_queue_destroy(&console.work_queue);
	job_queue_destroy(&console.tower_queue);
}

static void set_up_folder(void)
{
	assert_non_null(mkdtemp(scratch_name(fake_page_directory, "tower")));
	snprintf(fake_page_bus, sizeof(fake_page_bus), "%s/bus", fake_page_directory);
	snprintf(fake_page_url, sizeof(fake_page_url), "unix:%s/socket", fake_page_bus);
	snprintf(fake_page_archive, sizeof(fake_page_archive), "%s/archive", fake_page_directory);
	assert_int_equal(mkdir(fake_page_bus, 0700), 0);
	sem_init(&answered, 0, 0);
	make_archive();
	fake_tower_reset();
}

int fake_page_set_up(void **state)
{
	(void)state;
	set_up_folder();
	fake_tower_join(fake_page_url);
	fake_page_open();
	return 0;
}

int fake_page_set_up_holding(void **state)
{
	(void)state;
	set_up_folder();
	fake_tower_fall_unseen();
	fake_tower_join(fake_page_url);
	fake_page_open();
	return 0;
}

static void remove_tree(const char *folder)
{
	char command[200];

	snprintf(command, sizeof(command), "rm -rf '%s'", folder);
	assert_int_equal(system(command), 0);
}

int fake_page_tear_down(void **state)
{
	(void)state;
	fake_page_close();
	fake_tower_leave();
	remove_tree(fake_page_directory);
	return 0;
}

static void on_done(struct job *job)
{
	(void)job;
	sem_post(&answered);
}

void fake_page_ask(struct fake_page_asked *asked, void (*verb)(struct job *), const char *body)
{
	*asked = (struct fake_page_asked){.job = {.console = &console, .done = on_done},
	                                  .body = cJSON_Parse(body)};
	asked->job.body = asked->body;
	verb(&asked->job);
}

void fake_page_wait_answer(void)
{
	struct timespec until;

	clock_gettime(CLOCK_REALTIME, &until);
	until.tv_sec += FAKE_PAGE_WAIT_MS / 1000;
	if (sem_timedwait(&answered, &until) != 0)
		fail_msg("no answer");
}

int fake_page_take_answer(struct fake_page_asked *asked, char text[512])
{
	snprintf(text, 512, "%.*s", (int)asked->job.size, (const char *)asked->job.answer);
	free(asked->job.answer);
	cJSON_Delete(asked->body);
	return asked->job.status;
}

int fake_page_say(void (*verb)(struct job *), const char *body, char text[512])
{
	struct fake_page_asked asked;

	fake_page_ask(&asked, verb, body);
	fake_page_wait_answer();
	return fake_page_take_answer(&asked, text);
}

void fake_page_must(void (*verb)(struct job *), const char *body)
{
	char text[512];
	int status = fake_page_say(verb, body, text);

	if (status != 200)
		fail_msg("%d %s", status, text);
}

unsigned fake_page_arm(void)
{
	char text[512];
	unsigned token = 0;
	double warning_s = 0, expires_s = 0;

	if (fake_page_say(tower_arm, "{}", text) != 200 ||
	    sscanf(text, "{\"token\":%u,\"warning_s\":%lf,\"expires_s\":%lf}", &token, &warning_s,
	           &expires_s) != 3)
		fail_msg("%s", text);
	assert_true(warning_s > 0 && warning_s <= 1 && expires_s > warning_s && expires_s <= 10);
	return token;
}

void fake_page_release(unsigned token)
{
	char body[64], text[512];
	int status;

	snprintf(body, sizeof(body), "{\"token\":%u}", token);
	while ((status = fake_page_say(tower_release, body, text)) == 425) /* the warning is not over */
		usleep(50000);
	if (status != 200)
		fail_msg("%d %s", status, text);
}

void fake_page_nap(void)
{
	usleep(2000);
}

struct tower_view fake_page_wait(bool (*as_told)(const struct tower_view *view))
{
	int64_t until_ms = session_now_ms() + FAKE_PAGE_WAIT_MS;
	struct tower_view view;

	for (;;) {
		tower_look(console.tower, &view);
		if (as_told(&view))
			return view;
		if (session_now_ms() > until_ms)
			fail_msg("state %s, phase %s, %s", wire_state_name(view.session.state),
			         tower_phase_name(view.phase), view.trouble);
		fake_page_nap();
	}
}

bool fake_page_is_heard(const struct tower_view *view)
{
	return view->open && view->session.seen && view->session.hash_known;
}

bool fake_page_is_idle(const struct tower_view *view)
{
	return view->phase == TOWER_IDLE;
}

bool fake_page_is_ready(const struct tower_view *view)
{
	return fake_page_is_idle(view) && view->session.state == WIRE_STATE_READY;
}

bool fake_page_is_armed(const struct tower_view *view)
{
	return view->phase == TOWER_ARMED && view->session.state == WIRE_STATE_ARMED;
}

bool fake_page_is_moving(const struct tower_view *view)
{
	return view->phase == TOWER_MOVING && view->session.state == WIRE_STATE_FALLING;
}

bool fake_page_is_set_up(const struct tower_view *view)
{
	return fake_page_is_heard(view) && view->series[0] != '\0' && view->trouble[0] == '\0';
}

void fake_page_wait_heard(unsigned op, unsigned count)
{
	int64_t until_ms = session_now_ms() + FAKE_PAGE_WAIT_MS;
	unsigned found = 0;

	while (found < count) {
		if (session_now_ms() > until_ms)
			fail_msg("%s came %u times, expected %u", wire_op_name(op), found, count);
		fake_page_nap();
		pthread_mutex_lock(&fake_tower.lock);
		found = 0;
		for (unsigned i = 0; i < fake_tower.heard_count; i++)
			found += fake_tower.heard[i] == op;
		pthread_mutex_unlock(&fake_tower.lock);
	}
}

void fake_page_select_box(void)
{
	fake_page_wait(fake_page_is_heard);
	fake_page_must(tower_select, "{\"series\":\"box\"}");
	fake_page_wait(fake_page_is_set_up);
}

void fake_page_begin_to_fall(void)
{
	fake_page_select_box();
	fake_tower_behave(0, 0, false);
	fake_page_release(fake_page_arm());
	fake_page_wait(fake_page_is_moving);
	assert_false(console.at_rest);
}

void fake_page_wait_recorded(const char *drop)
{
	int64_t until_ms = session_now_ms() + FAKE_PAGE_WAIT_MS;
	struct work_view view;

	do {
		fake_page_nap();
		work_look(console.work, &view);
		if (session_now_ms() > until_ms)
			fail_msg("result '%s', %s", view.result, view.trouble);
	} while (strcmp(view.result, drop) != 0);
	fake_page_wait(fake_page_is_idle);
}

static int find(void *context, const struct archive_drop *drop)
{
	struct fake_page_found *found = context;

	found->count++;
	snprintf(found->state, sizeof(found->state), "%s", drop->state);
	snprintf(found->note, sizeof(found->note), "%s", drop->note);
	snprintf(found->raw, sizeof(found->raw), "%s", drop->raw);
	return 0;
}

struct fake_page_found fake_page_archived(void)
{
	struct archive_filter filter = archive_filter_none();
	struct fake_page_found found = {0};
	struct archive *archive;

	fake_page_close();
	archive = archive_open(fake_page_archive, ARCHIVE_READ, message);
	assert_non_null(archive);
	assert_int_equal(archive_each_drop(archive, &filter, find, &found), 0);
	archive_close(archive);
	fake_page_open(); /* for tear_down to stop */
	return found;
}
