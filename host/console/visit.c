/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <stdlib.h>
#include <sys/socket.h>

#include "host/session/session.h"
#include "host/console/http_private.h"

enum {
	VISITS_MAX = HTTP_CONNECTIONS / 2, /* the other half is for who has the token */
	VISIT_MS = 10000,
};

static void unlist(struct http *http, struct visit *visit)
{
	if (!visit->listed)
		return;
	*(visit->older != NULL ? &visit->older->newer : &http->oldest) = visit->newer;
	*(visit->newer != NULL ? &visit->newer->older : &http->newest) = visit->older;
	visit->older = visit->newer = NULL;
	visit->listed = false;
	http->visits--;
}

static void list(struct http *http, struct visit *visit)
{
	visit->older = http->newest;
	*(http->newest != NULL ? &http->newest->newer : &http->oldest) = visit;
	http->newest = visit;
	visit->listed = true;
	http->visits++;
}

/* The server then sees the other end gone, and closes it in its own time. Under the lock, its descriptor is
 * still its own. */
static void send_away(struct http *http, struct visit *visit)
{
	unlist(http, visit);
	(void)shutdown(visit->fd, SHUT_RDWR);
}

static void come(struct http *http, struct MHD_Connection *connection, void **context)
{
	const union MHD_ConnectionInfo *info =
	        MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
	struct visit *visit = calloc(1, sizeof(*visit));

	*context = visit;
	if (visit == NULL || info == NULL)
		return;
	visit->fd = info->connect_fd;
	visit->came_ms = session_now_ms();
	if (http->visits == VISITS_MAX)
		send_away(http, http->oldest);
	list(http, visit);
}

void http_visit(void *user, struct MHD_Connection *connection, void **context,
                enum MHD_ConnectionNotificationCode code)
{
	struct http *http = user;

	pthread_mutex_lock(&http->visits_lock);
	if (code == MHD_CONNECTION_NOTIFY_STARTED) {
		come(http, connection, context);
	} else if (*context != NULL) {
		unlist(http, *context);
		free(*context);
		*context = NULL;
	}
	pthread_mutex_unlock(&http->visits_lock);
}

void http_prove(struct http *http, struct MHD_Connection *connection)
{
	const union MHD_ConnectionInfo *info =
	        MHD_get_connection_info(connection, MHD_CONNECTION_INFO_SOCKET_CONTEXT);

	pthread_mutex_lock(&http->visits_lock);
	if (info != NULL && info->socket_context != NULL)
		unlist(http, info->socket_context);
	pthread_mutex_unlock(&http->visits_lock);
}

void http_close_slow(struct http *http)
{
	int64_t now_ms = session_now_ms();

	pthread_mutex_lock(&http->visits_lock);
	while (http->oldest != NULL && now_ms - http->oldest->came_ms > VISIT_MS)
		send_away(http, http->oldest);
	pthread_mutex_unlock(&http->visits_lock);
}
