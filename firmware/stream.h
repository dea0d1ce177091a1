/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_STREAM_H
#define DT_FIRMWARE_STREAM_H
/*
 * Frames out. What the controller does not take at once waits in a queue, in order, and is counted; what the
 * queue has no room for is dropped and counted. Blocks leave STREAM_RESERVED places to the other messages,
 * for a block can be asked for again. Resend requests wait in a short list and are served from the capture
 * ring, STREAM_RESENT_PER_TICK blocks a millisecond, only when nothing else waits.
 *
 * On classic CAN nothing is sent live. Messages longer than 8 bytes are cut into segments (common/segment.h),
 * and the window is uploaded as if it had been asked for. The bus takes less than one block a millisecond
 * there, so that a few segments always wait and keep it busy.
 *
 * Context: main.
 */
#include <stdbool.h>
#include <stdint.h>

#include "common/frame.h"
#include "common/ring.h"
#include "common/wire.h"
#include "firmware/capture.h"

enum {
	STREAM_QUEUE = 64, /* frames, a power of two */
	STREAM_RESERVED = 16,
	STREAM_REQUESTS = 8, /* a power of two */
	STREAM_RESENT_PER_TICK = 2,
	STREAM_UPLOAD_WAITING = 20, /* classic: segments that may wait before the next block */
};

struct stream {
	volatile uint32_t *counters;
	bool classic;
	bool waiting; /* next was taken out of the queue and not sent yet */
	struct frame next;
	struct ring queue;
	struct frame queue_storage[STREAM_QUEUE];
	struct wire_resend request; /* being served while its count is not 0 */
	struct ring requests;
	struct wire_resend requests_storage[STREAM_REQUESTS];
};

void stream_init(struct stream *stream, volatile uint32_t *counters);

/* The bus as the parameters want it: 0, or DT_E_ARGUMENT from the port, and all is as it was. At rest. */
DT_MUST_USE int stream_set_up(struct stream *stream, const struct parameters *parameters);

/* Takes effect at once: what waits and does not fit the new bus is dropped and counted. */
void stream_set_classic(struct stream *stream, bool classic);

void stream_send(struct stream *stream, const struct frame *frame);

/* A live block; nothing on classic CAN. */
void stream_block(struct stream *stream, const struct frame *block);

/* Offers the controller what waits. */
void stream_flush(struct stream *stream);

/* Notes a request for blocks (count > 0, sensor 1 or 2). Ticks the ring does not hold are counted. */
void stream_request(struct stream *stream, const struct capture *capture, const struct wire_resend *request);

/* Classic CAN: asks for the whole window of a complete capture. */
void stream_upload(struct stream *stream, const struct capture *capture);

/* Once a tick: serves the requests. */
void stream_resend(struct stream *stream, const struct capture *capture);

#endif
