/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "host/command/beside.h"
#include "host/command/command.h"

static const char help[] =
        "usage: droptower serve [OPTIONS]\n"
        "\n"
        "The technician's page: set-up, checks, arm, release, abort, live traces, results, series, history. "
        "Prints\n"
        "its address with the token that every request needs, and serves until Ctrl-C; a drop in motion is\n"
        "collected first, unless Ctrl-C comes twice.\n"
        "\n"
        "  --link URL         unix:PATH, can:IF or slcan:DEV; without it a simulated tower is started\n"
        "  --control PATH     with --link: control socket of a simulated tower, for its faults\n"
        "  --archive DIR      where drops are kept; without it $DROPTOWER_ARCHIVE or ./archive\n"
        "  --series NAME      selected at the start\n"
        "  --operator NAME    who drops ($USER)\n"
        "  --scene FILE       scenes that the page offers (those that come along); may be repeated\n"
        "  --bind ADDRESS     where it listens (default 127.0.0.1); any other lets the token go over the\n"
        "                     network in clear\n"
        "  --port N           default 8731; 0 takes a free one\n"
        "  --token-file FILE  the token, made there when there is no file; without it a new one each time\n"
        "  --bench WORD       simulated tower only: a word for droptower-bench, e.g. --bench=--loss\n"
        "                     --bench=0.05; may be repeated\n";

/* It is a program of its own, so that this one needs no web server. */
int command_serve(int argc, char **argv)
{
	char path[PATH_MAX];

	for (int i = 1; i < argc && strcmp(argv[i], "--") != 0; i++)
		if (strcmp(argv[i], "--help") == 0 || strcmp(argv[i], "-h") == 0) {
			fputs(help, stdout);
			return COMMAND_DONE;
		}
	if (beside("droptower-console", path) == 0)
		execv(path, argv);
	if (errno == ENOENT)
		command_error("serve needs droptower-console beside droptower: 'make console' builds it");
	else
		command_error("%s: %s", path, strerror(errno));
	return COMMAND_INPUT;
}
