/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A request, from its first line to its answer: who asks, for which job, with what body.
 */
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

#include "common/plain.h"
#include "host/archive/archive.h"
#include "host/console/http_private.h"
#include "host/console/metrics.h"
#include "host/console/route.h"
#include "host/console/state.h"
#include "host/session/session.h"

enum {
	BODY_MAX = 16 * 1024,
	SWALLOW_MAX = 1024 * 1024, /* behind a body that is too large, so that its sender hears why */
	PHOTOS_MAX = 4,            /* on their way in at once, each in memory until it is whole */
	TEXT_MAX = 128,
	TARGET_MAX = 4096,  /* of a request, in bytes */
	ARGUMENTS_MAX = 64, /* in it */
};

/* A request, from its first line to its answer. */
struct request {
	struct job job; /* its maker is the request */
	struct http *http;
	struct MHD_Connection *connection;
	const struct route *route;
	char console[HOLD_CONSOLE_MAX + 1];
	cJSON *tree;
	size_t announced; /* of its body, so far */
	char *photo;      /* body of a photo: grows with what comes */
	size_t photo_room;
	bool asked; /* the job was given away */
	char body[BODY_MAX + 1];
};

static const char *header(struct MHD_Connection *connection, const char *name)
{
	return MHD_lookup_connection_value(connection, MHD_HEADER_KIND, name);
}

/* ---- answers ---- */

static void add_headers(struct MHD_Response *response, const char *type, bool page)
{
	static const char *const always[][2] = {
	        {"X-Content-Type-Options", "nosniff"},
	        {"X-Frame-Options", "DENY"},
	        {"Referrer-Policy", "no-referrer"},
	        {"Cross-Origin-Opener-Policy", "same-origin"},
	        {"Cross-Origin-Resource-Policy", "same-origin"},
	        {"Permissions-Policy", "camera=(), microphone=(), geolocation=(), usb=(), serial=()"},
	};

	for (size_t i = 0; i < sizeof(always) / sizeof(always[0]); i++)
		MHD_add_response_header(response, always[i][0], always[i][1]);
	if (type != NULL)
		MHD_add_response_header(response, MHD_HTTP_HEADER_CONTENT_TYPE, type);
	/* no script or style but the page's own files, no frame around it, nothing sent elsewhere; what else
	 * is answered is no page at all */
	MHD_add_response_header(
	        response, "Content-Security-Policy",
	        page ? "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src "
	               "'self'; manifest-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors "
	               "'none'"
	             : "default-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'; "
	               "sandbox");
	MHD_add_response_header(response, MHD_HTTP_HEADER_CACHE_CONTROL, page ? "no-cache" : "no-store");
}

static enum MHD_Result send_and_forget(struct MHD_Connection *connection, unsigned status,
                                       struct MHD_Response *response)
{
	enum MHD_Result result = MHD_queue_response(connection, status, response);

	MHD_destroy_response(response);
	return result;
}

/* An answer that needs no job. extra: a header, or NULL. */
static enum MHD_Result request_refuse(struct MHD_Connection *connection, unsigned status, const char *text,
                                      const char *extra, const char *value)
{
	char body[TEXT_MAX + 16];
	int size = snprintf(body, sizeof(body), "{\"error\":\"%.*s\"}", TEXT_MAX, text);
	struct MHD_Response *response =
	        MHD_create_response_from_buffer((size_t)size, body, MHD_RESPMEM_MUST_COPY);

	if (response == NULL)
		return MHD_NO;
	add_headers(response, "application/json", false);
	if (extra != NULL)
		MHD_add_response_header(response, extra, value);
	return send_and_forget(connection, status, response);
}

static enum MHD_Result request_answer(struct request *request)
{
	struct job *job = &request->job;
	struct MHD_Response *response = MHD_create_response_from_buffer(job->answer != NULL ? job->size : 0,
	                                                                job->answer, MHD_RESPMEM_MUST_FREE);

	if (response == NULL)
		return MHD_NO;
	job->answer = NULL; /* the response's */
	add_headers(response, job->type, false);
	return send_and_forget(request->connection, (unsigned)job->status, response);
}

/* ---- the page ---- */

static enum MHD_Result send_part(struct http *http, struct MHD_Connection *connection, const char *method,
                                 const char *path)
{
	const char *name = path[0] == '\0' || strcmp(path, "wall") == 0 ? "index.html" : path;

	for (size_t i = 0; i < http->part_count; i++) {
		const struct page_part *part = &http->parts[i];
		struct MHD_Response *response;
		union { /* only read */
			const unsigned char *given;
			void *taken;
		} bytes = {.given = part->bytes};

		if (strcmp(part->name, name) != 0)
			continue;
		if (strcmp(method, "GET") != 0 && strcmp(method, "HEAD") != 0)
			return request_refuse(connection, 405, "expected GET", MHD_HTTP_HEADER_ALLOW,
			                      "GET, HEAD");
		response = MHD_create_response_from_buffer(part->size, bytes.taken, MHD_RESPMEM_PERSISTENT);
		if (response == NULL)
			return MHD_NO;
		add_headers(response, part->type, true);
		return send_and_forget(connection, 200, response);
	}
	return request_refuse(connection, 404, "no such page", NULL, NULL);
}

/* ---- jobs ---- */

static const char *request_query(const struct job *job, const char *name)
{
	const struct request *request = job->maker;

	return MHD_lookup_connection_value(request->connection, MHD_GET_ARGUMENT_KIND, name);
}

static bool count_job(struct http *http)
{
	bool open;

	pthread_mutex_lock(&http->jobs_lock);
	open = !http->closing;
	if (open)
		http->jobs++;
	pthread_mutex_unlock(&http->jobs_lock);
	return open;
}

/* On any thread. */
static void wake(struct job *job)
{
	struct request *request = job->maker;
	struct http *http = request->http;

	MHD_resume_connection(request->connection); /* from here on the request is http's again */
	pthread_mutex_lock(&http->jobs_lock);
	http->jobs--;
	pthread_mutex_unlock(&http->jobs_lock);
}

static void run_hold(struct request *request)
{
	struct job *job = &request->job;
	struct hold *hold = &request->http->hold;
	const cJSON *take = cJSON_GetObjectItemCaseSensitive(job->body, "take");
	int64_t now_ms = session_now_ms();
	cJSON *tree;

	if (!cJSON_IsBool(take) || request->console[0] == '\0') {
		job_refuse(job, 400, "expected \"take\": true or false, and X-Console");
		return;
	}
	if (!cJSON_IsTrue(take)) {
		hold_give(hold, request->console);
	} else if (!hold_take(hold, request->console, now_ms)) {
		job_refuse(job, 409, "another console holds the arm");
		return;
	}
	tree = cJSON_CreateObject();
	cJSON_AddBoolToObject(tree, "mine", hold_mine(hold, request->console, now_ms));
	job_answer_json(job, tree);
}

static enum MHD_Result open_stream(struct request *request)
{
	struct MHD_Response *response =
	        stream_open(request->http->streams, request->connection, request->console);

	if (response == NULL)
		return request_refuse(request->connection, 503, "too many pages watch already",
		                      MHD_HTTP_HEADER_RETRY_AFTER, "5");
	add_headers(response, "text/event-stream", false);
	return send_and_forget(request->connection, 200, response);
}

static enum MHD_Result send_metrics(struct request *request)
{
	struct console *console = request->http->console;
	struct state state;
	size_t size;
	cJSON *tree;
	char *text;

	state_look(&state, console->tower, console->work, console->live);
	tree = state_tree(&state);
	text = metrics_text(tree, &size);
	cJSON_Delete(tree);
	if (text == NULL)
		return request_refuse(request->connection, 503, error_text(DT_E_MEMORY), NULL, NULL);
	job_answer_bytes(&request->job, "text/plain; version=0.0.4; charset=utf-8", text, size);
	return request_answer(request);
}

/* What a body may have, by its route. */
static size_t body_max(const struct route *route)
{
	return route->photo ? ARCHIVE_PHOTO_BYTES : BODY_MAX;
}

static enum MHD_Result refuse_length(struct MHD_Connection *connection, const struct route *route)
{
	return request_refuse(connection, 413,
	                      route->photo ? "expected a photo of at most 8 MiB" : "expected at most 16 KiB",
	                      NULL, NULL);
}

static bool parse_body(struct request *request)
{
	bool post = strcmp(request->route->method, "POST") == 0;

	if (request->route->photo) {
		request->job.photo = request->photo;
		request->job.photo_size = request->announced;
		return true;
	}
	if (post) {
		request->body[request->announced] = '\0';
		request->tree = plain_is_utf8(request->body, request->announced) &&
		                                !auth_json_has_nul(request->body) &&
		                                strlen(request->body) == request->announced
		                        ? cJSON_ParseWithOpts(request->body, NULL, true)
		                        : NULL;
	}
	if (request->route->always && !cJSON_IsObject(request->tree)) {
		cJSON_Delete(request->tree);
		request->tree = cJSON_CreateObject();
	}
	request->job.body = request->tree;
	return !post || cJSON_IsObject(request->tree);
}

/* The job goes its way, and the connection sleeps until it is done. */
static enum MHD_Result give_away(struct request *request)
{
	struct http *http = request->http;
	struct job *job = &request->job;

	if (!count_job(http))
		return request_refuse(request->connection, 503, "the console is ending", NULL, NULL);
	request->asked = true;
	MHD_suspend_connection(request->connection); /* first: the job may be done at once */
	job->run = request->route->run;
	if (request->route->kind == ROUTE_TOWER) {
		job->run(job);
	} else if (job_put(&http->console->work_queue, job) != 0) {
		job_refuse(job, 503, "too much is asked for at once");
		job_done(job);
	}
	return MHD_YES;
}

/* The request is whole. */
static enum MHD_Result request_begin(struct request *request)
{
	struct http *http = request->http;

	if (request->announced > body_max(request->route) && !request->route->always)
		return refuse_length(request->connection, request->route);
	if (request->announced > body_max(request->route))
		request->announced = 0;
	if (request->route->photo && request->announced > request->photo_room)
		return request_refuse(request->connection, 503, error_text(DT_E_MEMORY), NULL, NULL);
	if (!parse_body(request))
		return request_refuse(request->connection, 400,
		                      "expected a JSON object in UTF-8, without NUL", NULL, NULL);
	if (request->route->needs_hold && !hold_mine(&http->hold, request->console, session_now_ms()))
		return request_refuse(request->connection, 423, "this console does not hold the arm", NULL,
		                      NULL);
	if (request->route->kind == ROUTE_STREAM)
		return open_stream(request);
	if (request->route->kind == ROUTE_METRICS)
		return send_metrics(request);
	if (request->route->kind == ROUTE_HOLD) {
		run_hold(request);
		return request_answer(request);
	}
	return give_away(request);
}

/* Memory comes with the bytes, and not with what a header promises; without it the photo stays as it was. */
static void take_photo(struct request *request, const char *bytes, size_t size)
{
	size_t room = request->photo_room != 0 ? request->photo_room : BODY_MAX;
	char *more;

	while (room < request->announced + size && room < ARCHIVE_PHOTO_BYTES)
		room *= 2;
	more = room > request->photo_room ? realloc(request->photo, room) : request->photo;
	if (more != NULL) {
		request->photo = more;
		request->photo_room = room;
		if (request->announced + size <= room)
			memcpy(more + request->announced, bytes, size);
	}
	request->announced += size;
}

static void take_body(struct request *request, const char *bytes, size_t size)
{
	size_t room = request->announced < BODY_MAX ? BODY_MAX - request->announced : 0;

	memcpy(request->body + (BODY_MAX - room), bytes, size < room ? size : room);
	request->announced += size;
}

/* ---- who asks ---- */

static bool longer_than(struct MHD_Connection *connection, unsigned long long most)
{
	const char *length = header(connection, MHD_HTTP_HEADER_CONTENT_LENGTH);

	return length != NULL && strtoull(length, NULL, 10) > most;
}

static enum MHD_Result count_length(void *user, enum MHD_ValueKind kind, const char *name, const char *value)
{
	(void)kind;
	(void)value;
	*(unsigned *)user += strcasecmp(name, MHD_HTTP_HEADER_CONTENT_LENGTH) == 0;
	return MHD_YES;
}

/* Two lengths: what follows the body is then not what it seems (RFC 9112, 6.3). */
static bool has_two_lengths(struct MHD_Connection *connection)
{
	unsigned count = 0;

	MHD_get_connection_values(connection, MHD_HEADER_KIND, count_length, &count);
	return count > 1;
}

/* The holder's renewals and verbs do not stand behind what other consoles ask for. */
static bool within_rate(struct http *http, const char *console)
{
	int64_t now_ms = session_now_ms();

	if (console == NULL || !auth_console_valid(console))
		console = "";
	if (hold_mine(&http->hold, console, now_ms))
		return auth_take(&http->held, now_ms);
	return auth_take_of(&http->asked, console, now_ms);
}

static void forget_job(struct job *job)
{
	free(job->answer);
	free(job);
}

/* An ABORT with a body that is long, or of a length nobody knows, does not wait for it. */
static enum MHD_Result abort_at_once(struct http *http, struct MHD_Connection *connection,
                                     const struct route *route)
{
	struct job *job = calloc(1, sizeof(*job));

	if (job == NULL)
		return request_refuse(connection, 503, error_text(DT_E_MEMORY), NULL, NULL);
	job->console = http->console;
	job->done = forget_job;
	job->run = route->run;
	job->run(job);
	return request_refuse(connection, 202, "aborting; the body was not waited for", NULL, NULL);
}

static enum MHD_Result check_token(struct http *http, struct MHD_Connection *connection, bool *passed)
{
	*passed = auth_token_agrees(http->token, header(connection, MHD_HTTP_HEADER_AUTHORIZATION));
	if (*passed) {
		http_prove(http, connection);
		return MHD_YES;
	}
	if (!auth_take(&http->wrong, session_now_ms()))
		return request_refuse(connection, 429, "too many requests without the token",
		                      MHD_HTTP_HEADER_RETRY_AFTER, "2");
	return request_refuse(connection, 401, "expected the token that the console printed when it started",
	                      MHD_HTTP_HEADER_WWW_AUTHENTICATE, "Bearer realm=\"droptower\"");
}

static struct request *new_request(struct http *http, struct MHD_Connection *connection,
                                   const struct route *route, const char *rest, const char *console)
{
	struct request *request = malloc(sizeof(*request));

	if (request == NULL)
		return NULL;
	memset(request, 0, offsetof(struct request, body));
	request->http = http;
	request->connection = connection;
	request->route = route;
	snprintf(request->console, sizeof(request->console), "%s", console != NULL ? console : "");
	request->job.console = http->console;
	request->job.maker = request;
	request->job.done = wake;
	request->job.query = request_query;
	request->job.path = rest;
	return request;
}

static const char *request_allowed(const char *path)
{
	const char *rest;
	bool other;

	if (route_find("GET", path, &rest, &other) == NULL)
		return "POST";
	return route_find("POST", path, &rest, &other) != NULL ? "GET, POST" : "GET";
}

/* What is behind /api/, for who has the token. */
static enum MHD_Result open_request(struct http *http, struct MHD_Connection *connection, const char *method,
                                    const char *path, void **context)
{
	const char *console = header(connection, "X-Console"), *rest;
	bool other_method;
	const struct route *route = route_find(method, path, &rest, &other_method);

	if (route == NULL && other_method)
		return request_refuse(connection, 405, "another method is expected here",
		                      MHD_HTTP_HEADER_ALLOW, request_allowed(path));
	if (route == NULL)
		return request_refuse(connection, 404, "no such request, or no such name", NULL, NULL);
	if (has_two_lengths(connection))
		return request_refuse(connection, 400, "expected one Content-Length",
		                      MHD_HTTP_HEADER_CONNECTION, "close");
	if (!route->always && !within_rate(http, console))
		return request_refuse(connection, 429, "too many requests", MHD_HTTP_HEADER_RETRY_AFTER, "1");
	if (console != NULL && !auth_console_valid(console) && !route->always)
		return request_refuse(connection, 400, "X-Console: expected 16 to 64 letters and digits",
		                      NULL, NULL);
	if (route->always && (longer_than(connection, BODY_MAX) ||
	                      header(connection, MHD_HTTP_HEADER_TRANSFER_ENCODING) != NULL))
		return abort_at_once(http, connection, route);
	if (longer_than(connection, body_max(route) + SWALLOW_MAX))
		return refuse_length(connection, route);
	if (route->photo && http->photos == PHOTOS_MAX)
		return request_refuse(connection, 503, "other photos are on their way in",
		                      MHD_HTTP_HEADER_RETRY_AFTER, "2");
	*context = new_request(http, connection, route, rest, console);
	if (*context != NULL)
		http->photos += route->photo;
	return *context != NULL ? MHD_YES : MHD_NO;
}

/* The first line and the headers are there. */
static enum MHD_Result look_at(struct http *http, struct MHD_Connection *connection, const char *method,
                               const char *url, void **context)
{
	const char *host = header(connection, MHD_HTTP_HEADER_HOST);
	const union MHD_ConnectionInfo *info =
	        MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
	struct sockaddr_storage local = {0};
	socklen_t size = sizeof(local);
	enum MHD_Result result;
	bool passed;
	union {
		struct sockaddr_storage *stored;
		struct sockaddr *any;
	} address = {.stored = &local};

	if (info == NULL || getsockname(info->connect_fd, address.any, &size) != 0 ||
	    !auth_host_agrees(host, address.any))
		return request_refuse(connection, 403, "Host is not this console's", NULL, NULL);
	if (!auth_origin_agrees(header(connection, MHD_HTTP_HEADER_ORIGIN), host))
		return request_refuse(connection, 403, "Origin is not this console's", NULL, NULL);
	if (strncmp(url, "/api/", 5) == 0)
		url += 5;
	else if (strcmp(url, "/metrics") == 0) /* where it is looked for */
		url += 1;
	else
		return send_part(http, connection, method, url[0] == '/' ? url + 1 : url);
	result = check_token(http, connection, &passed);
	return passed ? open_request(http, connection, method, url, context) : result;
}

/* What stands for the request then: whatever else of it is here is not done. */
static char target_refused;

void *http_target(void *user, const char *target, struct MHD_Connection *connection)
{
	static const char refused[] =
	        "HTTP/1.1 414 URI Too Long\r\nConnection: close\r\nContent-Length: 0\r\n\r\n";
	const union MHD_ConnectionInfo *info =
	        MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
	unsigned arguments = 1;

	(void)user;
	for (const char *at = target; (at = strchr(at, '&')) != NULL; at++)
		arguments++;
	if (info == NULL || (strlen(target) <= TARGET_MAX && arguments <= ARGUMENTS_MAX))
		return NULL;
	(void)send(info->connect_fd, refused, sizeof(refused) - 1, MSG_DONTWAIT | MSG_NOSIGNAL);
	(void)shutdown(info->connect_fd, SHUT_RDWR);
	return &target_refused;
}

enum MHD_Result http_request(void *user, struct MHD_Connection *connection, const char *url,
                             const char *method, const char *version, const char *upload, size_t *upload_size,
                             void **context)
{
	struct request *request = *context;

	(void)version;
	if (*context == &target_refused)
		return MHD_NO;
	if (request == NULL)
		return look_at(user, connection, method, url, context);
	if (request->asked)
		return request_answer(request);
	if (*upload_size == 0)
		return request_begin(request);
	if (request->route->photo)
		take_photo(request, upload, *upload_size);
	else
		take_body(request, upload, *upload_size);
	*upload_size = 0;
	return request->announced <= body_max(request->route) + SWALLOW_MAX ? MHD_YES : MHD_NO;
}

void http_completed(void *user, struct MHD_Connection *connection, void **context,
                    enum MHD_RequestTerminationCode code)
{
	struct request *request = *context;

	(void)user;
	(void)connection;
	(void)code;
	if (request == NULL || *context == &target_refused)
		return;
	request->http->photos -= request->route->photo;
	cJSON_Delete(request->tree);
	free(request->photo);
	free(request->job.answer);
	free(request);
	*context = NULL;
}
