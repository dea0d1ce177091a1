/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/chart/file.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "host/report/picture.h"

enum { PATH = 4096 };

int file_begin(struct file_text *text, char *message)
{
	*text = (struct file_text){0};
	text->stream = open_memstream(&text->bytes, &text->length);
	if (text->stream)
		return 0;
	snprintf(message, CHART_MESSAGE_MAX, "%s", error_text(DT_E_MEMORY));
	return DT_E_MEMORY;
}

void file_drop(struct file_text *text)
{
	if (text->stream)
		fclose(text->stream);
	free(text->bytes);
	*text = (struct file_text){0};
}

/* What was written so far is in bytes, length. */
static int finish(struct file_text *text, char *message)
{
	int failed = fclose(text->stream);

	text->stream = NULL;
	if (!failed)
		return 0;
	snprintf(message, CHART_MESSAGE_MAX, "%s", error_text(DT_E_MEMORY));
	return DT_E_MEMORY;
}

static int put(const char *bytes, size_t length, const char *path)
{
	char beside[PATH + 8];
	FILE *file;
	int failed;

	snprintf(beside, sizeof(beside), "%s.part", path);
	file = fopen(beside, "w");
	if (!file)
		return -1;
	failed = fwrite(bytes, 1, length, file) != length;
	failed |= fclose(file) != 0;
	if (!failed && rename(beside, path) == 0)
		return 0;
	failed = errno;
	unlink(beside);
	errno = failed;
	return -1;
}

static int put_named(const char *bytes, size_t length, const char *folder, const char *kind, const char *name,
                     const char *extension, char *message)
{
	char path[PATH];

	if ((size_t)snprintf(path, sizeof(path), "%s/%s-%s.%s", folder, kind, name, extension) >=
	    sizeof(path))
		errno = ENAMETOOLONG;
	else if (put(bytes, length, path) == 0)
		return 0;
	snprintf(message, CHART_MESSAGE_MAX, "%.300s: %s", path, strerror(errno));
	return DT_E_SYSTEM;
}

int file_write(struct file_text *text, const char *folder, const char *kind, const char *name,
               const char *extension, char *message)
{
	int status = finish(text, message);

	return status ? status : put_named(text->bytes, text->length, folder, kind, name, extension, message);
}

int file_draw(struct file_text *script, const char *folder, const char *kind, const char *name, char *message)
{
	char *svg = NULL;
	int status = finish(script, message);

	if (!status)
		status = picture_draw(script->bytes, script->length, &svg, message, CHART_MESSAGE_MAX);
	if (!status)
		status = put_named(svg, strlen(svg), folder, kind, name, "svg", message);
	free(svg);
	return status;
}
