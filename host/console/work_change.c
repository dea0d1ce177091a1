/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What the operator decides and notes of a drop.
 */
#include <string.h>

#include "host/console/work_private.h"

static void work_change_finish(struct job *job, int result)
{
	if (result != 0) {
		work_refuse(job, result);
		return;
	}
	work_changed(job->console->work);
	job_answer_json(job, cJSON_CreateObject());
	job_done(job);
}

static bool parse_decision(const char *text, enum archive_decision *decision)
{
	static const char *const names[] = {
	        [ARCHIVE_OPEN] = "open", [ARCHIVE_ACCEPTED] = "accepted", [ARCHIVE_REJECTED] = "rejected"};

	for (int i = ARCHIVE_OPEN; i <= ARCHIVE_REJECTED; i++) {
		if (strcmp(text, names[i]) != 0)
			continue;
		*decision = (enum archive_decision)i;
		return true;
	}
	return false;
}

void work_decide(struct job *job)
{
	struct work *work = job->console->work;
	const char *drop = job_text(job, "drop", NULL),
	           *word = drop != NULL ? job_text(job, "decision", NULL) : NULL,
	           *reason = word != NULL ? job_text(job, "reason", "") : NULL;
	enum archive_decision decision;

	if (reason == NULL) {
		job_done(job);
		return;
	}
	if (!parse_decision(word, &decision)) {
		job_refuse(job, 400, "\"decision\": expected accepted, rejected or open");
		job_done(job);
		return;
	}
	work_change_finish(
	        job, archive_decide(work->archive, drop, decision, work->options.operator_name, reason));
}

void work_note(struct job *job)
{
	struct work *work = job->console->work;
	const char *drop = job_text(job, "drop", NULL),
	           *text = drop != NULL ? job_text(job, "text", NULL) : NULL;

	if (text == NULL) {
		job_done(job);
		return;
	}
	work_change_finish(job, archive_note(work->archive, drop, work->options.operator_name, text));
}
