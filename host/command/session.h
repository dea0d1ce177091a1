/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_COMMAND_SESSION_H
#define DT_HOST_COMMAND_SESSION_H
/*
 * The host's end of a tower: keeps the heartbeat going, follows the tower's state, sends commands and
 * waits for their replies, collects a drop and asks for what is missing until its CRC-32 agrees, then
 * accepts it. Over a CAN link, or over LCM through `droptower bridge`: one interface, so that every
 * command works on both.
 *
 * One thread. Everything happens inside session_poll and the calls that wait; poll at least every 50 ms.
 */
#include <stdbool.h>
#include <stdint.h>

#include "common/frame.h"
#include "common/link/link.h"
#include "common/wire.h"
#include "host/record/record.h"

enum { SESSION_MESSAGE_MAX = 256 };

/* What is known of the tower, from its own messages. */
struct session_view {
	bool seen;         /* a status arrived */
	uint64_t statuses; /* so many did; ten a second */
	bool hash_known;   /* a heartbeat arrived */
	bool hash_agrees;  /* it carried our wire hash */
	uint32_t wire_hash;
	uint8_t state;   /* WIRE_STATE_* */
	uint8_t fault;   /* WIRE_FAULT_* */
	uint16_t checks; /* not green */
	uint16_t io;
	uint16_t drop_id;
	uint64_t blocks; /* live blocks received */
	uint64_t asked;  /* blocks asked for again */
	uint32_t counters[WIRE_COUNTERS];
	bool counter_known[WIRE_COUNTERS];
	const struct link_counters *link; /* what the link lost; NULL over LCM */
};

struct session_options {
	bool passive;     /* no heartbeat, no collecting: look and command only */
	struct link *log; /* as session_log */
	void (*on_frame)(void *user, const struct frame *frame); /* every frame received; NULL: none */
	bool (*cancelled)(void *user); /* a command other than ABORT is given up once this says so, asked
	                                * every 10 ms; NULL: only Ctrl-C cancels */
	void *user;
};

struct session;

/* url: a link of common/link/link.h, or "udpm://..." for LCM. NULL with one line in message. */
struct session *session_open(const char *url, const struct session_options *options,
                             char message[SESSION_MESSAGE_MAX]);
void session_close(struct session *session);

/* Every frame sent or received from now on is appended to log, over LCM the drop's own; NULL: none. It stays
 * the caller's. */
void session_log(struct session *session, struct link *log);

/* With hold the tower keeps what it captures and is asked for nothing; without, it is collected. Over LCM the
 * bridge collects in any case. */
void session_hold(struct session *session, bool hold);

/* Handles what arrives within timeout_ms (returns earlier after handling what was there). 0; DT_E_CLOSED when
 * the tower was heard and then nothing came for 2 s, or the link's other end is gone; DT_E_LINK; DT_E_SYSTEM
 * when the log cannot be written. */
DT_MUST_USE int session_poll(struct session *session, int timeout_ms);

const struct session_view *session_view(const struct session *session);

/* Sends a command and waits for its reply; a lost frame is sent again. 0, the tower's DT_E_* refusal,
 * DT_E_TIMEOUT, or the errors of session_poll. */
DT_MUST_USE int session_command(struct session *session, enum wire_op op, uint16_t token);

/* Writes a parameter (WIRE_PARAMETER_*). As session_command; DT_E_UNKNOWN over LCM, where parameters are
 * the bridge's business. */
DT_MUST_USE int session_set_parameter(struct session *session, enum wire_parameter_number number,
                                      uint32_t value);

/* Reads a parameter into value. As session_set_parameter; DT_E_EMPTY when the tower does not have it. */
DT_MUST_USE int session_get_parameter(struct session *session, enum wire_parameter_number number,
                                      uint32_t *value);

/* 1 and a record (free it) when a drop was collected, complete or given up; 0 when there is none. */
DT_MUST_USE int session_take_drop(struct session *session, struct record *record);

/* A token for ARM from the kernel's generator, never 0. */
uint16_t session_token(void);

/* A state of the tower: it drops, or holds a drop that nobody has fetched. */
bool session_drops(unsigned state);
/* No drop can come of it. */
bool session_at_rest(unsigned state);

/* Monotonic milliseconds, and microseconds since the epoch. */
int64_t session_now_ms(void);
int64_t session_utime(void);

#endif
