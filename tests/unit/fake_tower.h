/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_UNIT_FAKE_TOWER_H
#define DT_TESTS_UNIT_FAKE_TOWER_H
/*
 * A tower on the bus that a thread of the test plays: it answers, or does not, as the test says, and writes
 * down what it was told, in order.
 */
#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "common/link/link.h"
#include "firmware/parameter.h"
#include "tests/unit/drop_by_hand.h"

enum {
	FAKE_TOWER_HEARD_MAX = 4096,
	FAKE_TOWER_PARAMETERS = 6, /* that a host writes for a series */
};

extern struct fake_tower {
	pthread_t thread;
	pthread_mutex_t lock;
	struct link *link;
	bool stop;
	/* how it behaves */
	bool dumb;      /* says nothing at all */
	bool boots;     /* its next heartbeat is that of a tower that has just started */
	unsigned deaf;  /* ops that are not answered, a bit each */
	int8_t refusal; /* what ARM is answered with */
	unsigned hole;  /* live blocks of S2 that are lost */
	bool falls;     /* a release becomes a drop; else it stays in motion */
	bool fall_due;  /* what is in motion has fallen */
	uint8_t fault;  /* in motion */
	/* what it is */
	uint8_t state;
	uint32_t session; /* in the host's heartbeat */
	uint32_t nonce;
	bool captured;
	struct hand_drop drop;
	/* what it heard: ops; of parameters only how many */
	uint8_t heard[FAKE_TOWER_HEARD_MAX];
	unsigned heard_count, parameters, resends; /* parameters: written */
	struct parameters values;                  /* and what it took of them */
	atomic_uint ends;                          /* said so often that it holds a drop */
} fake_tower;

/* At rest, READY, with a drop by hand that it has not made yet. */
void fake_tower_reset(void);

/* On the bus from then on, and no longer. */
void fake_tower_join(const char *url);
void fake_tower_leave(void);

/* How often it was told this. */
unsigned fake_tower_heard(unsigned op);

/* deaf: ops that are not answered, a bit each; refusal: of ARM. */
void fake_tower_behave(unsigned deaf, int8_t refusal, bool falls);

/* It holds a drop of which no block comes by itself. */
void fake_tower_fall_unseen(void);

#endif
