/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <arpa/inet.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "host/console/http_private.h"

enum {
	MEMORY_PER_CONNECTION = 16 * 1024,
	IDLE_S = 60, /* a connection with the token that says nothing */
};

static int make_address(const char *text, unsigned port, struct sockaddr_storage *address)
{
	union {
		struct sockaddr_storage *stored;
		struct sockaddr_in *four;
		struct sockaddr_in6 *six;
	} place = {.stored = address};

	memset(address, 0, sizeof(*address));
	if (inet_pton(AF_INET, text, &place.four->sin_addr) == 1) {
		place.four->sin_family = AF_INET;
		place.four->sin_port = htons((uint16_t)port);
		return 0;
	}
	if (inet_pton(AF_INET6, text, &place.six->sin6_addr) == 1) {
		place.six->sin6_family = AF_INET6;
		place.six->sin6_port = htons((uint16_t)port);
		return 0;
	}
	return DT_E_ARGUMENT;
}

bool http_is_address(const char *text)
{
	struct sockaddr_storage address;

	return make_address(text, 0, &address) == 0;
}

static struct MHD_Daemon *start_daemon(struct http *http, const struct sockaddr_storage *address)
{
	unsigned flags = MHD_USE_EPOLL_INTERNAL_THREAD | MHD_ALLOW_SUSPEND_RESUME |
	                 (address->ss_family == AF_INET6 ? (unsigned)MHD_USE_IPv6 : 0u);

	return MHD_start_daemon(flags, 0, NULL, NULL, http_request, http, MHD_OPTION_SOCK_ADDR, address,
	                        MHD_OPTION_CONNECTION_LIMIT, (unsigned)HTTP_CONNECTIONS,
	                        MHD_OPTION_CONNECTION_TIMEOUT, (unsigned)IDLE_S,
	                        MHD_OPTION_CONNECTION_MEMORY_LIMIT, (size_t)MEMORY_PER_CONNECTION,
	                        MHD_OPTION_STRICT_FOR_CLIENT, 1, MHD_OPTION_URI_LOG_CALLBACK, http_target,
	                        http, MHD_OPTION_NOTIFY_COMPLETED, http_completed, NULL,
	                        MHD_OPTION_NOTIFY_CONNECTION, http_visit, http, MHD_OPTION_END);
}

struct http *http_start(struct console *console, const struct http_options *options,
                        char message[HTTP_MESSAGE_MAX])
{
	struct sockaddr_storage address;
	int why = make_address(options->address, options->port, &address);
	struct http *http = why == 0 ? calloc(1, sizeof(*http)) : NULL;

	if (http == NULL) {
		snprintf(message, HTTP_MESSAGE_MAX, "%.100s: %s", options->address,
		         error_text(why != 0 ? why : DT_E_MEMORY));
		return NULL;
	}
	http->console = console;
	http->parts = options->parts;
	http->part_count = options->part_count;
	http->token = options->token;
	/* a technician and a page that fetches five drops at once are far below the first */
	auth_rates_init(&http->asked, 400, 200);
	http->held = (struct auth_rate){.burst = 400, .per_s = 200};
	http->wrong = (struct auth_rate){.burst = 20, .per_s = 5};
	pthread_mutex_init(&http->visits_lock, NULL);
	pthread_mutex_init(&http->jobs_lock, NULL);
	http->streams = streams_create(console, &http->hold);
	if (http->streams != NULL)
		http->daemon = start_daemon(http, &address);
	if (http->daemon != NULL)
		return http;
	why = errno;
	snprintf(message, HTTP_MESSAGE_MAX, "%.100s port %u: %s", options->address, options->port,
	         strerror(why));
	if (http->streams != NULL)
		streams_destroy(http->streams);
	pthread_mutex_destroy(&http->visits_lock);
	pthread_mutex_destroy(&http->jobs_lock);
	free(http);
	return NULL;
}

unsigned http_port(const struct http *http)
{
	const union MHD_DaemonInfo *info = MHD_get_daemon_info(http->daemon, MHD_DAEMON_INFO_BIND_PORT);

	return info != NULL ? info->port : 0;
}

void http_tick(struct http *http)
{
	streams_tick(http->streams);
	http_close_slow(http);
}

static bool jobs_done(struct http *http)
{
	bool done;

	pthread_mutex_lock(&http->jobs_lock);
	http->closing = true;
	done = http->jobs == 0;
	pthread_mutex_unlock(&http->jobs_lock);
	return done;
}

void http_stop(struct http *http)
{
	MHD_socket listening = MHD_quiesce_daemon(http->daemon);

	streams_end(http->streams);
	while (!jobs_done(http))
		usleep(10000);
	MHD_stop_daemon(http->daemon);
	if (listening != MHD_INVALID_SOCKET)
		close(listening);
	streams_destroy(http->streams);
	pthread_mutex_destroy(&http->visits_lock);
	pthread_mutex_destroy(&http->jobs_lock);
	free(http);
}
