/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_COMMAND_RUN_PRIVATE_H
#define DT_HOST_COMMAND_RUN_PRIVATE_H
/*
 * What the files of `droptower run` share: run.c has the options and the order of things, run_follow.c the
 * drop on its way from the first check to the last sample, run_keep.c what stays of it: files, archive,
 * report. Every function that returns an int returns a COMMAND_* exit code and has printed what was wrong.
 */
#include <limits.h>
#include <stdbool.h>
#include <stdint.h>

#include "common/base/option.h"
#include "common/scenes/scene.h"
#include "host/command/archived.h"
#include "host/session/session.h"
#include "host/record/record.h"

enum { RUN_BENCH_WORDS_MAX = 24 };

struct run {
	const char *link, *scene_file, *out, *chain, *limits, *channel;
	const char *archive_folder, *series, *operator_name;
	double angle_deg;
	const char *key; /* for commands over LCM */
	bool json, strict, unattended;
	struct option_words bench;
	/* while it runs */
	struct scene scene;
	struct session *session;
	int64_t start_ms;
	bool aborted;    /* by the operator, after the release */
	bool earlier;    /* the drop is one that the tower still held */
	bool log_failed; /* the disk took no more of it */
	bool kept;       /* the drop is still in the tower */
	bool released;   /* what comes now is, or may be, a drop, whatever becomes of it */
	char scene_path[PATH_MAX];
	char stem[4096]; /* OUT/drop-NNNN */
	char log[ARCHIVE_PATH_MAX];
	struct archive *archive; /* NULL: files in OUT */
	char series_scene[ARCHIVED_SCENE_MAX];
	struct archive_recording recording;
};

/* One line to stderr, with the time since the start. */
void run_progress(const struct run *run, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* Reads the scene, and makes an empty log: the next of --out, or the next of the series. */
int run_keep_begin(struct run *run);

/* COMMAND_INPUT when there is no room for a drop on the disk. */
int run_keep_room(const struct run *run);

/* Drops on the tower at url, every frame into the log. The log is on disk when it returns. */
int run_follow(struct run *run, const char *url, struct record *record);

/* Analyses and reports what was recorded. */
int run_keep_report(struct run *run, struct record *record);

/* Takes the log away again when nothing was released or fetched; to be called after any run_keep_begin. */
void run_keep_end(struct run *run);

#endif
