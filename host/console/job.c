/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/console/job.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { QUEUE_MAX = 128 };

void job_queue_init(struct job_queue *queue)
{
	pthread_condattr_t attributes;

	memset(queue, 0, sizeof(*queue));
	pthread_mutex_init(&queue->lock, NULL);
	pthread_condattr_init(&attributes);
	pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
	pthread_cond_init(&queue->filled, &attributes);
	pthread_condattr_destroy(&attributes);
}

void job_queue_destroy(struct job_queue *queue)
{
	pthread_cond_destroy(&queue->filled);
	pthread_mutex_destroy(&queue->lock);
}

int job_put(struct job_queue *queue, struct job *job)
{
	int result = 0;

	pthread_mutex_lock(&queue->lock);
	if (queue->closed) {
		result = DT_E_CLOSED;
	} else if (queue->count >= QUEUE_MAX) {
		result = DT_E_FULL;
	} else {
		job->next = NULL;
		*(queue->first != NULL ? &queue->last->next : &queue->first) = job;
		queue->last = job;
		queue->count++;
		pthread_cond_signal(&queue->filled);
	}
	pthread_mutex_unlock(&queue->lock);
	return result;
}

int job_put_first(struct job_queue *queue, struct job *job)
{
	int result = 0;

	pthread_mutex_lock(&queue->lock);
	if (queue->closed) {
		result = DT_E_CLOSED;
	} else {
		job->next = queue->first;
		queue->first = job;
		if (job->next == NULL)
			queue->last = job;
		queue->count++;
		pthread_cond_signal(&queue->filled);
	}
	pthread_mutex_unlock(&queue->lock);
	return result;
}

static struct timespec in_ms(int ms)
{
	struct timespec then;

	clock_gettime(CLOCK_MONOTONIC, &then);
	then.tv_sec += ms / 1000;
	then.tv_nsec += ms % 1000 * 1000000L;
	if (then.tv_nsec >= 1000000000L) {
		then.tv_nsec -= 1000000000L;
		then.tv_sec++;
	}
	return then;
}

struct job *job_take(struct job_queue *queue, int timeout_ms)
{
	struct timespec then = in_ms(timeout_ms < 0 ? 0 : timeout_ms);
	struct job *job;

	pthread_mutex_lock(&queue->lock);
	while (queue->first == NULL && !queue->closed && timeout_ms != 0)
		if (timeout_ms < 0)
			pthread_cond_wait(&queue->filled, &queue->lock);
		else if (pthread_cond_timedwait(&queue->filled, &queue->lock, &then) != 0)
			break;
	job = queue->first;
	if (job != NULL) {
		queue->first = job->next;
		queue->count--;
	}
	pthread_mutex_unlock(&queue->lock);
	return job;
}

void job_queue_close(struct job_queue *queue)
{
	pthread_mutex_lock(&queue->lock);
	queue->closed = true;
	pthread_cond_broadcast(&queue->filled);
	pthread_mutex_unlock(&queue->lock);
}

void job_done(struct job *job)
{
	job->done(job);
}

void job_answer_bytes(struct job *job, const char *type, void *bytes, size_t size)
{
	job->status = bytes != NULL ? 200 : 500;
	job->type = type;
	job->answer = bytes;
	job->size = bytes != NULL ? size : 0;
}

void job_answer_json(struct job *job, cJSON *tree)
{
	char *text = tree != NULL ? cJSON_PrintUnformatted(tree) : NULL;

	cJSON_Delete(tree);
	job_answer_bytes(job, "application/json", text, text != NULL ? strlen(text) : 0);
}

void job_refuse(struct job *job, int status, const char *format, ...)
{
	cJSON *tree = cJSON_CreateObject();
	char text[1024];
	va_list arguments;

	va_start(arguments, format);
	vsnprintf(text, sizeof(text), format, arguments);
	va_end(arguments);
	if (tree != NULL)
		cJSON_AddStringToObject(tree, "error", text);
	job_answer_json(job, tree);
	job->status = status;
}

const char *job_text(struct job *job, const char *key, const char *fallback)
{
	const cJSON *item = cJSON_GetObjectItemCaseSensitive(job->body, key);

	if (item == NULL && fallback != NULL)
		return fallback;
	if (cJSON_IsString(item))
		return item->valuestring;
	job_refuse(job, 400, "\"%s\": expected a text", key);
	return NULL;
}

bool job_number(struct job *job, const char *key, double min, double max, double fallback, double *value)
{
	const cJSON *item = cJSON_GetObjectItemCaseSensitive(job->body, key);

	if (item == NULL && !isnan(fallback)) {
		*value = fallback;
		return true;
	}
	if (cJSON_IsNumber(item) && item->valuedouble >= min && item->valuedouble <= max) {
		*value = item->valuedouble;
		return true;
	}
	job_refuse(job, 400, "\"%s\": expected a number from %g to %g", key, min, max);
	return false;
}
