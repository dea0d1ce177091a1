/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_SESSION_PUBLISH_H
#define DT_HOST_SESSION_PUBLISH_H
/*
 * What the host publishes on LCM: DT_BLOCK, DT_STATE, DT_DROP, DT_RESULT; and DT_COMMAND, which it takes.
 * One thread. The bridge, the replay and a session over LCM use it.
 *
 * With a key DT_STATE and DT_DROP carry a MAC (mac.h). What is received is only what this machine sent,
 * unless the URL says otherwise (loopback.h).
 */
#include <stdbool.h>
#include <stddef.h>

#include <lcm/lcm.h>

#include <droptower_state.h>

#include "common/frame.h"
#include "host/session/mac.h"
#include "host/record/record.h"

#define PUBLISH_STATE "DT_STATE"
#define PUBLISH_COMMAND "DT_COMMAND"
#define PUBLISH_RESULT "DT_RESULT"

enum { PUBLISH_MESSAGE_MAX = 256 };

/* What one bus needs besides the default: no time to live beyond this machine, room for a burst. */
#define PUBLISH_URL "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=4194304"

struct publisher {
	lcm_t *lcm;
	const char *url; /* the caller's */
	bool listening;
	const struct mac_key *key; /* signs; NULL: nothing is signed */
	droptower_state state;     /* the last one; the bridge keeps what it says of commands */
	bool status_seen;
	int64_t utime;                           /* of the last state; grows */
	uint64_t blocks, states, drops, refused; /* refused: frames that are none of the wire's */
};

/* url is an LCM provider's, so neither a link nor a log. */
bool publisher_wants(const char *url);

/* NULL with one line in message. */
struct publisher *publisher_open(const char *url, char message[PUBLISH_MESSAGE_MAX]);
void publisher_close(struct publisher *publisher);

/* A frame of the tower: blocks and status are published, the others are none of LCM's business. 0 or
 * DT_E_LINK. */
DT_MUST_USE int publisher_frame(struct publisher *publisher, const struct frame *frame);

/* A collected drop, and the result of its analysis as JSON. 0, DT_E_LINK, DT_E_MEMORY, DT_E_ARGUMENT. */
DT_MUST_USE int publisher_drop(struct publisher *publisher, const struct record *record);
DT_MUST_USE int publisher_result(struct publisher *publisher, unsigned drop_id, const char *json);

/* Publishes the last state again with what is now said of commands. */
DT_MUST_USE int publisher_state(struct publisher *publisher);

/* The bytes of a message, as they are and unchecked, to a handler: none is lost to a full queue. 0 or
 * DT_E_LINK: LCM refuses, or its socket cannot be kept to this machine. */
DT_MUST_USE int publisher_listen(struct publisher *publisher, const char *channel, lcm_msg_handler_t handler,
                                 void *user);

/* Bytes as they are. */
DT_MUST_USE int publisher_raw(struct publisher *publisher, const char *channel, const void *bytes,
                              size_t size);

#endif
