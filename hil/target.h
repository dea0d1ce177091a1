/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HIL_TARGET_H
#define DT_HIL_TARGET_H
/*
 * The firmware under test: within this program, or a process of its own on a sensor bus of two FIFOs
 * (common/sensorbus.h), which lie in a temporary directory for as long as it runs. It is always ended, and
 * only it: by its own pid.
 *
 * While a target lives SIGINT, SIGTERM and SIGHUP are blocked and arrive as a result of target_receive,
 * so that nothing is left behind. One thread, one target at a time.
 * Errors come with one line (no newline) in message.
 */
#include <stdbool.h>

#include "common/error.h"
#include "common/frame.h"
#include "common/sensorbus.h"

enum { TARGET_MESSAGE_MAX = 512 };

struct target;

/* How it starts. cause and kept are those of common/sensorbus.h and firmware's --help, 0 after power-on. */
struct target_options {
	const struct sensorbus_inside *inside; /* in this program; NULL: a process of its own, by */
	const char *command; /* split into words as a shell would, without running any other; NULL:
	                        droptower-firmware next to this program */
	bool realtime;
	unsigned cause, kept;
};

/* Runs `COMMAND --bus PREFIX [--realtime] [--reset-cause CAUSE] [--kept BYTE]`, the last two where they are
 * not 0. NULL on error. */
struct target *target_start(const struct target_options *options, char message[TARGET_MESSAGE_MAX]);

/* Waits for the next request. 1 with it and its frames, whose time_us is how many answers ahead the firmware
 * had taken when it sent them; 0 when a signal asks to stop, DT_E_TIMEOUT after 5 s without one, DT_E_CLOSED
 * when the firmware is gone, DT_E_FORMAT for bytes that are no request. */
DT_MUST_USE int target_receive(struct target *target, struct sensorbus_request *request,
                               struct frame frames[SENSORBUS_FRAMES_MAX], char message[TARGET_MESSAGE_MAX]);

/* count answers, the last of them with its frames. 0 or DT_E_SYSTEM. */
DT_MUST_USE int target_answer(struct target *target, const struct sensorbus_answer *answers, unsigned count,
                              const struct frame *frames, char message[TARGET_MESSAGE_MAX]);

/* Waits for the firmware to end by itself, after an answer with stop or its own death; one that does not
 * is killed. Removes the FIFOs and frees. 0 if it ended with exit status 0, else DT_E_LINK with its status
 * in message. NULL is allowed. */
DT_MUST_USE int target_end(struct target *target, char message[TARGET_MESSAGE_MAX]);

#endif
