/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_COMMAND_H
#define DT_FIRMWARE_COMMAND_H
/*
 * Frames in: network management, the operator's commands, resend requests, parameters, the host's
 * heartbeat. Every command is answered, ABORT by NMT stop too (with sequence 0). Frames of other
 * identifiers and of wrong length or content are counted and ignored. Context: main.
 */
#include "common/frame.h"
#include "firmware/app.h"

void command_handle(struct app *app, const struct frame *frame);

#endif
