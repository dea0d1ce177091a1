/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/session/publish.h"

#include <droptower_result.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/link/link.h"
#include "common/wire.h"
#include "host/session/loopback.h"
#include "host/session/session.h"
#include "host/record/lcm_codec.h"

bool publisher_wants(const char *url)
{
	return strncmp(url, "udpm:", 5) == 0;
}

struct publisher *publisher_open(const char *url, char message[PUBLISH_MESSAGE_MAX])
{
	struct publisher *publisher = calloc(1, sizeof(*publisher));

	if (publisher != NULL) {
		publisher->url = strcmp(url, "udpm://") == 0 ? PUBLISH_URL : url;
		publisher->lcm = lcm_create(publisher->url);
	}
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

/* LCM opens its socket with the first subscription. What came before it was confined is thrown away. */
static int publish_confine(struct publisher *publisher)
{
	publisher->listening = true;
	if (!loopback_only(publisher->url))
		return 0;
	if (loopback_confine(publisher->url) != 0)
		return DT_E_LINK;
	while (lcm_handle_timeout(publisher->lcm, 0) > 0)
		continue;
	return 0;
}

static void ignore(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
	(void)buffer;
	(void)channel;
	(void)user;
}

int publisher_listen(struct publisher *publisher, const char *channel, lcm_msg_handler_t handler, void *user)
{
	lcm_subscription_t *subscription;

	if (!publisher->listening) {
		subscription = lcm_subscribe(publisher->lcm, "DT_.*", ignore, NULL);
		if (subscription == NULL || publish_confine(publisher) != 0)
			return DT_E_LINK;
		lcm_unsubscribe(publisher->lcm, subscription);
	}
	subscription = lcm_subscribe(publisher->lcm, channel, handler, user);
	return subscription != NULL && lcm_subscription_set_queue_capacity(subscription, 0) == 0 ? 0
	                                                                                         : DT_E_LINK;
}

static int publish_sent(int lcm_result)
{
	return lcm_result == 0 ? 0 : DT_E_LINK;
}

static int publish_signed(struct publisher *publisher, const char *channel, uint8_t *bytes, int size)
{
	if (size < MAC_BYTES)
		return DT_E_MEMORY;
	if (publisher->key != NULL)
		mac_seal(publisher->key, channel, bytes, (size_t)size);
	return publish_sent(lcm_publish(publisher->lcm, channel, bytes, (unsigned)size));
}

int publisher_state(struct publisher *publisher)
{
	uint8_t bytes[512];
	int64_t now_us = link_clock_us();

	if (!publisher->status_seen)
		return 0;
	publisher->utime = now_us > publisher->utime ? now_us : publisher->utime + 1;
	publisher->state.utime = publisher->utime;
	publisher->states++;
	return publish_signed(publisher, PUBLISH_STATE, bytes,
	                      droptower_state_encode(bytes, 0, sizeof(bytes), &publisher->state));
}

static int publish_status(struct publisher *publisher, const struct frame *frame)
{
	if (lcm_codec_state(frame, &publisher->state) != 0) {
		publisher->refused++;
		return 0;
	}
	publisher->status_seen = true;
	return publisher_state(publisher);
}

static int publish_block(struct publisher *publisher, const struct frame *frame)
{
	droptower_block block;

	if (lcm_codec_block(frame, &block) != 0) {
		publisher->refused++;
		return 0;
	}
	publisher->blocks++;
	publisher->state.drop_id = block.drop_id;
	return publish_sent(droptower_block_publish(publisher->lcm, LCM_CODEC_BLOCK, &block));
}

int publisher_frame(struct publisher *publisher, const struct frame *frame)
{
	switch (frame->id) {
	case WIRE_ID_STATUS:
		return publish_status(publisher, frame);
	case WIRE_ID_BLOCK_S1:
	case WIRE_ID_BLOCK_S2:
	case WIRE_ID_RESENT_S1:
	case WIRE_ID_RESENT_S2:
		return publish_block(publisher, frame);
	default:
		return 0;
	}
}

int publisher_drop(struct publisher *publisher, const struct record *record)
{
	droptower_drop drop;
	uint8_t *bytes;
	int size, result = lcm_codec_drop(record, link_clock_us(), &drop);

	if (result != 0)
		return result;
	publisher->drops++;
	size = droptower_drop_encoded_size(&drop);
	bytes = malloc((size_t)size);
	if (bytes == NULL)
		result = DT_E_MEMORY;
	else
		result = publish_signed(publisher, LCM_CODEC_DROP, bytes,
		                        droptower_drop_encode(bytes, 0, size, &drop));
	free(bytes);
	lcm_codec_free_drop(&drop);
	return result;
}

int publisher_result(struct publisher *publisher, unsigned drop_id, const char *json)
{
	union { /* the generated struct has no const, and publishing does not write */
		const char *given;
		char *taken;
	} text = {.given = json};
	droptower_result result = {.utime = link_clock_us(), .drop_id = (int32_t)drop_id, .json = text.taken};

	return publish_sent(droptower_result_publish(publisher->lcm, PUBLISH_RESULT, &result));
}

int publisher_raw(struct publisher *publisher, const char *channel, const void *bytes, size_t size)
{
	return publish_sent(lcm_publish(publisher->lcm, channel, bytes, (unsigned)size));
}
