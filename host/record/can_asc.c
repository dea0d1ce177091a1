/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Vector's text of a CAN log: base hex or dec, absolute or relative times. What is no frame (statistics,
 * J1939TP, error frames) is left out.
 */
#include <math.h>
#include <string.h>
#include <strings.h>

#include "common/base/number.h"
#include "common/link/transport.h"
#include "host/record/can_formats.h"

enum { WORDS_MAX = 16 + FRAME_DATA_MAX };

struct asc {
	struct can_text *text;
	bool decimal, relative;
	double time_s;
	const char *word[WORDS_MAX];
	size_t length[WORDS_MAX], words;
};

bool can_asc_is(const char *head, size_t length)
{
	return length > 5 && strncasecmp(head, "date ", 5) == 0 &&
	       (memmem(head, length, "base hex", 8) != NULL || memmem(head, length, "base dec", 8) != NULL);
}

static void split(struct asc *asc, const struct source_line *line)
{
	asc->words = 0;
	for (size_t at = 0; at < line->length && asc->words < WORDS_MAX; at++) {
		size_t begin = at;

		while (at < line->length && line->text[at] != ' ' && line->text[at] != '\t')
			at++;
		if (at == begin)
			continue;
		asc->word[asc->words] = line->text + begin;
		asc->length[asc->words++] = at - begin;
	}
}

static bool word_is(const struct asc *asc, size_t i, const char *word)
{
	return i < asc->words && asc->length[i] == strlen(word) &&
	       strncasecmp(asc->word[i], word, asc->length[i]) == 0;
}

/* A whole number; false where it is none, or too large. */
static bool asc_whole(const struct asc *asc, size_t i, unsigned base, unsigned long max, unsigned long *value)
{
	unsigned long sum = 0;

	if (i >= asc->words || asc->length[i] == 0)
		return false;
	for (size_t k = 0; k < asc->length[i]; k++) {
		static const char digits[] = "0123456789abcdef";
		const char *digit = memchr(digits, asc->word[i][k] | 0x20, base);

		if (digit == NULL)
			return false;
		sum = sum * base + (unsigned long)(digit - digits);
		if (sum > max)
			return false;
	}
	*value = sum;
	return true;
}

static bool asc_id(struct asc *asc, size_t i, struct frame *frame)
{
	unsigned long id;
	bool extended;

	if (i >= asc->words)
		return false;
	extended = asc->length[i] > 1 && (asc->word[i][asc->length[i] - 1] | 0x20) == 'x';
	asc->length[i] -= extended;
	if (!asc_whole(asc, i, asc->decimal ? 10 : 16, extended ? 0x1FFFFFFF : 0x7FF, &id))
		return false;
	frame->id = (uint32_t)id;
	frame->flags |= extended ? FRAME_EXTENDED : 0;
	return true;
}

static bool asc_data(const struct asc *asc, size_t from, unsigned long count, struct frame *frame)
{
	for (unsigned long k = 0; k < count; k++) {
		unsigned long byte;

		if (!asc_whole(asc, from + k, asc->decimal ? 10 : 16, 255, &byte))
			return false;
		frame->data[k] = (uint8_t)byte;
	}
	frame->length = (uint8_t)count;
	return true;
}

/* time channel id Rx d 8 01 02 ... */
static bool asc_classic(struct asc *asc, struct frame *frame)
{
	unsigned long length = 0;

	if (!asc_id(asc, 2, frame))
		return false;
	if (word_is(asc, 4, "r")) {
		frame->flags |= FRAME_REMOTE;
		frame->length = asc_whole(asc, 5, 16, 8, &length) ? (uint8_t)length : 0;
		return true;
	}
	return asc_whole(asc, 5, 16, 15, &length) && asc_data(asc, 6, length < 8 ? length : 8, frame);
}

/* time CANFD channel Rx id [name] brs esi dlc length 01 02 ... */
static bool asc_fd(struct asc *asc, struct frame *frame)
{
	unsigned long brs, esi, length;
	size_t at = 5;

	if (!asc_id(asc, 4, frame))
		return false;
	at += !(asc_whole(asc, 5, 2, 1, &brs) && asc_whole(asc, 6, 2, 1, &esi)); /* a symbolic name */
	if (!asc_whole(asc, at, 2, 1, &brs) || !asc_whole(asc, at + 1, 2, 1, &esi) ||
	    !asc_whole(asc, at + 3, 10, FRAME_DATA_MAX, &length))
		return false;
	frame->flags |= (uint8_t)(FRAME_FD | (brs ? FRAME_BRS : 0) | (esi ? FRAME_ESI : 0));
	return asc_data(asc, at + 4, length, frame);
}

static void asc_line(struct asc *asc, const struct source_line *line)
{
	struct frame frame = {0};
	unsigned long channel;
	double time_s;
	bool fd, right;

	split(asc, line);
	if (word_is(asc, 0, "base")) {
		asc->decimal = word_is(asc, 1, "dec");
		asc->relative = word_is(asc, 3, "relative");
	}
	if (asc->words < 2 || !number_parse(asc->word[0], asc->length[0], '.', &time_s) || !(time_s >= 0) ||
	    time_s > 1e11)
		return;
	asc->time_s = asc->relative ? asc->time_s + time_s : time_s;
	fd = word_is(asc, 1, "CANFD");
	if (!asc_whole(asc, fd ? 2 : 1, 10, 999, &channel) ||
	    !(word_is(asc, 3, "Rx") || word_is(asc, 3, "Tx")) || (!fd && asc->words < 5))
		return; /* of something else */
	if (!fd && !word_is(asc, 4, "d") && !word_is(asc, 4, "r"))
		return;
	frame.time_us = asc->time_s < 9e12 ? llround(asc->time_s * 1e6) : 0;
	right = fd ? asc_fd(asc, &frame) : asc_classic(asc, &frame);
	if (right && link_frame_valid(&frame))
		can_text_put(asc->text, &frame, (unsigned)channel);
	else
		can_text_corrupt(asc->text, line->number);
}

int can_asc(struct can_text *text, char message[READ_MESSAGE_MAX])
{
	struct asc asc = {.text = text};
	struct source_line line = {0};

	while (source_next_line(text->source, &line))
		asc_line(&asc, &line);
	if (text->frames > 0)
		return 0;
	return source_refuse(message, DT_E_EMPTY, text->source->file, 0,
	                     "a CAN log of Vector (ASC) without a CAN frame");
}
