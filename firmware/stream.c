/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "firmware/stream.h"

#include "common/memory.h"
#include "common/segment.h"
#include "firmware/port.h"

void stream_init(struct stream *stream, volatile uint32_t *counters)
{
	memset(stream, 0, sizeof(*stream));
	stream->counters = counters;
	stream->queue = (struct ring)RING_OVER(stream->queue_storage);
	stream->requests = (struct ring)RING_OVER(stream->requests_storage);
}

static bool is_idle(const struct stream *stream)
{
	return !stream->waiting && ring_fill(&stream->queue) == 0;
}

static bool fits_bus(const struct stream *stream, const struct frame *frame)
{
	return !stream->classic || frame->length <= WIRE_LENGTH_segment;
}

static void put_frame(struct stream *stream, const struct frame *frame)
{
	bool is_block = frame->length == WIRE_LENGTH_block;

	if (is_idle(stream) && port_can_send(frame) == 0) {
		stream->counters[WIRE_COUNTER_frames_sent]++;
		return;
	}
	if ((is_block && ring_fill(&stream->queue) >= STREAM_QUEUE - STREAM_RESERVED) ||
	    ring_put(&stream->queue, frame) != 0)
		stream->counters[WIRE_COUNTER_frames_dropped]++;
	else
		stream->counters[WIRE_COUNTER_frames_deferred]++;
}

void stream_send(struct stream *stream, const struct frame *frame)
{
	struct frame segment;

	if (fits_bus(stream, frame)) {
		put_frame(stream, frame);
		return;
	}
	for (unsigned i = 0; i < segment_count(frame->length); i++) {
		segment_cut(frame, i, &segment);
		put_frame(stream, &segment);
	}
}

/* Goes once round the queue. */
void stream_set_classic(struct stream *stream, bool classic)
{
	uint32_t waiting = ring_fill(&stream->queue);
	struct frame frame;

	stream->classic = classic;
	if (stream->waiting && !fits_bus(stream, &stream->next)) {
		stream->waiting = false;
		stream->counters[WIRE_COUNTER_frames_dropped]++;
	}
	for (; waiting > 0 && ring_get(&stream->queue, &frame) == 0; waiting--)
		if (!fits_bus(stream, &frame) || ring_put(&stream->queue, &frame) != 0)
			stream->counters[WIRE_COUNTER_frames_dropped]++;
}

int stream_set_up(struct stream *stream, const struct parameters *parameters)
{
	bool classic = parameters->value[WIRE_PARAMETER_bus_mode] != 0;
	int result = port_can_setup(classic, parameters->value[WIRE_PARAMETER_data_kbit_s]);

	if (result == 0)
		stream_set_classic(stream, classic);
	return result;
}

void stream_flush(struct stream *stream)
{
	for (unsigned i = 0; i <= STREAM_QUEUE; i++) {
		if (!stream->waiting && ring_get(&stream->queue, &stream->next) != 0)
			return;
		stream->waiting = port_can_send(&stream->next) != 0;
		if (stream->waiting)
			return;
		stream->counters[WIRE_COUNTER_frames_sent]++;
	}
}

void stream_block(struct stream *stream, const struct frame *block)
{
	if (!stream->classic)
		stream_send(stream, block);
}

/* Cuts the request to what the ring holds; the rest is counted. */
static void cut(struct stream *stream, const struct capture *capture, struct wire_resend *request)
{
	uint32_t oldest_ms = capture->newest_ms - (capture->count - 1);
	uint32_t asked = request->count, early = 0, held = 0;

	if (capture->count > 0 && (int32_t)(oldest_ms - request->first_tick_ms) > 0)
		early = oldest_ms - request->first_tick_ms;
	if (early > asked)
		early = asked;
	if (capture->count > 0 && (int32_t)(capture->newest_ms - request->first_tick_ms) >= 0)
		held = capture->newest_ms - request->first_tick_ms + 1;
	held = held < asked ? held : asked;
	held = held > early ? held - early : 0;
	request->first_tick_ms += early;
	request->count = (uint16_t)held;
	stream->counters[WIRE_COUNTER_resends_out_of_range] += asked - held;
}

void stream_request(struct stream *stream, const struct capture *capture, const struct wire_resend *request)
{
	struct wire_resend held = *request;

	cut(stream, capture, &held);
	if (held.count > 0 && ring_put(&stream->requests, &held) != 0)
		stream->counters[WIRE_COUNTER_resends_overflowed]++;
}

void stream_upload(struct stream *stream, const struct capture *capture)
{
	struct wire_resend request = {
	        .first_tick_ms = capture->first_ms,
	        .count = (uint16_t)(capture->last_ms - capture->first_ms + 1),
	};

	if (!stream->classic)
		return;
	for (request.sensor = 1; request.sensor <= WIRE_SENSORS; request.sensor++)
		stream_request(stream, capture, &request);
}

static void resend_one(struct stream *stream, const struct capture *capture)
{
	struct wire_resend *request = &stream->request;
	const struct acquire_tick *tick = capture_find(capture, request->first_tick_ms);
	unsigned sensor = request->sensor - 1u;
	struct frame frame;

	if (tick == NULL) { /* the ring has rolled on */
		stream->counters[WIRE_COUNTER_resends_out_of_range]++;
	} else {
		acquire_pack(tick, sensor, sensor == 0 ? WIRE_ID_RESENT_S1 : WIRE_ID_RESENT_S2, &frame);
		stream_send(stream, &frame);
		stream->counters[WIRE_COUNTER_blocks_resent]++;
	}
	request->first_tick_ms++;
	request->count--;
}

static bool ready_for_block(const struct stream *stream)
{
	return stream->classic ? ring_fill(&stream->queue) < STREAM_UPLOAD_WAITING : is_idle(stream);
}

void stream_resend(struct stream *stream, const struct capture *capture)
{
	for (unsigned i = 0; i < STREAM_RESENT_PER_TICK; i++) {
		if (!ready_for_block(stream))
			return;
		if (stream->request.count == 0 && ring_get(&stream->requests, &stream->request) != 0)
			return;
		resend_one(stream, capture);
	}
}
