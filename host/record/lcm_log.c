/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/lcm_log.h"

#include <string.h>

enum { HEADER_BYTES = 28, TIME_AT = 12, CHANNEL_AT = 20, DATA_AT = 24, LOOK_BYTES = 65536 };

static const uint8_t sync_word[] = {0xED, 0xA1, 0xDA, 0x01};

static uint32_t big_endian(const uint8_t *p)
{
	return (uint32_t)p[0] << 24 | (uint32_t)p[1] << 16 | (uint32_t)p[2] << 8 | p[3];
}

static bool sync_at(const struct source *source, size_t at)
{
	return source->size - at >= sizeof(sync_word) &&
	       memcmp(source->bytes + at, sync_word, sizeof(sync_word)) == 0;
}

/* A damaged length swallows the events behind it: it is believed if the next event or the end follows, or
 * if there is no sync word inside. */
static bool length_holds(const struct source *source, size_t data, size_t size)
{
	size_t behind = data + size;

	return behind == source->size || sync_at(source, behind) ||
	       !memmem(source->bytes + data, size, sync_word, sizeof(sync_word));
}

/* The event at *at, which moves behind it; false when there is none. */
static bool event_at(const struct source *source, size_t *at, struct lcm_log_event *event)
{
	const uint8_t *header = (const uint8_t *)source->bytes + *at;
	size_t left = source->size - *at, channel, data;

	if (!sync_at(source, *at) || left < HEADER_BYTES)
		return false;
	channel = big_endian(header + CHANNEL_AT);
	data = big_endian(header + DATA_AT);
	left -= HEADER_BYTES;
	if (channel == 0 || channel > LCM_LOG_CHANNEL_MAX || channel > left || data > left - channel ||
	    !length_holds(source, *at + HEADER_BYTES + channel, data))
		return false;
	event->time_us =
	        (int64_t)((uint64_t)big_endian(header + TIME_AT) << 32 | big_endian(header + TIME_AT + 4));
	memcpy(event->channel, header + HEADER_BYTES, channel);
	event->channel[channel] = '\0';
	event->data = header + HEADER_BYTES + channel;
	event->size = data;
	*at += HEADER_BYTES + channel + data;
	return true;
}

bool lcm_log_is(const struct source *source)
{
	size_t look = source->size < LOOK_BYTES ? source->size : LOOK_BYTES;

	return memmem(source->bytes, look, sync_word, sizeof(sync_word)) != NULL;
}

bool lcm_log_next(const struct source *source, struct lcm_log_walk *walk, struct lcm_log_event *event)
{
	bool in_step = true;

	while (walk->at < source->size) {
		if (event_at(source, &walk->at, event)) {
			walk->events++;
			return true;
		}
		walk->skipped += in_step;
		in_step = false;
		walk->at++;
	}
	return false;
}
