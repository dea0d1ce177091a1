/* SPDX-License-Identifier: GPL-2.0-or-later */
#ifndef DT_COMMON_SENSORBUS_H
#define DT_COMMON_SENSORBUS_H
/*
 * The simulated sensor bus between a firmware port without hardware (posix, qemu) and the bench.
 *
 * Two byte pipes. At a sample instant the port writes a request and reads its answer; the plant integrates
 * exactly up to that instant, so time stands still in between and the result does not depend on the
 * machine's load. CAN frames ride along: what the firmware sent since the last request goes with the
 * request, what it is to receive comes with the answer. All integers little endian, no padding:
 *
 *   request:  SENSORBUS_REQUEST_BYTES, then `frames` frames
 *   answer:   SENSORBUS_ANSWER_BYTES, then `frames` frames
 *   frame:    u16: id, and above it (12 bits up) the answers ahead that had been taken when it was sent;
 *             flags u8 (FRAME_*), length u8, data[length]
 *
 * Each exchange costs two processes their turn, so one of them serves more than one instant where it can: a
 * port that will change no output before the next tick, whatever the samples are, says `ahead`. Then
 * answers for the instants of this tick that follow may come at once, without a request: as many as bring
 * neither a frame nor a capture, which could make the port act, and the first that does.
 *
 * Virtual time counts from the reset of the firmware; tick_ms + k/7 or k/10 ms is exact. An output edge
 * carries its own time in us, inside the span since the request before, so that a compare event is
 * applied between the samples where it belongs.
 * Packing and unpacking is freestanding; any context.
 */
#include <stddef.h>
#include <stdint.h>

#include "common/frame.h"

enum {
	SENSORBUS_OUTPUTS = 5,  /* bits 0-4 of the io word */
	SENSORBUS_CAPTURES = 3, /* upper gate, lower gate, keeper current */
	SENSORBUS_REQUEST_BYTES = 32,
	SENSORBUS_ANSWER_BYTES = 40,
	SENSORBUS_FRAMES_MAX = 32, /* in one request or answer; a capture end and what follows it are 24 */
	SENSORBUS_FRAME_BYTES_MAX = 4 + 64,
	SENSORBUS_ANSWERS_MAX = 15, /* to one request */
	SENSORBUS_MESSAGE_MAX = SENSORBUS_ANSWER_BYTES + SENSORBUS_FRAMES_MAX * SENSORBUS_FRAME_BYTES_MAX,
};

enum {
	SENSORBUS_X = 1,  /* X of both sensors, 7 kHz, index 0-6 */
	SENSORBUS_YZ = 2, /* Y and Z of both sensors, 10 kHz, index 0-9 */
};

struct sensorbus_request {
	uint32_t tick_ms;
	uint8_t group;    /* SENSORBUS_X and/or SENSORBUS_YZ; both only for index 0 */
	uint8_t index;    /* sample within the tick */
	uint16_t outputs; /* io word's output bits at this instant, all edges applied */
	uint8_t edges;    /* bit i: output i changed at edge_us[i] since the request before */
	uint8_t frames;   /* frames that follow */
	uint8_t reset;    /* bit 0 of a byte: 1 in the first request after a reset */
	uint8_t ahead;    /* bit 1 of it: answers ahead are welcome */
	uint8_t kept;     /* what the firmware keeps over a reset (port_keep); --kept gives it back */
	uint32_t edge_us[SENSORBUS_OUTPUTS]; /* virtual us since reset, modulo 2^32 */
};

struct sensorbus_answer {
	int16_t codes[6]; /* S1 X Y Z, S2 X Y Z, 1/32 g; only the group asked for counts */
	uint16_t inputs;  /* io word's input bits */
	uint8_t captures; /* bit 0, 1: upper, lower gate's beam was broken; 2: the keeper current fell, at
	                     capture_us[] */
	uint8_t frames;   /* frames that follow */
	uint32_t capture_us[SENSORBUS_CAPTURES];
	uint8_t ready;       /* bit 0 X, bit 1 YZ: the converter delivered; 0 = overrun */
	uint8_t then;        /* SENSORBUS_ASK, SENSORBUS_STOP or SENSORBUS_MORE */
	uint16_t bus_errors; /* CAN errors since the answer before */
	uint8_t bus_state;   /* SENSORBUS_BUS_* now */
	uint8_t tx_blocked;  /* 1: the bus takes no frame now */
	uint8_t bias_high;   /* bit 0 S1, 1 S2: where inputs say that the bias is lost, it is above its window
	                      */
	uint8_t hang;        /* 1: the firmware's main loop hangs from now on, until its watchdog resets it */
	uint32_t random;     /* for port_random; from the bench's seed, so that a run repeats */
};

/* After this answer: the next request; the bench ends the run, the port exits with 0; another answer. */
enum { SENSORBUS_ASK, SENSORBUS_STOP, SENSORBUS_MORE };

enum { SENSORBUS_BUS_ACTIVE, SENSORBUS_BUS_PASSIVE, SENSORBUS_BUS_OFF };

/* A port in the program of the bench: no process, no pipes, the same bytes. Its answer must stay where it is
 * until the next request is asked for. */
struct sensorbus_inside {
	void (*start)(unsigned cause, uint8_t kept);
	size_t (*ask)(const uint8_t **request); /* bytes of the next request; 0: it has ended */
	void (*answer)(const uint8_t *bytes, size_t count);
};
extern const struct sensorbus_inside sensorbus_inside; /* firmware/port/inside */

/* Each returns the bytes it wrote or read. Buffers hold at least the fixed length. */
size_t sensorbus_put_request(uint8_t *out, const struct sensorbus_request *request);
size_t sensorbus_get_request(const uint8_t *in, struct sensorbus_request *request);
size_t sensorbus_put_answer(uint8_t *out, const struct sensorbus_answer *answer);
size_t sensorbus_get_answer(const uint8_t *in, struct sensorbus_answer *answer);

/* A frame, sent behind so many answers ahead: put returns bytes written (4 + length); sensorbus_frame_head
 * reads the 4 bytes of the head and returns the data bytes that follow, or DT_E_LENGTH above 64. */
size_t sensorbus_put_frame(uint8_t *out, const struct frame *frame, unsigned behind);
int sensorbus_frame_head(const uint8_t *in, struct frame *frame, unsigned *behind);

#endif
