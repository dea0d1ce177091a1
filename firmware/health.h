/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_HEALTH_H
#define DT_FIRMWARE_HEALTH_H
/*
 * Is everything fit for a drop? The check bits of wire.def from the inputs, the sensors, the sample clocks
 * and the host.
 *
 * A sensor's cable is open or short when its bias is not in its window. A sensor is fit when, over the last
 * HEALTH_WINDOW_TICKS, offset and standard deviation of every axis stay within noise_counts (1/32 g) and at
 * least half the samples were taken. The trigger is fit when S2 did not reach trigger_counts in that time, or
 * a drop would be triggered by what is there before it. A channel in motion that gives one value for
 * HEALTH_STUCK_TICKS is counted, once for each such spell, and marks the ticks until it ends.
 *
 * Context: health_samples main; the rest control, or main between port_lock and port_unlock.
 */
#include <stdbool.h>
#include <stdint.h>

#include "firmware/acquire.h"
#include "firmware/input.h"
#include "firmware/parameter.h"
#include "firmware/sequence.h"

enum {
	HEALTH_WINDOW_TICKS = 100,
	HEALTH_STUCK_TICKS = 20,
};

struct health_channel {
	int32_t sum;
	uint64_t squares;
	uint16_t count;
	int16_t last;
	uint8_t same_ticks;
};

struct health {
	const struct parameters *parameters;
	volatile uint32_t *counters;
	struct health_channel channel[ACQUIRE_CHANNELS];
	int16_t zero[ACQUIRE_CHANNELS]; /* offsets over the last window at rest */
	uint32_t window_checks;         /* of the sensors that are judged already */
	uint8_t window_ticks;
	bool window_moved, window_triggered;
	volatile uint32_t sensor_checks; /* written by main */
};

/* What is seen at the moment of a call. */
struct health_view {
	uint16_t io;        /* debounced */
	uint16_t bias_high; /* as port_bias_high */
	bool host_good;     /* the host that counts is here */
	bool clocks_good;
	bool brown_out_set; /* as port_brown_out_set */
};

void health_init(struct health *health, const struct parameters *parameters, volatile uint32_t *counters);

/* One sensor's samples of a tick, S1 (0) first, then S2 (1). Sets WIRE_MARK_STUCK in the tick where it
 * applies. */
void health_samples(struct health *health, struct acquire_tick *tick, unsigned sensor);

/* WIRE_CHECK_* bits that are not green, those of the sequence apart. */
uint32_t health_checks(const struct health *health, const struct health_view *view);

/* Everything that is seen now, for the sequence; pins as port_io, host_good as in the view. */
struct sequence_view health_look(const struct health *health, const struct input *input, uint16_t pins,
                                 const struct acquire *acquire, bool host_good);

#endif
