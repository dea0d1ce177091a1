/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * LCM event logs: the last drop message is the drop; without one the block messages go through the join.
 */
#include <string.h>

#include "host/record/join.h"
#include "host/record/lcm_codec.h"
#include "host/record/lcm_log.h"
#include "host/record/source.h"

struct reading {
	struct join *join;
	struct record drop;
	bool has_drop;
	struct lcm_log_walk walk;
	uint64_t refused; /* messages on our channels that are none of ours */
};

static int take_drop(struct reading *reading, const struct lcm_log_event *event)
{
	droptower_drop drop;
	struct record record;
	int error = lcm_codec_decode_drop(event->data, event->size, &drop);

	if (error)
		return error;
	error = lcm_codec_record(&drop, &record);
	droptower_drop_decode_cleanup(&drop);
	if (error)
		return error;
	if (reading->has_drop)
		record_free(&reading->drop);
	reading->drop = record;
	reading->has_drop = true;
	return 0;
}

static int take_block(struct reading *reading, const struct lcm_log_event *event)
{
	droptower_block block;
	struct frame frame;
	int error = lcm_codec_decode_block(event->data, event->size, &block);

	if (!error)
		error = lcm_codec_frame(&block, &frame);
	if (!error)
		join_feed(reading->join, &frame);
	return error;
}

static void take_events(struct reading *reading, const struct source *source)
{
	struct lcm_log_event event;

	while (lcm_log_next(source, &reading->walk, &event)) {
		int error = 0;

		if (strcmp(event.channel, LCM_CODEC_DROP) == 0)
			error = take_drop(reading, &event);
		else if (strcmp(event.channel, LCM_CODEC_BLOCK) == 0)
			error = take_block(reading, &event);
		reading->refused += error != 0;
	}
}

static int finish(struct reading *reading, struct record *record, const struct source *source, char *message)
{
	int error = 0;

	if (reading->has_drop)
		*record = reading->drop;
	else
		error = join_take(reading->join, record);
	if (error == DT_E_EMPTY)
		return source_refuse(
		        message, error, source->file, 0,
		        "no message of a drop tower in %llu events, %llu refused, expected %s or %s",
		        (unsigned long long)reading->walk.events, (unsigned long long)reading->refused,
		        LCM_CODEC_DROP, LCM_CODEC_BLOCK);
	if (error)
		return source_refuse(message, error, source->file, 0, "%s", error_text(error));
	strcpy(record->format, "lcm");
	return 0;
}

int read_lcm(struct record *record, const struct source *source, char message[READ_MESSAGE_MAX])
{
	struct reading reading = {.join = join_create()};
	int error;

	if (!reading.join)
		return source_refuse(message, DT_E_MEMORY, source->file, 0, "%s", error_text(DT_E_MEMORY));
	take_events(&reading, source);
	error = finish(&reading, record, source, message);
	if (!error)
		record->counters.corrupt += reading.walk.skipped + reading.refused;
	join_destroy(reading.join);
	return error;
}
