/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/lcm_log.h"

#include <string.h>

enum { HEADER_BYTES = 28, TIME_AT = 12, CHANNEL_AT = 20, DATA_AT = 24, SYNC_BYTES = 4, LOOK_BYTES = 65536 };

static const uint8_t sync_word[SYNC_BYTES] = {0xED, 0xA1, 0xDA, 0x01};

static uint32_t big_endian(const uint8_t *p)
{
	return (uint32_t)p[0] << 24 | (uint32_t)p[1] << 16 | (uint32_t)p[2] << 8 | p[3];
}

static const uint8_t *bytes_at(struct log_file *log, uint64_t at, size_t want, size_t *held)
{
	return (const uint8_t *)log_file_get(log, at, want, held);
}

static bool sync_at(struct log_file *log, uint64_t at)
{
	size_t held;
	const uint8_t *bytes = bytes_at(log, at, SYNC_BYTES, &held);

	return held >= SYNC_BYTES && memcmp(bytes, sync_word, SYNC_BYTES) == 0;
}

/* A damaged length swallows the events behind it: it is believed if the next event or the end follows, or
 * if there is no sync word inside. */
static bool length_holds(struct log_file *log, uint64_t data, size_t size, uint64_t end)
{
	const uint8_t *bytes;
	size_t held;

	if (data + size == end || sync_at(log, data + size))
		return true;
	bytes = bytes_at(log, data, size, &held);
	return held >= size && !memmem(bytes, size, sync_word, SYNC_BYTES);
}

/* Its length leads beyond the log's end, and nothing that is there follows it: the end has cut it. */
static bool lcm_log_is_cut(struct log_file *log, uint64_t data, size_t size, uint64_t end)
{
	const uint8_t *bytes;
	size_t held;

	if (end != log->size)
		return false;
	bytes = bytes_at(log, data, size, &held);
	return held >= size && !memmem(bytes, size, sync_word, SYNC_BYTES);
}

/* The event at *at, which moves behind it; false when there is none before end. */
static bool event_at(struct log_file *log, uint64_t *at, uint64_t end, struct lcm_log_event *event)
{
	size_t held, channel, data;
	const uint8_t *header = bytes_at(log, *at, HEADER_BYTES + LCM_LOG_CHANNEL_MAX, &held);
	uint64_t left = end - *at;

	if (held < HEADER_BYTES || left < HEADER_BYTES || memcmp(header, sync_word, SYNC_BYTES) != 0)
		return false;
	channel = big_endian(header + CHANNEL_AT);
	data = big_endian(header + DATA_AT);
	left -= HEADER_BYTES;
	if (channel == 0 || channel > LCM_LOG_CHANNEL_MAX || channel > left)
		return false;
	event->cut = data > left - channel;
	if (event->cut)
		data = (size_t)(left - channel);
	event->time_us =
	        (int64_t)((uint64_t)big_endian(header + TIME_AT) << 32 | big_endian(header + TIME_AT + 4));
	memcpy(event->channel, header + HEADER_BYTES, channel);
	event->channel[channel] = '\0';
	event->at = *at;
	*at += HEADER_BYTES + channel;
	/* all of it and the next sync word into the window at once */
	(void)bytes_at(log, event->at, HEADER_BYTES + channel + data + SYNC_BYTES, &held);
	if (event->cut ? !lcm_log_is_cut(log, *at, data, end) : !length_holds(log, *at, data, end)) {
		*at = event->at;
		return false;
	}
	event->data = bytes_at(log, *at, data, &held);
	event->size = data;
	if (held < data)
		event->data = NULL;
	*at += data;
	return true;
}

static bool lcm_log_looks(struct log_file *log)
{
	size_t held;
	const uint8_t *head = bytes_at(log, 0, LOOK_BYTES, &held), *end;

	if (held == 0)
		return false;
	/* Text has none of its bytes, and a single one is looked for many times faster. */
	end = head + (held < LOOK_BYTES ? held : LOOK_BYTES);
	head = memchr(head, sync_word[0], (size_t)(end - head));
	return head != NULL && memmem(head, (size_t)(end - head), sync_word, SYNC_BYTES) != NULL;
}

bool lcm_log_is(struct log_file *log)
{
	if (log->kind == LOG_UNKNOWN)
		log->kind = lcm_log_looks(log) ? LOG_LCM : LOG_OTHER;
	return log->kind == LOG_LCM;
}

/* To the next byte that a sync word may begin with. */
static void lcm_log_step(struct log_file *log, struct lcm_log_walk *walk, uint64_t end)
{
	size_t held;
	const uint8_t *bytes = bytes_at(log, ++walk->at, LOOK_BYTES, &held), *found;

	if (walk->at >= end)
		return;
	if (held > end - walk->at)
		held = (size_t)(end - walk->at);
	found = held > 0 ? memchr(bytes, sync_word[0], held) : NULL;
	walk->at += found != NULL ? (size_t)(found - bytes) : held;
}

bool lcm_log_next(struct log_file *log, struct lcm_log_walk *walk, struct lcm_log_event *event)
{
	uint64_t end = walk->end != 0 && walk->end < log->size ? walk->end : log->size;
	bool in_step = true;

	while (walk->at < end && log->failed == 0) {
		if (event_at(log, &walk->at, end, event)) {
			walk->events++;
			walk->skipped += event->cut;
			return true;
		}
		walk->skipped += in_step;
		in_step = false;
		lcm_log_step(log, walk, end);
	}
	return false;
}
