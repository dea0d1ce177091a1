/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/can_text.h"

#include <errno.h>
#include <string.h>
#include <sys/mman.h>

#include "common/base/process.h"
#include "common/link/candump.h"
#include "host/base/mapped.h"
#include "host/record/can_formats.h"

enum { HEAD_BYTES = 512 };

void can_text_put(struct can_text *text, const struct frame *frame, unsigned channel)
{
	char line[CANDUMP_LINE_MAX], name[16];
	size_t length;

	snprintf(name, sizeof(name), "can%u", channel % 1000);
	length = candump_format(line, frame, name);
	fwrite(line, 1, length, text->out);
	mapped_seen(length); /* of the source, nearly */
	text->frames++;
}

void can_text_corrupt(struct can_text *text, unsigned long long at)
{
	fprintf(text->out, "(no frame at %llu\n", at);
	text->corrupt++;
}

static const struct {
	bool (*is)(const char *head, size_t length);
	int (*text)(struct can_text *text, char *message);
} formats[] = {{can_asc_is, can_asc}, {can_pcap_is, can_pcap}, {can_blf_is, can_blf}};
enum { FORMATS = sizeof(formats) / sizeof(formats[0]) };

static size_t format_of(const char *head, size_t length)
{
	size_t i = 0;

	while (i < FORMATS && !formats[i].is(head, length < HEAD_BYTES ? length : HEAD_BYTES))
		i++;
	return i;
}

bool can_text_is(const char *head, size_t length)
{
	return format_of(head, length) < FORMATS;
}

int can_text(struct source *source, char message[READ_MESSAGE_MAX])
{
	struct can_text text = {.source = source};
	size_t format = format_of(source->bytes, source->size);
	int error, fd;

	if (format == FORMATS)
		return 0;
	fd = process_scratch();
	if (fd < 0)
		fd = memfd_create("log", MFD_CLOEXEC);
	text.out = fd >= 0 ? fdopen(fd, "w") : NULL;
	if (text.out == NULL)
		return source_refuse(message, DT_E_SYSTEM, source->file, 0, "%s", strerror(errno));
	error = formats[format].text(&text, message);
	if (!error && fflush(text.out) != 0)
		error = source_refuse(message, DT_E_SYSTEM, source->file, 0, "%s", strerror(errno));
	if (!error)
		error = source_remake(source, fd, message);
	fclose(text.out);
	return error;
}
