/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CONSOLE_WORK_H
#define DT_HOST_CONSOLE_WORK_H
/*
 * Everything that touches the archive: one thread, one open archive. Jobs of the page (work_*.c has their
 * functions), and of the tower: begin a recording, keep a collected drop, throw one away.
 */
#include "host/archive/archive.h"
#include "host/console/job.h"

struct work;

struct work_options {
	const char *archive; /* folder, made when there is none */
	const char *operator_name;
	const char *const *scenes; /* files that a series can be made of, NULL-terminated */
};

/* What the page's state shows of it. */
struct work_view {
	uint64_t revision;                  /* grows with every change of the archive, whoever made it */
	char result[ARCHIVE_NAME_MAX + 16]; /* the drop recorded last, once it is analysed; "" */
	double disk_free_bytes;
	char trouble[ARCHIVE_MESSAGE_MAX]; /* the last thing that went wrong; "" */
	struct archive_series series;      /* selected, with its counts, a moment behind; name NULL: none */
	char text[5][ARCHIVE_TEXT_MAX];    /* what series points into; its scene is "" */
};

/* NULL and one line in message. */
struct work *work_start(struct console *console, const struct work_options *options,
                        char message[ARCHIVE_MESSAGE_MAX]);
void work_stop(struct work *work); /* after what is queued is done */
void work_look(struct work *work, struct work_view *view);

/* ---- the page's, as run of a job; the routes stand in README.md ---- */

void work_setup(struct job *job);
void work_series(struct job *job);
void work_drops(struct job *job);
void work_tables(struct job *job);
void work_result(struct job *job);
void work_trace(struct job *job);
void work_model(struct job *job);
void work_spectrum(struct job *job);
void work_csv(struct job *job);
void work_report(struct job *job);
void work_new_series(struct job *job);
void work_decide(struct job *job);
void work_note(struct job *job);
void work_photo(struct job *job);
void work_photos(struct job *job);
void work_photo_bytes(struct job *job);
void work_photos_discard(struct job *job);

#endif
