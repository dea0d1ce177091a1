/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_SEQUENCE_H
#define DT_FIRMWARE_SEQUENCE_H
/*
 * What the tower does next: the states of wire.def, a const table of state x event, and the outputs that
 * belong to each state.
 *
 *   BOOT -> SAFE <-> READY -> ARMED -> FALLING -> SEPARATED -> BRAKED -> CAPTURED -> UPLOADED -> SAFE
 *   at rest -> FAULT_HELD, in motion -> FAULT_MOVING -> CAPTURED -> UPLOADED -> FAULT_HELD -> SAFE
 *   FAULT_MOVING -> FAULT_HELD when the frame never left the latch
 *
 * Outputs fail safe when de-energised, but for the magnet, whose release is the drop: it is energised by
 * sequence_init and by SAFE, and de-energised by nothing but the edge computed from the two light gates.
 *
 * Context: control (sequence_tick, sequence_gate); everything else from main between port_lock and
 * port_unlock, so that no two calls overlap. Times in us wrap after 71 minutes, in ms after 49 days.
 */
#include <stdbool.h>
#include <stdint.h>

#include "common/wire.h"
#include "firmware/parameter.h"
#include "firmware/port.h"

enum sequence_event {
	SEQUENCE_TESTED, /* self-test passed */
	SEQUENCE_GREEN,  /* all checks are green */
	SEQUENCE_RED,    /* a check is not */
	SEQUENCE_ARM,
	SEQUENCE_RELEASE,
	SEQUENCE_ABORT,
	SEQUENCE_CLEAR,
	SEQUENCE_ACCEPT,
	SEQUENCE_DISCARD,
	SEQUENCE_EXPIRED, /* armed for too long */
	SEQUENCE_FREE,    /* the magnet is off */
	SEQUENCE_BRAKE,   /* the dampers are not relieved any more, or the frame is in them */
	SEQUENCE_FULL,    /* the capture window is complete */
	SEQUENCE_DONE,    /* UPLOADED has been shown long enough */
	SEQUENCE_STILL,   /* the frame never left the latch */
	SEQUENCE_FAULT,
	SEQUENCE_EVENTS
};

/* What sequence_next returns beside a state. */
enum {
	SEQUENCE_STAY = 0xFE, /* understood, nothing changes */
	SEQUENCE_NO = 0xFF,   /* has no place in this state: a command is refused */
};

enum {
	SEQUENCE_SELF_TEST_MS = 100,
	SEQUENCE_CAMERA_MS = 10,
	SEQUENCE_LATCH_MS = 100,     /* the latch must be open by then */
	SEQUENCE_NO_IMPACT_MS = 600, /* after separation, or after a fault in motion */
	SEQUENCE_UPLOADED_MS = 200,  /* two status messages show it */
};

/* From the parameters, for the fall. Constant acceleration from rest: a travel s takes sqrt(2 s / a), so with
 * t1, t2 at the gates s1, s2 the time from t2 to s is (t2 - t1) (sqrt s - sqrt s2) / (sqrt s2 - sqrt s1). */
struct sequence_plan {
	uint32_t separation_q24, dampers_q24; /* that factor for the two travels */
	uint32_t gate_limit_us[2];            /* after release; twice the free fall */
	uint32_t fast_us, slow_us; /* time between the gates: less is no fall, more is a slow one */
	uint32_t gate_distance_um;
};

struct sequence {
	const struct parameters *parameters;
	volatile uint32_t *counters;
	struct sequence_plan plan;
	uint8_t state; /* WIRE_STATE_* */
	uint8_t fault; /* WIRE_FAULT_*, latched until CLEAR */
	uint8_t gates_seen;
	bool triggered;
	bool moved;     /* since the release something has seen the frame move */
	uint16_t token; /* 0 unless armed */
	uint16_t drop_id;
	uint16_t marks; /* WIRE_MARK_* of this drop */
	uint16_t frame_speed_mm_s;
	uint32_t tick_ms;    /* now */
	uint32_t entered_ms; /* the state */
	uint32_t released_ms, released_us;
	uint32_t upper_us;     /* t1 */
	uint32_t no_impact_ms; /* when waiting for an impact ends */
};

/* What is seen at the moment of a call. */
struct sequence_view {
	uint32_t now_us;
	uint16_t io;
	uint16_t checks; /* WIRE_CHECK_* that are not green */
	bool clocks_good;
	bool hash_differs; /* the host is there, but with another wire.def */
};

/* Energises the magnet, de-energises the rest. Before interrupts. */
void sequence_init(struct sequence *sequence, const struct parameters *parameters,
                   volatile uint32_t *counters, enum port_reset cause);

/* After a change of parameters. */
void sequence_plan(struct sequence *sequence);

void sequence_tick(struct sequence *sequence, const struct sequence_view *view, uint32_t tick_ms);

/* gate 0 upper, 1 lower: its beam was broken at time_us. */
void sequence_gate(struct sequence *sequence, unsigned gate, uint32_t time_us);

/* 0 or why not: DT_E_STATE, DT_E_CHECKS, DT_E_HASH, DT_E_TOKEN, DT_E_CORRUPT (ACCEPT with a CRC-32 that is
 * not the capture's), DT_E_UNKNOWN. */
DT_MUST_USE int sequence_command(struct sequence *sequence, const struct sequence_view *view,
                                 const struct wire_command *command, uint32_t capture_crc32);

/* Never refused. */
void sequence_abort(struct sequence *sequence);

/* Latches a fault and goes to the fault state that fits; the first fault stays. */
void sequence_fault(struct sequence *sequence, enum wire_fault fault);

/* The capture has seen its trigger; the capture is complete. */
void sequence_triggered(struct sequence *sequence);
void sequence_full(struct sequence *sequence);

/* WIRE_MARK_NO_IMPACT when the capture shall trigger without an impact, else 0. */
uint16_t sequence_tick_marks(const struct sequence *sequence);

/* The table: a state, SEQUENCE_STAY or SEQUENCE_NO. */
uint8_t sequence_next(unsigned state, enum sequence_event event);

bool sequence_moving(unsigned state);
bool sequence_separated(unsigned state); /* moving, and the trigger is enabled */

#endif
