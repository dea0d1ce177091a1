/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/record.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/base/wide.h"
#include "common/wire.h"
#include "host/base/mapped.h"

void record_init(struct record *record)
{
	*record = (struct record){.trigger_s = NAN, .frame_speed_m_s = NAN};
}

void record_free(struct record *record)
{
	for (size_t i = 0; i < record->channel_count; i++) {
		mapped_free(record->channels[i].value_g);
		mapped_free(record->channels[i].sample);
	}
	free(record->channels);
	free(record->gaps);
	record_init(record);
}

struct channel *record_add_room(struct record *record, const char *name, double rate_hz, size_t count)
{
	struct channel *channels =
	        realloc(record->channels, (record->channel_count + 1) * sizeof(*record->channels));
	if (!channels)
		return NULL;
	record->channels = channels;

	struct channel *channel = &channels[record->channel_count];
	*channel = (struct channel){.rate_hz = rate_hz, .count = count};
	strncpy(channel->name, name, sizeof(channel->name) - 1);
	channel->value_g = mapped_array(count, sizeof(*channel->value_g));
	channel->sample = mapped_array(count, 1);
	if (!channel->value_g || !channel->sample) {
		mapped_free(channel->value_g);
		mapped_free(channel->sample);
		return NULL;
	}
	record->channel_count++;
	return channel;
}

struct channel *record_add_channel(struct record *record, const char *name, double rate_hz, size_t count)
{
	struct channel *channel = record_add_room(record, name, rate_hz, count);

	for (size_t first = 0; channel != NULL && first < count; first += RECORD_PART) {
		const size_t end = count - first < RECORD_PART ? count : first + RECORD_PART;

		memset(channel->sample + first, SAMPLE_LOST, end - first);
		for (size_t k = first; k < end; k++)
			channel->value_g[k] = NAN;
		mapped_seen(RECORD_PART * (sizeof(*channel->value_g) + 1));
	}
	return channel;
}

bool record_lacks_seal(const struct record *record)
{
	return record->is_drop && !record->file_sealed && strcmp(record->format, "candump") != 0 &&
	       strcmp(record->format, "live") != 0;
}

const struct channel *record_channel(const struct record *record, const char *name)
{
	for (size_t i = 0; i < record->channel_count; i++)
		if (strcmp(record->channels[i].name, name) == 0)
			return &record->channels[i];
	return NULL;
}

const struct channel *record_axis(const struct record *record, const char *which)
{
	for (size_t i = 0; i < record->channel_count; i++)
		if (record->channels[i].sensor > 0 && record->channels[i].sensor == which[1] - '0' &&
		    record->channels[i].axis == which[2])
			return &record->channels[i];
	return NULL;
}

static unsigned marks_of(const struct channel *channel)
{
	uint64_t marks = 0;
	size_t k = 0;

	for (; k + sizeof(marks) <= channel->count; k += sizeof(marks)) {
		uint64_t eight;

		memcpy(&eight, channel->sample + k, sizeof(eight));
		marks |= eight;
		record_seen(k, 1);
	}
	for (; k < channel->count; k++)
		marks |= channel->sample[k];
	marks |= marks >> 32;
	marks |= marks >> 16;
	return (marks | marks >> 8) & UINT8_MAX;
}

/* Four values side by side. */
WIDE static bool reaches(const struct channel *channel, double level_g)
{
	enum { TOGETHER = 4 };
	typedef double values __attribute__((vector_size(TOGETHER * sizeof(double))));
	typedef int64_t masks __attribute__((vector_size(TOGETHER * sizeof(int64_t))));
	masks far = {0};
	bool any = false;
	size_t k = 0;

	for (; k + TOGETHER <= channel->count; k += TOGETHER) {
		values value;

		memcpy(&value, channel->value_g + k, sizeof(value));
		far |= (value >= level_g) | (value <= -level_g);
	}
	for (; k < channel->count; k++)
		any |= fabs(channel->value_g[k]) >= level_g;
	for (unsigned i = 0; i < TOGETHER; i++)
		any |= far[i] != 0;
	return any;
}

static void record_finish_channel(struct record *record, struct channel *channel)
{
	const double full_scale_g = (double)WIRE_SAMPLE_FULL_SCALE / WIRE_COUNTS_PER_G;
	const unsigned readers =
	        RECORD_FLAG_UNEVEN | RECORD_FLAG_NO_LINE_END | RECORD_FLAG_SAME_NAMES | RECORD_FLAG_ASSUMED;
	unsigned flags = channel->flags & readers; /* only the reader knows */
	unsigned marks = marks_of(channel);
	uint64_t lost = 0;

	for (size_t k = 0; k < channel->count && marks & SAMPLE_LOST; k++)
		lost += (channel->sample[k] & SAMPLE_LOST) != 0;
	if (marks & SAMPLE_BAD)
		flags |= RECORD_FLAG_BAD;
	if (marks & SAMPLE_CLIPPED)
		flags |= RECORD_FLAG_CLIPPED;
	if (record->is_drop && reaches(channel, full_scale_g))
		flags |= RECORD_FLAG_FULL_SCALE;
	if (lost)
		flags |= RECORD_FLAG_LOST;
	channel->flags = flags;
	record->lost_samples += lost;
	record->flags |= flags;
}

static unsigned flags_of_marks(unsigned marks)
{
	static const struct {
		unsigned mark, flag;
	} table[] = {
	        {WIRE_MARK_SLOW_FRAME, RECORD_FLAG_SLOW_FRAME},
	        {WIRE_MARK_NO_IMPACT, RECORD_FLAG_NO_IMPACT},
	        {WIRE_MARK_FAULT, RECORD_FLAG_FAULT},
	        {WIRE_MARK_CLIPPED, RECORD_FLAG_CLIPPED},
	        {WIRE_MARK_OVERRUN, RECORD_FLAG_OVERRUN},
	        {WIRE_MARK_FULL_SCALE, RECORD_FLAG_FULL_SCALE},
	        {WIRE_MARK_ZERO_SHIFT, RECORD_FLAG_ZERO_SHIFT},
	        {WIRE_MARK_CABLE, RECORD_FLAG_CABLE},
	        {WIRE_MARK_STUCK, RECORD_FLAG_STUCK},
	        {WIRE_MARK_SEPARATED_LATE, RECORD_FLAG_SEPARATED_LATE},
	        {WIRE_MARK_DROPOUT_CHANGED, RECORD_FLAG_DROPOUT_CHANGED},
	        {WIRE_MARK_FRAME_NOT_DOWN, RECORD_FLAG_FRAME_NOT_DOWN},
	};
	unsigned flags = 0;

	for (size_t i = 0; i < sizeof(table) / sizeof(table[0]); i++)
		if (marks & table[i].mark)
			flags |= table[i].flag;
	return flags;
}

void record_begin_at_zero(struct record *record)
{
	double first_s = INFINITY;

	for (size_t i = 0; i < record->channel_count; i++)
		first_s = fmin(first_s, record->channels[i].start_s);
	for (size_t i = 0; i < record->channel_count; i++)
		record->channels[i].start_s -= first_s;
}

void record_finish(struct record *record)
{
	record->lost_samples = 0;
	record->flags = 0;
	for (size_t i = 0; i < record->channel_count; i++)
		record_finish_channel(record, &record->channels[i]);
	if (!record->is_drop)
		return;
	record->flags |= flags_of_marks(record->marks);
	if (!record->crc_known)
		record->flags |= RECORD_FLAG_NO_CRC;
	else if (!record->crc_agrees)
		record->flags |= RECORD_FLAG_INCOMPLETE;
	if ((record->seal_known && !record->seal_agrees) ||
	    (record->parameters_held == RECORD_PARAMETERS_ALL && !record->parameters_known))
		record->flags |= RECORD_FLAG_ALTERED;
}

const char *record_flag_name(unsigned flags)
{
	static const char *const names[] = {
	        "lost_samples",
	        "bad_samples",
	        "clipped",
	        "incomplete",
	        "crc_unknown",
	        "slow_frame",
	        "no_impact",
	        "fault",
	        "uneven_sampling",
	        "full_scale",
	        "overrun",
	        "zero_shift",
	        "cable",
	        "stuck",
	        "spike",
	        "zeroed",
	        "offset",
	        "drift",
	        "hum",
	        "too_short",
	        "zero_unsure",
	        "unfiltered",
	        "no_line_end",
	        "same_names",
	        "settling",
	        "altered",
	        "separated_late",
	        "dropout_changed",
	        "frame_not_down",
	        "assumed",
	        "overdue",
	        "default_used",
	};

	for (size_t bit = 0; bit < sizeof(names) / sizeof(names[0]); bit++)
		if (flags & 1u << bit)
			return names[bit];
	return "";
}
