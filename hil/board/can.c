/* SPDX-License-Identifier: GPL-2.0-or-later */
#include <string.h>

#include "hil/board/chip.h"

enum {
	DBTP = FDCAN + 0x0C,
	CCCR = FDCAN + 0x18,
	NBTP = FDCAN + 0x1C,
	ECR = FDCAN + 0x40,
	PSR = FDCAN + 0x44,
	TDCR = FDCAN + 0x48,
	IR = FDCAN + 0x50,
	IE = FDCAN + 0x54,
	ILE = FDCAN + 0x5C,
	RXGFC = FDCAN + 0x80,
	RXF0S = FDCAN + 0x90,
	RXF0A = FDCAN + 0x94,
	TXFQS = FDCAN + 0xC4,
	TXBAR = FDCAN + 0xCC,
	CKDIV = FDCAN + 0x100,
	RAM_RX0 = CAN_RAM + 0xB0,
	RAM_TX = CAN_RAM + 0x278,
	ELEMENT = 72,
	ELEMENTS = 3,
	INIT = 1,
	CCE = 2,
	FDOE = 1 << 8,
	BRSE = 1 << 9,
	RF0N = 1,
	RF0L = 4,
};

static struct {
	unsigned tx_get, tx_fill, rx_get, rx_fill;
	uint8_t errors;
	bool off, off_told, passive, blocked;
	struct frame last; /* that was received */
} can;

static const uint8_t lengths[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};

static uint32_t *at(uint32_t address)
{
	return registers_at(address);
}

void can_reset(void)
{
	memset(&can, 0, sizeof(can));
	*at(CCCR) = INIT;
}

void can_state(void)
{
	preempt_keep(&can, sizeof(can));
}

void can_again(void)
{
	struct frame frame = can.last;

	can_receive(&frame);
}

unsigned can_waiting(void)
{
	return can.rx_fill;
}

static void raise_line(void)
{
	exception_line(BOARD_FDCAN, *at(IR) & *at(IE) && *at(ILE) & 1);
}

/* ---- to the bus ---- */

static struct frame element_frame(uint32_t element)
{
	uint32_t t0 = *at(element), t1 = *at(element + 4);
	struct frame frame = {.id = t0 >> 18 & 0x7FF, .length = lengths[t1 >> 16 & 15]};

	if (t0 >> 30 & 1)
		board_fail("an extended frame is sent");
	frame.flags |= t0 >> 29 & 1 ? FRAME_REMOTE : 0;
	frame.flags |= t1 >> 21 & 1 ? FRAME_FD : 0;
	frame.flags |= t1 >> 20 & 1 ? FRAME_BRS : 0;
	if (frame.flags & FRAME_FD && !(*at(CCCR) & FDOE))
		board_fail("an FD frame is sent in classic operation");
	if (frame.flags & FRAME_BRS && !(*at(CCCR) & BRSE))
		board_fail("a frame is sent with a switch of bit rates that is not set");
	for (unsigned i = 0; i < frame.length; i += 4)
		memcpy(frame.data + i, at(element + 8 + i), frame.length - i < 4 ? frame.length - i : 4);
	return frame;
}

static bool bus_open(void)
{
	return !can.off && !can.blocked && !(*at(CCCR) & INIT);
}

/* A frame takes no time: it rides with the next request. */
static void send_all(void)
{
	while (can.tx_fill > 0 && bus_open()) {
		struct frame frame = element_frame(RAM_TX + ELEMENT * can.tx_get);

		if (!plant_send(&frame))
			return;
		can.tx_get = (can.tx_get + 1) % ELEMENTS;
		can.tx_fill--;
		board.woken = true;
	}
}

static void request_send(uint32_t bits)
{
	unsigned put = (can.tx_get + can.tx_fill) % ELEMENTS;

	if (can.tx_fill == ELEMENTS || bits != 1u << put)
		board_fail("the transmit buffers 0x%X are requested, the FIFO's next is %u", bits, put);
	can.tx_fill++;
	send_all();
}

/* ---- from the bus ---- */

static bool passes_filters(const struct frame *frame)
{
	uint32_t settings = *at(RXGFC);

	if (frame->flags & FRAME_EXTENDED || (frame->flags & FRAME_REMOTE && settings & 2))
		return false;
	for (unsigned i = 0; i < (settings >> 16 & 31); i++) {
		uint32_t filter = *at(CAN_RAM + 4 * i);

		if (filter >> 30 != 1 || (filter >> 27 & 7) != 1)
			board_fail("the filter 0x%08X is not two identifiers to FIFO 0", filter);
		if ((filter >> 16 & 0x7FF) == frame->id || (filter & 0x7FF) == frame->id)
			return true;
	}
	return (settings >> 4 & 3) == 0;
}

static uint32_t code_of_length(unsigned length)
{
	uint32_t code = 0;

	while (code < 15 && lengths[code] < length)
		code++;
	return code;
}

void can_receive(const struct frame *frame)
{
	can.last = *frame;
	uint32_t element = RAM_RX0 + ELEMENT * ((can.rx_get + can.rx_fill) % ELEMENTS);

	if (!passes_filters(frame) || *at(CCCR) & INIT)
		return;
	if (can.rx_fill == ELEMENTS) {
		*at(IR) |= RF0L;
		raise_line();
		return;
	}
	*at(element) = frame->id << 18 | (frame->flags & FRAME_REMOTE ? 1u << 29 : 0) |
	               (frame->flags & FRAME_ESI ? 1u << 31 : 0);
	*at(element + 4) = code_of_length(frame->length) << 16 | (frame->flags & FRAME_FD ? 1u << 21 : 0) |
	                   (frame->flags & FRAME_BRS ? 1u << 20 : 0);
	for (unsigned i = 0; i < frame->length; i += 4)
		memcpy(at(element + 8 + i), frame->data + i, 4);
	can.rx_fill++;
	*at(IR) |= RF0N;
	raise_line();
}

void can_answer(const struct sensorbus_answer *answer)
{
	unsigned errors = can.errors + answer->bus_errors;

	can.errors = (uint8_t)(errors > UINT8_MAX ? UINT8_MAX : errors);
	can.passive = answer->bus_state == SENSORBUS_BUS_PASSIVE;
	can.blocked = answer->tx_blocked != 0;
	can.off = answer->bus_state == SENSORBUS_BUS_OFF;
	if (can.off && !can.off_told) /* once: the program takes INIT back */
		*at(CCCR) |= INIT;
	can.off_told = can.off;
	send_all();
}

/* ---- registers ---- */

/* The bit rate that a timing gives, of the 1 + before + after quanta of its fields. */
static unsigned rate(uint32_t prescaler, uint32_t before, uint32_t after)
{
	return system_can_hz() / ((prescaler + 1) * (1 + before + 1 + after + 1));
}

static void leave_init(void)
{
	uint32_t n = *at(NBTP), d = *at(DBTP);
	unsigned nominal = rate(n >> 16 & 511, n >> 8 & 255, n & 127);
	unsigned data = rate(d >> 16 & 31, d >> 8 & 31, d >> 4 & 15);

	if (*at(CKDIV) != 0 || nominal != 1000000)
		board_fail("the bus runs with %u bit/s, expected 1000000", nominal);
	if (*at(CCCR) & FDOE && data != 2000000 && data != 5000000 && data != 8000000)
		board_fail("the data phase runs with %u bit/s", data);
}

static void write_cccr(uint32_t value)
{
	uint32_t before = *at(CCCR);

	if (value & CCE && !(before & INIT))
		board_fail("CCE is set without INIT");
	if (!(before & CCE)) /* a write to what CCE protects is not heeded */
		value = (value & ~(uint32_t)(FDOE | BRSE)) | (before & (FDOE | BRSE));
	if (!(value & INIT))
		value &= ~(uint32_t)CCE;
	*at(CCCR) = value;
	if (before & INIT && !(value & INIT))
		leave_init();
	if (value & CCE && !(before & CCE)) /* what waited is lost */
		can.tx_get = can.tx_fill = can.rx_get = can.rx_fill = 0;
	send_all();
}

bool can_read(uint32_t address, uint32_t *value)
{
	if (address - CAN_RAM >= CAN_RAM_BYTES && address - FDCAN >= 0x400)
		return false;
	*value = *at(address);
	if (address == TXFQS)
		*value = (ELEMENTS - can.tx_fill) | can.tx_get << 8 |
		         (can.tx_get + can.tx_fill) % ELEMENTS << 16 |
		         (can.tx_fill == ELEMENTS ? 1u << 21 : 0);
	if (address == RXF0S)
		*value = can.rx_fill | can.rx_get << 8 | (can.rx_get + can.rx_fill) % ELEMENTS << 16 |
		         (can.rx_fill == ELEMENTS ? 1u << 24 : 0);
	if (address == PSR)
		*value = (uint32_t)can.passive << 5 | (uint32_t)can.off << 7;
	if (address == ECR) {
		*value = (uint32_t)can.errors << 16;
		can.errors = 0;
	}
	return true;
}

void can_write(uint32_t address, uint32_t value)
{
	bool guarded = address == NBTP || address == DBTP || address == TDCR || address == RXGFC ||
	               address == CKDIV || address == FDCAN + 0xC0;

	if (guarded && !(*at(CCCR) & CCE))
		board_fail("the register at 0x%08X is written without CCE", address);
	switch (address) {
	case CCCR:
		write_cccr(value);
		break;
	case IR:
		*at(IR) &= ~value;
		raise_line();
		break;
	case RXF0A:
		if (can.rx_fill == 0 || value != can.rx_get)
			board_fail("element %u of the receive FIFO is acknowledged, the oldest of %u is %u",
			           value, can.rx_fill, can.rx_get);
		can.rx_get = (can.rx_get + 1) % ELEMENTS;
		can.rx_fill--;
		break;
	case TXBAR:
		request_send(value);
		break;
	default:
		*at(address) = value;
		if (address == IE || address == ILE)
			raise_line();
	}
}
