/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "firmware/health.h"

#include "common/memory.h"
#include "firmware/sequence.h"

void health_init(struct health *health, const struct parameters *parameters, volatile uint32_t *counters)
{
	memset(health, 0, sizeof(*health));
	health->parameters = parameters;
	health->counters = counters;
	health->sensor_checks = WIRE_CHECK_SENSOR_S1 | WIRE_CHECK_SENSOR_S2; /* until seen */
}

/* Adds one tick of one channel; true when all its samples have the value of the sample before. */
static bool add(struct health_channel *channel, const int16_t *code, unsigned count)
{
	bool same = true;

	for (unsigned k = 0; k < count; k++) {
		if (code[k] == WIRE_SAMPLE_NOT_TAKEN)
			continue;
		same = same && code[k] == channel->last;
		channel->last = code[k];
		channel->sum += code[k];
		channel->squares += (uint64_t)((int32_t)code[k] * code[k]);
		channel->count++;
	}
	return same;
}

static void watch_stuck(struct health *health, struct health_channel *channel, bool same)
{
	if (!same)
		channel->same_ticks = 0;
	else if (channel->same_ticks < HEALTH_STUCK_TICKS && ++channel->same_ticks == HEALTH_STUCK_TICKS)
		health->counters[WIRE_COUNTER_samples_stuck]++;
}

/* |mean| <= limit and variance <= limit^2, in whole numbers: with n samples both sides times n^2. */
static bool quiet(const struct health_channel *channel, unsigned expected, int64_t limit)
{
	int64_t n = channel->count, sum = channel->sum;

	if (channel->count < expected / 2)
		return false;
	return sum <= limit * n && -sum <= limit * n &&
	       n * (int64_t)channel->squares - sum * sum <= limit * limit * n * n;
}

static void judge_window(struct health *health)
{
	static const uint16_t sensor_check[WIRE_SENSORS] = {WIRE_CHECK_SENSOR_S1, WIRE_CHECK_SENSOR_S2};
	int64_t limit = health->parameters->value[WIRE_PARAMETER_noise_counts];
	uint16_t checks = 0;

	for (unsigned i = 0; i < HEALTH_CHANNELS; i++) {
		struct health_channel *channel = &health->channel[i];
		unsigned per_tick = i % 3 == 0 ? WIRE_X_PER_TICK : WIRE_YZ_PER_TICK;

		if (!quiet(channel, per_tick * HEALTH_WINDOW_TICKS, limit))
			checks |= sensor_check[i / 3];
		channel->sum = 0;
		channel->squares = 0;
		channel->count = 0;
	}
	health->sensor_checks = checks;
	health->window_ticks = 0;
}

void health_samples(struct health *health, const struct acquire_tick *tick)
{
	bool moving = sequence_moving(tick->status[0] & WIRE_STATUS_STATE);

	for (unsigned s = 0; s < WIRE_SENSORS; s++) {
		const struct acquire_samples *samples = &tick->sensor[s];
		struct health_channel *channel = &health->channel[3 * s];

		watch_stuck(health, &channel[0], add(&channel[0], samples->x, WIRE_X_PER_TICK) && moving);
		watch_stuck(health, &channel[1], add(&channel[1], samples->y, WIRE_YZ_PER_TICK) && moving);
		watch_stuck(health, &channel[2], add(&channel[2], samples->z, WIRE_YZ_PER_TICK) && moving);
	}
	if (++health->window_ticks == HEALTH_WINDOW_TICKS)
		judge_window(health);
}

void health_host(struct health *health, uint32_t tick_ms, uint32_t hash)
{
	health->host_here = true;
	health->host_ms = tick_ms;
	health->host_hash_good = hash == wire_hash();
}

void health_tick(struct health *health, uint32_t tick_ms)
{
	if (health->host_here &&
	    tick_ms - health->host_ms > health->parameters->value[WIRE_PARAMETER_host_timeout_ms]) {
		health->host_here = false;
		health->counters[WIRE_COUNTER_host_heartbeats_lost]++;
	}
}

uint16_t health_checks(const struct health *health, uint16_t io)
{
	static const struct {
		uint16_t input, check;
	} needed[] = {
	        {WIRE_IO_LATCH_CLOSED, WIRE_CHECK_LATCH},      {WIRE_IO_PRODUCT_HELD, WIRE_CHECK_PRODUCT},
	        {WIRE_IO_DAMPERS_ENGAGED, WIRE_CHECK_DAMPERS}, {WIRE_IO_DOOR_CLOSED, WIRE_CHECK_DOOR},
	        {WIRE_IO_ESTOP_CLEAR, WIRE_CHECK_ESTOP},       {WIRE_IO_SUPPLY_GOOD, WIRE_CHECK_SUPPLY},
	        {WIRE_IO_IEPE_S1, WIRE_CHECK_SENSOR_S1},       {WIRE_IO_IEPE_S2, WIRE_CHECK_SENSOR_S2},
	};
	uint16_t checks = health->sensor_checks;

	for (unsigned i = 0; i < sizeof(needed) / sizeof(needed[0]); i++)
		if ((io & needed[i].input) == 0)
			checks |= needed[i].check;
	if (io & WIRE_IO_FRAME_DOWN) /* the latch cannot hold a frame that is down */
		checks |= WIRE_CHECK_LATCH;
	if (io & (WIRE_IO_GATE_UPPER | WIRE_IO_GATE_LOWER))
		checks |= WIRE_CHECK_GATES;
	if (!health->host_here || !health->host_hash_good)
		checks |= WIRE_CHECK_HOST;
	return checks;
}
