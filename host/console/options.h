/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CONSOLE_OPTIONS_H
#define DT_HOST_CONSOLE_OPTIONS_H
/*
 * What the console is started with. The --help of `droptower serve` tells the options.
 */
#include <glob.h>

#include "host/console/console.h"
#include "host/console/http.h"

enum { OPTIONS_SCENES_MAX = 64, OPTIONS_BENCH_WORDS_MAX = 24 };

struct options {
	struct tower_options tower;
	struct work_options work;
	struct http_options http;        /* address and port */
	const char *series, *token_file; /* NULL: none */
	/* what the first two point into */
	const char *scenes[OPTIONS_SCENES_MAX + 1];
	int scene_count;
	const char *bench_words[OPTIONS_BENCH_WORDS_MAX + 1];
	int bench_word_count;
	glob_t found;
};

/* Fills options, which stay where they are and point into argv. A COMMAND_* exit code; what is wrong was
 * printed. */
int options_read(struct options *options, int argc, char **argv);

void options_free(struct options *options);

#endif
