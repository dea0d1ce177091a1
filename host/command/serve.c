/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "host/base/installed.h"
#include "host/command/command.h"
#include "host/command/serve.h"

static const struct option_row rows[] = {
        OPTION_TEXT("link", "URL", struct serve_arguments, link,
                    "unix:PATH, can:IF or slcan:DEV; without it a simulated tower is started"),
        OPTION_TEXT("control", "PATH", struct serve_arguments, control,
                    "with --link: control socket of a simulated tower, for its faults"),
        OPTION_TEXT("archive", "DIR", struct serve_arguments, archive,
                    "where drops are kept; without it $DROPTOWER_ARCHIVE or ./archive"),
        OPTION_TEXT("series", "NAME", struct serve_arguments, series, "selected at the start"),
        OPTION_TEXT("operator", "NAME", struct serve_arguments, operator_name, "who drops ($USER)"),
        OPTION_WORDS("scene", "FILE", struct serve_arguments, scenes, SERVE_SCENES_MAX,
                     "scenes that the page offers (those that come along); may be repeated"),
        OPTION_TEXT("bind", "ADDRESS", struct serve_arguments, address,
                    "where it listens (default 127.0.0.1); any other lets the token go over the network in "
                    "clear"),
        OPTION_UNSIGNED("port", "N", struct serve_arguments, port, 0, 65535,
                        "default 8731; 0 takes a free one"),
        OPTION_TEXT("token-file", "FILE", struct serve_arguments, token_file,
                    "the token, made there when there is no file; without it a new one each time"),
        OPTION_WORDS("bench", "WORD", struct serve_arguments, bench, SERVE_BENCH_WORDS_MAX,
                     "simulated tower only: a word for droptower-bench, e.g. --bench=--loss --bench=0.05; "
                     "may be repeated"),
};

const struct option_table serve_options = {
        .program = "droptower",
        .command = "serve",
        .head = "usage: droptower serve [OPTIONS]\n"
                "\n"
                "The technician's page: set-up, checks, arm, release, abort, live traces, results, series, "
                "history. "
                "Prints\n"
                "its address with the token that every request needs, and serves until Ctrl-C; a drop in "
                "motion is\n"
                "collected first, unless Ctrl-C comes twice.\n"
                "\n",
        OPTION_ROWS(rows),
};

/* It is a program of its own, so that this one needs no web server. */
int command_serve(int argc, char **argv)
{
	char path[PATH_MAX];

	for (int i = 1; i < argc && strcmp(argv[i], "--") != 0; i++)
		if (strcmp(argv[i], "--help") == 0 || strcmp(argv[i], "-h") == 0) {
			option_help(&serve_options);
			return COMMAND_DONE;
		}
	if (installed_path("droptower-console", path) == 0)
		execv(path, argv);
	if (errno == ENOENT)
		command_error("serve needs droptower-console beside droptower: 'make console' builds it");
	else
		command_error("%s: %s", path, strerror(errno));
	return COMMAND_INPUT;
}
