/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The tower's thread: its turns, the link, and what others see of it.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/link/link.h"
#include "common/wire_table.h"
#include "host/session/tower_setup.h"
#include "host/console/tower_private.h"

enum {
	TURN_MS = 5, /* frames are taken by the dozen: one by one they cost several times as much */
	OPEN_AGAIN_MS = 1000,
	SETUP_AGAIN_MS = 1000,
	JOBS_AT_ONCE = 16,
};

const char *tower_phase_name(enum tower_phase phase)
{
	static const char *const names[] = {
	        [TOWER_IDLE] = "idle",     [TOWER_ARMING] = "arming",         [TOWER_ARMED] = "armed",
	        [TOWER_MOVING] = "moving", [TOWER_COLLECTING] = "collecting", [TOWER_SAVING] = "saving"};

	return names[phase];
}

/* ---- the link ---- */

static bool tower_cancelled(void *user)
{
	struct tower *tower = user;

	return atomic_load(&tower->stopping) || atomic_load(&tower->aborts) != tower->wanted;
}

static void tower_on_frame(void *user, const struct frame *frame)
{
	struct tower *tower = user;

	if (live_feed(tower->console->live, frame, link_now_us())) /* it has forgotten its parameters */
		tower->setup_due = tower->series[0] != '\0';
}

static void tower_open_link(struct tower *tower)
{
	struct session_options options = {
	        .program = tower->own ? NULL : "page", /* a simulated tower is nobody's business */
	        .log = tower->log,
	        .on_frame = tower_on_frame,
	        .cancelled = tower_cancelled,
	        .user = tower};

	tower->open_due_ms = session_now_ms() + OPEN_AGAIN_MS;
	if (tower->own && tower_bench_start(tower) != 0)
		return;
	tower->session = session_open(tower->url, &options, tower->link_trouble);
	if (tower->session == NULL)
		return;
	tower->link_trouble[0] = '\0';
	session_hold(tower->session, tower->series[0] == '\0'); /* before the first frame is heard */
	tower->setup_due = tower->series[0] != '\0';
}

void tower_link_close(struct tower *tower, int delay_ms)
{
	session_close(tower->session);
	tower->session = NULL;
	tower->open_due_ms = session_now_ms() + delay_ms;
}

static void tower_poll_link(struct tower *tower)
{
	int result = session_poll(tower->session, 0);

	if (result == DT_E_SYSTEM && tower->log != NULL) {
		tower_drop_log_failed(tower);
		result = 0;
	}
	if (result == 0)
		return;
	snprintf(tower->link_trouble, sizeof(tower->link_trouble), "%.180s: %s", tower->url,
	         error_text(result));
	tower_link_close(tower, OPEN_AGAIN_MS);
}

/* ---- set-up ---- */

static bool takes_parameters(const struct tower *tower)
{
	const struct session_view *view = session_view(tower->session);

	return view->seen && view->hash_known && view->hash_agrees &&
	       (view->state == WIRE_STATE_SAFE || view->state == WIRE_STATE_READY ||
	        view->state == WIRE_STATE_FAULT_HELD);
}

int tower_set_up(struct tower *tower)
{
	int result;

	if (!tower->setup_due || tower->session == NULL || session_now_ms() < tower->setup_due_ms ||
	    !takes_parameters(tower))
		return 0;
	tower->wanted = atomic_load(&tower->aborts);
	tower->setup_due_ms = session_now_ms() + SETUP_AGAIN_MS;
	tower->setup_trouble[0] = '\0';
	tower->setup_due = false;
	result = tower_setup_write(tower->session, &tower->scene, tower->setup_trouble);
	tower->setup_due |= result != 0;
	return result;
}

/* ---- what others see ---- */

/* Why nothing can be armed; "" when it can, as far as we know. */
static const char *find_trouble(const struct tower *tower)
{
	const struct session_view *view;

	if (tower->session == NULL)
		return tower->link_trouble[0] != '\0' ? tower->link_trouble : "the link is being opened";
	view = session_view(tower->session);
	if (!view->seen)
		return "no tower is heard";
	if (view->hash_known && !view->hash_agrees)
		return error_text(DT_E_HASH);
	if (view->two_towers)
		return "two towers on this bus: their clocks disagree, expected one";
	if (view->state == WIRE_STATE_CAPTURED && tower->series[0] == '\0')
		return "the tower holds a drop: select the series that it belongs to";
	if (view->state == WIRE_STATE_CAPTURED && view->kept && tower->phase == TOWER_IDLE)
		return "the tower holds a drop that is not on the disk: make room, and select its series "
		       "again";
	if (tower->setup_due)
		return tower->setup_trouble[0] != '\0' ? tower->setup_trouble
		                                       : "the tower's parameters are being set";
	return "";
}

static void publish_session(struct tower *tower)
{
	struct tower_view *view = &tower->view;

	view->open = tower->session != NULL;
	if (!view->open) {
		view->session = (struct session_view){0};
		return;
	}
	view->session = *session_view(tower->session);
	if (view->session.link != NULL)
		view->link = *view->session.link;
	view->session.link = NULL;
	if (view->session.state ==
	    WIRE_STATE_READY) { /* which blocks say at once, the rest ten times a second */
		view->session.checks = 0;
		view->session.fault = WIRE_FAULT_NONE;
	}
}

void tower_publish(struct tower *tower)
{
	struct tower_view *view = &tower->view;
	const char *trouble = find_trouble(tower);

	pthread_mutex_lock(&tower->lock);
	publish_session(tower);
	view->blocked = trouble[0] != '\0';
	snprintf(view->trouble, sizeof(view->trouble), "%s", view->blocked ? trouble : tower->drop_trouble);
	snprintf(view->url, sizeof(view->url), "%s", tower->url);
	snprintf(view->series, sizeof(view->series), "%s", tower->series);
	snprintf(view->drop, sizeof(view->drop), "%s", tower->drop_name);
	view->scene = tower->scene;
	view->phase = tower->phase;
	view->armed_until_ms = tower->armed_until_ms;
	view->simulated = tower->control >= 0;
	view->simulated_count = tower->simulated_count;
	memcpy(view->simulated_name, tower->simulated_name, sizeof(view->simulated_name));
	view->simulated_faults = tower->simulated_faults;
	atomic_store(&tower->console->at_rest, view->phase == TOWER_IDLE &&
	                                               !wire_state_moving(view->session.state) &&
	                                               view->session.state != WIRE_STATE_ARMED);
	pthread_mutex_unlock(&tower->lock);
}

void tower_look(struct tower *tower, struct tower_view *view)
{
	pthread_mutex_lock(&tower->lock);
	*view = tower->view;
	pthread_mutex_unlock(&tower->lock);
}

/* ---- the thread ---- */

static void tower_do(struct tower *tower, struct job *job)
{
	if (job->message == JOB_SAVED)
		tower_drop_saved(tower, job->maker);
	else
		job->run(job);
}

static void run_jobs(struct tower *tower)
{
	struct job_queue *queue = &tower->console->tower_queue;
	struct job *job;

	for (unsigned i = 0; i < JOBS_AT_ONCE; i++) {
		tower_obey_abort(tower);
		job = job_take(queue, i == 0 ? TURN_MS : 0);
		if (job == NULL)
			return;
		tower_do(tower, job);
	}
}

static void tower_turn(struct tower *tower)
{
	if (tower->session == NULL && session_now_ms() >= tower->open_due_ms)
		tower_open_link(tower);
	run_jobs(tower);
	if (tower->session != NULL)
		tower_poll_link(tower);
	if (tower->phase == TOWER_IDLE || tower->phase == TOWER_SAVING)
		(void)tower_set_up(tower);
	tower_drop_follow(tower);
	tower_bench_hear(tower);
	tower_publish(tower);
}

static void *tower_run(void *user)
{
	struct tower *tower = user;
	struct job *job;

	tower->failed = tower->own && tower_bench_start(tower) != 0;
	sem_post(&tower->started);
	while (!tower->failed && !atomic_load(&tower->stopping))
		tower_turn(tower);
	tower_drop_leave(tower);
	while ((job = job_take(&tower->console->tower_queue, 0)) != NULL)
		tower_do(tower, job); /* each is refused, and lets go of what it carries */
	tower_link_close(tower, 0);
	tower_bench_stop(tower);
	return NULL;
}

static bool tower_begin(struct tower *tower, const struct tower_options *options)
{
	tower->own = options->link == NULL;
	tower->is_simulated = tower->own || options->control != NULL;
	tower->bench_words = options->bench_words;
	tower->control = tower->scene_fd = -1;
	tower->angle_deg = NAN;
	tower->origin = "was still in the tower from an earlier run";
	snprintf(tower->url, sizeof(tower->url), "%s", options->link != NULL ? options->link : "");
	snprintf(tower->scene_file, sizeof(tower->scene_file), "%s",
	         options->scene != NULL ? options->scene : "");
	pthread_mutex_init(&tower->lock, NULL);
	sem_init(&tower->started, 0, 0);
	if (options->control != NULL && tower_bench_control(tower, options->control) != 0)
		return false;
	tower_publish(tower);
	if (pthread_create(&tower->thread, NULL, tower_run, tower) != 0) {
		snprintf(tower->link_trouble, sizeof(tower->link_trouble), "no thread for the tower");
		return false;
	}
	while (sem_wait(&tower->started) != 0)
		continue;
	if (tower->failed)
		pthread_join(tower->thread, NULL);
	return !tower->failed;
}

static void console_tower_destroy(struct tower *tower)
{
	sem_destroy(&tower->started);
	pthread_mutex_destroy(&tower->lock);
	free(tower);
}

struct tower *tower_start(struct console *console, const struct tower_options *options,
                          char message[SESSION_MESSAGE_MAX])
{
	struct tower *tower = calloc(1, sizeof(*tower));

	if (tower == NULL) {
		snprintf(message, SESSION_MESSAGE_MAX, "%s", error_text(DT_E_MEMORY));
		return NULL;
	}
	tower->console = console;
	console->tower = tower;
	if (tower_begin(tower, options))
		return tower;
	snprintf(message, SESSION_MESSAGE_MAX, "%s", tower->link_trouble);
	console->tower = NULL;
	console_tower_destroy(tower);
	return NULL;
}

void tower_stop(struct tower *tower)
{
	if (tower == NULL)
		return;
	atomic_store(&tower->stopping, true);
	job_queue_close(&tower->console->tower_queue);
	pthread_join(tower->thread, NULL);
	console_tower_destroy(tower);
}
