/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HIL_ADC_LOG_H
#define DT_HIL_ADC_LOG_H
/*
 * The truth file: the converter codes exactly as the firmware got them, one line for each tick and sensor,
 *
 *     tick_ms sensor x0..x6 y0..y9 z0..z9
 *
 * sensor 1 or 2, codes in 1/32 g. A sample the firmware never asked for is -32768, as on the wire. Ticks
 * start again at 0 when the firmware was reset. One thread; the file stays the caller's.
 */
#include <stdint.h>
#include <stdio.h>

#include "common/sensorbus.h"
#include "common/wire.h"

struct adc_log {
	FILE *file; /* NULL: nothing is kept */
	uint32_t tick_ms;
	bool begun;
	int16_t values[WIRE_SENSORS][WIRE_X_PER_TICK + 2 * WIRE_YZ_PER_TICK];
};

void adc_log_init(struct adc_log *codes, FILE *file);

/* What was answered to a request. */
void adc_log_put(struct adc_log *codes, const struct sensorbus_request *request, const int16_t given[6]);

/* Writes the tick that has begun, complete or not. */
void adc_log_flush(struct adc_log *codes);

#endif
