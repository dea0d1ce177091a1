/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CONSOLE_OPTIONS_H
#define DT_HOST_CONSOLE_OPTIONS_H
/*
 * What the console is started with. host/command/serve.h has the options.
 */
#include "host/command/serve.h"
#include "host/console/job.h"
#include "host/console/http.h"
#include "host/console/tower.h"
#include "host/console/work.h"

struct options {
	struct tower_options tower;
	struct work_options work;
	struct http_options http;      /* address and port */
	struct serve_arguments given;  /* what the others point into */
	char *found[SERVE_SCENES_MAX]; /* scenes that come along; ours */
};

/* Fills options, which stay where they are and point into argv. OPTIONS_READ, or the exit code; what is wrong
 * was printed. */
int options_read(struct options *options, int argc, char **argv);

void options_free(struct options *options);

#endif
