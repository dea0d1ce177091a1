/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_CAN_FORMATS_H
#define DT_HOST_RECORD_CAN_FORMATS_H
/*
 * The formats behind can_text.h: each finds itself by its head, and puts the frames of its source as lines of
 * candump text. What does not make sense becomes a line that is none, and counts as corrupt. 0, or an error
 * told in message.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#include "common/frame.h"
#include "host/record/source.h"

struct can_text {
	const struct source *source;
	FILE *out;
	size_t frames, corrupt; /* lines written */
};

void can_text_put(struct can_text *text, const struct frame *frame, unsigned channel);

/* at: line or byte of the source. */
void can_text_corrupt(struct can_text *text, unsigned long long at);

bool can_asc_is(const char *head, size_t length);
bool can_pcap_is(const char *head, size_t length);
bool can_blf_is(const char *head, size_t length);
DT_MUST_USE int can_asc(struct can_text *text, char message[READ_MESSAGE_MAX]);
DT_MUST_USE int can_pcap(struct can_text *text, char message[READ_MESSAGE_MAX]);
DT_MUST_USE int can_blf(struct can_text *text, char message[READ_MESSAGE_MAX]);

#endif
