/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/command/command.h"

#include <errno.h>
#include <limits.h>
#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/base/number.h"
#include "common/error.h"
#include "common/scenes/scene.h"
#include "host/base/atomic_file.h"
#include "host/report/language.h"

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
	int code;

	va_start(arguments, format);
	code = option_vwrong("droptower", name, format, arguments);
	va_end(arguments);
	return code;
}

int command_output_failed(const char *why)
{
	struct pollfd out = {.fd = STDOUT_FILENO};

	if (poll(&out, 1, 0) > 0 && (out.revents & POLLERR) != 0)
		return COMMAND_DONE;
	command_error("standard output: %s", why);
	return COMMAND_INPUT;
}

int command_write(const char *file, const void *bytes, size_t size)
{
	char message[PATH_MAX + 128];

	if (strcmp(file, "-") == 0)
		return fwrite(bytes, 1, size, stdout) == size && fflush(stdout) == 0
		               ? COMMAND_DONE
		               : command_output_failed(strerror(errno));
	if (atomic_file_write(file, bytes, size, message, sizeof(message)) == 0)
		return COMMAND_DONE;
	command_error("%s", message);
	return COMMAND_INPUT;
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

int command_tower_failed(int result, const char *message)
{
	static const int refusals[] = {DT_E_STATE, DT_E_RANGE, DT_E_HASH, DT_E_PARAMETERS};
	bool refused = interrupt_came();

	command_error("%s", message);
	for (size_t i = 0; i < sizeof(refusals) / sizeof(refusals[0]); i++)
		refused |= result == refusals[i];
	return refused ? COMMAND_REFUSED : COMMAND_LINK;
}

int command_stopped(void)
{
	command_error("interrupted, nothing was released");
	return COMMAND_REFUSED;
}

static int within_scene(const struct option_table *table, const char *name, const char *key, const char *text,
                        void *field)
{
	double min, max;

	scene_limits("drop", key, &min, &max);
	if (number_read(text, min, max, field))
		return OPTIONS_READ;
	return option_wrong(table, "--%s is '%s', expected a number from %g to %g", name, text, min, max);
}

int command_angle(const struct option_table *table, const char *name, const char *text, void *field)
{
	return within_scene(table, name, "angle_deg", text, field);
}

int command_language(const struct option_table *table, const char *name, const char *text, void *field)
{
	const struct language *language = language_find(text);

	if (language == NULL)
		return option_wrong(table, "--%s is '%s', expected en or de", name, text);
	*(const struct language **)field = language;
	return OPTIONS_READ;
}

void command_untranslated(void *context, const char *text)
{
	(void)context;
	command_error("no translation: '%s'", text);
}

int command_height(const struct option_table *table, const char *name, const char *text, void *field)
{
	return within_scene(table, name, "height_m", text, field);
}
