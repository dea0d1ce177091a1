/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_BATCH_CREW_H
#define DT_HOST_BATCH_CREW_H
/*
 * Processes that analyse files side by side, each the next one that nobody has taken. What an analysis prints
 * becomes a part (store.h); it has a process of its own because a file that ends it must not end the batch.
 * One that was killed is replaced and its file tried once more; a file that ends two is refused.
 */
#include <stdbool.h>

#include "host/batch/input.h"

/* Analyses a file: results to standard output, a line each, complaints to standard error. Its exit code. */
typedef int crew_analyse(const char *file, void *context);

struct crew_progress {
	unsigned long files, found,
	        refused;               /* done; of them, those that were done before, or have no result */
	unsigned long results, failed; /* failed: files with an exit code and a result */
	int64_t bytes, new_bytes;      /* of what is done; of what was analysed now */
	int code;                      /* exit code of the batch so far */
};

struct crew {
	const struct store *store;
	const struct inputs *inputs;
	crew_analyse *analyse;
	void *context;
	unsigned jobs;
	int notes;                   /* where input_note writes */
	int failed_code, limit_code; /* exit codes of files: no result or not all; a limit not met */
	void (*tell)(const struct crew_progress *progress, void *context); /* a few times a second, or NULL */
	struct crew_progress progress;                                     /* filled in */
};

/* 0, DT_E_SYSTEM with errno where no process can be started, or DT_E_STOPPED after a signal
 * (interrupt.h); whatever is done is kept. */
DT_MUST_USE int crew_work(struct crew *crew);

#endif
