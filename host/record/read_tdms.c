/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * TDMS of National Instruments ("TDMS File Format Internal Structure"): segments, each with a lead-in,
 * objects with properties, and raw data of those objects that have some. Data of DAQmx and data with scales
 * that are still to be applied are refused.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/base/mapped.h"
#include "host/record/table_data.h"
#include "host/record/unit.h"

enum {
	LEAD_IN = 28,
	TOC_META = 1 << 1,
	TOC_NEW_LIST = 1 << 2,
	TOC_RAW = 1 << 3,
	TOC_INTERLEAVED = 1 << 5,
	TOC_BIG = 1 << 6,
	TOC_DAQMX = 1 << 7,
	INDEX_SAME = 0,
	INDEX_DAQMX = 0x1269,
	INDEX_DAQMX_DIGITAL = 0x126A,
	TYPE_STRING = 0x20,
	TYPE_BOOL = 0x21,
	TYPE_TIMESTAMP = 0x44,
	OBJECTS_MOST = 1024,
};
static const uint32_t INDEX_NONE = UINT32_MAX;

struct tdms_object {
	const char *path;
	uint32_t path_length, type;
	uint64_t count, bytes; /* of a chunk */
	bool active, unscaled, scales;
	bool moved;            /* step or beginning are told twice, and differ */
	const char *begins_at; /* its wf_start_time, 16 bytes; NULL: not told */
	char name[64], unit[32], time_unit[32];
	double increment, offset; /* in the unit of time */
	double *value;
	size_t used, room;
};

struct tdms {
	const struct source *source;
	char *message;
	size_t at, end; /* within the metadata */
	bool big, cut;
	struct tdms_object *object;
	size_t objects;
	size_t list[OBJECTS_MOST], listed; /* those with raw data, in their order */
};

static int tdms_refuse(const struct tdms *tdms, const char *why)
{
	return source_refuse(tdms->message, DT_E_FORMAT, tdms->source->file, 0, "TDMS file: %s", why);
}

/* ---- metadata ---- */

static uint64_t take_whole(struct tdms *tdms, size_t size)
{
	uint64_t value;

	if (tdms->cut || size > tdms->end - tdms->at) {
		tdms->cut = true;
		return 0;
	}
	value = bytes_whole(tdms->source->bytes + tdms->at, size, tdms->big);
	tdms->at += size;
	return value;
}

static const char *take_text(struct tdms *tdms, uint32_t *length)
{
	const char *text;

	*length = (uint32_t)take_whole(tdms, 4);
	if (tdms->cut || *length > tdms->end - tdms->at) {
		tdms->cut = true;
		*length = 0;
		return "";
	}
	text = tdms->source->bytes + tdms->at;
	tdms->at += *length;
	return text;
}

/* Bytes of a value; 0 for a string or a type that is not known. */
static size_t type_bytes(uint32_t type)
{
	static const size_t bytes[] = {0, 1, 2, 4, 8, 1, 2, 4, 8, 4, 8};

	if (type < sizeof(bytes) / sizeof(bytes[0]))
		return bytes[type];
	return type == TYPE_BOOL ? 1 : type == TYPE_TIMESTAMP ? 16 : type == 0x19 ? 4 : type == 0x1A ? 8 : 0;
}

static bool type_kind(uint32_t type, enum bytes_kind *kind)
{
	static const enum bytes_kind kinds[] = {BYTES_I8,  BYTES_I8,  BYTES_I16, BYTES_I32,
	                                        BYTES_I64, BYTES_U8,  BYTES_U16, BYTES_U32,
	                                        BYTES_U64, BYTES_F32, BYTES_F64};

	*kind = type <= 10 ? kinds[type] : type == 0x19 ? BYTES_F32 : BYTES_F64;
	return (type >= 1 && type <= 10) || type == 0x19 || type == 0x1A;
}

static bool says(const char *name, uint32_t length, const char *word)
{
	return length == strlen(word) && memcmp(name, word, length) == 0;
}

static void set_text(struct tdms_object *object, const char *name, uint32_t length, const char *text,
                     uint32_t size)
{
	if (says(name, length, "unit_string"))
		snprintf(object->unit, sizeof(object->unit), "%.*s", (int)(size < 31 ? size : 31), text);
	else if (says(name, length, "wf_xunit_string"))
		snprintf(object->time_unit, sizeof(object->time_unit), "%.*s", (int)(size < 31 ? size : 31),
		         text);
	else if (says(name, length, "NI_Scaling_Status"))
		object->unscaled = says(text, size, "unscaled");
}

static void set_number(struct tdms_object *object, const char *name, uint32_t length, double value)
{
	if (says(name, length, "wf_increment")) {
		object->moved |= object->used > 0 && fabs(value - object->increment) > 1e-9 * fabs(value);
		object->increment = value;
	}
	if (says(name, length, "wf_start_offset"))
		object->offset = value;
	else if (says(name, length, "NI_Number_Of_Scales"))
		object->scales = value > 0;
}

static int take_property(struct tdms *tdms, struct tdms_object *object)
{
	uint32_t length, type, size;
	const char *name = take_text(tdms, &length), *text;
	enum bytes_kind kind;

	type = (uint32_t)take_whole(tdms, 4);
	if (type == TYPE_STRING) {
		text = take_text(tdms, &size);
		set_text(object, name, length, text, size);
		return 0;
	}
	size = (uint32_t)type_bytes(type);
	if (tdms->cut || size > tdms->end - tdms->at)
		return tdms_refuse(tdms, "cut or damaged in its properties");
	if (size == 0)
		return tdms_refuse(tdms, "a property of a type that is not known");
	if (type == TYPE_TIMESTAMP && says(name, length, "wf_start_time")) {
		const char *at = tdms->source->bytes + tdms->at;

		object->moved |= object->used > 0 && object->begins_at != NULL &&
		                 memcmp(object->begins_at, at, size) != 0;
		object->begins_at = at;
	}
	if (type_kind(type, &kind))
		set_number(object, name, length,
		           bytes_value(tdms->source->bytes + tdms->at, kind, tdms->big));
	tdms->at += size;
	return 0;
}

/* The last name of "/'Group'/'Channel'". */
static void name_object(struct tdms_object *object)
{
	const char *end = object->path + object->path_length, *from = end;

	while (from > object->path && from[-1] != '/')
		from--;
	if (end - from >= 2 && from[0] == '\'') {
		from++;
		end--;
	}
	snprintf(object->name, sizeof(object->name), "%.*s", (int)(end - from < 63 ? end - from : 63), from);
}

static struct tdms_object *find_object(struct tdms *tdms, const char *path, uint32_t length)
{
	struct tdms_object *object;

	for (size_t i = 0; i < tdms->objects; i++)
		if (tdms->object[i].path_length == length && memcmp(tdms->object[i].path, path, length) == 0)
			return &tdms->object[i];
	if (tdms->objects == OBJECTS_MOST)
		return NULL;
	object = &tdms->object[tdms->objects++];
	*object = (struct tdms_object){.path = path, .path_length = length};
	name_object(object);
	return object;
}

static void list_object(struct tdms *tdms, const struct tdms_object *object)
{
	size_t index = (size_t)(object - tdms->object);

	for (size_t i = 0; i < tdms->listed; i++)
		if (tdms->list[i] == index)
			return;
	tdms->list[tdms->listed++] = index;
}

static int take_index(struct tdms *tdms, struct tdms_object *object)
{
	uint32_t length = (uint32_t)take_whole(tdms, 4);

	if (length == INDEX_DAQMX || length == INDEX_DAQMX_DIGITAL)
		return tdms_refuse(tdms, "raw data of DAQmx, expected it saved with scaled values");
	if (length == INDEX_NONE) {
		object->active = false;
		return 0;
	}
	object->active = true;
	list_object(tdms, object);
	if (length == INDEX_SAME)
		return object->type != 0 ? 0
		                         : tdms_refuse(tdms, "data like those before, where there are none");
	object->type = (uint32_t)take_whole(tdms, 4);
	if (take_whole(tdms, 4) != 1)
		return tdms_refuse(tdms, "data of several dimensions, or damaged");
	object->count = take_whole(tdms, 8);
	object->bytes =
	        object->type == TYPE_STRING ? take_whole(tdms, 8) : object->count * type_bytes(object->type);
	if (object->count > tdms->source->size || object->bytes > tdms->source->size ||
	    (object->type != TYPE_STRING && type_bytes(object->type) == 0))
		return tdms_refuse(tdms, "more data than the file has, or of a type that is not known");
	return 0;
}

static int take_objects(struct tdms *tdms, uint32_t toc)
{
	uint64_t objects = take_whole(tdms, 4);

	if (toc & TOC_NEW_LIST) {
		tdms->listed = 0;
		for (size_t i = 0; i < tdms->objects; i++)
			tdms->object[i].active = false;
	}
	for (uint64_t i = 0; i < objects && !tdms->cut; i++) {
		uint32_t length;
		const char *path = take_text(tdms, &length);
		struct tdms_object *object = tdms->cut ? NULL : find_object(tdms, path, length);
		uint64_t properties;
		int error;

		if (object == NULL && !tdms->cut)
			return tdms_refuse(tdms, "more objects than 1024");
		if (object == NULL)
			break;
		error = take_index(tdms, object);
		properties = take_whole(tdms, 4);
		for (uint64_t k = 0; k < properties && !error; k++)
			error = take_property(tdms, object);
		if (error)
			return error;
	}
	return tdms->cut ? tdms_refuse(tdms, "cut or damaged in its objects") : 0;
}

/* ---- raw data ---- */

static bool tdms_make_room(struct tdms_object *object, size_t more)
{
	size_t room = object->room > 0 ? object->room : 1024;
	double *value;

	while (room < object->used + more)
		room *= 2;
	if (room == object->room)
		return true;
	value = mapped_array_resize(object->value, object->used, room, sizeof(*value));
	if (value == NULL)
		return false;
	object->value = value;
	object->room = room;
	return true;
}

/* One chunk; stride 0: the values of an object stand together. */
static int take_chunk(struct tdms *tdms, size_t at, size_t stride)
{
	size_t within = 0;

	for (size_t i = 0; i < tdms->listed; i++) {
		struct tdms_object *object = &tdms->object[tdms->list[i]];
		size_t size = type_bytes(object->type), step = stride > 0 ? stride : size;
		enum bytes_kind kind;

		if (!object->active)
			continue;
		if (type_kind(object->type, &kind)) {
			if (!tdms_make_room(object, (size_t)object->count))
				return source_no_memory(tdms->message, tdms->source->file);
			for (uint64_t k = 0; k < object->count; k++)
				object->value[object->used++] = bytes_value(
				        tdms->source->bytes + at + within + k * step, kind, tdms->big);
		}
		within += stride > 0 ? size : (size_t)object->bytes;
		mapped_seen((size_t)object->bytes + (size_t)object->count * sizeof(double));
	}
	return 0;
}

static int take_raw(struct tdms *tdms, uint32_t toc, size_t at, size_t end)
{
	size_t chunk = 0, stride = 0, active = 0;
	uint64_t rows = 0;
	int error = 0;

	for (size_t i = 0; i < tdms->listed; i++) {
		const struct tdms_object *object = &tdms->object[tdms->list[i]];

		if (!object->active)
			continue;
		chunk += (size_t)object->bytes;
		stride += type_bytes(object->type);
		if (toc & TOC_INTERLEAVED &&
		    (type_bytes(object->type) == 0 || (active > 0 && object->count != rows)))
			return tdms_refuse(
			        tdms,
			        "interleaved data of strings or of unequal counts, expected equal ones");
		rows = object->count;
		active++;
	}
	if (chunk == 0 || (end - at) % chunk != 0)
		return tdms_refuse(tdms, "raw data that are no whole chunks: cut or damaged");
	for (; at < end && !error; at += chunk)
		error = take_chunk(tdms, at, toc & TOC_INTERLEAVED ? stride : 0);
	return error;
}

static int take_segment(struct tdms *tdms, size_t at, size_t *next)
{
	const char *head = tdms->source->bytes + at;
	size_t room = tdms->source->size - at;
	uint32_t toc;
	uint64_t segment, raw;
	int error = 0;

	if (room < LEAD_IN || memcmp(head, "TDSm", 4) != 0)
		return tdms_refuse(tdms, "no segment where one should begin: cut or damaged");
	toc = (uint32_t)bytes_whole(head + 4, 4, false);
	tdms->big = (toc & TOC_BIG) != 0;
	segment = bytes_whole(head + 12, 8, tdms->big);
	raw = bytes_whole(head + 20, 8, tdms->big);
	if (toc & TOC_DAQMX)
		return tdms_refuse(tdms, "raw data of DAQmx, expected it saved with scaled values");
	if (segment > room - LEAD_IN || raw > segment)
		return tdms_refuse(tdms, "a segment that was not finished, or is cut");
	tdms->at = at + LEAD_IN;
	tdms->end = tdms->at + (size_t)raw;
	*next = at + LEAD_IN + (size_t)segment;
	if (toc & TOC_META)
		error = take_objects(tdms, toc);
	if (!error && toc & TOC_RAW && segment > raw)
		error = take_raw(tdms, toc, at + LEAD_IN + (size_t)raw, *next);
	return error;
}

/* ---- the table ---- */

static int give_columns(struct tdms *tdms, struct table_data *table)
{
	for (size_t i = 0; i < tdms->objects; i++) {
		struct tdms_object *object = &tdms->object[i];
		double unit_s = unit_seconds(object->time_unit);
		struct table_column *column;

		if (object->used == 0)
			continue;
		if (unit_s == 0)
			return source_refuse(tdms->message, DT_E_FORMAT, tdms->source->file, 0,
			                     "TDMS file: %s steps in \"%s\", expected s or another time",
			                     object->name, object->time_unit);
		if (object->moved)
			return source_refuse(
			        tdms->message, DT_E_FORMAT, tdms->source->file, 0,
			        "TDMS file: %s was appended to with another beginning or step, expected one "
			        "recording",
			        object->name);
		if (object->scales && object->unscaled)
			return source_refuse(
			        tdms->message, DT_E_FORMAT, tdms->source->file, 0,
			        "TDMS file: %s is not scaled, expected it saved with scaled values",
			        object->name);
		column = table_data_add(table, object->used);
		if (column == NULL)
			return source_no_memory(tdms->message, tdms->source->file);
		memcpy(column->value, object->value, object->used * sizeof(double));
		mapped_free(object->value);
		object->value = NULL;
		memcpy(column->name, object->name, sizeof(column->name));
		memcpy(column->unit, object->unit, sizeof(column->unit));
		column->rate_hz = object->increment > 0 ? 1 / (object->increment * unit_s) : 0;
		column->start_s = object->offset * unit_s;
	}
	return table->count > 0 ? 0 : tdms_refuse(tdms, "no channel with numbers");
}

int read_tdms(struct table_data *table, const struct source *source, char message[READ_MESSAGE_MAX])
{
	struct tdms *tdms = calloc(1, sizeof(*tdms));
	size_t at = 0;
	int error = 0;

	table->format = "tdms";
	if (tdms != NULL) {
		*tdms = (struct tdms){.source = source, .message = message};
		tdms->object = calloc(OBJECTS_MOST, sizeof(*tdms->object));
	}
	if (tdms == NULL || tdms->object == NULL)
		error = source_no_memory(message, source->file);
	while (!error && at < source->size)
		error = take_segment(tdms, at, &at);
	if (!error)
		error = give_columns(tdms, table);
	for (size_t i = 0; tdms != NULL && i < tdms->objects; i++)
		mapped_free(tdms->object[i].value);
	if (tdms != NULL)
		free(tdms->object);
	free(tdms);
	return error;
}
