/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HIL_BUSFAULT_H
#define DT_HIL_BUSFAULT_H
/*
 * A bad CAN bus, one direction of it: loses, repeats and reorders frames, and counts all it did. Every
 * frame draws the same number of random values whatever is switched on, so a seed loses the same frames
 * with and without the other troubles.
 *
 * No heap; any context; frames are copied. At all times
 *     taken + duplicated = given + lost + burst_lost + cut + silenced + busfault_held()
 */
#include <stdbool.h>
#include <stdint.h>

#include "common/frame.h"

enum {
	BUSFAULT_BEHIND_MAX = 3, /* a frame held back comes behind 1 to 3 that followed it */
	BUSFAULT_OUT_MAX = 2 * (1 + BUSFAULT_BEHIND_MAX),
};

struct busfault_options {
	double loss;      /* probability that a frame is lost, 0 to 1 */
	double duplicate; /* that it comes twice */
	double reorder;   /* that it is held back */
	bool cut_resend;  /* no RESENT_S1, RESENT_S2 passes */
};

struct busfault_counters {
	uint64_t taken, given; /* frames in and out */
	uint64_t lost;         /* at random */
	uint64_t burst_lost;
	uint64_t cut;
	uint64_t silenced; /* while the bus was silent */
	uint64_t duplicated;
	uint64_t reordered; /* held back */
};

struct busfault {
	struct busfault_options options;
	struct busfault_counters counters;
	uint64_t random;
	unsigned burst_left;
	bool silent;
	struct busfault_slot {
		struct frame frame;
		unsigned copies; /* 0: free */
		unsigned behind; /* frames still to pass it */
	} held[BUSFAULT_BEHIND_MAX];
};

void busfault_init(struct busfault *fault, const struct busfault_options *options, uint64_t seed);

/* The next `frames` live blocks (BLOCK_S1, BLOCK_S2) are lost. */
void busfault_burst(struct busfault *fault, unsigned frames);

/* Nothing passes until it is switched off again. */
void busfault_silence(struct busfault *fault, bool on);

/* Takes one frame in; returns how many come out, in their order, in out. */
unsigned busfault_pass(struct busfault *fault, const struct frame *frame, struct frame out[BUSFAULT_OUT_MAX]);

/* Frames, copies included, that are held back now. */
unsigned busfault_held(const struct busfault *fault);

#endif
