/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CONSOLE_HANDOVER_H
#define DT_HOST_CONSOLE_HANDOVER_H
/*
 * What the tower's thread and the archive's hand to each other, through their queues (job.h: enum
 * job_message). Neither knows anything else of the other.
 */
#include <stdbool.h>

#include "common/scenes/scene.h"
#include "host/archive/archive.h"
#include "host/console/job.h"

/* A drop, from arm to archive: malloc, with the recording's lock -1 until the archive has made one. */
struct handover_drop {
	struct archive_recording
	        recording;    /* lock < 0: none was begun, the log is to be written from the record */
	struct record record; /* initialised; the receiver frees it */
	char series[ARCHIVE_NAME_MAX + 1];
	char note[ARCHIVE_TEXT_MAX];
	bool released;                     /* something may have fallen: discarded it stays, partial */
	bool simulated;                    /* nothing has */
	unsigned aborted;                  /* the tower's own */
	char trouble[ARCHIVE_MESSAGE_MAX]; /* with JOB_SAVED: why the archive did not take it; "" */
	bool on_disk;                      /* with JOB_SAVED: it is, there or elsewhere */
	struct job way;                    /* of JOB_KEEP, JOB_DISCARD, JOB_SAVED; its maker is the drop */
};

/* A series, as the archive hands it over: malloc, text too. */
struct handover_scene {
	char series[ARCHIVE_NAME_MAX + 1];
	struct scene scene; /* at the angle and height of the series */
	char *text;         /* its file, for a simulated tower, which gets the angle beside it */
	unsigned aborted;   /* the tower's own */
	struct job way;     /* of JOB_SELECTED; its maker is the scene */
};

#endif
