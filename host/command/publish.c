/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/command/publish.h"

#include <droptower_result.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/wire.h"
#include "host/command/session.h"
#include "host/record/lcm_codec.h"

bool publisher_wants(const char *url)
{
	return strncmp(url, "udpm:", 5) == 0;
}

struct publisher *publisher_open(const char *url, char message[PUBLISH_MESSAGE_MAX])
{
	struct publisher *publisher = calloc(1, sizeof(*publisher));

	if (publisher != NULL)
		publisher->lcm = lcm_create(strcmp(url, "udpm://") == 0 ? PUBLISH_URL : url);
	if (publisher == NULL || publisher->lcm == NULL) {
		free(publisher);
		snprintf(message, PUBLISH_MESSAGE_MAX,
		         "%.160s: LCM refuses; is there a route for multicast (ip route add 224.0.0.0/4 dev "
		         "lo)?",
		         url);
		return NULL;
	}
	return publisher;
}

void publisher_close(struct publisher *publisher)
{
	if (publisher == NULL)
		return;
	lcm_destroy(publisher->lcm);
	free(publisher);
}

static int sent(int lcm_result)
{
	return lcm_result == 0 ? 0 : DT_E_LINK;
}

static int publish_state(struct publisher *publisher, const struct frame *frame)
{
	droptower_state state = {.command_utime = publisher->command_utime,
	                         .command_result = publisher->command_result};

	if (lcm_codec_state(frame, &state) != 0) {
		publisher->refused++;
		return 0;
	}
	publisher->status = *frame;
	publisher->states++;
	return sent(droptower_state_publish(publisher->lcm, PUBLISH_STATE, &state));
}

static int publish_block(struct publisher *publisher, const struct frame *frame)
{
	droptower_block block;

	if (lcm_codec_block(frame, &block) != 0) {
		publisher->refused++;
		return 0;
	}
	publisher->blocks++;
	return sent(droptower_block_publish(publisher->lcm, LCM_CODEC_BLOCK, &block));
}

int publisher_frame(struct publisher *publisher, const struct frame *frame)
{
	switch (frame->id) {
	case WIRE_ID_STATUS:
		return publish_state(publisher, frame);
	case WIRE_ID_BLOCK_S1:
	case WIRE_ID_BLOCK_S2:
	case WIRE_ID_RESENT_S1:
	case WIRE_ID_RESENT_S2:
		return publish_block(publisher, frame);
	default:
		return 0;
	}
}

int publisher_answer(struct publisher *publisher, int64_t command_utime, int result)
{
	publisher->command_utime = command_utime;
	publisher->command_result = (int16_t)result;
	return publish_state(publisher, &publisher->status);
}

int publisher_drop(struct publisher *publisher, const struct record *record)
{
	droptower_drop drop;
	int result = lcm_codec_drop(record, session_utime(), &drop);

	if (result != 0)
		return result;
	publisher->drops++;
	result = sent(droptower_drop_publish(publisher->lcm, LCM_CODEC_DROP, &drop));
	lcm_codec_free_drop(&drop);
	return result;
}

int publisher_result(struct publisher *publisher, unsigned drop_id, const char *json)
{
	union { /* the generated struct has no const, and publishing does not write */
		const char *given;
		char *taken;
	} text = {.given = json};
	droptower_result result = {.utime = session_utime(), .drop_id = (int32_t)drop_id, .json = text.taken};

	return sent(droptower_result_publish(publisher->lcm, PUBLISH_RESULT, &result));
}

int publisher_raw(struct publisher *publisher, const char *channel, const void *bytes, size_t size)
{
	return sent(lcm_publish(publisher->lcm, channel, bytes, (unsigned)size));
}
