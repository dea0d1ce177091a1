/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "common/wire_table.h"

#include "common/wire.h"

#define COUNT(a) (sizeof(a) / sizeof((a)[0]))
#define SIGNED_u8 0
#define SIGNED_i8 1
#define SIGNED_u16 0
#define SIGNED_i16 1
#define SIGNED_u32 0

/* Offsets on the wire: a packed struct of byte arrays has them, whatever the compiler's alignment. */
#define WIRE_LAYOUT(layout, doc) struct bytes_##layout {
#define WIRE_FIELD(layout, type, name, scale, unit, doc) uint8_t name[WIRE_SIZE_##type];
#define WIRE_ARRAY(layout, type, name, count, scale, unit, doc) uint8_t name[WIRE_SIZE_##type * (count)];
#define WIRE_END(layout) \
	}                \
	;
#include "common/wire.def"

#define WIRE_LAYOUT(layout, doc) static const struct wire_field fields_##layout[] = {
#define WIRE_FIELD(layout, type, name, scale, unit, doc) \
	{#name, unit, doc, scale, offsetof(struct bytes_##layout, name), WIRE_SIZE_##type, 1, SIGNED_##type},
#define WIRE_ARRAY(layout, type, name, count, scale, unit, doc)                                    \
	{#name, unit,         doc, scale, offsetof(struct bytes_##layout, name), WIRE_SIZE_##type, \
	 count, SIGNED_##type},
#define WIRE_END(layout) \
	}                \
	;
#include "common/wire.def"

#define WIRE_LAYOUT(layout, doc)                                                          \
	static const struct wire_layout layout_##layout = {#layout, doc, fields_##layout, \
	                                                   COUNT(fields_##layout), WIRE_LENGTH_##layout};
#include "common/wire.def"

const struct wire_message wire_messages[] = {
#define WIRE_ID(NAME, id, layout, sender, doc) {#NAME, doc, #sender, &layout_##layout, id},
#include "common/wire.def"
};
const size_t wire_message_count = COUNT(wire_messages);

const struct wire_parameter_info wire_parameters[] = {
#define WIRE_PARAMETER(name, index, unit, min, max, initial, doc) \
	{#name, unit, doc, index, min, max, initial},
#include "common/wire.def"
};

static const struct {
	const char *name, *text;
	uint8_t moving;
} states[] = {
#define WIRE_STATE(NAME, moving, doc) {#NAME, doc, moving},
#include "common/wire.def"
};

static const struct {
	const char *name, *text;
	uint16_t emcy;
} faults[] = {
#define WIRE_FAULT(NAME, emcy, doc) {#NAME, doc, emcy},
#include "common/wire.def"
};

static const struct {
	const char *name, *text;
} checks[] = {
#define WIRE_CHECK(NAME, doc) {#NAME, doc},
#include "common/wire.def"
};

static const char *const counter_names[] = {
#define WIRE_COUNTER(name, doc) #name,
#include "common/wire.def"
};

const struct wire_message *wire_message_of(uint32_t id)
{
	for (size_t i = 0; i < wire_message_count; i++)
		if (wire_messages[i].id == id)
			return &wire_messages[i];
	return NULL;
}

const char *wire_state_name(unsigned state)
{
	return state < WIRE_STATES ? states[state].name : "?";
}

const char *wire_state_text(unsigned state)
{
	return state < WIRE_STATES ? states[state].text : "?";
}

int wire_state_moving(unsigned state)
{
	return state < WIRE_STATES ? states[state].moving : 0;
}

const char *wire_fault_name(unsigned fault)
{
	return fault < WIRE_FAULTS ? faults[fault].name : "?";
}

const char *wire_fault_text(unsigned fault)
{
	return fault < WIRE_FAULTS ? faults[fault].text : "?";
}

uint16_t wire_fault_emcy(unsigned fault)
{
	return fault < WIRE_FAULTS ? faults[fault].emcy : 0xFF00u;
}

const char *wire_counter_name(unsigned counter)
{
	return counter < WIRE_COUNTERS ? counter_names[counter] : "?";
}

const char *wire_check_name(unsigned check_number)
{
	return check_number < WIRE_CHECKS ? checks[check_number].name : "?";
}

const char *wire_check_text(unsigned check_number)
{
	return check_number < WIRE_CHECKS ? checks[check_number].text : "?";
}

const char *wire_mark_name(unsigned bit)
{
	switch (bit) {
#define WIRE_MARK(NAME, number, doc) \
	case number:                 \
		return #NAME;
#include "common/wire.def"
	default:
		return "?";
	}
}

const char *wire_op_name(unsigned op)
{
	switch (op) {
#define WIRE_OP(NAME, value, doc) \
	case value:               \
		return #NAME;
#include "common/wire.def"
	default:
		return "?";
	}
}
