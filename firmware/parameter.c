/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "firmware/parameter.h"

#include "firmware/capture.h"

static const struct {
	uint32_t min, max, initial;
	uint16_t index;
} table[WIRE_PARAMETERS] = {
#define WIRE_PARAMETER(name, index, unit, min, max, initial, doc) {min, max, initial, index},
#include "common/wire.def"
};

void parameters_init(struct parameters *parameters)
{
	for (unsigned i = 0; i < WIRE_PARAMETERS; i++)
		parameters->value[i] = table[i].initial;
}

static unsigned parameter_find(uint16_t index)
{
	unsigned i = 0;

	while (i < WIRE_PARAMETERS && table[i].index != index)
		i++;
	return i;
}

static bool exists(unsigned i, uint32_t value)
{
	return i != WIRE_PARAMETER_data_kbit_s || value == 2000 || value == 5000 || value == 8000;
}

static bool agree(const uint32_t *value)
{
	return value[WIRE_PARAMETER_gate_upper_um] + PARAMETER_GATE_DISTANCE_UM <=
	               value[WIRE_PARAMETER_gate_lower_um] &&
	       value[WIRE_PARAMETER_gate_lower_um] < value[WIRE_PARAMETER_separation_um] &&
	       value[WIRE_PARAMETER_separation_um] <= value[WIRE_PARAMETER_dampers_um] &&
	       value[WIRE_PARAMETER_warning_ms] + PARAMETER_ARMED_MS <=
	               value[WIRE_PARAMETER_arm_timeout_ms] &&
	       value[WIRE_PARAMETER_pre_trigger_ms] + value[WIRE_PARAMETER_post_trigger_ms] <= CAPTURE_TICKS;
}

uint32_t parameters_get(const struct parameters *parameters, uint16_t index, uint32_t *value)
{
	unsigned i = parameter_find(index);

	if (i == WIRE_PARAMETERS)
		return PARAMETER_NO_OBJECT;
	*value = parameters->value[i];
	return 0;
}

uint32_t parameters_set(struct parameters *parameters, uint16_t index, uint32_t value)
{
	struct parameters wanted = *parameters;
	unsigned i = parameter_find(index);

	if (i == WIRE_PARAMETERS)
		return PARAMETER_NO_OBJECT;
	if (value < table[i].min)
		return PARAMETER_TOO_LOW;
	if (value > table[i].max)
		return PARAMETER_TOO_HIGH;
	if (!exists(i, value))
		return PARAMETER_NO_VALUE;
	wanted.value[i] = value;
	if (!agree(wanted.value))
		return PARAMETER_INCOMPATIBLE;
	parameters->value[i] = value;
	return 0;
}
