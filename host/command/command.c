/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/command/command.h"

#include <getopt.h>
#include <signal.h>
#include <stdarg.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "common/error.h"
#include "common/scenes/scene.h"

static volatile sig_atomic_t interrupted;

void command_error(const char *format, ...)
{
	va_list arguments;

	va_start(arguments, format);
	fputs("droptower: ", stderr);
	vfprintf(stderr, format, arguments);
	fputc('\n', stderr);
	va_end(arguments);
}

int command_usage(const char *name, const char *format, ...)
{
	va_list arguments;

	va_start(arguments, format);
	fprintf(stderr, "droptower: %s: ", name);
	vfprintf(stderr, format, arguments);
	fprintf(stderr, "; try 'droptower %s --help'\n", name);
	va_end(arguments);
	return COMMAND_USAGE;
}

int command_option(const char *name, const char *word)
{
	if (optopt == 0 || strncmp(word, "--", 2) != 0)
		return command_usage(name, "no option '%s'", word);
	if (strchr(word, '=') != NULL)
		return command_usage(name, "option '%s' takes no value", word);
	return command_usage(name, "option '%s' lacks its value", word);
}

bool command_is_input(const char *name, const char *out, const char *in)
{
	struct stat written, read;

	if (out == NULL || stat(out, &written) != 0 || stat(in, &read) != 0 || !S_ISREG(read.st_mode) ||
	    written.st_dev != read.st_dev || written.st_ino != read.st_ino)
		return false;
	command_usage(name, "'%s' is read, expected another file to write", out);
	return true;
}

int command_link_failed(const char *doing, int result)
{
	command_error("%s: %s", doing, error_text(result));
	return COMMAND_LINK;
}

static void on_signal(int number)
{
	interrupted = number;
}

void command_catch_signals(void)
{
	struct sigaction action;

	memset(&action, 0, sizeof(action));
	action.sa_handler = on_signal;
	sigemptyset(&action.sa_mask);
	sigaction(SIGINT, &action, NULL);
	sigaction(SIGTERM, &action, NULL);
	signal(SIGPIPE, SIG_IGN);
}

int command_interrupted(void)
{
	return interrupted != 0;
}

int command_stopped(void)
{
	command_error("interrupted, nothing was released");
	return COMMAND_REFUSED;
}

bool command_is_number(const char *text, double min, double max, double *value)
{
	char *end;
	double number = strtod(text, &end);

	if (end == text || *end != '\0' || !(number >= min && number <= max))
		return false;
	*value = number;
	return true;
}

int command_number(const char *name, const char *option, const char *text, double min, double max,
                   double *value)
{
	if (command_is_number(text, min, max, value))
		return COMMAND_DONE;
	return command_usage(name, "--%s is '%s', expected a number from %g to %g", option, text, min, max);
}

static int of_the_drop(const char *name, const char *option, const char *key, const char *text, double *value)
{
	double min, max;

	scene_limits("drop", key, &min, &max);
	return command_number(name, option, text, min, max, value);
}

int command_angle(const char *name, const char *text, double *angle_deg)
{
	return of_the_drop(name, "angle", "angle_deg", text, angle_deg);
}

int command_height(const char *name, const char *text, double *height_m)
{
	return of_the_drop(name, "height", "height_m", text, height_m);
}

int command_drop(const char *name, const char *text, unsigned *number)
{
	double value;

	if (!command_is_number(text, 1, 1e9, &value) || value > floor(value))
		return command_usage(name, "--drop is '%s', expected the number of a drop in its log, from 1",
		                     text);
	*number = (unsigned)value;
	return COMMAND_DONE;
}
