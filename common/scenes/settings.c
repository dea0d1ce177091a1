/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "common/scenes/settings.h"

#include <errno.h>
#include <ini.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

static void settings_say(const struct settings *settings, int used, const char *format, va_list arguments)
{
	vsnprintf(settings->message + used, (size_t)(SETTINGS_MESSAGE_MAX - used), format, arguments);
}

int settings_fail(struct settings *settings, int code, const char *format, ...)
{
	int used = snprintf(settings->message, SETTINGS_MESSAGE_MAX, "%.300s:%d: ", settings->file,
	                    settings->line);
	va_list arguments;

	va_start(arguments, format);
	settings_say(settings, used, format, arguments);
	va_end(arguments);
	settings->result = code;
	return 0;
}

int settings_refuse(const struct settings *settings, int code, const char *format, ...)
{
	int used = snprintf(settings->message, SETTINGS_MESSAGE_MAX, "%.300s: ", settings->file);
	va_list arguments;

	va_start(arguments, format);
	settings_say(settings, used, format, arguments);
	va_end(arguments);
	return code;
}

/* fgets for inih that counts the lines: Debian's build does not tell the handler where it is. */
static char *read_line(char *text, int size, void *user)
{
	struct settings *settings = user;

	if (fgets(text, size, settings->in) == NULL)
		return NULL;
	settings->line++;
	if (strchr(text, '\n') == NULL && !feof(settings->in)) { /* inih would take the rest for a new line */
		settings_fail(settings, DT_E_FORMAT, "a line longer than %d characters", size - 2);
		return NULL;
	}
	return text;
}

static int settings_read_entry(void *user, const char *section, const char *name, const char *value)
{
	struct settings *settings = user;

	return settings->result == 0 ? settings->entry(settings, section, name, value) : 0;
}

int settings_read(struct settings *settings)
{
	int line;

	settings->line = 0;
	settings->result = 0;
	settings->in = fopen(settings->file, "re");
	if (settings->in == NULL)
		return settings_refuse(settings, DT_E_SYSTEM, "%s", strerror(errno));
	line = ini_parse_stream(read_line, settings, settings_read_entry, settings);
	fclose(settings->in);
	if (settings->result != 0)
		return settings->result;
	settings->line = line;
	if (line != 0)
		settings_fail(settings, DT_E_FORMAT, "not a [section] or key = value");
	return settings->result;
}
