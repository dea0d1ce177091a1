/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * LCM event logs: each drop message is a drop; block messages go through the join, for what never became one.
 */
#include <string.h>

#include "host/record/digest.h"
#include "host/record/lcm_codec.h"
#include "host/record/lcm_log.h"
#include "host/record/log_walk.h"
#include "host/record/seal.h"

enum { ORIGIN_MAX = 1024 };

struct reading {
	struct log_walk *walk;
	bool has_drop; /* the event before was a drop, decoded or not, or what is known of it */
	bool wanted;   /* with its samples: then SHA-256 of both */
	struct sha256_ctx digest;
};

static int read_lcm_take_drop(struct log_walk *walk, const struct lcm_log_event *event)
{
	droptower_drop drop;
	struct record record;
	int error = lcm_codec_decode_drop(event->data, event->size, event->cut, &drop);

	if (error)
		return error;
	error = (log_walk_may_want(walk) ? lcm_codec_record : lcm_codec_outline)(&drop, &record);
	lcm_codec_free_drop(&drop);
	if (!error)
		log_walk_drop(walk, &record);
	return error;
}

static int read_lcm_take_block(struct log_walk *walk, const struct lcm_log_event *event)
{
	droptower_block block;
	struct frame frame;
	int error = lcm_codec_decode_block(event->data, event->size, &block);

	if (!error)
		error = lcm_codec_frame(&block, &frame);
	if (!error)
		log_walk_frame(walk, &frame);
	return error;
}

/* Seals the drop message before it. Whom nobody reads is not hashed: what a list says of it, the tower's own
 * two CRC-32 prove. */
static int take_seal(struct reading *reading, const struct lcm_log_event *event)
{
	size_t word = strlen(SEAL_WORD);
	const char *expected = (const char *)event->data + word;
	char found[DIGEST_CHARS];

	if (!reading->has_drop || event->size != word + DIGEST_CHARS - 1 ||
	    memcmp(event->data, SEAL_WORD, word) != 0)
		return DT_E_FORMAT;
	if (reading->wanted)
		digest_end(&reading->digest, found);
	if (!reading->wanted || memcmp(expected, found, DIGEST_CHARS - 1) == 0)
		log_walk_sealed(reading->walk);
	else
		log_walk_altered(reading->walk, found, expected);
	return 0;
}

/* What is known of the drop message before it. */
static int take_origin(struct reading *reading, const struct lcm_log_event *event)
{
	char text[ORIGIN_MAX + 1], *rest = text;

	if (!reading->has_drop || event->size > ORIGIN_MAX)
		return DT_E_FORMAT;
	if (reading->wanted)
		sha256_update(&reading->digest, event->size, event->data);
	memcpy(text, event->data, event->size);
	text[event->size] = '\0';
	for (char *line = strtok_r(text, "\n", &rest); line != NULL; line = strtok_r(NULL, "\n", &rest)) {
		char *value = strchr(line, ' ');

		if (value == NULL)
			return DT_E_FORMAT;
		*value++ = '\0';
		if (log_walk_told(reading->walk, line, value) != 0)
			return DT_E_FORMAT;
	}
	return 0;
}

static int take_event(struct reading *reading, const struct lcm_log_event *event)
{
	bool is_drop = strcmp(event->channel, LCM_CODEC_DROP) == 0, is_origin = false;
	int error = 0;

	if (event->data == NULL || (event->cut && !is_drop))
		return 0;
	if (is_drop) {
		reading->wanted = log_walk_may_want(reading->walk);
		sha256_init(&reading->digest);
		if (reading->wanted)
			sha256_update(&reading->digest, event->size, event->data);
		error = read_lcm_take_drop(reading->walk, event);
	} else if (strcmp(event->channel, LCM_LOG_ORIGIN) == 0) {
		is_origin = true;
		error = take_origin(reading, event);
	} else if (strcmp(event->channel, LCM_LOG_SEAL) == 0) {
		error = take_seal(reading, event);
	} else if (strcmp(event->channel, LCM_CODEC_BLOCK) == 0) {
		error = read_lcm_take_block(reading->walk, event);
	}
	reading->has_drop = is_drop || (is_origin && reading->has_drop);
	return error;
}

void read_lcm(struct log_walk *walk, struct log_file *log, uint64_t from, uint64_t to)
{
	struct lcm_log_walk events = {.at = from, .end = to};
	struct reading reading = {.walk = walk};
	struct lcm_log_event event;
	uint64_t skipped = 0;

	while (walk->result == 0 && lcm_log_next(log, &events, &event)) {
		bool refused;

		walk->corrupt += events.skipped - skipped;
		skipped = events.skipped;
		walk->at = event.at;
		walk->next = events.at;
		walk->time_us = event.time_us;
		refused = take_event(&reading, &event) != 0;
		walk->corrupt += refused;
		walk->contents->refused += refused;
	}
	walk->corrupt += events.skipped - skipped;
	walk->contents->frames = events.events;
}
