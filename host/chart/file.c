/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/chart/file.h"

#include <stdlib.h>
#include <string.h>

#include "host/base/atomic_file.h"
#include "host/report/picture.h"

enum { PATH = 4096 };

int file_begin(struct text *text, char *message)
{
	int result = text_open(text);

	if (result != 0)
		snprintf(message, CHART_MESSAGE_MAX, "%s", error_text(result));
	return result;
}

void file_drop(struct text *text)
{
	if (text->out && text_close(text, 0) != 0)
		return;
	free(text->bytes);
	*text = (struct text){0};
}

/* What was written so far is in bytes, size. */
static int file_finish(struct text *text, char *message)
{
	int result = text_close(text, 0);

	if (result != 0)
		snprintf(message, CHART_MESSAGE_MAX, "%s", error_text(result));
	return result;
}

static int put_named(const char *bytes, size_t length, const char *folder, const char *kind, const char *name,
                     const char *extension, char *message)
{
	char path[PATH];

	if ((size_t)snprintf(path, sizeof(path), "%s/%s-%s.%s", folder, kind, name, extension) < sizeof(path))
		return atomic_file_write(path, bytes, length, message, CHART_MESSAGE_MAX);
	snprintf(message, CHART_MESSAGE_MAX, "%.300s: the name is too long", folder);
	return DT_E_SYSTEM;
}

int file_write(struct text *text, const char *folder, const char *kind, const char *name,
               const char *extension, char *message)
{
	int status = file_finish(text, message);

	return status ? status : put_named(text->bytes, text->size, folder, kind, name, extension, message);
}

int file_draw(struct text *script, const char *folder, const char *kind, const char *name, char *message)
{
	char *svg = NULL;
	int status = file_finish(script, message);

	if (!status)
		status = picture_draw(script->bytes, script->size, &svg, message, CHART_MESSAGE_MAX);
	if (!status)
		status = put_named(svg, strlen(svg), folder, kind, name, "svg", message);
	free(svg);
	return status;
}
