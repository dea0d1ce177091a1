/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HIL_MONITOR_H
#define DT_HIL_MONITOR_H
/*
 * Watches a run and writes down what a verdict needs: states, emergencies, replies, counters, what the
 * outputs did against what the tower did, and who lost which frames. Decides nothing.
 *
 * The bench calls it with what it carries; it takes nothing from the firmware's code and asks no host.
 * "From the firmware" is before the fault injector, "at the host" behind it. tower_s is the tower's own
 * time, now_us the firmware's since the run began. No heap; one thread; a struct of 370 kB.
 */
#include <stdbool.h>
#include <stdint.h>

#include "common/frame.h"
#include "common/scenes/scene.h"
#include "common/segment.h"
#include "common/sensorbus.h"
#include "common/wire.h"
#include "hil/busfault.h"
#include "hil/hazard.h"
#include "hil/scenario.h"
#include "hil/tower.h"

enum {
	MONITOR_TICKS = 1 << 16, /* blocks are told apart up to this tick since a reset */
	MONITOR_NOTES = 64,      /* of each kind that are kept; further ones are counted */
};

struct monitor_note {
	uint32_t number; /* state, fault, error or abort code */
	double time_s;   /* virtual */
};

struct monitor_notes {
	unsigned count; /* all of them */
	struct monitor_note note[MONITOR_NOTES];
};

/* The live blocks of one sensor since the latest reset. */
struct monitor_blocks {
	uint8_t sent[MONITOR_TICKS], received[MONITOR_TICKS]; /* 0 or 1 */
	int64_t last;                                         /* tick received, -1: none */
	int64_t gaps;
};

struct monitor {
	double tower_rate;       /* the tower's seconds in one of the firmware's */
	double planned_travel_m; /* where the product shall leave the frame */
	double now_s;            /* virtual time */

	struct monitor_notes path, emcy, replies, refused, aborts;
	uint8_t state, fault;
	bool was_ready;
	uint32_t checks;    /* told as not green at any time since it first was READY */
	double block_s;     /* when the last live block told the state, negative: none yet */
	bool emcy_is_wrong; /* a code that is not its fault's */

	bool has_counter[WIRE_COUNTERS];
	uint32_t counter[WIRE_COUNTERS];
	uint64_t sent, given;            /* frames from and to the firmware since its reset */
	int64_t sent_error, given_error; /* the firmware's count less ours, the worst */
	uint64_t hash;                   /* FNV-1a of all frames from the firmware, with their times */

	struct monitor_blocks blocks[WIRE_SENSORS];
	int64_t blocks_error; /* of boots before the present one */
	double gaps_before, blocks_before;

	struct segment_join segments; /* of classic CAN */
	struct wire_capture_end capture;
	unsigned captures;
	double capture_first_s; /* tower's time of its first tick */
	struct monitor_tail {   /* what follows a capture end */
		struct wire_measured measured;
		bool has_measured;
		uint32_t value[WIRE_PARAMETERS];
		uint32_t has_value; /* a bit each */
	} tail;
	unsigned tails;     /* captures with all of it, the parameters those of the capture end's CRC-32 */
	unsigned tail_bad;  /* seals that do not agree, sets that are not what the capture end says */
	unsigned separated; /* drops whose separation was measured */
	double separation_error_um, dropout_error_us, latch_delay_error_us; /* against the tower, the worst */
	double dropout_first_us;                                            /* measured, NAN: none */

	struct tower_truth truth; /* of the latest drop that began */
	unsigned impacts, resets;
	double event_s, reaction_ms; /* when something went wrong last, and how soon a state answered; NAN */
	struct hazard hazard;
	double release_us; /* when the last RELEASE reached the firmware, NAN: never */
	double latch_us;   /* from there to the latch's edge, NAN */
	double latch_s;    /* that edge, tower's time */
	double warning_ms; /* that the warning was on before it, NAN */
	double relieve_s;  /* dampers not relieved any more, tower's time, NAN */
	int peak_x;        /* counts */
	unsigned bursts;
	double burst_end_s;
};

/* tower_rate: the tower's seconds in one of the firmware's. */
void monitor_init(struct monitor *monitor, const struct scene *scene, double tower_rate);

/* The firmware started anew: its counters and ticks begin at 0. */
void monitor_reset(struct monitor *monitor);

/* Something goes wrong now. */
void monitor_event(struct monitor *monitor, double now_s);

/* An edge of the firmware's output; the tower has not made it yet. */
void monitor_edge(struct monitor *monitor, unsigned bit, bool on, double edge_us, double tower_s);

/* What was converted, and the tower as it is now. */
void monitor_sample(struct monitor *monitor, unsigned group, const struct sensorbus_answer *answer,
                    const struct tower_truth *truth, double tower_s);

/* tick_s: tower's time of the firmware's tick 0; tower_s: now. */
void monitor_from_firmware(struct monitor *monitor, const struct frame *frame, double tick_s, double tower_s);
void monitor_at_host(struct monitor *monitor, const struct frame *frame);
void monitor_to_firmware(struct monitor *monitor, const struct frame *frame, double now_us);

/* The numbers of scenario.def that come from here; the rest (done, complete, discarded, ledger_bus,
 * edges_outside, queue_lost) is the bench's. NAN: did not happen. */
void monitor_results(const struct monitor *monitor, double results[SCENARIO_RESULTS]);

#endif
