/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_BATCH_BATCH_H
#define DT_HOST_BATCH_BATCH_H
/*
 * Any number of recordings to results in a folder (store.h), by several processes (crew.h) on any number of
 * machines, and their union (collect.h). What is done is not done again: a batch that was stopped or killed
 * goes on when it is started again.
 */
#include "host/batch/collect.h"
#include "host/batch/crew.h"

struct batch {
	const char *folder, *settings; /* settings: all that results depend on beside the recordings */
	unsigned shard, shards;        /* from 1; the union is made where shards is 1 */
	unsigned forms;                /* enum collect_form */
	struct crew crew;              /* analyse, context, jobs, exit codes and tell are the caller's */
	struct inputs inputs;          /* filled in, to be freed, as are these */
	struct collected collected;
	bool stopped; /* by a signal */
};

/* 0, or DT_E_* told in message. batch_end in any case. */
DT_MUST_USE int batch_work(struct batch *batch, char *const *path, size_t count,
                           char message[STORE_MESSAGE_MAX]);
void batch_end(struct batch *batch);

#endif
