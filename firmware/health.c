/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "firmware/health.h"

#include "common/memory.h"
#include "firmware/capture.h"
#include "firmware/port.h"

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
	int32_t last = channel->last, sum = channel->sum, differ = 0;
	uint64_t squares = channel->squares;
	unsigned missing = 0;

	for (unsigned k = 0; k < count; k++) {
		int32_t now = code[k];

		if (now == WIRE_SAMPLE_NOT_TAKEN) {
			missing++;
			continue;
		}
		differ |= now ^ last;
		last = now;
		sum += now;
		squares += (uint64_t)(now * now);
	}
	channel->last = (int16_t)last;
	channel->sum = sum;
	channel->squares = squares;
	channel->count = (uint16_t)(channel->count + count - missing);
	return differ == 0;
}

/* True while it is stuck. */
static bool watch_stuck(struct health *health, struct health_channel *channel, bool same)
{
	if (!same)
		channel->same_ticks = 0;
	else if (channel->same_ticks < HEALTH_STUCK_TICKS && ++channel->same_ticks == HEALTH_STUCK_TICKS)
		health->counters[WIRE_COUNTER_samples_stuck]++;
	return channel->same_ticks == HEALTH_STUCK_TICKS;
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

static void keep_zero(struct health *health, unsigned channel)
{
	const struct health_channel *seen = &health->channel[channel];

	if (!health->window_moved && seen->count > 0)
		health->zero[channel] = (int16_t)(seen->sum / seen->count);
}

static void judge_sensor(struct health *health, unsigned sensor)
{
	static const uint32_t sensor_check[WIRE_SENSORS] = {WIRE_CHECK_SENSOR_S1, WIRE_CHECK_SENSOR_S2};
	int64_t limit = health->parameters->value[WIRE_PARAMETER_noise_counts];

	for (unsigned i = 3 * sensor; i < 3 * sensor + 3; i++) {
		struct health_channel *channel = &health->channel[i];
		unsigned per_tick = i % 3 == 0 ? WIRE_X_PER_TICK : WIRE_YZ_PER_TICK;

		if (!quiet(channel, per_tick * HEALTH_WINDOW_TICKS, limit))
			health->window_checks |= sensor_check[sensor];
		keep_zero(health, i);
		channel->sum = 0;
		channel->squares = 0;
		channel->count = 0;
	}
}

static void end_tick(struct health *health, const struct acquire_tick *tick, bool moving)
{
	uint32_t level = health->parameters->value[WIRE_PARAMETER_trigger_counts];

	if (!moving && capture_impact_us(&tick->sensor[1], level) < 1000)
		health->window_triggered = true;
	if (++health->window_ticks < HEALTH_WINDOW_TICKS)
		return;
	health->sensor_checks = health->window_checks | (health->window_triggered ? WIRE_CHECK_TRIGGER : 0);
	health->window_checks = 0;
	health->window_ticks = 0;
	health->window_moved = false;
	health->window_triggered = false;
}

void health_samples(struct health *health, struct acquire_tick *tick, unsigned sensor)
{
	bool moving = sequence_moving(tick->status[0] & WIRE_STATUS_STATE);

	for (unsigned i = 3 * sensor; i < 3 * sensor + 3; i++) {
		struct health_channel *channel = &health->channel[i];
		unsigned count;
		const int16_t *code = acquire_channel(tick, i, &count);

		if (watch_stuck(health, channel, add(channel, code, count) && moving))
			tick->marks |= WIRE_MARK_STUCK;
	}
	health->window_moved |= moving;
	if (health->window_ticks == HEALTH_WINDOW_TICKS - 1)
		judge_sensor(health, sensor);
	if (sensor == WIRE_SENSORS - 1)
		end_tick(health, tick, moving);
}

static uint32_t cable_checks(uint16_t io, uint16_t bias_high)
{
	uint32_t checks = 0;

	if ((io & WIRE_IO_IEPE_S1) == 0)
		checks |= bias_high & WIRE_IO_IEPE_S1 ? WIRE_CHECK_OPEN_S1 : WIRE_CHECK_SHORT_S1;
	if ((io & WIRE_IO_IEPE_S2) == 0)
		checks |= bias_high & WIRE_IO_IEPE_S2 ? WIRE_CHECK_OPEN_S2 : WIRE_CHECK_SHORT_S2;
	return checks;
}

static uint32_t input_checks(uint16_t io)
{
	static const struct {
		uint16_t input, check;
	} needed[] = {
	        {WIRE_IO_LATCH_CLOSED, WIRE_CHECK_LATCH},      {WIRE_IO_PRODUCT_HELD, WIRE_CHECK_PRODUCT},
	        {WIRE_IO_DAMPERS_ENGAGED, WIRE_CHECK_DAMPERS}, {WIRE_IO_DOOR_CLOSED, WIRE_CHECK_DOOR},
	        {WIRE_IO_ESTOP_CLEAR, WIRE_CHECK_ESTOP},       {WIRE_IO_SUPPLY_GOOD, WIRE_CHECK_SUPPLY},
	};
	uint32_t checks = 0;

#pragma GCC unroll 8
	for (unsigned i = 0; i < sizeof(needed) / sizeof(needed[0]); i++)
		if ((io & needed[i].input) == 0)
			checks |= needed[i].check;
	if (io & WIRE_IO_FRAME_DOWN) /* the latch cannot hold a frame that is down */
		checks |= WIRE_CHECK_LATCH;
	if (io & (WIRE_IO_GATE_UPPER | WIRE_IO_GATE_LOWER))
		checks |= WIRE_CHECK_GATES;
	return checks;
}

uint32_t health_checks(const struct health *health, const struct health_view *view)
{
	uint32_t checks =
	        health->sensor_checks | input_checks(view->io) | cable_checks(view->io, view->bias_high);

	if (!view->host_good)
		checks |= WIRE_CHECK_HOST;
	if (!view->clocks_good)
		checks |= WIRE_CHECK_CLOCKS;
	if (!view->brown_out_set)
		checks |= WIRE_CHECK_BROWN_OUT_LEVEL;
	return checks;
}

struct sequence_view health_look(const struct health *health, const struct input *input, uint16_t pins,
                                 const struct acquire *acquire, bool host_good)
{
	struct health_view view = {
	        .io = input_io(input, pins),
	        .bias_high = port_bias_high(),
	        .host_good = host_good,
	        .clocks_good = acquire->clocks_good,
	        .brown_out_set = port_brown_out_set(),
	};

	return (struct sequence_view){
	        .now_us = port_time_us(),
	        .io = view.io,
	        .known = input->known,
	        .checks = health_checks(health, &view),
	};
}
