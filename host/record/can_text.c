/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/can_text.h"

#include <stdlib.h>

#include "common/base/text.h"
#include "common/link/candump.h"
#include "host/record/can_formats.h"

enum { HEAD_BYTES = 512 };
static const size_t CAN_TEXT_MOST = (size_t)2 << 30;

static void put_line(struct can_text *text, const char *line, size_t length)
{
	text->bytes += length;
	if (text->bytes <= CAN_TEXT_MOST)
		fwrite(line, 1, length, text->out);
}

void can_text_put(struct can_text *text, const struct frame *frame, unsigned channel)
{
	char line[CANDUMP_LINE_MAX], name[16];

	snprintf(name, sizeof(name), "can%u", channel % 1000);
	put_line(text, line, candump_format(line, frame, name));
	text->frames++;
}

void can_text_corrupt(struct can_text *text, unsigned long long at)
{
	char line[64];

	put_line(text, line, (size_t)snprintf(line, sizeof(line), "(no frame at %llu\n", at));
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
	struct text made;
	int error;

	if (format == FORMATS)
		return 0;
	if (text_open(&made) != 0)
		return source_no_memory(message, source->file);
	text.out = made.out;
	error = formats[format].text(&text, message);
	if (!error && text.bytes > CAN_TEXT_MOST)
		error = source_refuse(
		        message, DT_E_RANGE, source->file, 0,
		        "a CAN log of more than 2 GiB as candump text: cut it, or save it as such");
	if (text_close(&made, error) != 0)
		return error ? error : source_no_memory(message, source->file);
	source_replace(source, made.bytes, made.size);
	return 0;
}
