/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_COMMON_WIRE_H
#define DT_COMMON_WIRE_H
/*
 * The wire: structs, lengths, identifiers, pack and unpack, all made from wire.def. Freestanding; any
 * context; no state.
 *
 *     struct wire_status status = {.state = WIRE_STATE_SAFE};
 *     struct frame frame;
 *     wire_pack_status(&frame, WIRE_ID_STATUS, &status);
 *     ...
 *     if (wire_unpack_status(&frame, &status) == 0) ...
 *
 * A frame longer than 8 bytes is CAN FD with bit-rate switching, the others are classic frames on either
 * bus. On classic CAN the longer ones travel in segments (segment.h).
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "common/frame.h"

typedef uint8_t wire_u8;
typedef int8_t wire_i8;
typedef uint16_t wire_u16;
typedef int16_t wire_i16;
typedef uint32_t wire_u32;

enum { WIRE_SIZE_u8 = 1, WIRE_SIZE_i8 = 1, WIRE_SIZE_u16 = 2, WIRE_SIZE_i16 = 2, WIRE_SIZE_u32 = 4 };

/* struct wire_LAYOUT, in the order of the wire */
#define WIRE_LAYOUT(layout, doc) struct wire_##layout {
#define WIRE_FIELD(layout, type, name, scale, unit, doc) wire_##type name;
#define WIRE_ARRAY(layout, type, name, count, scale, unit, doc) wire_##type name[count];
#define WIRE_END(layout) \
	}                \
	;
#include "common/wire.def"

/* WIRE_LENGTH_layout, bytes on the wire */
#define WIRE_LAYOUT(layout, doc) enum { WIRE_LENGTH_##layout = 0
#define WIRE_FIELD(layout, type, name, scale, unit, doc) +WIRE_SIZE_##type
#define WIRE_ARRAY(layout, type, name, count, scale, unit, doc) +(WIRE_SIZE_##type * (count))
#define WIRE_END(layout) \
	}                \
	;
#include "common/wire.def"

enum {
#define WIRE_ID(NAME, id, layout, sender, doc) WIRE_ID_##NAME = (id),
#include "common/wire.def"
};

enum wire_state {
#define WIRE_STATE(NAME, moving, doc) WIRE_STATE_##NAME,
#include "common/wire.def"
	WIRE_STATES
};

enum wire_fault {
#define WIRE_FAULT(NAME, emcy, doc) WIRE_FAULT_##NAME,
#include "common/wire.def"
	WIRE_FAULTS
};

enum wire_check_number {
#define WIRE_CHECK(NAME, doc) WIRE_CHECK_NUMBER_##NAME,
#include "common/wire.def"
	WIRE_CHECKS
};

/* Bits of the words `checks`, `io` and `marks`. */
enum {
#define WIRE_CHECK(NAME, doc) WIRE_CHECK_##NAME = 1u << WIRE_CHECK_NUMBER_##NAME,
#define WIRE_OUTPUT(NAME, bit, doc) WIRE_IO_##NAME = 1u << (bit),
#define WIRE_INPUT(NAME, bit, doc) WIRE_IO_##NAME = 1u << (bit),
#define WIRE_MARK(NAME, bit, doc) WIRE_MARK_##NAME = 1u << (bit),
#include "common/wire.def"
};

/* The io bits that are outputs. */
enum {
	WIRE_IO_OUTPUTS = 0
#define WIRE_OUTPUT(NAME, bit, doc) | WIRE_IO_##NAME
#include "common/wire.def"
};

enum wire_op {
#define WIRE_OP(NAME, value, doc) WIRE_OP_##NAME = (value),
#include "common/wire.def"
};

enum wire_counter_number {
#define WIRE_COUNTER(name, doc) WIRE_COUNTER_##name,
#include "common/wire.def"
	WIRE_COUNTERS
};

enum wire_parameter_number {
#define WIRE_PARAMETER(name, index, unit, min, max, initial, doc) WIRE_PARAMETER_##name,
#include "common/wire.def"
	WIRE_PARAMETERS
};

enum {
	WIRE_SENSORS = 2,
	WIRE_X_PER_TICK = 7,     /* 7 kHz */
	WIRE_YZ_PER_TICK = 10,   /* 10 kHz */
	WIRE_SAMPLE_BYTES = 54,  /* of one block: 7 X, 10 Y, 10 Z */
	WIRE_SAMPLE_OFFSET = 10, /* first sample byte in a block */
	WIRE_TICK_OFFSET = 2,    /* first byte of its tick */
	WIRE_CRC8_OFFSET = 9,
	WIRE_COUNTS_PER_G = 32,
	WIRE_SAMPLE_NOT_TAKEN = -32768,
	WIRE_SAMPLE_FULL_SCALE = 32767, /* +-: the converter's limit */
};

/* Fields of block.status. */
enum {
	WIRE_STATUS_STATE = 0x0F,
	WIRE_STATUS_TRIGGERED = 0x10,
	WIRE_STATUS_CLIP_X = 0x20,
	WIRE_STATUS_CLIP_Y = 0x40,
	WIRE_STATUS_CLIP_Z = 0x80,
};

/* Pack *m into *frame: id, length, flags and data; time_us is left alone. A block's crc8 is not
 * computed here: see wire_seal_block. Unpack returns DT_E_LENGTH, with *m unchanged, if the frame does
 * not have the layout's length or is not a data frame. */
#define WIRE_LAYOUT(layout, doc)                                                                  \
	void wire_pack_##layout(struct frame *frame, uint32_t id, const struct wire_##layout *m); \
	DT_MUST_USE int wire_unpack_##layout(const struct frame *frame, struct wire_##layout *m);
#include "common/wire.def"

/* Writes the CRC-8 of a packed block into its place. */
void wire_seal_block(struct frame *frame);

/* 0, DT_E_LENGTH, or DT_E_CORRUPT if the CRC-8 does not agree. */
DT_MUST_USE int wire_check_block(const struct frame *frame);

/* Of a block that is one: its tick alone. */
static inline uint32_t wire_block_tick_ms(const struct frame *frame)
{
	const uint8_t *p = frame->data + WIRE_TICK_OFFSET;

	return p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

/* Writes the seal of a packed capture end into its place. */
void wire_seal_capture_end(struct frame *frame);

/* 0, DT_E_LENGTH, or DT_E_CORRUPT if the seal does not agree. */
DT_MUST_USE int wire_check_capture_end(const struct frame *frame);

/* The same for the CRC-32 of a packed `measured`. */
void wire_seal_measured(struct frame *frame);
DT_MUST_USE int wire_check_measured(const struct frame *frame);

/* CRC-32 over a whole parameter set, values little endian, in the order of wire.def. */
uint32_t wire_parameters_crc32(const uint32_t value[WIRE_PARAMETERS]);

/* The argument of ARM and RELEASE: CRC-32 over the nonce of the challenge that is answered, the sender's
 * session for ARM or the number of the drop to come for RELEASE, and the CRC-32 of the parameters believed
 * in. ARM over nonce 0 answers nothing and asks for a challenge. It proves that the command was given after
 * that challenge; it is no secret. */
uint32_t wire_answer(uint32_t nonce, uint32_t subject, uint32_t parameters_crc32);

/* CRC-32 over wire.def without its texts: equal on both ends or they do not speak the same wire. */
uint32_t wire_hash(void);

#endif
