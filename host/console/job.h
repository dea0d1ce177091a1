/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CONSOLE_JOB_H
#define DT_HOST_CONSOLE_JOB_H
/*
 * A request on its way to the thread that does it, and its answer on the way back. Three threads: http takes
 * connections and does nothing that waits; tower keeps the session with the tower; work does what touches the
 * archive. A connection whose job is under way is suspended, so that none waits for another's.
 *
 * run is called once, on the thread whose queue the job was put into. Either it answers (job_answer_*,
 * job_refuse) and calls job_done, or it hands the job on to another queue with another run. After job_done
 * the job is its maker's again. Queues are bounded; a full one refuses.
 */
#include <cjson/cJSON.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"

struct console;

/* What a job asks of the thread that takes it. */
enum job_message {
	JOB_RUN, /* what its run says */
	/* The tower's thread asks the archive's. These two come back as JOB_RUN, or are answered when they
	 * fail (404 without such a series), and then their payload is freed. */
	JOB_BEGIN, /* payload: a drop with its series. Makes the next recording of it */
	JOB_SCENE, /* payload: a scene with its series. Adds scene and text */
	/* These are never refused and go before all that waits; what comes with them is the receiver's. */
	JOB_KEEP,     /* a drop that was collected: syncs, records, analyses it; JOB_SAVED when done */
	JOB_DISCARD,  /* a drop of which nothing came, or nothing was collected (released) */
	JOB_SELECTED, /* the scene whose series the tower drops in from now on */
	/* The archive's thread tells the tower's. */
	JOB_SAVED, /* what became of the drop that was to be kept */
	JOB_MESSAGES,
};

struct job {
	struct job *next;
	struct console *console;
	enum job_message message;
	void (*run)(struct job *job);
	void (*done)(struct job *job); /* called by job_done, on any thread */
	void *maker;                   /* what done needs */

	/* the request */
	const cJSON *body; /* object; NULL: none */
	const void *photo; /* body that is no JSON; NULL: none */
	size_t photo_size;
	const char *path; /* what follows the route, "box-30/2" */
	const char *(*query)(const struct job *job, const char *name); /* NULL: not given */
	void *payload;                                                 /* of a job that is handed on */

	/* the answer: freed by the maker */
	int status;       /* HTTP */
	const char *type; /* "application/json" */
	void *answer;
	size_t size;
};

struct job_queue {
	pthread_mutex_t lock;
	pthread_cond_t filled;
	struct job *first, *last;
	unsigned count;
	bool closed;
};

struct live;
struct tower;
struct work;

/* The parts of a running console, as each finds the others. */
struct console {
	struct live *live;
	struct tower *tower;
	struct work *work;
	struct job_queue tower_queue, work_queue;
	atomic_bool at_rest; /* nothing falls, is about to, or is being fetched; the tower's thread knows */
};

void job_queue_init(struct job_queue *queue);
void job_queue_destroy(struct job_queue *queue);

/* 0, DT_E_FULL, or DT_E_CLOSED once it is closed. On an error the job is still the caller's. */
DT_MUST_USE int job_put(struct job_queue *queue, struct job *job);

/* Before all others, although it is full. DT_E_CLOSED as job_put. */
DT_MUST_USE int job_put_first(struct job_queue *queue, struct job *job);

/* NULL when nothing came within timeout_ms; negative waits until something comes or the queue is closed. */
struct job *job_take(struct job_queue *queue, int timeout_ms);

/* Nothing comes in any more; what is in is still taken. */
void job_queue_close(struct job_queue *queue);

void job_done(struct job *job);

/* Answers. job_answer_json takes tree over and frees it; job_answer_bytes takes bytes over (malloc). Without
 * memory the answer is 500 without a body. */
void job_answer_json(struct job *job, cJSON *tree);
void job_answer_bytes(struct job *job, const char *type, void *bytes, size_t size);

/* {"error": "..."} with that HTTP status; one line, made for the technician. */
__attribute__((format(printf, 3, 4))) void job_refuse(struct job *job, int status, const char *format, ...);

/* Of the body: the text of key, or NULL with job refused (400); fallback not NULL: it may be missing. */
const char *job_text(struct job *job, const char *key, const char *fallback);
/* The number of key in [min, max], or false with job refused. Without the key: fallback, unless that is NAN.
 */
bool job_number(struct job *job, const char *key, double min, double max, double fallback, double *value);

#endif
