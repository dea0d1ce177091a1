/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HIL_HAZARD_H
#define DT_HIL_HAZARD_H
/*
 * What a controller must never do, seen from outside: by its outputs, by what it says of its state, and by
 * what the tower really does. Each is counted once for each time it begins; README.md of the scenarios lists
 * them.
 *
 * tower_s is the tower's own time. Plain data, no heap, one thread.
 */
#include <stdbool.h>
#include <stdint.h>

#include "common/wire.h"
#include "hil/tower.h"

struct hazard {
	unsigned count;
	unsigned unbraked; /* frames that moved on where dampers should have braked them */
	const char *first; /* what it was, NULL: nothing */
	double first_s;    /* tower's time */

	double free_fall_s; /* from the latch to the dampers */
	uint16_t outputs, inputs;
	double warning_s, latch_s; /* when they were energised last, NAN: never */
	double chain_s, guard_s;   /* since when a contact of the chain, a guard is open; NAN: it is not */
	double loss_s;             /* when a guard was lost that nobody has acknowledged yet, NAN: none */
	double latch_open_s;       /* of the drop under way, NAN: none */
	unsigned captures;         /* gates since the latch was energised, a bit each */
	unsigned unwarned;         /* blocks in a row that should have had a warning */
	uint8_t state;
	bool chain_told, ready_told, relief_told, unbraked_told;
	bool asked;    /* since the frame was last at rest a RELEASE opened its latch */
	bool dropping; /* frame or product have left their places */
	bool free_running;
};

/* dampers_m: travel to them. */
void hazard_init(struct hazard *hazard, double dampers_m);

/* The firmware starts anew. */
void hazard_reset(struct hazard *hazard);

/* An edge of an output; asked: a RELEASE came just before. */
void hazard_edge(struct hazard *hazard, uint16_t mask, bool on, bool asked, double tower_s);

/* At every sample. captures: gates that were broken since the one before. */
void hazard_sample(struct hazard *hazard, uint16_t inputs, unsigned captures, const struct tower_truth *truth,
                   double tower_s);

/* What a live block says: state and io of one tick; what a status message says. */
void hazard_block(struct hazard *hazard, uint8_t state, uint16_t io);
void hazard_state(struct hazard *hazard, uint8_t state, const struct tower_truth *truth, double tower_s);

/* A hand lets the product go: that it falls is wanted. Before the next sample. */
void hazard_let_go(struct hazard *hazard);

/* CLEAR was taken. */
void hazard_acknowledged(struct hazard *hazard);

/* Those that show when the run is over. */
unsigned hazard_count(const struct hazard *hazard);

#endif
