/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/batch/batch.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "host/base/interrupt.h"

enum { RUN_CHARS = 100 };

/* A name that no other run of this folder has. */
static int open_notes(const struct store *store, char run[RUN_CHARS])
{
	char host[48] = "", name[RUN_CHARS + 8], path[PATH_MAX];

	gethostname(host, sizeof(host) - 1);
	snprintf(run, RUN_CHARS, "%lld-%s-%ld", (long long)time(NULL), host, (long)getpid());
	snprintf(name, sizeof(name), "known/%s", run);
	store_path(store, name, path);
	return open(path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
}

/* Nothing was noted by this run. */
static void drop_notes(const struct store *store, const char *run)
{
	char name[RUN_CHARS + 8], path[PATH_MAX];
	struct stat status;

	snprintf(name, sizeof(name), "known/%s", run);
	store_path(store, name, path);
	if (stat(path, &status) == 0 && status.st_size == 0)
		unlink(path);
}

static int batch_fail(const struct batch *batch, int code, char *message)
{
	snprintf(message, STORE_MESSAGE_MAX, "%.300s: %s", batch->folder,
	         code == DT_E_SYSTEM ? strerror(errno) : error_text(code));
	return code;
}

static int batch_run(struct batch *batch, const struct store *store, char *message)
{
	char run[RUN_CHARS];
	int result;

	result = inputs_recall(&batch->inputs, store, "");
	batch->crew.notes = open_notes(store, run);
	if (result == 0 && batch->crew.notes < 0)
		result = DT_E_SYSTEM;
	if (result == 0)
		result = crew_work(&batch->crew);
	if (batch->crew.notes >= 0)
		close(batch->crew.notes);
	batch->stopped = interrupt_came();
	if (result == 0 && batch->shards == 1 && !batch->stopped)
		result = inputs_recall(&batch->inputs, store, run);
	drop_notes(store, run);
	if (result != 0)
		return batch_fail(batch, result, message);
	if (batch->shards > 1 || batch->stopped)
		return 0;
	return collect(store, &batch->inputs, batch->forms, &batch->collected, message);
}

int batch_work(struct batch *batch, char *const *path, size_t count, char message[STORE_MESSAGE_MAX])
{
	struct store store;
	int result = store_open(&store, batch->folder, batch->settings, message);

	if (result != 0)
		return result;
	if (inputs_take(&batch->inputs, path, count, batch->shard, batch->shards) != 0)
		return batch_fail(batch, DT_E_MEMORY, message);
	batch->crew.store = &store;
	batch->crew.inputs = &batch->inputs;
	return batch_run(batch, &store, message);
}

void batch_end(struct batch *batch)
{
	inputs_free(&batch->inputs);
}
