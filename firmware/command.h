/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_COMMAND_H
#define DT_FIRMWARE_COMMAND_H
/*
 * Frames in: network management, the operator's commands, resend requests, parameters, the host's
 * heartbeat. Every command is answered, ABORT by NMT stop too (with sequence 0). Frames of other
 * identifiers and of wrong length or content are counted and ignored. Context: main.
 */
#include <stdbool.h>

#include "common/frame.h"
#include "firmware/acquire.h"
#include "firmware/capture.h"
#include "firmware/health.h"
#include "firmware/hosts.h"
#include "firmware/input.h"
#include "firmware/measure.h"
#include "firmware/parameter.h"
#include "firmware/sequence.h"
#include "firmware/stream.h"

/* All that a command may change, and what it may look at. The modules belong to the caller. */
struct command_scope {
	struct parameters *parameters;
	struct parameters *set; /* that the last ARM confirmed */
	volatile uint32_t *counters;
	struct hosts *hosts;
	struct sequence *sequence;
	struct capture *capture;
	struct measure *measure;
	struct stream *stream;
	const struct acquire *acquire;
	const struct input *input;
	const struct health *health;
	const volatile uint32_t *tick_ms;
	const uint32_t *wire_hash; /* our own */
};

/* True when the capture end, and what follows it, is asked for: the capture is complete. */
bool command_handle(const struct command_scope *scope, const struct frame *frame);

#endif
