/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/told.h"

#include <string.h>

#include "common/wire_table.h"

void told_begin(struct told *told, uint16_t drop_id)
{
	*told = (struct told){.begun = true, .drop_id = drop_id};
}

static int told_feed_measured(struct told *told, const struct frame *frame)
{
	struct wire_measured measured;
	int result = wire_check_measured(frame);

	if (result == 0)
		result = wire_unpack_measured(frame, &measured);
	if (result != 0)
		return result;
	if (measured.drop_id != told->drop_id)
		return DT_E_CORRUPT;
	told->measured_known = true;
	told->measured = measured;
	return 0;
}

static int told_feed_parameter(struct told *told, const struct frame *frame)
{
	struct wire_parameter parameter;
	int result = wire_unpack_parameter(frame, &parameter);

	if (result != 0)
		return result;
	if (parameter.drop_id != told->drop_id)
		return DT_E_CORRUPT;
	for (unsigned i = 0; i < WIRE_PARAMETERS; i++) {
		bool held = told->held >> i & 1u, same = told->parameter[i] == parameter.value;

		if (wire_parameters[i].index != parameter.index)
			continue;
		told->parameter[i] = parameter.value;
		told->held |= UINT32_C(1) << i;
		return held && !same ? DT_E_CORRUPT : 0;
	}
	return DT_E_UNKNOWN;
}

int told_feed(struct told *told, const struct frame *frame)
{
	if (!told->begun)
		return 0;
	return frame->id == WIRE_ID_MEASURED ? told_feed_measured(told, frame)
	                                     : told_feed_parameter(told, frame);
}

bool told_whole(const struct told *told, const struct wire_capture_end *end)
{
	return told->measured_known && told->held == RECORD_PARAMETERS_ALL && !told_is_altered(told, end);
}

bool told_is_altered(const struct told *told, const struct wire_capture_end *end)
{
	return told->held == RECORD_PARAMETERS_ALL &&
	       wire_parameters_crc32(told->parameter) != end->parameters_crc32;
}

void told_fill(const struct told *told, const struct wire_capture_end *end, struct record *record)
{
	record->measured_known = told->measured_known;
	record->measured = told->measured;
	record->parameters_held = told->held;
	memcpy(record->parameters, told->parameter, sizeof(record->parameters));
	record->counters.corrupt += told_is_altered(told, end);
}
