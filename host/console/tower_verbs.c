/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What the operator asks for. Each verb is begun on any thread (tower_arm ...) and sent on the tower's
 * (send_arm ...). An ABORT that was asked for after it makes it void wherever it is on its way.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/wire_table.h"
#include "host/console/tower_private.h"

enum { LINE_MAX_CHARACTERS = 150 };

static void tower_verbs_finish(struct job *job)
{
	tower_publish(job->console->tower);
	job_done(job);
}

static void answer_empty(struct job *job)
{
	job_answer_json(job, cJSON_CreateObject());
}

/* Puts the job into queue with run, or answers it. */
static bool hand_on(struct job *job, struct job_queue *queue, void (*run)(struct job *job))
{
	int result;

	job->run = run;
	result = job_put(queue, job);
	if (result == 0)
		return true;
	job_refuse(job, 503, "%s",
	           result == DT_E_CLOSED ? "the console is ending" : "too much is asked for at once");
	job_done(job);
	return false;
}

/* ---- arm ---- */

/* The token is the nonce of this ARM. */
static void answer_token(struct job *job, const struct session_view *view)
{
	cJSON *tree = cJSON_CreateObject();
	int64_t now_ms = session_now_ms();

	if (tree != NULL) {
		cJSON_AddNumberToObject(tree, "token", view->nonce);
		cJSON_AddNumberToObject(tree, "warning_s", (double)(view->release_from_ms - now_ms) / 1000.0);
		cJSON_AddNumberToObject(tree, "expires_s", (double)(view->armed_until_ms - now_ms) / 1000.0);
	}
	job_answer_json(job, tree);
}

static void tower_verbs_arm(struct job *job, struct handover_drop *drop)
{
	struct tower *tower = job->console->tower;
	const struct session_view *view = session_view(tower->session);
	int result;

	if (!tower_drop_begin(tower, drop)) {
		job_refuse(job, 500, "%s", tower->drop_trouble);
		return;
	}
	tower_publish(tower);
	result = session_command(tower->session, WIRE_OP_ARM);
	if (result == 0)
		tower_drop_armed(tower);
	else
		tower_drop_end(tower);
	if (result == DT_E_TIMEOUT && !tower_is_void(tower, tower->wanted))
		atomic_fetch_add(&tower->aborts, 1); /* it may be armed all the same */
	if (result == 0 && !tower_is_void(tower, tower->wanted))
		answer_token(job, view);
	else
		tower_refuse_result(job, result);
}

static void send_arm(struct job *job)
{
	struct tower *tower = job->console->tower;
	struct handover_drop *drop = job->payload;
	bool may = false;

	tower->wanted = drop->aborted;
	if (tower_refuse_void(job, drop->aborted))
		may = false;
	else if (strcmp(drop->series, tower->series) != 0)
		job_refuse(job, 409, "another series was selected");
	else
		may = tower_check_arm(job);
	if (may)
		tower_verbs_arm(job, drop);
	else
		tower_drop_discard(tower, drop);
	tower_verbs_finish(job);
}

void tower_arm(struct job *job)
{
	struct tower *tower = job->console->tower;
	unsigned aborted = atomic_load(&tower->aborts);
	struct handover_drop *drop;

	if (!tower_check_arm(job)) {
		job_done(job);
		return;
	}
	pthread_mutex_lock(&tower->lock);
	drop = tower_drop_new(tower, tower->view.series);
	pthread_mutex_unlock(&tower->lock);
	if (drop == NULL) {
		job_refuse(job, 500, "%s", error_text(DT_E_MEMORY));
		job_done(job);
		return;
	}
	drop->aborted = aborted;
	job->payload = drop;
	job->message = JOB_BEGIN;
	if (!hand_on(job, &job->console->work_queue, send_arm))
		free(drop);
}

/* ---- release, clear ---- */

/* Of a verb without payload of its own: how many aborts were asked for before it. */
static void tower_verbs_mark(struct job *job)
{
	job->payload = (void *)(uintptr_t)atomic_load(&job->console->tower->aborts);
}

/* False with job refused when it is void, or there is no tower to send it to. */
static bool check_sending(struct job *job)
{
	struct tower *tower = job->console->tower;

	tower->wanted = (unsigned)(uintptr_t)job->payload;
	if (tower_refuse_void(job, tower->wanted))
		return false;
	if (tower->session != NULL)
		return true;
	job_refuse(job, 503, "no tower is heard");
	return false;
}

static void tower_verbs_release(struct job *job)
{
	struct tower *tower = job->console->tower;
	int result = session_command(tower->session, WIRE_OP_RELEASE);

	/* unanswered it may have worked */
	if (result == 0 || result == DT_E_TIMEOUT || result == DT_E_CLOSED || result == DT_E_LINK ||
	    result == DT_E_SYSTEM)
		tower_drop_released(tower);
	if (result == 0)
		answer_empty(job);
	else
		tower_refuse_result(job, result);
}

static void send_release(struct job *job)
{
	struct tower *tower = job->console->tower;
	double token;

	if (check_sending(job) && job_number(job, "token", 0, UINT32_MAX, NAN, &token)) {
		const struct session_view *view = session_view(tower->session);

		if (tower->phase != TOWER_ARMED)
			job_refuse(job, 409, "nothing is armed");
		else if (!view->armed && view->state != WIRE_STATE_ARMED)
			tower_refuse_result(job, DT_E_STATE); /* it says why it let go of it */
		else if (!view->armed || (uint32_t)token != view->nonce)
			job_refuse(job, 409, "%s", error_text(DT_E_TOKEN));
		else if (session_now_ms() < view->release_from_ms)
			job_refuse(job, 425, "%s", error_text(DT_E_EARLY));
		else
			tower_verbs_release(job);
	}
	tower_verbs_finish(job);
}

void tower_release(struct job *job)
{
	tower_verbs_mark(job);
	(void)hand_on(job, &job->console->tower_queue, send_release);
}

static void send_clear(struct job *job)
{
	struct tower *tower = job->console->tower;

	if (check_sending(job)) {
		int result = session_command(tower->session, WIRE_OP_CLEAR);

		if (result == 0)
			answer_empty(job);
		else
			tower_refuse_result(job, result);
	}
	tower_verbs_finish(job);
}

void tower_clear(struct job *job)
{
	tower_verbs_mark(job);
	(void)hand_on(job, &job->console->tower_queue, send_clear);
}

/* ---- abort ---- */

void tower_obey_abort(struct tower *tower)
{
	unsigned asked = atomic_load(&tower->aborts);

	if (asked == tower->aborted)
		return;
	tower->aborted = asked;
	tower->abort_result = DT_E_CLOSED;
	if (tower->session == NULL)
		return;
	if (tower->phase == TOWER_MOVING)
		tower->abort_moving = true;
	tower->abort_result = session_command(tower->session, WIRE_OP_ABORT);
}

static void answer_abort(struct job *job)
{
	struct tower *tower = job->console->tower;

	tower_obey_abort(tower);
	if (tower->abort_result == 0)
		answer_empty(job);
	else if (tower->abort_result == DT_E_TIMEOUT)
		job_refuse(job, 504, "ABORT was sent, the tower does not answer");
	else
		job_refuse(job, 503, "no tower is heard: %s", error_text(tower->abort_result));
	tower_verbs_finish(job);
}

void tower_abort(struct job *job)
{
	atomic_fetch_add(&job->console->tower->aborts, 1);
	job->run = answer_abort;
	if (job_put_first(&job->console->tower_queue, job) == 0)
		return;
	job_refuse(job, 503, "the console is ending");
	job_done(job);
}

void tower_disarm(struct tower *tower)
{
	struct tower_view view;

	tower_look(tower, &view);
	if (view.phase == TOWER_ARMING || view.phase == TOWER_ARMED)
		atomic_fetch_add(&tower->aborts, 1);
}

/* ---- select ---- */

/* A simulated tower of our own becomes one of that scene. */
static bool change_bench(struct tower *tower, const struct handover_scene *scene)
{
	if (!tower->own)
		return true;
	if (tower_bench_scene(tower, scene) != 0)
		return false;
	tower_link_close(tower, 0);
	tower_bench_stop(tower);
	live_restart(tower->console->live);
	return true;
}

/* Whether it is selected now; a job that was refused may have selected it. */
static bool tower_verbs_select_series(struct job *job, const struct handover_scene *scene)
{
	struct tower *tower = job->console->tower;

	if (!change_bench(tower, scene)) {
		job_refuse(job, 500, "the scene: %s", error_text(DT_E_SYSTEM));
		return false;
	}
	snprintf(tower->series, sizeof(tower->series), "%s", scene->series);
	tower->scene = scene->scene;
	if (tower->session != NULL && session_view(tower->session)->kept)
		tower_link_close(tower, 0); /* what could not be kept is collected again */
	if (tower->session != NULL)
		session_hold(tower->session, false);
	tower->drop_trouble[0] = '\0';
	tower->setup_trouble[0] = '\0';
	tower->setup_due = true;
	tower->setup_due_ms = 0;
	if (tower_set_up(tower) == 0)
		answer_empty(job);
	else
		job_refuse(job, 409, "%s is selected, but %s", tower->series, tower->setup_trouble);
	return true;
}

static void send_select(struct job *job)
{
	struct handover_scene *scene = job->payload;
	bool selected = false;

	if (!tower_refuse_void(job, scene->aborted) && tower_check_select(job))
		selected = tower_verbs_select_series(job, scene);
	free(scene->text);
	scene->way = (struct job){.console = job->console, .message = JOB_SELECTED, .maker = scene};
	if (!selected || job_put_first(&job->console->work_queue, &scene->way) != 0)
		free(scene);
	tower_verbs_finish(job);
}

void tower_select(struct job *job)
{
	const char *series = job_text(job, "series", NULL);
	struct handover_scene *scene = NULL;

	if (series == NULL || !tower_check_select(job)) {
		job_done(job);
		return;
	}
	if (strlen(series) < sizeof(scene->series))
		scene = calloc(1, sizeof(*scene));
	if (scene == NULL) {
		job_refuse(job, 404, "no series of that name");
		job_done(job);
		return;
	}
	snprintf(scene->series, sizeof(scene->series), "%s", series);
	scene->aborted = atomic_load(&job->console->tower->aborts);
	job->payload = scene;
	job->message = JOB_SCENE;
	if (!hand_on(job, &job->console->work_queue, send_select))
		free(scene);
}

/* ---- simulate ---- */

static void tower_verbs_send_line(struct job *job)
{
	struct tower *tower = job->console->tower;

	if (tower_refuse_void(job, atomic_load(&tower->aborts)))
		job_done(job);
	else
		tower_bench_say(tower, job, job_text(job, "line", NULL));
}

/* What breaks the tower; not what commands it, which only who holds the arm may. */
static bool tower_verbs_is_line(const char *text)
{
	static const char command[] = "send";
	size_t length = strlen(text);

	text += strspn(text, " ,"); /* what parts words there */
	if (strncmp(text, command, sizeof(command) - 1) == 0)
		return false;
	for (size_t i = 0; text[i] != '\0'; i++)
		if (text[i] < ' ' || text[i] > '~')
			return false;
	return length > 0 && length <= LINE_MAX_CHARACTERS;
}

static bool has_control(struct tower *tower)
{
	bool simulated;

	pthread_mutex_lock(&tower->lock);
	simulated = tower->view.simulated;
	pthread_mutex_unlock(&tower->lock);
	return simulated;
}

void tower_simulate(struct job *job)
{
	const char *line = NULL;

	if (!has_control(job->console->tower))
		job_refuse(job, 404, "this tower is not simulated");
	else
		line = job_text(job, "line", NULL);
	if (line != NULL && tower_verbs_is_line(line)) {
		(void)hand_on(job, &job->console->tower_queue, tower_verbs_send_line);
		return;
	}
	if (line != NULL)
		job_refuse(job, 400, "\"line\": expected a fault in 1 to %d printable characters, no command",
		           LINE_MAX_CHARACTERS);
	job_done(job);
}
