/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "common/wire.h"

#include "common/crc.h"

/* Every layout must fit a frame that CAN FD has. */
#define FD_HAS(n) \
	((n) <= 8 || (n) == 12 || (n) == 16 || (n) == 20 || (n) == 24 || (n) == 32 || (n) == 48 || (n) == 64)
#define WIRE_LAYOUT(layout, doc) _Static_assert(FD_HAS(WIRE_LENGTH_##layout), "wire.def: " #layout);
#include "common/wire.def"
_Static_assert(WIRE_SAMPLE_OFFSET + WIRE_SAMPLE_BYTES == WIRE_LENGTH_block, "block");
_Static_assert(WIRE_CHECKS <= 32, "checks are a 32-bit word");
_Static_assert(WIRE_STATES <= 16, "the state has 4 bits in block.status");

static uint8_t *put_u8(uint8_t *p, uint8_t v)
{
	*p = v;
	return p + 1;
}

static uint8_t *put_i8(uint8_t *p, int8_t v)
{
	return put_u8(p, (uint8_t)v);
}

static uint8_t *put_u16(uint8_t *p, uint16_t v)
{
	return put_u8(put_u8(p, (uint8_t)v), (uint8_t)(v >> 8));
}

static uint8_t *put_i16(uint8_t *p, int16_t v)
{
	return put_u16(p, (uint16_t)v);
}

static uint8_t *put_u32(uint8_t *p, uint32_t v)
{
	return put_u16(put_u16(p, (uint16_t)v), (uint16_t)(v >> 16));
}

static const uint8_t *get_u8(const uint8_t *p, uint8_t *v)
{
	*v = *p;
	return p + 1;
}

static const uint8_t *get_i8(const uint8_t *p, int8_t *v)
{
	*v = (int8_t)*p;
	return p + 1;
}

static const uint8_t *get_u16(const uint8_t *p, uint16_t *v)
{
	*v = (uint16_t)(p[0] | (unsigned)p[1] << 8);
	return p + 2;
}

static const uint8_t *get_i16(const uint8_t *p, int16_t *v)
{
	*v = (int16_t)(uint16_t)(p[0] | (unsigned)p[1] << 8);
	return p + 2;
}

static const uint8_t *get_u32(const uint8_t *p, uint32_t *v)
{
	*v = p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
	return p + 4;
}

static uint8_t *open_frame(struct frame *frame, uint32_t id, uint8_t length)
{
	frame->id = id;
	frame->length = length;
	frame->flags = length > 8 ? FRAME_FD | FRAME_BRS : 0;
	return frame->data;
}

static bool carries(const struct frame *frame, uint8_t length)
{
	return frame->length == length && (frame->flags & (FRAME_REMOTE | FRAME_ERROR | FRAME_EXTENDED)) == 0;
}

#define WIRE_LAYOUT(layout, doc)                                                                 \
	void wire_pack_##layout(struct frame *frame, uint32_t id, const struct wire_##layout *m) \
	{                                                                                        \
		uint8_t *p = open_frame(frame, id, WIRE_LENGTH_##layout);
#define WIRE_FIELD(layout, type, name, scale, unit, doc) p = put_##type(p, m->name);
#define WIRE_ARRAY(layout, type, name, count, scale, unit, doc) \
	for (int i = 0; i < (count); i++)                       \
		p = put_##type(p, m->name[i]);
#define WIRE_END(layout) \
	(void)p;         \
	}
#include "common/wire.def"

#define WIRE_LAYOUT(layout, doc)                                                     \
	int wire_unpack_##layout(const struct frame *frame, struct wire_##layout *m) \
	{                                                                            \
		const uint8_t *p = frame->data;                                      \
		if (!carries(frame, WIRE_LENGTH_##layout))                           \
			return DT_E_LENGTH;
#define WIRE_FIELD(layout, type, name, scale, unit, doc) p = get_##type(p, &m->name);
#define WIRE_ARRAY(layout, type, name, count, scale, unit, doc) \
	for (int i = 0; i < (count); i++)                       \
		p = get_##type(p, &m->name[i]);
#define WIRE_END(layout) \
	(void)p;         \
	return 0;        \
	}
#include "common/wire.def"

static uint8_t block_crc8(const struct frame *frame)
{
	uint8_t crc = crc8(CRC8_INIT, frame->data, WIRE_CRC8_OFFSET);

	return crc8(crc, frame->data + WIRE_SAMPLE_OFFSET, WIRE_SAMPLE_BYTES);
}

void wire_seal_block(struct frame *frame)
{
	frame->data[WIRE_CRC8_OFFSET] = block_crc8(frame);
}

int wire_check_block(const struct frame *frame)
{
	if (!carries(frame, WIRE_LENGTH_block))
		return DT_E_LENGTH;
	return frame->data[WIRE_CRC8_OFFSET] == block_crc8(frame) ? 0 : DT_E_CORRUPT;
}

/* A layout whose last four bytes are the CRC-32 of those before. */
static void seal_frame(struct frame *frame)
{
	(void)put_u32(frame->data + frame->length - 4, crc32(CRC32_INIT, frame->data, frame->length - 4u));
}

static int check_sealed(const struct frame *frame, uint8_t length)
{
	uint32_t crc;

	if (!carries(frame, length))
		return DT_E_LENGTH;
	(void)get_u32(frame->data + length - 4, &crc);
	return crc == crc32(CRC32_INIT, frame->data, length - 4u) ? 0 : DT_E_CORRUPT;
}

void wire_seal_capture_end(struct frame *frame)
{
	seal_frame(frame);
}

int wire_check_capture_end(const struct frame *frame)
{
	return check_sealed(frame, WIRE_LENGTH_capture_end);
}

void wire_seal_measured(struct frame *frame)
{
	seal_frame(frame);
}

int wire_check_measured(const struct frame *frame)
{
	return check_sealed(frame, WIRE_LENGTH_measured);
}

static uint32_t crc_u32(uint32_t crc, uint32_t value)
{
	uint8_t bytes[4];

	(void)put_u32(bytes, value);
	return crc32(crc, bytes, sizeof(bytes));
}

uint32_t wire_parameters_crc32(const uint32_t value[WIRE_PARAMETERS])
{
	uint32_t crc = CRC32_INIT;

	for (unsigned i = 0; i < WIRE_PARAMETERS; i++)
		crc = crc_u32(crc, value[i]);
	return crc;
}

uint32_t wire_answer(uint32_t nonce, uint32_t subject, uint32_t parameters_crc32)
{
	return crc_u32(crc_u32(crc_u32(CRC32_INIT, nonce), subject), parameters_crc32);
}

uint32_t wire_hash(void)
{
	static const char text[] =
#define WIRE_LAYOUT(layout, doc) "{" #layout
#define WIRE_FIELD(layout, type, name, scale, unit, doc) ";" #type " " #name " " #scale
#define WIRE_ARRAY(layout, type, name, count, scale, unit, doc) ";" #type " " #name "[" #count "] " #scale
#define WIRE_END(layout) "}"
#define WIRE_ID(NAME, id, layout, sender, doc) #NAME " " #id " " #layout " " #sender ";"
#define WIRE_STATE(NAME, moving, doc) #NAME " " #moving ";"
#define WIRE_FAULT(NAME, emcy, doc) #NAME " " #emcy ";"
#define WIRE_CHECK(NAME, doc) #NAME ";"
#define WIRE_OUTPUT(NAME, bit, doc) #NAME " out " #bit ";"
#define WIRE_INPUT(NAME, bit, doc) #NAME " in " #bit ";"
#define WIRE_OP(NAME, value, doc) #NAME " " #value ";"
#define WIRE_MARK(NAME, bit, doc) #NAME " " #bit ";"
#define WIRE_COUNTER(name, doc) #name ";"
#define WIRE_PARAMETER(name, index, unit, min, max, initial, doc) #name " " #index " " #min " " #max ";"
#include "common/wire.def"
	        ;

	return crc32(CRC32_INIT, (const uint8_t *)text, sizeof(text) - 1);
}
