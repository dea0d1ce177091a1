/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CONSOLE_WORK_PRIVATE_H
#define DT_HOST_CONSOLE_WORK_PRIVATE_H
/*
 * What the files of work share. All of it is for the work thread, but for the view under its lock.
 */
#include <pthread.h>
#include <stdatomic.h>
#include <sys/types.h>

#include "common/link/temporary.h"
#include "host/console/job.h"
#include "host/console/handover.h"
#include "host/console/work.h"

struct work_scene_file {
	const char *file;
	struct scene scene;
};

/* A report that another process makes. */
struct work_report {
	struct job *job; /* NULL: none */
	pid_t pid;
	struct temporary folder;
	char file[TEMPORARY_PATH_MAX + 16];
	int errors; /* what it says on stderr */
};

struct work {
	struct console *console;
	struct work_options options;
	struct archive *archive;
	struct work_scene_file *scene;
	size_t scenes;
	struct work_report report;
	pthread_t thread;
	atomic_bool ending;
	char selected[ARCHIVE_NAME_MAX + 1]; /* series; "" */
	bool changed;                        /* the view's series is to be read again */
	int64_t looked_ms, changes;

	pthread_mutex_t lock;
	struct work_view view;
};

/* HTTP for a DT_E_*. */
int work_status(int result);

/* Answers with what the archive said, and is done with the job. */
void work_refuse(struct job *job, int result);

/* The archive is not what it was. */
void work_changed(struct work *work);

/* For the view; "" takes it back. */
void work_trouble(struct work *work, const char *text);

/* Reads the scenes' files. 0 or DT_E_* with one line in message. */
DT_MUST_USE int work_open_scenes(struct work *work, char message[ARCHIVE_MESSAGE_MAX]);

/* The tower's messages. */
void work_keep_begin(struct job *job);
void work_keep_drop(struct job *way);
void work_keep_discard(struct job *way);
void work_setup_scene(struct job *job);

/* Notes interrupted drops as recorded whose logs are whole. */
void work_keep_recover(struct work *work);

/* Answers a report once its process has ended; now: ends it. */
void work_report_look(struct work *work, bool now);

#endif
