/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/report/picture.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/base/process.h"

/* gnuplot's complaint: the first line of its error stream that says something. */
static void picture_complain(int fd, char *message, size_t size)
{
	size_t length;
	char *text = process_read(fd, &length);
	const char *line = text ? text + strspn(text, " \t\r\n^") : "";

	snprintf(message, size, "gnuplot failed: %.*s", (int)strcspn(line, "\n"), line);
	free(text);
}

static int picture_collect(const struct process_streams *streams, int status, char **svg, char *message,
                           size_t size)
{
	size_t length;
	char *text;

	if (status < 0) {
		snprintf(message, size, "gnuplot cannot be run (%s): install the package gnuplot-nox",
		         strerror(-status));
		return DT_E_SYSTEM;
	}
	text = process_read(streams->fd[1], &length);
	if (!text) {
		snprintf(message, size, "gnuplot's picture: %s", strerror(errno));
		return DT_E_SYSTEM;
	}
	if (status > 0 || !strstr(text, "</svg>")) {
		picture_complain(streams->fd[2], message, size);
		free(text);
		return DT_E_SYSTEM;
	}
	*svg = text;
	return 0;
}

int picture_draw(const char *script, size_t length, char **svg, char *message, size_t size)
{
	static const char *const gnuplot[] = {"gnuplot", "--default-settings", NULL};
	struct process_streams streams;
	int result = process_streams_open(&streams, script, length);

	if (result != 0) {
		snprintf(message, size, "no file in memory for gnuplot: %s", strerror(result));
		return DT_E_SYSTEM;
	}
	result = picture_collect(&streams, process_filter(gnuplot, &streams), svg, message, size);
	process_streams_close(&streams);
	return result;
}
