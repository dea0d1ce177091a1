/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_SESSION_MAC_H
#define DT_HOST_SESSION_MAC_H
/*
 * That a message on LCM comes from somebody who has the key, and a command from somebody who has it now.
 *
 * Messages that prove something end with a MAC_WRONG: HMAC-SHA256 (RFC 2104, FIPS 180-4) over the channel's
 * name, a zero byte, and the message as LCM encodes it (fingerprint first, big endian) up to the MAC. The
 * bytes are judged before anything is decoded.
 *
 * A command is taken once: it names the session of one bridge, which that drew at random, is not older than
 * MAC_AGE_US by the sender's and our clock, and its counter is greater than that of any taken before. So
 * one that is recorded and sent again is refused, as is one that comes behind a later one.
 *
 * Any context, no state but the caller's; comparisons in constant time.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <droptower_command.h>

#include "common/error.h"

enum {
	MAC_BYTES = 32,
	MAC_KEY_MIN = 32,
	MAC_KEY_MAX = 4096,
	MAC_AGE_US = 1000000, /* and as much in the future */
	MAC_MESSAGE_MAX = 256,
};

struct mac_key {
	uint8_t bytes[MAC_KEY_MAX];
	size_t size;
};

/* The bytes of a regular file that belongs to us or root and that nobody else may read or write. 0, or
 * DT_E_ARGUMENT with one line in message: which file, what it is, what was expected. */
DT_MUST_USE int mac_read_key(const char *path, struct mac_key *key, char message[MAC_MESSAGE_MAX]);

/* Writes the MAC into the last bytes of an encoded message. */
void mac_seal(const struct mac_key *key, const char *channel, uint8_t *bytes, size_t size);

/* The message's MAC is that of its bytes. */
bool mac_holds(const struct mac_key *key, const char *channel, const void *bytes, size_t size);

/* Why a command is refused; on the wire in DT_STATE. */
enum mac_refusal {
	MAC_TAKEN,
	MAC_FORM,     /* no DT_COMMAND */
	MAC_CLOSED,   /* the bridge takes none */
	MAC_WRONG,    /* no key, another key, or changed on its way */
	MAC_SESSION,  /* for another bridge, or the one before it was restarted */
	MAC_TIME,     /* more than a second old, or from the future */
	MAC_REPEATED, /* repeated, or behind a later one */
	MAC_BUSY,     /* another waits; said by the caller */
	MAC_REFUSALS
};

const char *mac_text(enum mac_refusal refusal);

/* What the taker of commands remembers. */
struct mac_taker {
	const struct mac_key *key; /* NULL: none is taken */
	uint32_t session;
	int64_t counter; /* of the last one taken */
	uint64_t refused[MAC_REFUSALS];
};

/* Judges a message of channel DT_COMMAND at now_us since the epoch. The command is decoded for all but
 * MAC_FORM: ABORT never asks for proof. What is refused is counted, ABORT too. */
enum mac_refusal mac_judge(struct mac_taker *taker, const void *bytes, size_t size, int64_t now_us,
                           droptower_command *command);

#endif
