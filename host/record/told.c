/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/told.h"

#include <string.h>

#include "common/wire_table.h"

_Static_assert(WIRE_PARAMETERS < 32, "a bit for each");
static const uint32_t ALL_PARAMETERS = (UINT32_C(1) << WIRE_PARAMETERS) - 1;

static void turn_to(struct told *told, uint16_t drop_id)
{
	if (told->drop_id != drop_id)
		*told = (struct told){.drop_id = drop_id};
}

static int feed_measured(struct told *told, const struct frame *frame)
{
	struct wire_measured measured;
	int result = wire_check_measured(frame);

	if (result == 0)
		result = wire_unpack_measured(frame, &measured);
	if (result != 0)
		return result;
	turn_to(told, measured.drop_id);
	told->measured_known = true;
	told->measured = measured;
	return 0;
}

static int feed_parameter(struct told *told, const struct frame *frame)
{
	struct wire_parameter parameter;
	int result = wire_unpack_parameter(frame, &parameter);

	if (result != 0)
		return result;
	turn_to(told, parameter.drop_id);
	for (unsigned i = 0; i < WIRE_PARAMETERS; i++) {
		if (wire_parameters[i].index != parameter.index)
			continue;
		told->parameter[i] = parameter.value;
		told->parameters_held |= 1u << i;
	}
	return 0;
}

int told_feed(struct told *told, const struct frame *frame)
{
	return frame->id == WIRE_ID_MEASURED ? feed_measured(told, frame) : feed_parameter(told, frame);
}

bool told_whole(const struct told *told, uint16_t drop_id)
{
	return told->drop_id == drop_id && told->measured_known && told->parameters_held == ALL_PARAMETERS;
}

void told_fill(const struct told *told, const struct wire_capture_end *end, struct record *record)
{
	if (told->drop_id != end->drop_id)
		return;
	record->measured_known = told->measured_known;
	record->measured = told->measured;
	record->parameters_known = told->parameters_held == ALL_PARAMETERS &&
	                           wire_parameters_crc32(told->parameter) == end->parameters_crc32;
	if (record->parameters_known)
		memcpy(record->parameters, told->parameter, sizeof(record->parameters));
}
