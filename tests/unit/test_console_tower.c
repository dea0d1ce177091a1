/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The console's tower and archive threads, against a tower on the bus that a thread of the test plays: it
 * answers, or does not, as the test says, and writes down what it was told, in order.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <dirent.h>
#include <math.h>
#include <pthread.h>
#include <semaphore.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/wire_table.h"
#include "firmware/parameter.h"
#include "host/console/job.h"
#include "host/console/tower.h"
#include "host/console/work.h"
#include "tests/unit/drop_by_hand.h"
#include "tests/unit/scratch.h"

enum {
	WAIT_MS = 15000, /* for what must come; a test that waits this long has failed */
	BEAT_MS = 20,
	HEARD_MAX = 4096,
	TRIES = 10, /* how often a host repeats what is not answered */
	PARAMETERS = 6,
};

/* ---- the tower on the bus ---- */

static struct {
	pthread_t thread;
	pthread_mutex_t lock;
	struct link *link;
	bool stop;
	/* how it behaves */
	bool dumb;      /* says nothing at all */
	bool boots;     /* its next heartbeat is that of a tower that has just started */
	unsigned deaf;  /* ops that are not answered, a bit each */
	int8_t refusal; /* what ARM is answered with */
	unsigned hole;  /* live blocks of S2 that are lost */
	bool falls;     /* a release becomes a drop; else it stays in motion */
	bool fall_due;  /* what is in motion has fallen */
	uint8_t fault;  /* in motion */
	/* what it is */
	uint8_t state;
	uint32_t session; /* in the host's heartbeat */
	uint32_t nonce;
	bool captured;
	struct hand_drop drop;
	/* what it heard: ops; of parameters only how many */
	uint8_t heard[HEARD_MAX];
	unsigned heard_count, parameters, resends; /* parameters: written */
	struct parameters values;                  /* and what it took of them */
	atomic_uint ends;                          /* said so often that it holds a drop */
} fake = {.lock = PTHREAD_MUTEX_INITIALIZER};

static void send(struct frame frame)
{
	if (link_send(fake.link, &frame) != 0)
		return; /* nobody is there: the test waits in vain and says so */
}

static void send_status(void)
{
	struct frame frame;

	wire_pack_status(&frame, WIRE_ID_STATUS,
	                 &(struct wire_status){.state = fake.state, .fault = fake.fault});
	send(frame);
	wire_pack_heartbeat(
	        &frame, WIRE_ID_HEARTBEAT_TOWER,
	        &(struct wire_heartbeat){.nmt_state = fake.boots ? 0 : 5, .wire_hash = wire_hash()});
	fake.boots = false;
	send(frame);
}

static void send_capture_end(void)
{
	struct frame frame;

	hand_capture_end(&fake.drop, &frame);
	send(frame);
	for (unsigned i = 0; i <= HAND_PARAMETERS; i++) {
		hand_told(&fake.drop, i, &frame);
		send(frame);
	}
	atomic_fetch_add(&fake.ends, 1);
}

static void fall(void)
{
	struct frame frame;

	fake.fall_due = false;
	fake.drop.drop_id++;
	fake.drop.first_tick_ms += 3000;
	for (uint32_t i = 0; i < fake.drop.ticks; i++)
		for (unsigned sensor = 1; sensor <= 2; sensor++) {
			if (sensor == 2 && i - 50 < fake.hole)
				continue;
			hand_block(&fake.drop, sensor, i, false, &frame);
			send(frame);
		}
	fake.state = WIRE_STATE_CAPTURED;
	fake.captured = true;
}

/* The tower holds a drop of which no block comes by itself. */
static void fall_unseen(void)
{
	fake.state = WIRE_STATE_CAPTURED;
	fake.captured = true;
}

static void send_challenge(uint16_t host)
{
	bool armed = fake.state == WIRE_STATE_ARMED;
	struct wire_challenge challenge = {
	        .drop_id = (uint16_t)(armed ? fake.drop.drop_id + 1 : 0), .host = host, .nonce = fake.nonce};
	struct frame frame;

	wire_pack_challenge(&frame, WIRE_ID_CHALLENGE, &challenge);
	send(frame);
}

/* The first ARM asks, the second answers; the third of the same is the second again. */
static int be_armed(const struct wire_command *command)
{
	uint32_t set = wire_parameters_crc32(fake.values.value);
	bool asks = command->argument == wire_answer(0, fake.session, set);

	if (fake.refusal != 0)
		return fake.refusal;
	if (fake.state != WIRE_STATE_ARMED && !asks &&
	    command->argument != wire_answer(fake.nonce, fake.session, set))
		return DT_E_PARAMETERS;
	if (fake.state != WIRE_STATE_ARMED)
		fake.nonce += 0x9E3779B9u;
	if (!asks)
		fake.state = WIRE_STATE_ARMED;
	send_challenge(command->host);
	return 0;
}

static int obey(const struct wire_command *command)
{
	switch (command->op) {
	case WIRE_OP_ARM:
		return be_armed(command);
	case WIRE_OP_RELEASE:
		if (command->argument != wire_answer(fake.nonce, (uint16_t)(fake.drop.drop_id + 1),
		                                     wire_parameters_crc32(fake.values.value)))
			return DT_E_TOKEN;
		fake.state = WIRE_STATE_FALLING;
		if (fake.falls)
			fall();
		return 0;
	case WIRE_OP_ABORT:
		if (fake.state == WIRE_STATE_FALLING)
			fall();
		else if (!fake.captured)
			fake.state = WIRE_STATE_READY;
		return 0;
	case WIRE_OP_ACCEPT:
		if (command->argument != hand_drop_crc32(&fake.drop))
			return DT_E_CORRUPT;
		fake.captured = false;
		fake.fault = WIRE_FAULT_NONE;
		fake.state = WIRE_STATE_READY;
		return 0;
	default:
		return DT_E_STATE;
	}
}

static void hear_command(const struct frame *frame)
{
	struct wire_command command;
	struct wire_reply reply;
	struct frame answer;

	if (wire_unpack_command(frame, &command) != 0)
		return;
	if (fake.heard_count < HEARD_MAX)
		fake.heard[fake.heard_count++] = command.op;
	if ((fake.deaf >> command.op & 1u) != 0)
		return;
	reply = (struct wire_reply){.op = command.op, .sequence = command.sequence};
	reply.result = (int8_t)obey(&command);
	reply.state = fake.state;
	wire_pack_reply(&answer, WIRE_ID_REPLY, &reply);
	send(answer);
}

static void hear_resend(const struct frame *frame)
{
	struct wire_resend resend;
	struct frame block;

	if (wire_unpack_resend(frame, &resend) != 0)
		return;
	fake.resends++;
	for (uint32_t i = 0; i < resend.count; i++) {
		uint32_t tick = resend.first_tick_ms - fake.drop.first_tick_ms + i;

		if (tick >= fake.drop.ticks)
			continue; /* of the drop before */
		hand_block(&fake.drop, resend.sensor, tick, true, &block);
		send(block);
	}
}

static void hear_parameter(const struct frame *frame)
{
	struct wire_sdo sdo;
	struct frame answer;

	if (wire_unpack_sdo(frame, &sdo) != 0)
		return;
	if (sdo.specifier == 0x40) {
		sdo.specifier = parameters_get(&fake.values, sdo.index, &sdo.value) == 0 ? 0x43 : 0x80;
		wire_pack_sdo(&answer, WIRE_ID_SDO_REPLY, &sdo);
		send(answer);
		return;
	}
	fake.parameters++;
	sdo.specifier = 0x60;
	if (parameters_set(&fake.values, sdo.index, sdo.value) != 0) {
		sdo.specifier = 0x80;
		sdo.value = PARAMETER_INCOMPATIBLE;
	}
	wire_pack_sdo(&answer, WIRE_ID_SDO_REPLY, &sdo);
	send(answer);
}

static void hear_heartbeat(const struct frame *frame)
{
	struct wire_host_heartbeat heartbeat;

	if (wire_unpack_host_heartbeat(frame, &heartbeat) == 0)
		fake.session = heartbeat.session;
}

static void beat(void)
{
	if (fake.dumb)
		return;
	if (fake.fall_due)
		fall();
	send_status();
	if (fake.captured)
		send_capture_end();
}

static void *play(void *unused)
{
	int64_t due_ms = 0;

	(void)unused;
	pthread_mutex_lock(&fake.lock);
	while (!fake.stop) {
		struct frame frame;
		int got;

		pthread_mutex_unlock(&fake.lock);
		got = link_receive(fake.link, &frame, 2);
		pthread_mutex_lock(&fake.lock);
		if (got == 1 && frame.id == WIRE_ID_COMMAND)
			hear_command(&frame);
		else if (got == 1 && frame.id == WIRE_ID_RESEND)
			hear_resend(&frame);
		else if (got == 1 && frame.id == WIRE_ID_HEARTBEAT_HOST)
			hear_heartbeat(&frame);
		else if (got == 1 && frame.id == WIRE_ID_SDO_REQUEST)
			hear_parameter(&frame);
		if (session_now_ms() >= due_ms) {
			due_ms = session_now_ms() + BEAT_MS;
			beat();
		}
	}
	pthread_mutex_unlock(&fake.lock);
	return NULL;
}

/* ---- the console ---- */

static char directory[64], bus[96], url[128], archive_name[96], message[ARCHIVE_MESSAGE_MAX];
static struct console console;
static sem_t answered;

static void fake_join(void)
{
	fake.stop = false;
	fake.link = link_open(url, LINK_READ_WRITE, message, sizeof(message));
	assert_non_null(fake.link);
	assert_int_equal(pthread_create(&fake.thread, NULL, play, NULL), 0);
}

static void fake_leave(void)
{
	pthread_mutex_lock(&fake.lock);
	fake.stop = true;
	pthread_mutex_unlock(&fake.lock);
	pthread_join(fake.thread, NULL);
	(void)link_close(fake.link);
}

/* Series from other heights; each next one is selected after the one before, on one tower. */
static const struct {
	const char *series;
	double height_m;
} heights[] = {{"mid", 1.0}, {"top", 2.49}, {"low", 0.3}, {"high", 2.0}, {"lower", 0.5}, {"five", 5.0}};

/* geometry-2A's dampers, above what its product falls on. */
#define DAMPERS_ABOVE_M 0.094

static void make_archive(void)
{
	struct archive *archive = archive_open(archive_name, ARCHIVE_CREATE, message);

	assert_non_null(archive);
	assert_int_equal(
	        archive_new_series(archive, "box", "c", "common/scenes/geometry-2A.ini", 25, NAN, NULL, 5),
	        0);
	for (size_t i = 0; i < sizeof(heights) / sizeof(heights[0]); i++)
		assert_int_equal(archive_new_series(archive, heights[i].series, "c",
		                                    "common/scenes/geometry-2A.ini", 25, heights[i].height_m,
		                                    NULL, 1),
		                 0);
	archive_close(archive);
}

static void console_start(void)
{
	static const char *const scenes[] = {"common/scenes/geometry-2A.ini", NULL};
	struct work_options work = {.archive = archive_name, .operator_name = "me", .scenes = scenes};
	struct tower_options tower = {.link = url};
	char why[SESSION_MESSAGE_MAX];

	console = (struct console){.live = live_create()};
	job_queue_init(&console.tower_queue);
	job_queue_init(&console.work_queue);
	console.work = work_start(&console, &work, message);
	assert_non_null(console.work);
	console.tower = tower_start(&console, &tower, why);
	assert_non_null(console.tower);
}

static void console_stop(void)
{
	tower_stop(console.tower);
	work_stop(console.work);
	live_destroy(console.live);
	job_queue_destroy(&console.work_queue);
	job_queue_destroy(&console.tower_queue);
}

static void set_up_fake(void)
{
	fake.dumb = fake.captured = false;
	fake.deaf = fake.hole = fake.heard_count = fake.parameters = fake.resends = 0;
	fake.refusal = 0;
	parameters_init(&fake.values);
	fake.falls = true;
	fake.fault = WIRE_FAULT_NONE;
	fake.state = WIRE_STATE_READY;
	hand_fill(&fake.drop, 5000, 500, 0xD401);
}

static void set_up_folder(void)
{
	assert_non_null(mkdtemp(scratch_name(directory, "tower")));
	snprintf(bus, sizeof(bus), "%s/bus", directory);
	snprintf(url, sizeof(url), "unix:%s/socket", bus);
	snprintf(archive_name, sizeof(archive_name), "%s/archive", directory);
	assert_int_equal(mkdir(bus, 0700), 0);
	sem_init(&answered, 0, 0);
	make_archive();
	set_up_fake();
}

static int set_up(void **state)
{
	(void)state;
	set_up_folder();
	fake_join();
	console_start();
	return 0;
}

/* A tower that holds a drop when the console comes. */
static int set_up_holding(void **state)
{
	(void)state;
	set_up_folder();
	fall_unseen();
	fake_join();
	console_start();
	return 0;
}

static void remove_tree(const char *folder)
{
	char command[200];

	snprintf(command, sizeof(command), "rm -rf '%s'", folder);
	assert_int_equal(system(command), 0);
}

static int tear_down(void **state)
{
	(void)state;
	console_stop();
	fake_leave();
	remove_tree(directory);
	return 0;
}

/* ---- asking ---- */

struct asked {
	struct job job;
	cJSON *body, *answer;
};

static void on_done(struct job *job)
{
	(void)job;
	sem_post(&answered);
}

static void ask(struct asked *asked, void (*verb)(struct job *), const char *body)
{
	*asked = (struct asked){.job = {.console = &console, .done = on_done}, .body = cJSON_Parse(body)};
	asked->job.body = asked->body;
	verb(&asked->job);
}

static void wait_answer(void)
{
	struct timespec until;

	clock_gettime(CLOCK_REALTIME, &until);
	until.tv_sec += WAIT_MS / 1000;
	if (sem_timedwait(&answered, &until) != 0)
		fail_msg("no answer");
}

/* Its HTTP status; the answer's text goes to text. */
static int take_answer(struct asked *asked, char text[512])
{
	snprintf(text, 512, "%.*s", (int)asked->job.size, (const char *)asked->job.answer);
	free(asked->job.answer);
	cJSON_Delete(asked->body);
	return asked->job.status;
}

static int say(void (*verb)(struct job *), const char *body, char text[512])
{
	struct asked asked;

	ask(&asked, verb, body);
	wait_answer();
	return take_answer(&asked, text);
}

static void must(void (*verb)(struct job *), const char *body)
{
	char text[512];
	int status = say(verb, body, text);

	if (status != 200)
		fail_msg("%d %s", status, text);
}

static unsigned arm(void)
{
	char text[512];
	unsigned token = 0;
	double warning_s = 0, expires_s = 0;

	if (say(tower_arm, "{}", text) != 200 ||
	    sscanf(text, "{\"token\":%u,\"warning_s\":%lf,\"expires_s\":%lf}", &token, &warning_s,
	           &expires_s) != 3)
		fail_msg("%s", text);
	assert_true(warning_s > 0 && warning_s <= 1 && expires_s > warning_s && expires_s <= 10);
	return token;
}

static void release(unsigned token)
{
	char body[64], text[512];
	int status;

	snprintf(body, sizeof(body), "{\"token\":%u}", token);
	while ((status = say(tower_release, body, text)) == 425) /* the warning is not over */
		usleep(50000);
	if (status != 200)
		fail_msg("%d %s", status, text);
}

static void nap(void)
{
	usleep(2000);
}

/* Waits until the view is as told. */
static struct tower_view wait_view(bool (*as_told)(const struct tower_view *view))
{
	int64_t until_ms = session_now_ms() + WAIT_MS;
	struct tower_view view;

	for (;;) {
		tower_look(console.tower, &view);
		if (as_told(&view))
			return view;
		if (session_now_ms() > until_ms)
			fail_msg("state %s, phase %s, %s", wire_state_name(view.session.state),
			         tower_phase_name(view.phase), view.trouble);
		nap();
	}
}

static bool is_heard(const struct tower_view *view)
{
	return view->open && view->session.seen && view->session.hash_known;
}

static bool is_open(const struct tower_view *view)
{
	return view->open;
}

static bool is_broken(const struct tower_view *view)
{
	return !view->open && strstr(view->trouble, "no such directory") != NULL;
}

static bool is_idle(const struct tower_view *view)
{
	return view->phase == TOWER_IDLE;
}

static bool is_ready(const struct tower_view *view)
{
	return is_idle(view) && view->session.state == WIRE_STATE_READY;
}

static bool is_armed(const struct tower_view *view)
{
	return view->phase == TOWER_ARMED && view->session.state == WIRE_STATE_ARMED;
}

static bool is_moving(const struct tower_view *view)
{
	return view->phase == TOWER_MOVING && view->session.state == WIRE_STATE_FALLING;
}

static bool holds_drop(const struct tower_view *view)
{
	return view->session.state == WIRE_STATE_CAPTURED && strstr(view->trouble, "holds a drop") != NULL;
}

static bool is_blocked(const struct tower_view *view)
{
	return view->session.state == WIRE_STATE_READY && view->blocked &&
	       strstr(view->trouble, "gate_lower_um") != NULL;
}

static bool is_set_up(const struct tower_view *view)
{
	return is_heard(view) && view->series[0] != '\0' && view->trouble[0] == '\0';
}

static void wait_heard(unsigned op, unsigned count)
{
	int64_t until_ms = session_now_ms() + WAIT_MS;
	unsigned found = 0;

	while (found < count) {
		if (session_now_ms() > until_ms)
			fail_msg("%s came %u times, expected %u", wire_op_name(op), found, count);
		nap();
		pthread_mutex_lock(&fake.lock);
		found = 0;
		for (unsigned i = 0; i < fake.heard_count; i++)
			found += fake.heard[i] == op;
		pthread_mutex_unlock(&fake.lock);
	}
}

static unsigned heard(unsigned op)
{
	unsigned found = 0;

	pthread_mutex_lock(&fake.lock);
	for (unsigned i = 0; i < fake.heard_count; i++)
		found += fake.heard[i] == op;
	pthread_mutex_unlock(&fake.lock);
	return found;
}

static void behave(unsigned deaf, int8_t refusal, bool falls)
{
	pthread_mutex_lock(&fake.lock);
	fake.deaf = deaf;
	fake.refusal = refusal;
	fake.falls = falls;
	pthread_mutex_unlock(&fake.lock);
}

static void select_box(void)
{
	wait_view(is_heard);
	must(tower_select, "{\"series\":\"box\"}");
	wait_view(is_set_up);
}

/* Released and in motion, where it stays. */
static void begin_to_fall(void)
{
	select_box();
	behave(0, 0, false);
	release(arm());
	wait_view(is_moving);
	assert_false(console.at_rest);
}

static void wait_recorded(const char *drop)
{
	int64_t until_ms = session_now_ms() + WAIT_MS;
	struct work_view view;

	do {
		nap();
		work_look(console.work, &view);
		if (session_now_ms() > until_ms)
			fail_msg("result '%s', %s", view.result, view.trouble);
	} while (strcmp(view.result, drop) != 0);
	wait_view(is_idle);
}

/* ---- what the archive holds once the console has ended ---- */

struct found {
	unsigned count;
	char state[32], note[ARCHIVE_TEXT_MAX], raw[200];
};

static int find(void *context, const struct archive_drop *drop)
{
	struct found *found = context;

	found->count++;
	snprintf(found->state, sizeof(found->state), "%s", drop->state);
	snprintf(found->note, sizeof(found->note), "%s", drop->note);
	snprintf(found->raw, sizeof(found->raw), "%s", drop->raw);
	return 0;
}

static struct found archived(void)
{
	struct archive_filter filter = archive_filter_none();
	struct found found = {0};
	struct archive *archive;

	console_stop();
	archive = archive_open(archive_name, ARCHIVE_READ, message);
	assert_non_null(archive);
	assert_int_equal(archive_each_drop(archive, &filter, find, &found), 0);
	archive_close(archive);
	console_start(); /* for tear_down to stop */
	return found;
}

/* ---- tests ---- */

static void arming_needs_a_series(void **state)
{
	char text[512];

	(void)state;
	wait_view(is_heard);
	assert_int_equal(say(tower_arm, "{}", text), 409);
	assert_non_null(strstr(text, "series"));
	assert_int_equal(heard(WIRE_OP_ARM), 0);
	assert_int_equal(say(tower_select, "{\"series\":\"other\"}", text), 404);
	assert_int_equal(say(tower_select, "{}", text), 400);
	assert_int_equal(say(tower_simulate, "{\"line\":\"fault estop\"}", text), 404);
}

static void a_refused_arm_leaves_no_drop(void **state)
{
	char text[512];

	(void)state;
	select_box();
	assert_int_equal(fake.parameters, PARAMETERS);
	behave(0, DT_E_HASH, true);
	assert_int_equal(say(tower_arm, "{}", text), 409);
	assert_non_null(strstr(text, error_text(DT_E_HASH)));
	wait_view(is_idle);
	assert_int_equal(archived().count, 0);
}

static void a_drop_is_collected_and_kept(void **state)
{
	char text[512], log[400];
	struct found found;
	struct stat file;

	(void)state;
	pthread_mutex_lock(&fake.lock);
	fake.hole = 37;
	pthread_mutex_unlock(&fake.lock);
	select_box();
	assert_int_equal(say(tower_release, "{\"token\":1}", text), 409); /* nothing is armed */
	release(arm());
	wait_recorded("box/1");
	assert_string_equal(wait_view(is_idle).trouble, "");
	assert_true(fake.resends > 0);
	assert_true(heard(WIRE_OP_ACCEPT) >= 1); /* twice, if the tower asked again meanwhile */
	assert_int_equal(heard(WIRE_OP_DISCARD), 0);
	wait_view(is_ready);
	release(arm());
	wait_recorded("box/2");
	found = archived();
	assert_int_equal(found.count, 2);
	assert_string_equal(found.state, "recorded");
	assert_string_equal(found.note, "");
	snprintf(log, sizeof(log), "%s/%s", archive_name, found.raw);
	assert_int_equal(stat(log, &file), 0);
	assert_true(file.st_size > 1000 * 64);
}

static void a_wrong_token_leaves_it_armed(void **state)
{
	char text[512], body[64];
	unsigned token;

	(void)state;
	select_box();
	token = arm();
	snprintf(body, sizeof(body), "{\"token\":%u}", token ^ 1u);
	assert_int_equal(say(tower_release, body, text), 409);
	assert_non_null(strstr(text, error_text(DT_E_TOKEN)));
	assert_int_equal(wait_view(is_armed).phase, TOWER_ARMED);
	assert_false(console.at_rest);
	assert_int_equal(say(tower_arm, "{}", text), 409); /* one at a time */
	assert_int_equal(say(tower_select, "{\"series\":\"box\"}", text), 409);
	release(token);
	wait_recorded("box/1");
}

static void disarmed_without_a_release_leaves_no_drop(void **state)
{
	struct tower_view idle;

	(void)state;
	select_box();
	(void)arm();
	assert_true(wait_view(is_armed).armed_until_ms > session_now_ms());
	pthread_mutex_lock(&fake.lock);
	fake.state = WIRE_STATE_READY; /* its time is over */
	pthread_mutex_unlock(&fake.lock);
	idle = wait_view(is_idle);
	assert_true(idle.armed_until_ms == 0);
	assert_true(console.at_rest);
	assert_string_equal(idle.trouble, "");
	(void)arm();
	must(tower_abort, "{}");
	wait_view(is_idle);
	assert_int_equal(heard(WIRE_OP_ABORT), 1);
	tower_disarm(console.tower); /* there is nothing to */
	(void)arm();
	assert_int_equal(heard(WIRE_OP_ABORT), 1);
	tower_disarm(console.tower);
	wait_view(is_idle);
	assert_int_equal(heard(WIRE_OP_ABORT), 2);
	assert_int_equal(archived().count, 0);
}

/* The link stalls right behind the reply to ARM: the last that was heard is a tower at rest. */
static void an_arm_outlasts_a_silence(void **state)
{
	(void)state;
	select_box();
	pthread_mutex_lock(&fake.lock);
	fake.dumb = true;
	pthread_mutex_unlock(&fake.lock);
	(void)arm();
	usleep(300000);
	pthread_mutex_lock(&fake.lock);
	fake.dumb = false;
	pthread_mutex_unlock(&fake.lock);
	wait_view(is_armed);
	must(tower_abort, "{}");
	wait_view(is_idle);
}

/* By the order of things: an ARM that is not answered is repeated TRIES times unless it is given up. */
static void abort_does_not_wait_for_an_unanswered_arm(void **state)
{
	struct asked armed, aborted, released;
	unsigned arms = 0, last, count;
	char text[512];

	(void)state;
	select_box();
	behave(1u << WIRE_OP_ARM, 0, true);
	ask(&armed, tower_arm, "{}");
	wait_heard(WIRE_OP_ARM, 1);
	ask(&released, tower_release, "{\"token\":7}"); /* void as well: asked for before */
	ask(&aborted, tower_abort, "{}");
	for (unsigned i = 0; i < 3; i++)
		wait_answer();
	assert_int_equal(take_answer(&armed, text), 409);
	assert_string_equal(text, "{\"error\":\"aborted\"}");
	assert_int_equal(take_answer(&released, text), 409);
	assert_string_equal(text, "{\"error\":\"aborted\"}");
	assert_int_equal(take_answer(&aborted, text), 200);
	pthread_mutex_lock(&fake.lock);
	while (arms < fake.heard_count && fake.heard[arms] == WIRE_OP_ARM)
		arms++;
	last = fake.heard[arms];
	count = fake.heard_count;
	pthread_mutex_unlock(&fake.lock);
	assert_true(arms >= 1 && arms < TRIES);
	assert_int_equal(last, WIRE_OP_ABORT);
	assert_int_equal(count, arms + 1);
	wait_view(is_idle);
	behave(0, 0, true);
	release(arm()); /* and nothing of it stays behind */
	wait_recorded("box/1");
	assert_int_equal(archived().count, 1);
}

/* An ARM that waits behind something else is not sent after the ABORT that was asked for later. */
static void an_arm_from_before_an_abort_is_void(void **state)
{
	struct asked cleared, armed, aborted;
	char text[512];

	(void)state;
	select_box();
	behave(1u << WIRE_OP_CLEAR, 0, true);
	ask(&cleared, tower_clear, "{}");
	wait_heard(WIRE_OP_CLEAR, 1);
	ask(&armed, tower_arm, "{}");
	ask(&aborted, tower_abort, "{}");
	for (unsigned i = 0; i < 3; i++)
		wait_answer();
	assert_int_equal(take_answer(&cleared, text), 409);
	assert_int_equal(take_answer(&armed, text), 409);
	assert_string_equal(text, "{\"error\":\"aborted\"}");
	assert_int_equal(take_answer(&aborted, text), 200);
	assert_int_equal(heard(WIRE_OP_ARM), 0);
	assert_int_equal(archived().count, 0);
}

/* CLEARs that the tower does not answer; each holds the tower's thread for a while. */
static void fill_queue(struct asked *cleared, unsigned count)
{
	select_box();
	behave(1u << WIRE_OP_CLEAR, 0, true);
	for (unsigned i = 0; i < count; i++)
		ask(&cleared[i], tower_clear, "{}");
}

static void abort_goes_past_a_full_queue(void **state)
{
	enum { MANY = 200 };
	static struct asked cleared[MANY];
	struct asked aborted;
	char text[512];

	(void)state;
	fill_queue(cleared, MANY);
	ask(&aborted, tower_abort, "{}");
	for (unsigned i = 0; i < MANY + 1; i++)
		wait_answer();
	assert_int_equal(take_answer(&cleared[0], text), 409);
	assert_int_equal(take_answer(&cleared[MANY - 1], text), 503);
	assert_int_equal(take_answer(&aborted, text), 200);
	for (unsigned i = 1; i < MANY - 1; i++)
		(void)take_answer(&cleared[i], text);
	assert_int_equal(heard(WIRE_OP_ABORT), 1);
}

static void abort_goes_to_a_tower_that_was_never_heard(void **state)
{
	(void)state;
	pthread_mutex_lock(&fake.lock);
	fake.dumb = true;
	pthread_mutex_unlock(&fake.lock);
	wait_view(is_open);
	must(tower_abort, "{}");
	assert_int_equal(heard(WIRE_OP_ABORT), 1);
}

static void an_abort_in_motion_is_kept_with_its_note(void **state)
{
	struct found found;

	(void)state;
	begin_to_fall();
	must(tower_abort, "{}");
	wait_recorded("box/1");
	found = archived();
	assert_int_equal(found.count, 1);
	assert_string_equal(found.state, "recorded");
	assert_string_equal(found.note, "aborted in motion");
}

static void a_fault_in_motion_is_kept_with_its_text(void **state)
{
	struct found found;

	(void)state;
	begin_to_fall();
	pthread_mutex_lock(&fake.lock);
	fake.fault = WIRE_FAULT_DOOR;
	fake.state = WIRE_STATE_FAULT_MOVING;
	fake.fall_due = true;
	pthread_mutex_unlock(&fake.lock);
	wait_recorded("box/1");
	found = archived();
	assert_string_equal(found.note, wire_fault_text(WIRE_FAULT_DOOR));
}

static void a_release_without_a_capture_leaves_a_word(void **state)
{
	struct tower_view view;
	struct found found;

	(void)state;
	begin_to_fall();
	pthread_mutex_lock(&fake.lock);
	fake.state = WIRE_STATE_READY;
	pthread_mutex_unlock(&fake.lock);
	view = wait_view(is_ready);
	assert_string_equal(view.trouble, "nothing was captured: the frame did not move");
	found = archived();
	assert_int_equal(found.count, 1);
	assert_string_equal(found.state, "interrupted");
	assert_string_equal(found.note, view.trouble);
}

static void a_drop_from_before_waits_for_a_series(void **state)
{
	struct found found;
	int64_t until_ms;
	unsigned ends;

	(void)state;
	wait_view(holds_drop);
	until_ms = session_now_ms() + WAIT_MS;
	for (ends = fake.ends; fake.ends < ends + 50;) { /* time enough to collect it */
		if (session_now_ms() > until_ms)
			fail_msg("the tower holds nothing any longer");
		nap();
	}
	assert_int_equal(heard(WIRE_OP_ACCEPT) + heard(WIRE_OP_DISCARD), 0);
	must(tower_select, "{\"series\":\"box\"}");
	wait_recorded("box/1");
	wait_heard(WIRE_OP_ACCEPT, 1);
	found = archived();
	assert_int_equal(found.count, 1);
	assert_string_equal(found.state, "recorded");
	assert_string_equal(found.note, "was still in the tower from an earlier run");
}

static void a_drop_survives_the_loss_of_the_link(void **state)
{
	char elsewhere[80];
	struct found found;

	(void)state;
	snprintf(elsewhere, sizeof(elsewhere), "%s/gone", directory);
	begin_to_fall();
	fake_leave();
	assert_int_equal(rename(bus, elsewhere), 0);
	wait_view(is_broken);
	assert_int_equal(mkdir(bus, 0700), 0);
	fake.parameters = 0;
	fall_unseen();
	fake_join();
	wait_recorded("box/1");
	wait_view(is_set_up);
	assert_int_equal(fake.parameters, PARAMETERS); /* a tower that was away may have started again */
	release(arm());
	wait_view(is_moving);
	must(tower_abort, "{}");
	wait_recorded("box/2");
	found = archived();
	assert_int_equal(found.count, 2);
}

static void a_tower_that_starts_again_is_set_up_again(void **state)
{
	int64_t until_ms = session_now_ms() + WAIT_MS;
	unsigned parameters = 0;

	(void)state;
	select_box();
	pthread_mutex_lock(&fake.lock);
	fake.parameters = 0;
	fake.boots = true;
	pthread_mutex_unlock(&fake.lock);
	while (parameters < PARAMETERS && session_now_ms() < until_ms) {
		nap();
		pthread_mutex_lock(&fake.lock);
		parameters = fake.parameters;
		pthread_mutex_unlock(&fake.lock);
	}
	assert_int_equal(parameters, PARAMETERS);
	wait_view(is_set_up);
}

static void a_tower_is_set_up_from_any_height_for_any_other(void **state)
{
	char text[512];

	(void)state;
	wait_view(is_heard);
	for (size_t i = 0; heights[i].height_m < 5; i++) {
		double wanted_um = (heights[i].height_m - DAMPERS_ABOVE_M) * 1e6;

		snprintf(text, sizeof(text), "{\"series\":\"%s\"}", heights[i].series);
		must(tower_select, text);
		wait_view(is_set_up);
		assert_float_equal(fake.values.value[WIRE_PARAMETER_dampers_um], wanted_um, 1);
	}
}

static void what_no_tower_can_have_is_refused_with_its_range(void **state)
{
	unsigned before;
	char text[512];

	(void)state;
	select_box();
	before = fake.parameters;
	assert_int_equal(say(tower_select, "{\"series\":\"five\"}", text), 409);
	assert_non_null(strstr(text, "10000 to 2400000 um"));
	assert_int_equal(fake.parameters, before);
	wait_view(is_blocked); /* green, and yet the page must not call it ready */
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
	return is_idle(view) && view->session.state == WIRE_STATE_CAPTURED && view->blocked &&
	       strstr(view->trouble, "not on the disk") != NULL;
}

/* Neither in its log nor in the archive nor anywhere: the tower must not forget it. */
static void what_no_disk_took_is_not_accepted(void **state)
{
	unsigned token, ends, accepted;
	struct found found;
	char text[512];
	int status;

	(void)state;
	select_box();
	token = arm();
	limit_files(50000); /* a third of the drop */
	release(token);
	wait_view(is_kept_by_the_tower);
	ends = atomic_load(&fake.ends);
	while (atomic_load(&fake.ends) < ends + 5) /* nor when the tower asks for it */
		nap();
	accepted = heard(WIRE_OP_ACCEPT);
	assert_int_equal(say(tower_arm, "{}", text), 409);
	limit_files(0);
	status = say(tower_select, "{\"series\":\"box\"}", text);
	assert_int_equal(accepted, 0);
	assert_int_equal(status, 200);
	wait_heard(WIRE_OP_ACCEPT, 1);
	wait_view(is_ready);
	found = archived();
	assert_int_equal(found.count, 2);
	assert_string_equal(found.state, "recorded");
}

static void the_end_aborts_what_is_armed(void **state)
{
	(void)state;
	select_box();
	(void)arm();
	assert_int_equal(archived().count, 0);
	assert_int_equal(heard(WIRE_OP_ABORT), 1);
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
	struct asked cleared[MANY], armed, selected;
	int64_t until_ms = session_now_ms() + WAIT_MS;
	char text[512];

	(void)state;
	fill_queue(cleared, MANY);
	ask(&armed, tower_arm, "{}");
	ask(&selected, tower_select, "{\"series\":\"box\"}");
	while (!waits_for_tower(&selected.job) && session_now_ms() < until_ms)
		nap();
	assert_true(waits_for_tower(&armed.job));
	assert_int_equal(archived().count, 0);
	for (unsigned i = 0; i < MANY + 2; i++)
		wait_answer();
	assert_int_equal(take_answer(&armed, text), 503);
	assert_string_equal(text, "{\"error\":\"the console is ending\"}");
	assert_int_equal(take_answer(&selected, text), 503);
	for (unsigned i = 0; i < MANY; i++)
		(void)take_answer(&cleared[i], text);
	assert_int_equal(heard(WIRE_OP_ARM), 0);
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, set_up, tear_down)
	const struct CMUnitTest tests[] = {
	        TEST(arming_needs_a_series),
	        TEST(a_refused_arm_leaves_no_drop),
	        TEST(a_drop_is_collected_and_kept),
	        TEST(a_wrong_token_leaves_it_armed),
	        TEST(disarmed_without_a_release_leaves_no_drop),
	        TEST(an_arm_outlasts_a_silence),
	        TEST(abort_does_not_wait_for_an_unanswered_arm),
	        TEST(an_arm_from_before_an_abort_is_void),
	        TEST(abort_goes_past_a_full_queue),
	        TEST(abort_goes_to_a_tower_that_was_never_heard),
	        TEST(an_abort_in_motion_is_kept_with_its_note),
	        TEST(a_fault_in_motion_is_kept_with_its_text),
	        TEST(a_release_without_a_capture_leaves_a_word),
	        cmocka_unit_test_setup_teardown(a_drop_from_before_waits_for_a_series, set_up_holding,
	                                        tear_down),
	        TEST(a_drop_survives_the_loss_of_the_link),
	        TEST(a_tower_that_starts_again_is_set_up_again),
	        TEST(a_tower_is_set_up_from_any_height_for_any_other),
	        TEST(what_no_tower_can_have_is_refused_with_its_range),
	        TEST(what_no_disk_took_is_not_accepted),
	        TEST(the_end_aborts_what_is_armed),
	        TEST(the_end_refuses_what_waits),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
