/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_JOIN_H
#define DT_HOST_RECORD_JOIN_H
/*
 * Frames to channels: puts the blocks of one capture in their places by tick, counts every gap, repeat,
 * reorder and corrupt block, and says what to ask for again until the capture's CRC-32 agrees. The same
 * code serves live reception, replay and files. Frames that are no blocks or capture ends are ignored. On
 * classic CAN both come in segments (common/segment.h); nothing is live there, so that all of a capture is
 * missing when its end arrives and every block counts as resent.
 *
 * Live use: feed every received frame; after the capture end arrived and while !join_complete, send the
 * requests join_next_gap tells; when done, or given up, take the record.
 */
#include "common/frame.h"
#include "common/wire.h"
#include "host/record/log_capture.h"
#include "host/record/record.h"

struct join;

/* A live block this much older than the newest did not overtake: the tower started again. A hole of this many
 * ticks ends a run. */
enum { JOIN_FAR_TICKS = 100 };

/* NULL without memory. The join keeps the last 2 048 ticks until a capture end says which count; repeats,
 * reorders and resends are counted for these, corrupt blocks since the last take. A capture end that comes
 * again is the same capture. A boot-up heartbeat, or a live block more than JOIN_FAR_TICKS behind, is a tower
 * that started again: what came before belongs to no capture to come. */
struct join *join_create(void);
void join_destroy(struct join *join);

enum join_loss {
	JOIN_LOSS_CAPTURE, /* one that was not taken, since another one ends */
	JOIN_LOSS_RUN,     /* the blocks before the tower started again; a capture that is not taken stays */
};

/* Calls lost at the last moment to take what the frame being fed makes the join forget. It may take. */
void join_on_loss(struct join *join, void (*lost)(void *context, enum join_loss what), void *context);

/* 1 if a capture end arrived with it and a drop begins to be collectable, else 0. */
int join_feed(struct join *join, const struct frame *frame);

/* Whether frame is the capture end of another capture than the one at hand. */
bool join_is_news(const struct join *join, const struct frame *frame);

/* A capture end is known, for any drop. */
bool join_has_capture(const struct join *join);

/* Every block of the capture is held and the CRC-32 agrees. */
bool join_complete(const struct join *join);

/* What the drop measured of its tower and the parameters that it was made with are held, too: they follow the
 * capture end. */
bool join_told(const struct join *join);

/* The first missing run with last - first + 1 <= limit, starting at or after (sensor, tick) in the order S1
 * then S2, sensor 0 = from the beginning; false when there is none. When nothing is missing and yet the
 * CRC-32 disagrees, see join_forget. */
bool join_next_gap(const struct join *join, unsigned sensor, uint32_t tick_ms, uint32_t limit,
                   struct record_gap *gap);

/* Drops every block of the capture, so that all of it is asked for again: a corrupt block slipped through
 * its CRC-8. */
void join_forget(struct join *join);

/* CRC-32 as computed over what is held; only meaningful when nothing is missing. */
uint32_t join_crc32(const struct join *join);

/* Moves the capture, complete or not, into *record (initialised by the call) and makes room for the next
 * one. Without a capture end the longest run of ticks held since the last one, over holes of less than
 * JOIN_FAR_TICKS, is taken and flagged crc_unknown. DT_E_EMPTY when no block of it is held. */
DT_MUST_USE int join_take(struct join *join, struct record *record);

/* As join_take, but what is known of the capture instead of its samples, and a capture without a block is
 * one, too. Of *capture it sets what log_capture_of_record does. Without a capture end DT_E_EMPTY as above.
 */
DT_MUST_USE int join_skip(struct join *join, struct log_capture *capture);

/* What ended the capture; NULL when there is none. */
const struct wire_capture_end *join_end(const struct join *join);

/* Forgets the blocks of this run: they belong to a capture that was had another way. */
void join_forget_run(struct join *join);

/* Tick of the newest block held of this run of the tower; false when there is none. */
bool join_newest(const struct join *join, uint32_t *tick_ms);

/* How often the tower started again, and how many frames, from the first one on, went into a window. */
uint64_t join_restarts(const struct join *join);
uint64_t join_touched(const struct join *join);

#endif
