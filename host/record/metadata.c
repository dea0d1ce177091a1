/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/metadata.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "common/base/number.h"

#define FIELD(name, kind, member)                                 \
	{                                                         \
		name, kind, offsetof(struct record, member), true \
	}
#define FIELD_OF_ANY(name, kind, member)                           \
	{                                                          \
		name, kind, offsetof(struct record, member), false \
	}

static const struct metadata_entry entries[] = {
        FIELD_OF_ANY("date", METADATA_TIME, time_s),
        FIELD_OF_ANY("operator", METADATA_TEXT, operator_name),
        FIELD_OF_ANY("scene", METADATA_TEXT, scene),
        FIELD_OF_ANY("sensors", METADATA_TEXT, sensors),
        FIELD_OF_ANY("simulated", METADATA_U16, simulated),
        FIELD("drop_id", METADATA_U16, drop_id),
        FIELD("marks", METADATA_U16, marks),
        FIELD("first_tick_ms", METADATA_U32, first_tick_ms),
        FIELD("last_tick_ms", METADATA_U32, last_tick_ms),
        FIELD("trigger_s", METADATA_REAL, trigger_s),
        FIELD("trigger_us", METADATA_U32, trigger_us),
        FIELD("frame_speed_m_s", METADATA_REAL, frame_speed_m_s),
        FIELD("crc32", METADATA_U32, crc32),
        FIELD("camera_frame", METADATA_I16, camera_frame),
        FIELD("parameters_crc32", METADATA_U32, parameters_crc32),
        FIELD("seal", METADATA_U32, seal),
        FIELD("measured_dropout_us", METADATA_U16, measured.dropout_us),
        FIELD("measured_dropout_used_us", METADATA_U16, measured.dropout_used_us),
        FIELD("measured_separation_mm_s", METADATA_U16, measured.separation_mm_s),
        FIELD("measured_separation_um", METADATA_U32, measured.separation_um),
        FIELD("measured_acceleration_mm_s2", METADATA_U16, measured.acceleration_mm_s2),
        FIELD("measured_latch_delay_us", METADATA_U16, measured.latch_delay_us),
        FIELD("measured_clock_ppm", METADATA_I16, measured.clock_ppm),
        FIELD("measured_trigger_latency_us", METADATA_U16, measured.trigger_latency_us),
/* the parameters that the drop was made with */
#define WIRE_PARAMETER(name, index, unit, min, max, initial, doc) \
	FIELD("set_" #name, METADATA_U32, parameters[WIRE_PARAMETER_##name]),
#include "common/wire.def"
        FIELD("blocks", METADATA_U64, counters.blocks),
        FIELD("repeated", METADATA_U64, counters.repeated),
        FIELD("reordered", METADATA_U64, counters.reordered),
        FIELD("corrupt", METADATA_U64, counters.corrupt),
        FIELD("gaps", METADATA_U64, counters.gaps),
        FIELD("resent", METADATA_U64, counters.resent),
        FIELD("conflicting", METADATA_U64, counters.conflicting),
};

const struct metadata_entry *metadata_entry(size_t i)
{
	return i < sizeof(entries) / sizeof(entries[0]) ? &entries[i] : NULL;
}

const struct metadata_entry *metadata_find(const char *name)
{
	for (size_t i = 0; i < sizeof(entries) / sizeof(entries[0]); i++)
		if (strcmp(entries[i].name, name) == 0)
			return &entries[i];
	return NULL;
}

/* These come with the capture end and make no sense without. */
static bool of_capture_end(const struct metadata_entry *entry)
{
	return entry->offset == offsetof(struct record, crc32) ||
	       entry->offset == offsetof(struct record, camera_frame) ||
	       entry->offset == offsetof(struct record, trigger_us) ||
	       entry->offset == offsetof(struct record, parameters_crc32) ||
	       entry->offset == offsetof(struct record, seal);
}

/* What was not measured is there as such: all ones. */
static bool of_measured(const struct metadata_entry *entry)
{
	return entry->offset >= offsetof(struct record, measured) &&
	       entry->offset < offsetof(struct record, measured) + sizeof(struct wire_measured);
}

/* Bit of parameters_held; 0: it is no parameter. */
static uint32_t of_parameters(const struct metadata_entry *entry)
{
	size_t first = offsetof(struct record, parameters);
	size_t at = entry->offset - first;

	return entry->offset >= first && at < sizeof(((struct record *)NULL)->parameters)
	               ? UINT32_C(1) << at / sizeof(uint32_t)
	               : 0;
}

static const char *metadata_words(const struct record *record, const struct metadata_entry *entry)
{
	return (const char *)record + entry->offset;
}

bool metadata_known(const struct record *record, const struct metadata_entry *entry)
{
	if (!entry->of_drop)
		return entry->kind == METADATA_TEXT ? metadata_words(record, entry)[0] != '\0'
		                                    : metadata_whole(record, entry) != 0;
	if (entry->offset == offsetof(struct record, seal) && !record->seal_known)
		return false;
	if (entry->offset == offsetof(struct record, trigger_us) && isfinite(record->trigger_s))
		return false;
	if (!record->is_drop || (of_capture_end(entry) && !record->crc_known) ||
	    (of_measured(entry) && !record->measured_known))
		return false;
	if (of_parameters(entry) != 0)
		return record->crc_known && (record->parameters_held & of_parameters(entry)) != 0;
	return entry->kind != METADATA_REAL || isfinite(metadata_real(record, entry));
}

double metadata_real(const struct record *record, const struct metadata_entry *entry)
{
	double value;

	if (entry->kind != METADATA_REAL)
		return (double)metadata_whole(record, entry);
	memcpy(&value, (const char *)record + entry->offset, sizeof(value));
	return value;
}

int64_t metadata_whole(const struct record *record, const struct metadata_entry *entry)
{
	const char *at = (const char *)record + entry->offset;
	int16_t i16;
	uint16_t u16;
	uint32_t u32;
	uint64_t u64;
	int64_t i64;

	switch (entry->kind) {
	case METADATA_TIME:
		memcpy(&i64, at, sizeof(i64));
		return i64;
	case METADATA_I16:
		memcpy(&i16, at, sizeof(i16));
		return i16;
	case METADATA_U16:
		memcpy(&u16, at, sizeof(u16));
		return u16;
	case METADATA_U32:
		memcpy(&u32, at, sizeof(u32));
		return u32;
	case METADATA_U64:
		memcpy(&u64, at, sizeof(u64));
		return (int64_t)u64;
	case METADATA_REAL:
	case METADATA_TEXT:
		break;
	}
	return 0;
}

#define DATE_FORM "%Y-%m-%dT%H:%M:%S"
#define DATE_OFFSET "+00:00"

void metadata_format(const struct record *record, const struct metadata_entry *entry,
                     char text[METADATA_TEXT_MAX])
{
	time_t seconds = (time_t)metadata_whole(record, entry);
	struct tm utc;

	text[0] = '\0';
	if (entry->kind == METADATA_TEXT)
		snprintf(text, METADATA_TEXT_MAX, "%.*s", METADATA_TEXT_MAX - 1,
		         metadata_words(record, entry));
	else if (entry->kind == METADATA_REAL)
		number_format(text, metadata_real(record, entry), 15);
	else if (entry->kind != METADATA_TIME)
		snprintf(text, METADATA_TEXT_MAX, "%" PRId64, metadata_whole(record, entry));
	else if (gmtime_r(&seconds, &utc) != NULL)
		strftime(text, METADATA_TEXT_MAX, DATE_FORM DATE_OFFSET, &utc);
}

static int parse_time(struct record *record, const struct metadata_entry *entry, const char *text)
{
	struct tm utc = {.tm_mday = 0};
	const char *rest = strptime(text, DATE_FORM, &utc);
	int64_t time_s = rest != NULL && strcmp(rest, DATE_OFFSET) == 0 ? timegm(&utc) : 0;

	if (time_s <= 0)
		return DT_E_RANGE;
	memcpy((char *)record + entry->offset, &time_s, sizeof(time_s));
	return 0;
}

static bool can_hold(char letter)
{
	return (unsigned char)letter >= ' ' && letter != ',' && letter != '"' && letter != 0x7f;
}

int metadata_parse(struct record *record, const struct metadata_entry *entry, const char *text)
{
	size_t length = strlen(text);
	double value;

	if (entry->kind == METADATA_TIME)
		return parse_time(record, entry, text);
	if (entry->kind != METADATA_TEXT)
		return number_parse(text, length, '.', &value) ? metadata_set(record, entry, value)
		                                               : DT_E_RANGE;
	if (length == 0 || length >= METADATA_TEXT_MAX)
		return DT_E_RANGE;
	for (size_t i = 0; i < length; i++)
		if (!can_hold(text[i]))
			return DT_E_RANGE;
	memcpy((char *)record + entry->offset, text, length + 1);
	return 0;
}

void metadata_take_words(char text[METADATA_TEXT_MAX], const char *words)
{
	size_t length;

	words += strspn(words, " \t\r\n");
	length = strnlen(words, METADATA_TEXT_MAX - 1);
	while (length > 0 && words[length] != '\0' && ((unsigned char)words[length] & 0xc0u) == 0x80u)
		length--; /* no half of a letter */
	for (size_t i = 0; i < length; i++)
		text[i] = can_hold(words[i]) ? words[i]
		          : words[i] == ','  ? ';'
		          : words[i] == '"'  ? '\''
		                             : ' ';
	while (length > 0 && text[length - 1] == ' ')
		length--;
	text[length] = '\0';
}

static void set_whole(char *at, enum metadata_kind kind, double value)
{
	int16_t i16 = kind == METADATA_I16 ? (int16_t)value : 0;
	uint16_t u16 = kind == METADATA_U16 ? (uint16_t)value : 0;
	uint32_t u32 = kind == METADATA_U32 ? (uint32_t)value : 0;
	uint64_t u64 = kind == METADATA_U64 ? (uint64_t)value : 0;

	if (kind == METADATA_I16)
		memcpy(at, &i16, sizeof(i16));
	else if (kind == METADATA_U16)
		memcpy(at, &u16, sizeof(u16));
	else if (kind == METADATA_U32)
		memcpy(at, &u32, sizeof(u32));
	else
		memcpy(at, &u64, sizeof(u64));
}

int metadata_set(struct record *record, const struct metadata_entry *entry, double value)
{
	static const struct {
		double min, max;
	} range[] = {
	        [METADATA_REAL] = {-INFINITY, INFINITY},  [METADATA_I16] = {INT16_MIN, INT16_MAX},
	        [METADATA_U16] = {0, UINT16_MAX},         [METADATA_U32] = {0, UINT32_MAX},
	        [METADATA_U64] = {0, 9007199254740992.0}, /* beyond, a double is not every whole number */
	};
	char *at = (char *)record + entry->offset;

	if (entry->kind >= METADATA_TIME || !isfinite(value) || value < range[entry->kind].min ||
	    value > range[entry->kind].max || (entry->kind != METADATA_REAL && value != trunc(value)))
		return DT_E_RANGE;
	if (entry->kind == METADATA_REAL)
		memcpy(at, &value, sizeof(value));
	else
		set_whole(at, entry->kind, value);
	record->is_drop |= entry->offset == offsetof(struct record, drop_id);
	record->crc_known |= entry->offset == offsetof(struct record, crc32);
	record->seal_known |= entry->offset == offsetof(struct record, seal);
	record->measured_known |= of_measured(entry);
	record->parameters_held |= of_parameters(entry);
	return 0;
}
