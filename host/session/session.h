/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_SESSION_SESSION_H
#define DT_HOST_SESSION_SESSION_H
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

enum {
	SESSION_MESSAGE_MAX = 256,
	SESSION_STATUSES_HZ = 10, /* by the tower's clock; over LCM the bridge hands on each */
};

/* What is known of the tower, from its own messages. */
struct session_view {
	bool seen;         /* a status arrived */
	uint64_t statuses; /* so many did */
	int64_t status_ms; /* session_now_ms() of the newest */
	bool hash_known;   /* a heartbeat arrived */
	bool hash_agrees;  /* it carried our wire hash */
	uint32_t wire_hash;
	uint8_t state;   /* WIRE_STATE_* */
	uint8_t fault;   /* WIRE_FAULT_* */
	uint32_t checks; /* not green */
	uint16_t io;
	uint16_t drop_id; /* of the newest drop that was heard of */

	uint32_t session; /* our own number, drawn when the session was opened; over LCM the bridge's client's
	                   */
	bool armed;       /* by us, and not released yet: what follows is valid */
	uint32_t nonce;   /* that RELEASE answers */
	uint16_t armed_drop_id;
	int64_t release_from_ms; /* session_now_ms() from which RELEASE is taken: the warning is over */
	int64_t armed_until_ms;  /* at which the tower disarms by itself */

	bool collected; /* what the tower captured last is held, or was given up */
	bool kept;      /* and was not accepted: the tower waits for session_accept */

	bool parameters_known;                /* the set that ARM names; CAN only */
	uint32_t parameters[WIRE_PARAMETERS]; /* as read, or written since */

	bool measured_known; /* by the last drop */
	struct wire_measured measured;

	uint64_t blocks; /* live blocks received */
	uint64_t asked;  /* blocks asked for again */
	uint32_t counters[WIRE_COUNTERS];
	bool counter_known[WIRE_COUNTERS];
	bool two_towers;                  /* their clocks disagree: nothing that comes can be trusted */
	const struct link_counters *link; /* what the link lost; NULL over LCM */
};

struct session_options {
	bool passive;        /* no heartbeat, no collecting: look, set, ABORT and CLEAR only */
	const char *key;     /* file with the key that signs commands over LCM; NULL: none, and only ABORT */
	const char *program; /* writes every command into the journal (journal.h) under this name; NULL: none
	                      */
	const char *operator_name; /* who gives them; NULL: the user that runs this */
	struct link *log;          /* as session_log */
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
 * the caller's. A drop that is in the log is accepted, and the tower forgets it. Without a log, or with one
 * that could not be written, the tower keeps the drop until session_accept. */
void session_log(struct session *session, struct link *log);

/* The drop that was taken is safe: the tower may forget it. 0 too when it has; DT_E_LINK, DT_E_CLOSED. */
DT_MUST_USE int session_accept(struct session *session);

/* With hold the tower keeps what it captures and is asked for nothing; without, it is collected. Over LCM the
 * bridge collects in any case. */
void session_hold(struct session *session, bool hold);

/* Handles what arrives within timeout_ms (returns earlier after handling what was there). 0; DT_E_CLOSED when
 * the tower was heard and then nothing came for 5 s, or the link's other end is gone; DT_E_LINK; DT_E_SYSTEM
 * when the log cannot be written. */
DT_MUST_USE int session_poll(struct session *session, int timeout_ms);

const struct session_view *session_view(const struct session *session);

/* Sends a command and waits for its reply; a lost frame is sent again.
 *
 * ARM     names this session and the parameters it believes in: those in view, read first when none are
 * known. 0: view has `armed`. DT_E_PARAMETERS: the tower has others, and a person must see which; it is not
 *         tried again with them.
 * RELEASE answers the nonce of this ARM. DT_E_TOKEN when nothing is armed by us; DT_E_EARLY before the
 * warning is over: still armed. ABORT, CLEAR need nothing.
 *
 * 0, the tower's DT_E_* refusal, DT_E_TIMEOUT, or the errors of session_poll. */
DT_MUST_USE int session_command(struct session *session, enum wire_op op);

/* Reads every parameter into view: from now on the set that ARM names. 0 or as session_get_parameter. */
DT_MUST_USE int session_read_parameters(struct session *session);

/* Writes a parameter (WIRE_PARAMETER_*). As session_command; DT_E_UNKNOWN over LCM, where parameters are
 * the bridge's business. */
DT_MUST_USE int session_set_parameter(struct session *session, enum wire_parameter_number number,
                                      uint32_t value);

/* Reads a parameter into value, not into view. As session_set_parameter; DT_E_EMPTY when the tower does not
 * have it. */
DT_MUST_USE int session_get_parameter(struct session *session, enum wire_parameter_number number,
                                      uint32_t *value);

/* 1 and a record (free it) when a drop was collected, complete or given up; 0 when there is none. */
DT_MUST_USE int session_take_drop(struct session *session, struct record *record);

/* A state of the tower: it drops, or holds a drop that nobody has fetched. */
bool session_drops(unsigned state);
/* No drop can come of it. */
bool session_at_rest(unsigned state);

/* The tower has sent as many statuses, or none for 20 s. A limit in statuses is one of the tower's clock,
 * which is slow where the tower is simulated on a busy machine; a limit of ours would be over before the
 * tower's. */
bool session_is_over(const struct session *session, uint64_t statuses);

/* Milliseconds of link_now_us. */
int64_t session_now_ms(void);

#endif
