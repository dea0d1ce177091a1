/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/fuzz/fuzz.h"

#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

void fuzz_fail(const char *format, ...)
{
	va_list arguments;

	va_start(arguments, format);
	vfprintf(stderr, format, arguments);
	va_end(arguments);
	fputc('\n', stderr);
	abort();
}

const char *fuzz_file(const uint8_t *bytes, size_t size)
{
	static char path[64];
	static int fd = -1;

	if (fd < 0) {
		fd = memfd_create("fuzz", 0);
		snprintf(path, sizeof(path), "/proc/self/fd/%d", fd);
	}
	if (fd < 0 || ftruncate(fd, 0) != 0 || pwrite(fd, bytes, size, 0) != (ssize_t)size)
		fuzz_fail("no file");
	return path;
}

void fuzz_check_message(const char *message, const char *path)
{
	if (strncmp(message, path, strlen(path)) != 0 || strchr(message, '\n') != NULL)
		fuzz_fail("no line that names the file: \"%s\"", message);
}

static bool other(double a, double b)
{
	return !(a == b || (isnan(a) && isnan(b)));
}

static bool channel_differs(const struct channel *a, const struct channel *b)
{
	if (strcmp(a->name, b->name) != 0 || other(a->rate_hz, b->rate_hz) || other(a->start_s, b->start_s) ||
	    other(a->range_g, b->range_g) || a->count != b->count)
		return true;
	for (size_t k = 0; k < a->count; k++)
		if (other(a->value_g[k], b->value_g[k]))
			return true;
	return false;
}

void fuzz_check_equal(const struct record *a, const struct record *b, const char *what)
{
	if (a->channel_count != b->channel_count)
		fuzz_fail("%s: %zu channels, were %zu", what, b->channel_count, a->channel_count);
	for (size_t c = 0; c < a->channel_count; c++)
		if (channel_differs(&a->channels[c], &b->channels[c]))
			fuzz_fail("%s: channel %s differs", what, a->channels[c].name);
	if (a->is_drop != b->is_drop || a->drop_id != b->drop_id || a->marks != b->marks ||
	    a->first_tick_ms != b->first_tick_ms || a->last_tick_ms != b->last_tick_ms ||
	    other(a->trigger_s, b->trigger_s) || other(a->frame_speed_m_s, b->frame_speed_m_s) ||
	    a->camera_frame != b->camera_frame || a->crc32 != b->crc32 || a->crc_known != b->crc_known)
		fuzz_fail("%s: what is known of the drop differs", what);
}
