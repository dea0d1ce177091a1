/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_COMMON_WIRE_TABLE_H
#define DT_COMMON_WIRE_TABLE_H
/*
 * wire.def as tables, for dumps, error messages, the DBC file and tests. Constant; any context.
 */
#include <stddef.h>
#include <stdint.h>

#include "common/frame.h"

struct wire_field {
	const char *name;
	const char *unit;
	const char *doc;
	double scale;   /* physical value = raw value x scale */
	uint8_t offset; /* first byte */
	uint8_t size;   /* bytes of one element */
	uint8_t count;  /* elements; 1 for a plain field */
	uint8_t is_signed;
};

struct wire_layout {
	const char *name;
	const char *doc;
	const struct wire_field *fields;
	size_t field_count;
	uint8_t length; /* bytes */
};

struct wire_message {
	const char *name; /* "BLOCK_S1" */
	const char *doc;
	const char *sender; /* "tower" or "host" */
	const struct wire_layout *layout;
	uint32_t id;
};

struct wire_parameter_info {
	const char *name;
	const char *unit;
	const char *doc;
	uint16_t index;
	uint32_t min, max, initial;
};

extern const struct wire_message wire_messages[];
extern const size_t wire_message_count;
extern const struct wire_parameter_info wire_parameters[]; /* WIRE_PARAMETERS of them */

/* NULL for an identifier that wire.def does not have. */
const struct wire_message *wire_message_of(uint32_t id);

/* Names and texts; "?" for a number that wire.def does not have. */
const char *wire_state_name(unsigned state);
const char *wire_state_text(unsigned state);
const char *wire_fault_name(unsigned fault);
const char *wire_fault_text(unsigned fault);
uint16_t wire_fault_emcy(unsigned fault);
const char *wire_counter_name(unsigned counter);
const char *wire_check_name(unsigned check_number);
const char *wire_check_text(unsigned check_number); /* what to do about it */
const char *wire_mark_name(unsigned bit);
const char *wire_op_name(unsigned op);
int wire_state_moving(unsigned state); /* 1 in motion, 0 at rest or unknown */

#endif
