/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "hil/adc_log.h"

enum { VALUES = WIRE_X_PER_TICK + 2 * WIRE_YZ_PER_TICK };

static void adc_log_begin(struct adc_log *codes, uint32_t tick_ms)
{
	codes->tick_ms = tick_ms;
	codes->begun = true;
	for (unsigned sensor = 0; sensor < WIRE_SENSORS; sensor++)
		for (unsigned i = 0; i < VALUES; i++)
			codes->values[sensor][i] = WIRE_SAMPLE_NOT_TAKEN;
}

void adc_log_init(struct adc_log *codes, FILE *file)
{
	*codes = (struct adc_log){.file = file};
}

void adc_log_flush(struct adc_log *codes)
{
	if (codes->file == NULL || !codes->begun)
		return;
	for (unsigned sensor = 0; sensor < WIRE_SENSORS; sensor++) {
		fprintf(codes->file, "%u %u", codes->tick_ms, sensor + 1);
		for (unsigned i = 0; i < VALUES; i++)
			fprintf(codes->file, " %d", codes->values[sensor][i]);
		fputc('\n', codes->file);
	}
	codes->begun = false;
}

void adc_log_put(struct adc_log *codes, const struct sensorbus_request *request, const int16_t given[6])
{
	if (codes->file == NULL)
		return;
	if (!codes->begun || codes->tick_ms != request->tick_ms || request->reset) {
		adc_log_flush(codes);
		adc_log_begin(codes, request->tick_ms);
	}
	for (unsigned sensor = 0; sensor < WIRE_SENSORS; sensor++) {
		int16_t *values = codes->values[sensor];

		if (request->group & SENSORBUS_X)
			values[request->index] = given[3 * sensor];
		if (request->group & SENSORBUS_YZ) {
			values[WIRE_X_PER_TICK + request->index] = given[3 * sensor + 1];
			values[WIRE_X_PER_TICK + WIRE_YZ_PER_TICK + request->index] = given[3 * sensor + 2];
		}
	}
}
