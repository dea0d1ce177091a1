/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/console/live.h"

#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "common/link/canbits.h"
#include "common/segment.h"
#include "common/wire.h"
#include "host/record/join.h"

enum {
	SPANS = 20, /* of the last second */
	SPAN_US = 50000,
	SECOND_US = SPANS * SPAN_US,
	PATIENCE_TICKS = 20,    /* a block that is later did not come */
	FORWARDS_TICKS = 60000, /* further ahead is no gap */
	IDS = 0x800,
};

static const double NOMINAL_MBIT_S = 1, DATA_MBIT_S = 5;

struct tick {
	struct live_tick envelope;
	unsigned heard; /* a bit for each sensor */
};

/* What came in one span. */
struct span {
	int64_t number;
	unsigned frames;
	double us; /* of bus */
};

/* How long a frame of one identifier took last. */
struct cost {
	uint8_t length, flags;
	float us;
};

struct live {
	pthread_mutex_t lock;
	struct tick ticks[LIVE_TICKS]; /* number modulo that */
	uint64_t first, head;          /* numbers of those kept: first <= n < head */
	uint64_t begun;                /* number of the first tick since the start */
	uint64_t settled;              /* up to there nothing is waited for */
	uint32_t head_ms;              /* tick of head - 1 */
	bool started;
	uint64_t blocks, missing;
	struct span spans[SPANS + 1];
	struct cost cost[IDS];
	int64_t heard_since_us, heard_us, block_us, heartbeat_us; /* 0: never */
};

struct live *live_create(void)
{
	struct live *live = calloc(1, sizeof(*live));

	if (live != NULL)
		pthread_mutex_init(&live->lock, NULL);
	return live;
}

void live_destroy(struct live *live)
{
	if (live != NULL)
		pthread_mutex_destroy(&live->lock);
	free(live);
}

/* ---- the bus ---- */

/* The tower sends, and blocks are not among it. */
static bool is_classic(const struct live *live, int64_t now_us)
{
	return live->heard_us != 0 && now_us - live->heard_us < SECOND_US &&
	       live->heard_us - live->heard_since_us > SECOND_US &&
	       (live->block_us == 0 || now_us - live->block_us > SECOND_US);
}

static double frame_us(struct live *live, const struct frame *frame, bool classic)
{
	struct cost *cost = &live->cost[frame->id % IDS];
	double us;

	if (classic && frame->length > 8) /* it came in segments */
		return segment_count(frame->length) *
		       canbits_us(canbits_classic(frame->id, WIRE_LENGTH_segment), NOMINAL_MBIT_S, 1);
	if (cost->us > 0 && cost->length == frame->length && cost->flags == frame->flags)
		return cost->us;
	if ((frame->flags & FRAME_FD) != 0 && frame->length > 0)
		us = canbits_us(canbits_fd(frame->id, frame->length), NOMINAL_MBIT_S,
		                (frame->flags & FRAME_BRS) != 0 ? DATA_MBIT_S : NOMINAL_MBIT_S);
	else
		us = canbits_us(canbits_classic(frame->id, frame->length), NOMINAL_MBIT_S, 1);
	*cost = (struct cost){.length = frame->length, .flags = frame->flags, .us = (float)us};
	return us;
}

static void count_frame(struct live *live, const struct frame *frame, int64_t now_us)
{
	int64_t number = now_us / SPAN_US;
	struct span *span = &live->spans[number % (SPANS + 1)];

	if (live->heard_us == 0 || now_us - live->heard_us > SECOND_US)
		live->heard_since_us = now_us;
	live->heard_us = now_us;
	if (span->number != number)
		*span = (struct span){.number = number};
	span->frames++;
	span->us += frame_us(live, frame, is_classic(live, now_us));
}

/* ---- ticks ---- */

static struct tick *tick_at(struct live *live, uint64_t number)
{
	return &live->ticks[number % LIVE_TICKS];
}

static void add_tick(struct live *live)
{
	struct tick *tick = tick_at(live, live->head++);

	tick->heard = 0;
	for (unsigned i = 0; i < LIVE_CHANNELS; i++)
		tick->envelope.low[i] = tick->envelope.high[i] = WIRE_SAMPLE_NOT_TAKEN;
	if (live->head - live->first > LIVE_TICKS)
		live->first++;
}

static void console_live_restart(struct live *live)
{
	live->started = false;
	live->first = live->begun = live->settled = live->head;
}

/* What is old enough, or whole, is waited for no longer. */
static void live_settle(struct live *live)
{
	enum { BOTH = (1u << WIRE_SENSORS) - 1 };

	while (live->settled < live->head) {
		unsigned heard = tick_at(live, live->settled)->heard;

		if (heard != BOTH && live->settled + PATIENCE_TICKS >= live->head)
			return;
		if (live->settled != live->begun) /* of that one some may have come before we listened */
			live->missing += WIRE_SENSORS - (heard & 1u) - (heard >> 1);
		live->settled++;
	}
}

/* The tick's place, NULL of one that is no longer waited for. *anew: the tower of it started anew. */
static struct tick *live_place(struct live *live, uint32_t tick_ms, bool *anew)
{
	int64_t ahead = live->started ? (int64_t)tick_ms - live->head_ms : 1;

	*anew = ahead < -JOIN_FAR_TICKS;
	if (*anew || ahead > FORWARDS_TICKS) {
		console_live_restart(live);
		ahead = 1;
	}
	for (int64_t i = 0; i < ahead; i++) {
		add_tick(live);
		live_settle(live);
	}
	if (ahead > 0) {
		live->started = true;
		live->head_ms = tick_ms;
		ahead = 0;
	}
	if ((uint64_t)-ahead >= live->head - live->settled)
		return NULL;
	return tick_at(live, live->head - 1 - (uint64_t)-ahead);
}

static void span_samples(const int16_t *sample, unsigned count, int16_t *low, int16_t *high)
{
	int16_t least = INT16_MAX, largest = WIRE_SAMPLE_NOT_TAKEN;

	for (unsigned i = 0; i < count; i++) {
		if (sample[i] == WIRE_SAMPLE_NOT_TAKEN)
			continue;
		if (sample[i] < least)
			least = sample[i];
		if (sample[i] > largest)
			largest = sample[i];
	}
	*low = largest == WIRE_SAMPLE_NOT_TAKEN ? largest : least;
	*high = largest;
}

static bool live_take_block(struct live *live, const struct frame *frame, int64_t now_us)
{
	unsigned sensor = frame->id == WIRE_ID_BLOCK_S2, channel = 3 * sensor;
	struct wire_block block;
	struct tick *tick;
	int16_t *low, *high;
	bool anew;

	if (wire_check_block(frame) != 0 || wire_unpack_block(frame, &block) != 0)
		return false;
	live->block_us = now_us;
	tick = live_place(live, block.tick_ms, &anew);
	if (tick == NULL || (tick->heard >> sensor & 1u) != 0)
		return anew;
	tick->heard |= 1u << sensor;
	low = &tick->envelope.low[channel];
	high = &tick->envelope.high[channel];
	span_samples(block.x, WIRE_X_PER_TICK, &low[0], &high[0]);
	span_samples(block.y, WIRE_YZ_PER_TICK, &low[1], &high[1]);
	span_samples(block.z, WIRE_YZ_PER_TICK, &low[2], &high[2]);
	live->blocks++;
	live_settle(live);
	return anew;
}

static bool take_heartbeat(struct live *live, const struct frame *frame, int64_t now_us)
{
	struct wire_heartbeat heartbeat;
	bool anew = wire_unpack_heartbeat(frame, &heartbeat) == 0 && heartbeat.nmt_state == 0;

	live->heartbeat_us = now_us;
	if (anew)
		console_live_restart(live);
	return anew;
}

bool live_feed(struct live *live, const struct frame *frame, int64_t now_us)
{
	bool anew = false;

	pthread_mutex_lock(&live->lock);
	count_frame(live, frame, now_us);
	if (frame->id == WIRE_ID_BLOCK_S1 || frame->id == WIRE_ID_BLOCK_S2)
		anew = live_take_block(live, frame, now_us);
	else if (frame->id == WIRE_ID_HEARTBEAT_TOWER)
		anew = take_heartbeat(live, frame, now_us);
	pthread_mutex_unlock(&live->lock);
	return anew;
}

void live_restart(struct live *live)
{
	pthread_mutex_lock(&live->lock);
	console_live_restart(live);
	pthread_mutex_unlock(&live->lock);
}

/* ---- looking ---- */

void live_look(struct live *live, int64_t now_us, struct live_view *view)
{
	int64_t number = now_us / SPAN_US;

	*view = (struct live_view){.heartbeat_age_s = NAN};
	pthread_mutex_lock(&live->lock);
	for (unsigned i = 0; i <= SPANS; i++) { /* without the span under way */
		const struct span *span = &live->spans[i];

		if (span->number >= number || span->number < number - SPANS)
			continue;
		view->frames_s += span->frames;
		view->bus_load_percent += span->us * 100 / SECOND_US;
	}
	if (live->heartbeat_us != 0)
		view->heartbeat_age_s = (double)(now_us - live->heartbeat_us) / 1e6;
	view->blocks = live->blocks;
	view->missing = live->missing;
	view->classic = is_classic(live, now_us);
	pthread_mutex_unlock(&live->lock);
}

size_t live_read(struct live *live, uint64_t *next, uint64_t *first, struct live_tick *out, size_t room)
{
	size_t count = 0;

	pthread_mutex_lock(&live->lock);
	if (*next < live->first || *next > live->head)
		*next = live->first;
	*first = *next;
	while (*next < live->settled && count < room)
		out[count++] = tick_at(live, (*next)++)->envelope;
	pthread_mutex_unlock(&live->lock);
	return count;
}
