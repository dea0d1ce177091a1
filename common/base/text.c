/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "common/base/text.h"

#include <errno.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { ROOM_BYTES = 4096 };

static ssize_t text_put(void *context, const char *bytes, size_t size)
{
	struct text *text = context;
	size_t room = text->room;
	char *more;

	while (room - text->size <= size && room < SIZE_MAX / 2)
		room *= 2;
	more = room > text->room ? realloc(text->bytes, room) : text->bytes;
	if (more == NULL || room - text->size <= size)
		return 0; /* the stream notes an error */
	memcpy(more + text->size, bytes, size);
	text->bytes = more;
	text->room = room;
	text->size += size;
	more[text->size] = '\0';
	return (ssize_t)size;
}

int text_open(struct text *text)
{
	*text = (struct text){.room = ROOM_BYTES, .bytes = calloc(1, ROOM_BYTES)};
	if (text->bytes != NULL)
		text->out = fopencookie(text, "w", (cookie_io_functions_t){.write = text_put});
	if (text->out != NULL)
		return 0;
	free(text->bytes);
	*text = (struct text){0};
	return DT_E_MEMORY;
}

int text_close(struct text *text, int result)
{
	if (stream_close(text->out) != 0 && result == 0)
		result = DT_E_MEMORY;
	text->out = NULL;
	if (result != 0) {
		free(text->bytes);
		*text = (struct text){0};
	}
	return result;
}

int stream_close(FILE *out)
{
	bool failed = ferror(out) != 0 || fflush(out) != 0;
	int before = errno;

	if (fclose(out) != 0 && !failed)
		return DT_E_SYSTEM;
	errno = before;
	return failed ? DT_E_SYSTEM : 0;
}
