/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CONSOLE_HTTP_PRIVATE_H
#define DT_HOST_CONSOLE_HTTP_PRIVATE_H
/*
 * What the files of the web server share: http.c has its start and end, request.c what is asked for, visit.c
 * the connections that have not shown the token, which it keeps few and short.
 */
#include <microhttpd.h>
#include <pthread.h>

#include "host/console/auth.h"
#include "host/console/hold.h"
#include "host/console/http.h"
#include "host/console/stream.h"

struct visit {
	struct visit *older,
	        *newer; /* those without the token, by when they came; NULL for one that has shown it */
	bool listed;
	int fd;
	int64_t came_ms;
};

struct http {
	struct MHD_Daemon *daemon;
	struct console *console;
	const struct page_part *parts;
	size_t part_count;
	const char *token;
	struct hold hold;
	struct streams *streams;
	struct auth_rates asked;   /* requests with the token, of each console */
	struct auth_rate held;     /* of the console that holds the arm, whatever others ask for */
	struct auth_rate wrong;    /* without the token */
	unsigned photos;           /* on their way in */
	pthread_mutex_t jobs_lock; /* of closing and jobs */
	bool closing;
	unsigned jobs;               /* given away and not yet done */
	pthread_mutex_t visits_lock; /* of what follows */
	struct visit *oldest, *newest;
	unsigned visits;
};

/* A request's target, before libmicrohttpd takes it apart, which needs memory for each argument and without
 * it never answers: too long a one is refused here. MHD_OPTION_URI_LOG_CALLBACK; what it returns is the
 * context of http_request. */
void *http_target(void *user, const char *target, struct MHD_Connection *connection);

/* A piece of a request comes; MHD_AccessHandlerCallback. */
enum MHD_Result http_request(void *user, struct MHD_Connection *connection, const char *url,
                             const char *method, const char *version, const char *upload, size_t *upload_size,
                             void **context);

/* Its answer is out, or its connection gone; MHD_RequestCompletedCallback. */
void http_completed(void *user, struct MHD_Connection *connection, void **context,
                    enum MHD_RequestTerminationCode code);

/* A connection comes or goes; MHD_NotifyConnectionCallback. */
void http_visit(void *user, struct MHD_Connection *connection, void **context,
                enum MHD_ConnectionNotificationCode code);

/* It has shown the token. */
void http_prove(struct http *http, struct MHD_Connection *connection);

/* Closes those that took too long; on any thread. */
void http_close_slow(struct http *http);

#endif
