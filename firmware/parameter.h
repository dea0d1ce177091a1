/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_PARAMETER_H
#define DT_FIRMWARE_PARAMETER_H
/*
 * The parameters of wire.def: values, limits, and what must agree between them. Set from main, and only
 * in states in which no interrupt uses more than one of them; each is one word.
 */
#include <stdint.h>

#include "common/wire.h"

enum {
	PARAMETER_GATE_DISTANCE_UM = 10000, /* least distance between the gates */
	PARAMETER_ARMED_MS = 1000,          /* least time for a release, behind the warning */
};

struct parameters {
	uint32_t value[WIRE_PARAMETERS]; /* by WIRE_PARAMETER_name */
};

/* CiA 301 table 22, SDO abort codes. */
enum {
	PARAMETER_NO_OBJECT = 0x06020000,
	PARAMETER_NO_SUBINDEX = 0x06090011,
	PARAMETER_TOO_HIGH = 0x06090031,
	PARAMETER_TOO_LOW = 0x06090032,
	PARAMETER_NO_VALUE = 0x06090030,     /* between the limits, but not one of those there are */
	PARAMETER_INCOMPATIBLE = 0x06040043, /* does not agree with the other parameters */
	PARAMETER_BAD_SPECIFIER = 0x05040001,
	PARAMETER_WRONG_STATE = 0x08000022,
	PARAMETER_HARDWARE = 0x06060000, /* the port refuses it */
};

void parameters_init(struct parameters *parameters);

/* Both return 0 or an abort code. The gates, the separation and the dampers must come in this order on the
 * way down, pre-trigger and post-trigger together fit the capture ring, and arm_timeout_ms leave
 * PARAMETER_ARMED_MS behind warning_ms; else the value is refused. */
DT_MUST_USE uint32_t parameters_get(const struct parameters *parameters, uint16_t index, uint32_t *value);
DT_MUST_USE uint32_t parameters_set(struct parameters *parameters, uint16_t index, uint32_t value);

#endif
