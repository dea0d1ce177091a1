/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "common/sensorbus.h"

#include "common/error.h"
#include "common/memory.h"

enum { RESET = 1, AHEAD = 2, BEHIND_SHIFT = 12, ID_MASK = 0x0FFF };

static uint8_t *put16(uint8_t *p, uint16_t v)
{
	p[0] = (uint8_t)v;
	p[1] = (uint8_t)(v >> 8);
	return p + 2;
}

static uint8_t *put32(uint8_t *p, uint32_t v)
{
	return put16(put16(p, (uint16_t)v), (uint16_t)(v >> 16));
}

static uint16_t get16(const uint8_t *p)
{
	return (uint16_t)(p[0] | (unsigned)p[1] << 8);
}

static uint32_t get32(const uint8_t *p)
{
	return get16(p) | (uint32_t)get16(p + 2) << 16;
}

size_t sensorbus_put_request(uint8_t *out, const struct sensorbus_request *request)
{
	uint8_t *p = put32(out, request->tick_ms);

	*p++ = request->group;
	*p++ = request->index;
	p = put16(p, request->outputs);
	*p++ = request->edges;
	*p++ = request->frames;
	*p++ = (uint8_t)((request->reset ? RESET : 0) | (request->ahead ? AHEAD : 0));
	*p++ = request->kept;
	for (int i = 0; i < SENSORBUS_OUTPUTS; i++)
		p = put32(p, request->edge_us[i]);
	return (size_t)(p - out);
}

size_t sensorbus_get_request(const uint8_t *in, struct sensorbus_request *request)
{
	*request = (struct sensorbus_request){
	        .tick_ms = get32(in),
	        .group = in[4],
	        .index = in[5],
	        .outputs = get16(in + 6),
	        .edges = in[8],
	        .frames = in[9],
	        .reset = in[10] & RESET,
	        .ahead = (in[10] & AHEAD) != 0,
	        .kept = in[11],
	};
	for (int i = 0; i < SENSORBUS_OUTPUTS; i++)
		request->edge_us[i] = get32(in + 12 + 4 * i);
	return SENSORBUS_REQUEST_BYTES;
}

size_t sensorbus_put_answer(uint8_t *out, const struct sensorbus_answer *answer)
{
	uint8_t *p = out;

	for (int i = 0; i < 6; i++)
		p = put16(p, (uint16_t)answer->codes[i]);
	p = put16(p, answer->inputs);
	*p++ = answer->captures;
	*p++ = answer->frames;
	for (int i = 0; i < SENSORBUS_CAPTURES; i++)
		p = put32(p, answer->capture_us[i]);
	*p++ = answer->ready;
	*p++ = answer->then;
	p = put16(p, answer->bus_errors);
	*p++ = answer->bus_state;
	*p++ = answer->tx_blocked;
	*p++ = answer->bias_high;
	*p++ = answer->hang;
	p = put32(p, answer->random);
	return (size_t)(p - out);
}

size_t sensorbus_get_answer(const uint8_t *in, struct sensorbus_answer *answer)
{
	*answer = (struct sensorbus_answer){
	        .inputs = get16(in + 12),
	        .captures = in[14],
	        .frames = in[15],
	        .ready = in[28],
	        .then = in[29],
	        .bus_errors = get16(in + 30),
	        .bus_state = in[32],
	        .tx_blocked = in[33],
	        .bias_high = in[34],
	        .hang = in[35],
	        .random = get32(in + 36),
	};
	for (int i = 0; i < 6; i++)
		answer->codes[i] = (int16_t)get16(in + 2 * i);
	for (int i = 0; i < SENSORBUS_CAPTURES; i++)
		answer->capture_us[i] = get32(in + 16 + 4 * i);
	return SENSORBUS_ANSWER_BYTES;
}

size_t sensorbus_put_frame(uint8_t *out, const struct frame *frame, unsigned behind)
{
	uint8_t *p = put16(out, (uint16_t)((frame->id & ID_MASK) | behind << BEHIND_SHIFT));

	*p++ = frame->flags;
	*p++ = frame->length;
	memcpy(p, frame->data, frame->length);
	return 4u + frame->length;
}

int sensorbus_frame_head(const uint8_t *in, struct frame *frame, unsigned *behind)
{
	if (in[3] > FRAME_DATA_MAX)
		return DT_E_LENGTH;
	frame->time_us = 0;
	frame->id = get16(in) & ID_MASK;
	*behind = get16(in) >> BEHIND_SHIFT;
	frame->flags = in[2];
	frame->length = in[3];
	return in[3];
}
