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
 *   SEPARATED, BRAKED, FAULT_MOVING -> KEEP_OUT -> CAPTURED when the frame does not come down
 *
 * Outputs fail safe when de-energised, but for the magnet, whose release is the drop: it is energised by
 * sequence_init and by SAFE, and de-energised by nothing but the edge computed from the two light gates.
 *
 * READY takes an acknowledgement (CLEAR) after each drop, after a reset, and after emergency stop, door,
 * latch or product were lost; then all checks green for settle_ms. ARM answers a challenge that it asked for
 * less than SEQUENCE_ANSWER_MS ago and that no other ARM came after. RELEASE answers the challenge of this
 * ARM, from the host that armed, after warning_ms of warning. What was recorded answers neither.
 *
 * A fault outlives a reset until it is cleared, and none is while the frame is neither down nor latched.
 *
 * Context: control (sequence_tick, sequence_gate, sequence_keeper); sequence_plan main; everything else main
 * between port_lock and port_unlock, so that no two calls overlap. Times in us wrap after 71 minutes, in ms
 * after 49 days.
 */
#include <stdbool.h>
#include <stdint.h>

#include "common/wire.h"
#include "firmware/fall.h"
#include "firmware/hosts.h"
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
	SEQUENCE_FULL,    /* the capture window is complete, and the frame is down or latched */
	SEQUENCE_JAMMED,  /* it is complete, and the frame is neither */
	SEQUENCE_DOWN,    /* now it is */
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
	SEQUENCE_ANSWER_MS = 1000,   /* a challenge to ARM is good for so long */
};

struct sequence {
	const struct parameters *parameters;
	volatile uint32_t *counters;
	struct fall_plan plan;
	struct fall_times times;
	uint8_t state; /* WIRE_STATE_* */
	uint8_t fault; /* WIRE_FAULT_*, latched until CLEAR */
	bool planned;  /* plan is that of the parameters */
	bool triggered;
	bool moved;        /* since the release something has seen the frame move */
	bool acknowledged; /* no guard was lost since the last CLEAR */
	bool settled;      /* all checks are green for settle_ms */
	uint16_t io;       /* at the last tick */
	uint16_t drop_id;
	uint16_t marks; /* WIRE_MARK_* of this drop */
	uint16_t frame_speed_mm_s;
	uint32_t session, arm_key; /* who has armed, with what; 0 unless armed */
	uint32_t nonce;            /* of the challenge that waits for its answer, 0: none */
	uint32_t release_key;      /* what RELEASE has to answer it with while armed */
	uint32_t challenged_ms;    /* when READY gave one */
	uint32_t parameters_crc32; /* of the set that the last ARM confirmed */
	uint32_t tick_ms;          /* now */
	uint32_t entered_ms;       /* the state */
	uint32_t green_ms;         /* the last tick with a check red: green for less than the time since */
	uint32_t released_ms;
	uint32_t no_impact_ms; /* when waiting for an impact ends */
};

/* What is seen at the moment of a call. */
struct sequence_view {
	uint32_t now_us;
	uint16_t io;     /* outputs as they are, inputs debounced */
	uint16_t known;  /* inputs that have been read since the reset */
	uint32_t checks; /* WIRE_CHECK_* that are not green, those of sequence_checks apart */
};

/* A command, and what it is judged by. */
struct sequence_order {
	struct wire_command command;
	const struct hosts *hosts;
	uint32_t capture_crc32;    /* for ACCEPT; the rest is for ARM */
	uint32_t parameters_crc32; /* of the set as it is */
	uint32_t dropout_us;       /* for the magnet edge */
	uint32_t nonce;
	bool nonce_good; /* there was a random number */
};

/* Energises the magnet, de-energises the rest. Before interrupts. */
void sequence_init(struct sequence *sequence, const struct parameters *parameters,
                   volatile uint32_t *counters, enum port_reset cause);

/* A parameter was written: the plan of the fall is out of date. */
void sequence_replan(struct sequence *sequence);

/* Before ARM, at rest: brings the plan up to date; nothing if it is. */
void sequence_plan(struct sequence *sequence);

void sequence_tick(struct sequence *sequence, const struct sequence_view *view, uint32_t tick_ms);

/* gate 0 upper, 1 lower: its beam was broken at time_us. Believed only of a frame that falls, not earlier
 * than 7/8 of the free fall, the last break of the upper beam before that of the lower; else ignored and
 * counted. */
void sequence_gate(struct sequence *sequence, unsigned gate, uint32_t time_us);

/* The keeper current fell at time_us. The first time after the magnet's edge is when the product left. */
void sequence_keeper(struct sequence *sequence, uint32_t time_us);

/* All checks: the view's, and WIRE_CHECK_ACKNOWLEDGE and WIRE_CHECK_SETTLE; the latter only when it is the
 * last that is not green. */
uint32_t sequence_checks(const struct sequence *sequence, uint32_t checks);

/* 0 or why not, in this order. ARM: DT_E_STATE, DT_E_HASH, DT_E_CHECKS, DT_E_SESSION, DT_E_PARAMETERS,
 * DT_E_SYSTEM; 0: challenged, or armed when it was the answer; repeated by the host that has armed while it
 * is armed: 0, nothing changes. In both `nonce` waits for its answer. RELEASE: DT_E_STATE, DT_E_SESSION,
 * DT_E_TOKEN, DT_E_EARLY, DT_E_CHECKS. CLEAR: DT_E_STATE, DT_E_CHECKS. ACCEPT with a CRC-32 and DISCARD with
 * a number that are not the drop's: DT_E_CORRUPT. DT_E_UNKNOWN. */
DT_MUST_USE int sequence_command(struct sequence *sequence, const struct sequence_view *view,
                                 const struct sequence_order *order);

/* The number of the drop to come. */
uint16_t sequence_next_drop(const struct sequence *sequence);

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
bool sequence_captured(unsigned state);  /* a window is complete and its host has not said that it has it */

#endif
