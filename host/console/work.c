/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/base/room.h"
#include "host/console/work.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/console/work_private.h"
#include "host/session/session.h"

enum { LOOK_MS = 100, LOOK_AROUND_MS = 1000 };

int work_status(int result)
{
	switch (result) {
	case DT_E_UNKNOWN:
	case DT_E_EMPTY:
		return 404;
	case DT_E_STATE:
		return 409;
	case DT_E_ARGUMENT:
	case DT_E_RANGE:
	case DT_E_FORMAT:
		return 400;
	case DT_E_SYSTEM:
	case DT_E_FULL:
		return 507;
	default:
		return 500;
	}
}

void work_refuse(struct job *job, int result)
{
	const char *message = archive_message(job->console->work->archive);

	job_refuse(job, work_status(result), "%s",
	           message[0] != '\0' && result != DT_E_MEMORY ? message : error_text(result));
	job_done(job);
}

void work_changed(struct work *work)
{
	work->changed = true;
	pthread_mutex_lock(&work->lock);
	work->view.revision++;
	pthread_mutex_unlock(&work->lock);
}

void work_trouble(struct work *work, const char *text)
{
	pthread_mutex_lock(&work->lock);
	snprintf(work->view.trouble, sizeof(work->view.trouble), "%s", text);
	pthread_mutex_unlock(&work->lock);
}

/* ---- the view ---- */

/* Copies a series with its texts; those of to point into text. */
static void copy_series(struct archive_series *to, char text[5][ARCHIVE_TEXT_MAX],
                        const struct archive_series *series)
{
	const char *from[5] = {series->name, series->campaign, series->scene_name, series->created,
	                       series->last};

	*to = *series;
	for (int i = 0; i < 5; i++)
		snprintf(text[i], ARCHIVE_TEXT_MAX, "%s", from[i]);
	to->name = text[0];
	to->campaign = text[1];
	to->scene_name = text[2];
	to->created = text[3];
	to->last = text[4];
	to->scene = "";
}

static int show_series(void *context, const struct archive_series *series)
{
	struct work *work = context;

	pthread_mutex_lock(&work->lock);
	copy_series(&work->view.series, work->view.text, series);
	pthread_mutex_unlock(&work->lock);
	return 0;
}

static void look_at_series(struct work *work)
{
	struct archive_filter filter = archive_filter_none();
	const char *shown = work->view.series.name;

	if (work->selected[0] == '\0' ||
	    (!work->changed && shown != NULL && strcmp(shown, work->selected) == 0))
		return;
	filter.series = work->selected;
	work->changed = false;
	if (archive_each_series(work->archive, &filter, show_series, work) != 0)
		work_trouble(work, archive_message(work->archive));
}

static void look_at_disk(struct work *work)
{
	double bytes = room_bytes(work->options.archive);

	if (isnan(bytes))
		return;
	pthread_mutex_lock(&work->lock);
	work->view.disk_free_bytes = bytes;
	pthread_mutex_unlock(&work->lock);
}

/* Another program may write here, too. */
static void look_at_archive(struct work *work)
{
	int64_t changes;

	if (archive_changes(work->archive, &changes) != 0 || changes == work->changes)
		return;
	work->changes = changes;
	work_changed(work);
}

static void look_around(struct work *work)
{
	int64_t now_ms = session_now_ms();

	look_at_series(work);
	if (now_ms - work->looked_ms < LOOK_AROUND_MS)
		return;
	work->looked_ms = now_ms;
	look_at_disk(work);
	look_at_archive(work);
}

void work_look(struct work *work, struct work_view *view)
{
	pthread_mutex_lock(&work->lock);
	*view = work->view;
	if (view->series.name != NULL)
		copy_series(&view->series, view->text, &work->view.series);
	pthread_mutex_unlock(&work->lock);
}

/* ---- the thread ---- */

static void work_select(struct job *way)
{
	struct handover_scene *scene = way->maker;
	struct work *work = way->console->work;

	snprintf(work->selected, sizeof(work->selected), "%s", scene->series);
	free(scene);
}

static void work_do(struct job *job)
{
	static void (*const act[JOB_MESSAGES])(struct job * job) = {[JOB_BEGIN] = work_keep_begin,
	                                                            [JOB_SCENE] = work_setup_scene,
	                                                            [JOB_KEEP] = work_keep_drop,
	                                                            [JOB_DISCARD] = work_keep_discard,
	                                                            [JOB_SELECTED] = work_select};

	(act[job->message] != NULL ? act[job->message] : job->run)(job);
}

static void *work_run(void *context)
{
	struct work *work = context;
	bool ended = false;

	work_keep_recover(work);
	while (!ended) {
		struct job *job = job_take(&work->console->work_queue, LOOK_MS);

		if (job != NULL)
			work_do(job);
		else
			ended = atomic_load(&work->ending);
		work_report_look(work, false);
		look_around(work);
	}
	work_report_look(work, true);
	return NULL;
}

static void work_destroy(struct work *work)
{
	archive_close(work->archive);
	pthread_mutex_destroy(&work->lock);
	free(work->scene);
	free(work);
}

static int work_open_all(struct work *work, char message[ARCHIVE_MESSAGE_MAX])
{
	int result = work_open_scenes(work, message);

	if (result != 0)
		return result;
	work->archive = archive_open(work->options.archive, ARCHIVE_CREATE, message);
	return work->archive != NULL ? 0 : DT_E_SYSTEM;
}

struct work *work_start(struct console *console, const struct work_options *options,
                        char message[ARCHIVE_MESSAGE_MAX])
{
	struct work *work = calloc(1, sizeof(*work));

	if (work == NULL) {
		snprintf(message, ARCHIVE_MESSAGE_MAX, "%s", error_text(DT_E_MEMORY));
		return NULL;
	}
	work->console = console;
	work->options = *options;
	pthread_mutex_init(&work->lock, NULL);
	if (work_open_all(work, message) == 0) {
		look_around(work);
		if (pthread_create(&work->thread, NULL, work_run, work) == 0)
			return work;
		snprintf(message, ARCHIVE_MESSAGE_MAX, "no thread for the archive");
	}
	work_destroy(work);
	return NULL;
}

void work_stop(struct work *work)
{
	if (work == NULL)
		return;
	atomic_store(&work->ending, true);
	job_queue_close(&work->console->work_queue);
	pthread_join(work->thread, NULL);
	work_destroy(work);
}
