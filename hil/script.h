/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HIL_SCRIPT_H
#define DT_HIL_SCRIPT_H
/*
 * The scripted operator inside the bench: heartbeats, acknowledges when the guards are closed again, arms,
 * releases after the warning, asks for what is missing, accepts and waits for SAFE, as often as told. It
 * knows the tower's parameters by their initial values and what it wrote itself. It lives in virtual time and
 * has no randomness, so that a run repeats bit for bit. It holds no samples, only which blocks came: the host
 * proper is another program.
 *
 * One thread, no heap. Times are virtual, in ms.
 */
#include <stdbool.h>
#include <stdint.h>

#include "common/frame.h"
#include "common/segment.h"
#include "common/wire.h"
#include "hil/scenario.h"

enum {
	SCRIPT_TICKS = 2048,      /* blocks remembered of a sensor, more than the longest capture has */
	SCRIPT_SEND_MAX = 12,     /* frames in one call */
	SCRIPT_RELEASE_MS = 1100, /* from ARM to RELEASE: the warning, and a little */
	SCRIPT_LIMIT_MS = 30000,  /* for one drop, from SAFE to SAFE */
	SCRIPT_WHY_MAX = 200,
};

/* In the heartbeats of the operator and of the second host that the bench has. */
#define SCRIPT_SESSION UINT32_C(0x4F504552)
#define SCRIPT_SESSION_SECOND UINT32_C(0x4E4F4445)

enum script_phase {
	SCRIPT_SET,     /* wait for SAFE, write the parameters */
	SCRIPT_ARM,     /* wait for READY, arm */
	SCRIPT_RELEASE, /* armed: release */
	SCRIPT_FETCH,   /* falling; then until no block is missing */
	SCRIPT_ACCEPT,  /* say that all is there, or that it is given up */
	SCRIPT_RETURN,  /* wait for SAFE */
	SCRIPT_DONE,
	SCRIPT_FAILED,
};

struct script_options {
	unsigned drops;      /* 0: heartbeats only */
	uint32_t release_ms; /* from ARM to RELEASE */
	bool passive;        /* acknowledges nothing */
	bool patient;        /* a fault at rest does not end it: it waits for READY, for ever */
	bool wrong_hash;     /* as if built from another wire.def */
	const struct scenario_parameter *parameters; /* to write before the first drop, in this order */
	unsigned parameter_count;
};

struct script {
	struct script_options options;
	enum script_phase phase;
	unsigned drops_done;
	unsigned parameters_done;
	unsigned incomplete;             /* drops that came back to SAFE with blocks missing */
	uint32_t drop_ms;                /* when this drop began */
	uint32_t heartbeat_ms;           /* when the next one is due */
	uint32_t send_ms;                /* when the phase's next command or request is due */
	uint32_t clear_ms;               /* when the guards may be acknowledged again */
	uint32_t value[WIRE_PARAMETERS]; /* that it believes the tower has */
	struct wire_challenge challenge; /* the tower's last, to whomever */
	bool has_armed;                  /* it is that of the ARM by which we have armed */
	uint32_t progress_ms;            /* when a block of the capture came last ... */
	uint32_t segment_ms;             /* ... and a segment of anything */
	uint32_t resend_at; /* where the next round begins: S1's blocks are counted first, then S2's */
	uint8_t sequence;
	uint8_t accept_op;
	bool captured;      /* capture is this drop's */
	bool has_measured;  /* its measured came, good ... */
	uint32_t has_value; /* ... and these of its parameters, a bit each */
	bool classic;       /* it came in segments: the tower uploads by itself */
	struct segment_join segments;
	struct wire_capture_end capture;
	struct wire_status status;                 /* the tower's last */
	uint32_t held[WIRE_SENSORS][SCRIPT_TICKS]; /* tick + 1 of the block that came, at tick modulo size */
	char why[SCRIPT_WHY_MAX];                  /* one line: why FAILED, or which drop is incomplete */
};

/* The parameters stay the caller's. */
void script_init(struct script *script, const struct script_options *options);

/* A frame from the tower. */
void script_feed(struct script *script, const struct frame *frame, uint32_t now_ms);

/* Fills in host and argument of the command as that session would send it now, with what the bus has told
 * everybody. */
void script_verb(const struct script *script, uint32_t session, struct wire_command *command);

/* The heartbeat of that session. */
void script_heartbeat(struct frame *frame, uint32_t session, uint32_t hash);

/* To be called every ms; returns how many frames go to the tower. */
unsigned script_poll(struct script *script, uint32_t now_ms, struct frame out[SCRIPT_SEND_MAX]);

#endif
