/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "firmware/acquire.h"

#include "common/memory.h"

void acquire_init(struct acquire *acquire, const struct parameters *parameters, volatile uint32_t *counters)
{
	memset(acquire, 0, sizeof(*acquire));
	acquire->parameters = parameters;
	acquire->counters = counters;
	acquire->queue = (struct ring)RING_OVER(acquire->storage);
}

static int16_t not_taken(struct acquire *acquire)
{
	acquire->tick.marks |= WIRE_MARK_OVERRUN;
	acquire->tick.io |= WIRE_IO_OVERRUN;
	acquire->counters[WIRE_COUNTER_samples_overrun]++;
	return WIRE_SAMPLE_NOT_TAKEN;
}

/* Judges one sample and returns what stands for it in the block. */
static int16_t judge(struct acquire *acquire, unsigned sensor, uint8_t clip_bit, int16_t code, bool ready)
{
	int32_t size = code < 0 ? -code : code;

	if (!ready)
		return not_taken(acquire);
	if (size > (int32_t)acquire->parameters->value[WIRE_PARAMETER_range_counts]) {
		acquire->tick.status[sensor] |= clip_bit;
		acquire->tick.marks |= WIRE_MARK_CLIPPED;
		acquire->counters[WIRE_COUNTER_samples_clipped]++;
	}
	if (size < WIRE_SAMPLE_FULL_SCALE)
		return code;
	acquire->tick.marks |= WIRE_MARK_FULL_SCALE;
	acquire->counters[WIRE_COUNTER_samples_full_scale]++;
	return code < 0 ? -WIRE_SAMPLE_FULL_SCALE : WIRE_SAMPLE_FULL_SCALE; /* -32768 has another meaning */
}

static void store_x(struct acquire *acquire, const int16_t code[WIRE_SENSORS], bool ready)
{
	unsigned k = acquire->x_count++;

	for (unsigned s = 0; s < WIRE_SENSORS; s++)
		acquire->tick.sensor[s].x[k] = judge(acquire, s, WIRE_STATUS_CLIP_X, code[s], ready);
}

static void store_yz(struct acquire *acquire, const int16_t y[WIRE_SENSORS], const int16_t z[WIRE_SENSORS],
                     bool ready)
{
	unsigned k = acquire->yz_count++;

	for (unsigned s = 0; s < WIRE_SENSORS; s++) {
		acquire->tick.sensor[s].y[k] = judge(acquire, s, WIRE_STATUS_CLIP_Y, y[s], ready);
		acquire->tick.sensor[s].z[k] = judge(acquire, s, WIRE_STATUS_CLIP_Z, z[s], ready);
	}
}

void acquire_x(struct acquire *acquire, const int16_t code[WIRE_SENSORS], bool ready)
{
	acquire->clock_x++;
	if (acquire->open && acquire->x_count < WIRE_X_PER_TICK)
		store_x(acquire, code, ready);
}

void acquire_yz(struct acquire *acquire, const int16_t y[WIRE_SENSORS], const int16_t z[WIRE_SENSORS],
                bool ready)
{
	acquire->clock_yz++;
	if (acquire->open && acquire->yz_count < WIRE_YZ_PER_TICK)
		store_yz(acquire, y, z, ready);
}

static void judge_clocks(struct acquire *acquire)
{
	if (++acquire->clock_ticks < ACQUIRE_CLOCK_TICKS)
		return;
	acquire->clocks_good = acquire->clock_x == ACQUIRE_CLOCK_TICKS * WIRE_X_PER_TICK &&
	                       acquire->clock_yz == ACQUIRE_CLOCK_TICKS * WIRE_YZ_PER_TICK;
	acquire->clock_ticks = 0;
	acquire->clock_x = 0;
	acquire->clock_yz = 0;
}

void acquire_close(struct acquire *acquire)
{
	static const int16_t none[WIRE_SENSORS];

	if (!acquire->open)
		return;
	judge_clocks(acquire);
	while (acquire->x_count < WIRE_X_PER_TICK)
		store_x(acquire, none, false);
	while (acquire->yz_count < WIRE_YZ_PER_TICK)
		store_yz(acquire, none, none, false);
	if (ring_put(&acquire->queue, &acquire->tick) != 0)
		acquire->counters[WIRE_COUNTER_samples_overrun] += ACQUIRE_SAMPLES_PER_TICK;
	acquire->open = false;
}

void acquire_open(struct acquire *acquire, const struct acquire_head *head)
{
	struct acquire_tick *tick = &acquire->tick;

	tick->tick_ms = head->tick_ms;
	tick->drop_id = head->drop_id;
	tick->io = head->io;
	tick->marks = head->marks;
	if ((~head->io & (WIRE_IO_IEPE_S1 | WIRE_IO_IEPE_S2)) != 0)
		tick->marks |= WIRE_MARK_CABLE;
	tick->status[0] = tick->status[1] = head->state;
	acquire->open = true;
	acquire->x_count = 0;
	acquire->yz_count = 0;
}

int acquire_take(struct acquire *acquire, struct acquire_tick *tick)
{
	return ring_get(&acquire->queue, tick);
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
