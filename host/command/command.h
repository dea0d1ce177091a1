/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_COMMAND_COMMAND_H
#define DT_HOST_COMMAND_COMMAND_H
/*
 * The subcommands of `droptower`, one file each. A command gets its own argv (argv[0] is its name) and
 * returns the program's exit code. Results go to stdout, progress and errors to stderr.
 */
#include <stdbool.h>

#include "common/base/option.h"
#include "host/base/interrupt.h"

enum command_exit {
	COMMAND_DONE = 0,
	COMMAND_USAGE = 2,
	COMMAND_INPUT = 3,   /* input unusable, or --strict and a flag is set */
	COMMAND_LINK = 4,    /* link or hardware */
	COMMAND_REFUSED = 5, /* by an interlock, or stopped by the operator */
	COMMAND_LIMIT = 6,   /* a limit of the test plan is not met, or undecided */
};

int command_run(int argc, char **argv);
int command_analyze(int argc, char **argv);
int command_batch(int argc, char **argv);
int command_srs(int argc, char **argv);
int command_replay(int argc, char **argv);
int command_convert(int argc, char **argv);
int command_ctl(int argc, char **argv);
int command_bridge(int argc, char **argv);
int command_chart(int argc, char **argv);
int command_model(int argc, char **argv);
int command_fit(int argc, char **argv);
int command_scene(int argc, char **argv);
int command_series(int argc, char **argv);
int command_report(int argc, char **argv);
int command_verify(int argc, char **argv);
int command_serve(int argc, char **argv);

/* What `droptower --version` prints: this program, its wire, and the libraries that run with it. */
int command_version(void);

/* What `droptower --schema` prints: the JSON Schema of results. */
int command_schema(void);

/* One line to stderr: "droptower: ..." */
void command_error(const char *format, ...) __attribute__((format(printf, 1, 2)));

/* Wrong usage: the line, then "try 'droptower NAME --help'"; returns COMMAND_USAGE. */
int command_usage(const char *name, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* Standard output did not take all: says why and returns COMMAND_INPUT. That its reader has gone, as head
 * does, is no error: nothing is said, and COMMAND_DONE returned. */
int command_output_failed(const char *why);

/* Whether out, which is to be written, is the file that is read: says so. NULL is none. */
bool command_is_input(const char *name, const char *out, const char *in);

/* A call on a session or link failed with result: says so and returns COMMAND_LINK. */
int command_link_failed(const char *doing, int result);

/* A file at once, - is standard output. COMMAND_DONE, or COMMAND_INPUT and said why. */
int command_write(const char *file, const void *bytes, size_t size);

/* A tower that was not heard, or not set up (tower_setup.h): says why, returns COMMAND_LINK or _REFUSED. */
int command_tower_failed(int result, const char *message);

/* Interrupted before anything was released: says so and returns COMMAND_REFUSED. */
int command_stopped(void);

/* --angle and --height, within what a scene may have; --language, a struct language *. */
option_take command_angle, command_height, command_language;

#define COMMAND_LANGUAGE_ROW(in, at)                          \
	OPTION_TAKEN(                                         \
	        "language", "CODE", in, at, command_language, \
	        "of page and PDF: en, or de for German with a decimal comma; JSON and CSV stay English")

/* A text of a page that has no entry in its language (struct translation): says so. */
void command_untranslated(void *context, const char *text);

#endif
