/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/command/notify.h"

#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

void notify(const char *state)
{
	const char *path = getenv("NOTIFY_SOCKET");
	struct sockaddr_un address = {.sun_family = AF_UNIX};
	socklen_t size;
	int fd;

	if (path == NULL || strlen(path) >= sizeof(address.sun_path))
		return;
	strcpy(address.sun_path, path);
	size = (socklen_t)(offsetof(struct sockaddr_un, sun_path) + strlen(path));
	if (path[0] == '@') /* abstract: no file */
		address.sun_path[0] = '\0';
	fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
	if (fd < 0)
		return;
	sendto(fd, state, strlen(state), MSG_NOSIGNAL, (const struct sockaddr *)&address, size);
	close(fd);
}

void notify_alive(void)
{
	static int64_t next_us;
	const char *text = getenv("WATCHDOG_USEC");
	int64_t period_us = text ? strtoll(text, NULL, 10) : 0, now_us;
	struct timespec now;

	if (period_us <= 0)
		return;
	clock_gettime(CLOCK_MONOTONIC, &now);
	now_us = now.tv_sec * INT64_C(1000000) + now.tv_nsec / 1000;
	if (now_us < next_us)
		return;
	next_us = now_us + period_us / 3;
	notify("WATCHDOG=1");
}
