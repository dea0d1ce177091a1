/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "firmware/acquire.h"

#include <stdatomic.h>

#include "common/memory.h"
#include "firmware/port.h"

void acquire_init(struct acquire *acquire, const struct parameters *parameters, volatile uint32_t *counters)
{
	memset(acquire, 0, sizeof(*acquire));
	acquire->parameters = parameters;
	acquire->counters = counters;
	acquire->queue = (struct ring)RING_OVER(acquire->storage);
}

/* ---- sample interrupts: as few instructions as it takes to give each sample its place ---- */

void acquire_turn(struct acquire *acquire)
{
	struct acquire_page *page;

	acquire->turns++;
	if (!atomic_load_explicit(&acquire->waiting, memory_order_acquire)) {
		acquire->filling ^= 1;
		atomic_store_explicit(&acquire->waiting, true, memory_order_release);
	}
	page = &acquire->page[acquire->filling];
	page->x_count = page->yz_count = 0;
}

/* What stands for it in the block: there -32768 has another meaning. */
static int16_t taken(int16_t code, bool ready)
{
	if (!ready)
		return WIRE_SAMPLE_NOT_TAKEN;
	return code < -WIRE_SAMPLE_FULL_SCALE ? -WIRE_SAMPLE_FULL_SCALE : code;
}

void acquire_x(struct acquire *acquire, const int16_t code[WIRE_SENSORS], bool ready)
{
	struct acquire_page *page = &acquire->page[acquire->filling];
	unsigned k = page->x_count++;

	if (k >= WIRE_X_PER_TICK)
		return;
	for (unsigned s = 0; s < WIRE_SENSORS; s++)
		page->tick.sensor[s].x[k] = taken(code[s], ready);
}

void acquire_yz(struct acquire *acquire, const int16_t y[WIRE_SENSORS], const int16_t z[WIRE_SENSORS],
                bool ready)
{
	struct acquire_page *page = &acquire->page[acquire->filling];
	unsigned k = page->yz_count++;

	if (k >= WIRE_YZ_PER_TICK)
		return;
	for (unsigned s = 0; s < WIRE_SENSORS; s++) {
		page->tick.sensor[s].y[k] = taken(y[s], ready);
		page->tick.sensor[s].z[k] = taken(z[s], ready);
	}
}

/* ---- control ---- */

static void judge_clocks(struct acquire *acquire, const struct acquire_page *page)
{
	acquire->clock_x = (uint16_t)(acquire->clock_x + page->x_count);
	acquire->clock_yz = (uint16_t)(acquire->clock_yz + page->yz_count);
	acquire->total_x += page->x_count;
	if (acquire->total_yz < ACQUIRE_CLOCK_MOST)
		acquire->total_yz += page->yz_count;
	if (++acquire->clock_ticks < ACQUIRE_CLOCK_TICKS)
		return;
	acquire->clocks_good = acquire->clock_x == ACQUIRE_CLOCK_TICKS * WIRE_X_PER_TICK &&
	                       acquire->clock_yz == ACQUIRE_CLOCK_TICKS * WIRE_YZ_PER_TICK;
	acquire->clock_ticks = 0;
	acquire->clock_x = 0;
	acquire->clock_yz = 0;
}

static void fill_places(int16_t *code, unsigned count, unsigned places)
{
	for (unsigned k = count; k < places; k++)
		code[k] = WIRE_SAMPLE_NOT_TAKEN;
}

/* What did not come has its place. */
static void fill_page(struct acquire_page *page)
{
	for (unsigned s = 0; s < WIRE_SENSORS; s++) {
		struct acquire_samples *samples = &page->tick.sensor[s];

		fill_places(samples->x, page->x_count, WIRE_X_PER_TICK);
		fill_places(samples->y, page->yz_count, WIRE_YZ_PER_TICK);
		fill_places(samples->z, page->yz_count, WIRE_YZ_PER_TICK);
	}
}

static void finish_page(struct acquire *acquire, struct acquire_page *page)
{
	const struct acquire_head *head = &acquire->head;
	struct acquire_tick *tick = &page->tick;

	judge_clocks(acquire, page);
	tick->tick_ms = head->tick_ms;
	tick->drop_id = head->drop_id;
	tick->io = head->io;
	tick->marks = head->marks;
	if ((~head->io & (WIRE_IO_IEPE_S1 | WIRE_IO_IEPE_S2)) != 0)
		tick->marks |= WIRE_MARK_CABLE;
	tick->status[0] = tick->status[1] = head->state;
	if (page->x_count < WIRE_X_PER_TICK || page->yz_count < WIRE_YZ_PER_TICK)
		fill_page(page);
	if (ring_put(&acquire->queue, tick) != 0)
		acquire->counters[WIRE_COUNTER_samples_overrun] += ACQUIRE_SAMPLES_PER_TICK;
}

uint32_t acquire_close(struct acquire *acquire)
{
	uint32_t turns = acquire->turns, begun = turns - acquire->turns_seen, lost = begun;

	acquire->turns_seen = turns;
	if (atomic_load_explicit(&acquire->waiting, memory_order_acquire)) {
		if (acquire->open)
			finish_page(acquire, &acquire->page[!acquire->filling]);
		lost--;
		atomic_store_explicit(&acquire->waiting, false, memory_order_release);
	}
	acquire->counters[WIRE_COUNTER_samples_overrun] += lost * ACQUIRE_SAMPLES_PER_TICK;
	return begun;
}

void acquire_open(struct acquire *acquire, const struct acquire_head *head)
{
	acquire->head = *head;
	acquire->open = true;
}

/* ---- main ---- */

int16_t acquire_clock_ppm(struct acquire *acquire)
{
	int64_t expected = (int64_t)acquire->total_yz * WIRE_X_PER_TICK;
	int64_t more = (int64_t)acquire->total_x * WIRE_YZ_PER_TICK - expected, ppm;
	bool long_enough = acquire->total_yz >= ACQUIRE_CLOCK_LEAST,
	     full = acquire->total_yz >= ACQUIRE_CLOCK_MOST;

	acquire->total_x = acquire->total_yz = 0;
	if (!long_enough || full)
		return ACQUIRE_NO_PPM;
	ppm = more * 1000000 / expected;
	if (ppm < -ACQUIRE_NO_PPM)
		return -ACQUIRE_NO_PPM;
	return (int16_t)(ppm < ACQUIRE_NO_PPM ? ppm : ACQUIRE_NO_PPM - 1);
}

/* A sample that is not simply good. */
static void mark(struct acquire *acquire, struct acquire_tick *tick, unsigned sensor, uint8_t clip_bit,
                 int32_t size)
{
	if (size > WIRE_SAMPLE_FULL_SCALE) {
		tick->marks |= WIRE_MARK_OVERRUN;
		port_lock();
		acquire->counters[WIRE_COUNTER_samples_overrun]++;
		port_unlock();
		return;
	}
	if (size > (int32_t)acquire->parameters->value[WIRE_PARAMETER_range_counts]) {
		tick->status[sensor] |= clip_bit;
		tick->marks |= WIRE_MARK_CLIPPED;
		acquire->counters[WIRE_COUNTER_samples_clipped]++;
	}
	if (size == WIRE_SAMPLE_FULL_SCALE) {
		tick->marks |= WIRE_MARK_FULL_SCALE;
		acquire->counters[WIRE_COUNTER_samples_full_scale]++;
	}
}

/* One channel, sample by sample. */
static void judge_channel(struct acquire *acquire, struct acquire_tick *tick, unsigned sensor,
                          uint8_t clip_bit, const int16_t *code, unsigned places, uint32_t good)
{
#pragma GCC unroll 10
	for (unsigned k = 0; k < places; k++)
		if ((uint32_t)code[k] + good > 2u * good) /* |code| > good */
			mark(acquire, tick, sensor, clip_bit, code[k] < 0 ? -code[k] : code[k]);
}

_Static_assert(sizeof(struct acquire_samples) == (WIRE_X_PER_TICK + 2 * WIRE_YZ_PER_TICK) * sizeof(int16_t),
               "the three channels follow each other");

enum { SMALL = 8192 };

/* Every |code| is below SMALL: then the upper three bits of each are equal. Two at a time: nearly all ticks
 * are such. */
static bool all_small(const struct acquire_samples *samples)
{
	const unsigned char *bytes = (const unsigned char *)samples;
	uint32_t differ = (uint16_t)samples->z[WIRE_YZ_PER_TICK - 1];

	differ ^= differ << 1;
#pragma GCC unroll 13
	for (unsigned i = 0; i + 4 <= sizeof(*samples); i += 4) {
		uint32_t two;

		__builtin_memcpy(&two, bytes + i, sizeof(two));
		differ |= two ^ two << 1;
	}
	return (differ & 0xC000C000u) == 0;
}

static void judge_sample(struct acquire *acquire, struct acquire_tick *tick, unsigned sensor)
{
	const struct acquire_samples *samples = &tick->sensor[sensor];
	uint32_t range = acquire->parameters->value[WIRE_PARAMETER_range_counts];
	uint32_t good = range < WIRE_SAMPLE_FULL_SCALE ? range : WIRE_SAMPLE_FULL_SCALE - 1;

	if (good >= SMALL && all_small(samples))
		return;
	judge_channel(acquire, tick, sensor, WIRE_STATUS_CLIP_X, samples->x, WIRE_X_PER_TICK, good);
	judge_channel(acquire, tick, sensor, WIRE_STATUS_CLIP_Y, samples->y, WIRE_YZ_PER_TICK, good);
	judge_channel(acquire, tick, sensor, WIRE_STATUS_CLIP_Z, samples->z, WIRE_YZ_PER_TICK, good);
}

int acquire_take(struct acquire *acquire, struct acquire_tick *tick)
{
	int result = ring_get(&acquire->queue, tick);

	for (unsigned s = 0; s < WIRE_SENSORS && result == 0; s++)
		judge_sample(acquire, tick, s);
	return result;
}

const int16_t *acquire_channel(const struct acquire_tick *tick, unsigned channel, unsigned *count)
{
	const struct acquire_samples *samples = &tick->sensor[channel / 3];

	*count = channel % 3 == 0 ? WIRE_X_PER_TICK : WIRE_YZ_PER_TICK;
	return channel % 3 == 0 ? samples->x : channel % 3 == 1 ? samples->y : samples->z;
}

void acquire_pack(const struct acquire_tick *tick, unsigned sensor, uint32_t id, struct frame *frame)
{
	const struct acquire_samples *samples = &tick->sensor[sensor];
	struct wire_block block = {
	        .drop_id = tick->drop_id,
	        .tick_ms = tick->tick_ms,
	        .status = tick->status[sensor],
	        .io = tick->io,
	};

	memcpy(block.x, samples->x, sizeof(block.x));
	memcpy(block.y, samples->y, sizeof(block.y));
	memcpy(block.z, samples->z, sizeof(block.z));
	wire_pack_block(frame, id, &block);
	wire_seal_block(frame);
}
