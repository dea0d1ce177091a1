/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Why not: what stands against a verb, and in which words the operator is told.
 */
#include <stdio.h>

#include "common/wire_table.h"
#include "host/session/tower_setup.h"
#include "host/console/tower_private.h"

static void refuse_checks(struct job *job, uint32_t checks)
{
	char text[1600] = "";
	size_t length = 0;

	for (unsigned i = 0; i < WIRE_CHECKS && length < sizeof(text); i++)
		if ((checks >> i & 1u) != 0)
			length += (size_t)snprintf(text + length, sizeof(text) - length, "%s%s",
			                           length > 0 ? "; " : "", wire_check_text(i));
	job_refuse(job, 409, "not all checks are green: %s", text);
}

static void refuse_state(struct job *job, const struct session_view *view)
{
	if (view->state == WIRE_STATE_FAULT_HELD)
		job_refuse(job, 409, "the tower holds a fault: %s", wire_fault_text(view->fault));
	else if (view->state == WIRE_STATE_SAFE && view->checks != 0)
		refuse_checks(job, view->checks);
	else
		job_refuse(job, 409, "the tower is %s: %s", wire_state_name(view->state),
		           wire_state_text(view->state));
}

bool tower_is_void(struct tower *tower, unsigned aborted)
{
	return atomic_load(&tower->aborts) != aborted;
}

bool tower_refuse_void(struct job *job, unsigned aborted)
{
	struct tower *tower = job->console->tower;

	if (atomic_load(&tower->stopping))
		job_refuse(job, 503, "the console is ending");
	else if (tower_is_void(tower, aborted))
		job_refuse(job, 409, "aborted");
	else
		return false;
	return true;
}

/* Another has written them since; they are set again, and ARM is asked for again by a person. */
static void refuse_parameters(struct job *job)
{
	struct tower *tower = job->console->tower;
	char difference[SESSION_MESSAGE_MAX] = "it no longer tells which";

	(void)tower_setup_difference(tower->session, difference);
	job_refuse(job, 409, "%s: %s; they are set again", error_text(DT_E_PARAMETERS), difference);
	tower->setup_due = true;
}

void tower_refuse_result(struct job *job, int result)
{
	struct tower *tower = job->console->tower;

	if (tower_is_void(tower, tower->wanted))
		job_refuse(job, 409, "aborted");
	else if (result == DT_E_TIMEOUT)
		job_refuse(job, 504, "the tower does not answer");
	else if (result == DT_E_CLOSED || result == DT_E_LINK || result == DT_E_SYSTEM)
		job_refuse(job, 503, "%s", error_text(result));
	else if (result == DT_E_PARAMETERS)
		refuse_parameters(job);
	else if (result == DT_E_EARLY)
		job_refuse(job, 425, "%s", error_text(result));
	else if (result == DT_E_STATE || result == DT_E_CHECKS)
		refuse_state(job, session_view(tower->session));
	else
		job_refuse(job, 409, "the tower refuses: %s", error_text(result));
}

/* With the view locked: refuses and returns false when there is no tower. */
static bool check_heard(struct job *job, const struct tower_view *view)
{
	if (view->open && view->session.seen)
		return true;
	job_refuse(job, 503, "%s", view->trouble[0] != '\0' ? view->trouble : "no tower is heard");
	return false;
}

static bool check_idle(struct job *job, const struct tower_view *view)
{
	if (view->phase == TOWER_IDLE)
		return true;
	job_refuse(job, 409, "a drop is under way: %s", tower_phase_name(view->phase));
	return false;
}

bool tower_check_arm(struct job *job)
{
	struct tower *tower = job->console->tower;
	const struct tower_view *view = &tower->view;
	bool may = false;

	pthread_mutex_lock(&tower->lock);
	if (!check_heard(job, view) || !check_idle(job, view))
		may = false;
	else if (view->blocked)
		job_refuse(job, 409, "%s", view->trouble);
	else if (view->series[0] == '\0')
		job_refuse(job, 409, "no series is selected");
	else if (view->session.state != WIRE_STATE_READY)
		refuse_state(job, &view->session);
	else
		may = true;
	pthread_mutex_unlock(&tower->lock);
	return may;
}

bool tower_check_select(struct job *job)
{
	struct tower *tower = job->console->tower;
	const struct session_view *session = &tower->view.session;
	bool may;

	pthread_mutex_lock(&tower->lock);
	may = check_idle(job, &tower->view);
	if (may && session->seen &&
	    (wire_state_moving(session->state) || session->state == WIRE_STATE_ARMED)) {
		refuse_state(job, session);
		may = false;
	}
	pthread_mutex_unlock(&tower->lock);
	return may;
}
