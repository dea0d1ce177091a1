/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "firmware/port/stm32g474/can.h"

#include "common/ring.h"
#include "firmware/host_ids.h"
#include "firmware/port/stm32g474/interrupt.h"
#include "firmware/port/stm32g474/registers.h"

enum {
	ANSWER_POLLS = 2000, /* the kernel clock domain answers within a few of its clocks */
	RECEIVED = 16,
	FIFO_ELEMENTS = 3,
	NOMINAL = 0, /* bit rate of a timing: the arbitration phase's, or all of a classic frame's */
};

/* A bit is 1 + before + after time quanta; a quantum is one kernel clock. `after` is the jump width too. */
static const struct timing {
	uint32_t kernel_hz, data_kbit_s;
	uint8_t before, after;
} timings[] = {
        {40000000, NOMINAL, 31, 8},  {40000000, 2000, 15, 4}, {40000000, 5000, 5, 2}, {40000000, 8000, 3, 1},
        {56000000, NOMINAL, 44, 11}, {56000000, 2000, 21, 6}, {56000000, 8000, 4, 2},
};

static struct {
	struct ring received;
	struct frame storage[RECEIVED];
	uint32_t errors; /* main */
	volatile uint32_t lost;
} can;

/* ---- set-up ---- */

static const struct timing *find_timing(uint32_t kernel_hz, uint32_t data_kbit_s)
{
	for (unsigned i = 0; i < sizeof(timings) / sizeof(timings[0]); i++)
		if (timings[i].kernel_hz == kernel_hz && timings[i].data_kbit_s == data_kbit_s)
			return &timings[i];
	return NULL;
}

static void set_data_timing(const struct timing *data)
{
	WR(FDCAN_DBTP,
	   FDCAN_DBTP_TDC | (data->before - 1u) << 8 | (data->after - 1u) << 4 | (data->after - 1u));
	WR(FDCAN_TDCR, (1u + data->before) << 8);
}

/* INIT and CCE are set. */
static void can_configure(const struct timing *nominal, const struct timing *data)
{
	WR(FDCAN_CKDIV, 0);
	WR(FDCAN_NBTP, (nominal->after - 1u) << 25 | (nominal->before - 1u) << 8 | (nominal->after - 1u));
	if (data != NULL)
		set_data_timing(data);
	WR(FDCAN_RXGFC, FDCAN_RXGFC_LSS(HOST_IDS) | FDCAN_RXGFC_ANFS_REJECT | FDCAN_RXGFC_ANFE_REJECT |
	                        FDCAN_RXGFC_RRFS | FDCAN_RXGFC_RRFE); /* FIFO 0 keeps the oldest */
	WR(FDCAN_TXBC, 0);                                            /* a FIFO, not a queue */
	for (uint32_t i = 0; i < FDCAN_RAM_BYTES / 4; i++)
		WR(FDCAN_RAM_FILTER(i), i < HOST_IDS ? FDCAN_FILTER_DUAL(host_ids[i], host_ids[i]) : 0);
	WR(FDCAN_IR, FDCAN_IR_ALL);
	WR(FDCAN_ILS, 0);
	WR(FDCAN_IE, FDCAN_IR_RF0N | FDCAN_IR_RF0L);
	WR(FDCAN_ILE, 1);
}

/* INIT, then CCE, then what they protect; leaving INIT clears CCE (44.3.4). */
static int can_set_up(const struct timing *nominal, const struct timing *data)
{
	uint32_t mode = data != NULL ? FDCAN_CCCR_FDOE | FDCAN_CCCR_BRSE : 0;
	uint32_t closed = FDCAN_CCCR_INIT | FDCAN_CCCR_CCE;
	int result;

	register_set(RCC_APB1ENR1, RCC_APB1ENR1_FDCAN);
	(void)RD(RCC_APB1ENR1);
	WR(FDCAN_CCCR, FDCAN_CCCR_INIT);
	result = register_wait(FDCAN_CCCR, FDCAN_CCCR_INIT, FDCAN_CCCR_INIT, ANSWER_POLLS);
	if (result != 0)
		return result;
	WR(FDCAN_CCCR, closed);
	WR(FDCAN_CCCR, closed | mode);
	can_configure(nominal, data);
	WR(FDCAN_CCCR, mode);
	return register_wait(FDCAN_CCCR, FDCAN_CCCR_INIT, 0, ANSWER_POLLS);
}

int can_setup(uint32_t kernel_hz, bool classic, uint32_t data_kbit_s)
{
	const struct timing *nominal = find_timing(kernel_hz, NOMINAL);
	const struct timing *data = data_kbit_s == NOMINAL ? NULL : find_timing(kernel_hz, data_kbit_s);
	int result;

	if (nominal == NULL || (!classic && data == NULL))
		return DT_E_ARGUMENT;
	register_mask(INTERRUPT_CONTROL);
	can.received = (struct ring)RING_OVER(can.storage);
	result = can_set_up(nominal, classic ? NULL : data);
	register_mask(0);
	return result;
}

/* ---- frames ---- */

static const uint8_t lengths[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};

static uint32_t code_of_length(unsigned length)
{
	uint32_t code = 0;

	while (code < 15 && lengths[code] < length)
		code++;
	return code;
}

static void put_element(uint32_t element, const struct frame *frame)
{
	uint32_t t0 = frame->flags & FRAME_EXTENDED ? FDCAN_ELEMENT_XTD | frame->id : frame->id << 18;
	uint32_t t1 = code_of_length(frame->length) << 16;
	unsigned words = (frame->length < FRAME_DATA_MAX ? frame->length + 3u : FRAME_DATA_MAX) / 4u;

	if (frame->flags & FRAME_REMOTE)
		t0 |= FDCAN_ELEMENT_RTR;
	if (frame->flags & FRAME_FD)
		t1 |= FDCAN_ELEMENT_FDF;
	if (frame->flags & FRAME_BRS)
		t1 |= FDCAN_ELEMENT_BRS;
	WR(element, t0);
	WR(element + 4, t1);
	for (unsigned i = 0; i < words; i++) {
		uint32_t word; /* the processor and the message RAM are little endian */

		__builtin_memcpy(&word, frame->data + 4 * i, sizeof(word));
		WR(element + 8 + 4 * i, word);
	}
}

int can_send(const struct frame *frame)
{
	uint32_t status = RD(FDCAN_TXFQS);
	uint32_t put = status >> 16 & 3u;

	if ((status & FDCAN_TXFQS_TFQF) || (RD(FDCAN_CCCR) & FDCAN_CCCR_INIT) ||
	    (RD(FDCAN_PSR) & FDCAN_PSR_BO))
		return DT_E_FULL;
	put_element(FDCAN_RAM_TX + put * FDCAN_ELEMENT_BYTES, frame);
	WR(FDCAN_TXBAR, 1u << put);
	return 0;
}

/* What the frame does not have is left as it was. */
static void get_element(uint32_t element, struct frame *frame)
{
	uint32_t r0 = RD(element), r1 = RD(element + 4);
	bool fd = r1 & FDCAN_ELEMENT_FDF;
	unsigned length = lengths[r1 >> 16 & 15u];

	frame->time_us = 0;
	frame->id = r0 & FDCAN_ELEMENT_XTD ? r0 & 0x1FFFFFFFu : r0 >> 18 & 0x7FFu;
	frame->length = (uint8_t)(!fd && length > 8 ? 8 : length);
	frame->flags = r0 & FDCAN_ELEMENT_XTD ? FRAME_EXTENDED : 0;
	if (fd)
		frame->flags |= (uint8_t)(FRAME_FD | (r1 & FDCAN_ELEMENT_BRS ? FRAME_BRS : 0) |
		                          (r0 & FDCAN_ELEMENT_ESI ? FRAME_ESI : 0));
	else if (r0 & FDCAN_ELEMENT_RTR) {
		frame->flags |= FRAME_REMOTE;
		return;
	}
	for (unsigned i = 0; i < frame->length; i += 4) {
		uint32_t word = RD(element + 8 + i); /* little endian, as in put_element */

		if (frame->length - i < 4) /* what follows the data is nothing */
			word &= (1u << 8 * (frame->length - i)) - 1u;
		__builtin_memcpy(frame->data + i, &word, sizeof(word));
	}
}

int can_receive(struct frame *frame)
{
	return ring_get(&can.received, frame) == 0 ? 1 : 0;
}

/* New frames may come while the FIFO is emptied; those that do after twice its size ask again. */
void can_interrupt(void)
{
	uint32_t flags = RD(FDCAN_IR);

	WR(FDCAN_IR, flags);
	if (flags & FDCAN_IR_RF0L)
		can.lost++;
	for (unsigned i = 0; i < 2 * FIFO_ELEMENTS; i++) {
		uint32_t status = RD(FDCAN_RXF0S);
		uint32_t get = status >> 8 & 3u;
		struct frame *frame;

		if ((status & 15u) == 0)
			return;
		frame = ring_room(&can.received);
		if (frame != NULL) {
			get_element(FDCAN_RAM_RX0 + get * FDCAN_ELEMENT_BYTES, frame);
			ring_written(&can.received);
		} else {
			can.lost++;
		}
		WR(FDCAN_RXF0A, get);
	}
}

uint32_t can_errors(enum port_bus *state)
{
	uint32_t status, stuck;

	can.errors += RD(FDCAN_ECR) >> 16 & 0xFFu; /* reading clears it */
	status = RD(FDCAN_PSR);
	*state = status & FDCAN_PSR_BO   ? PORT_BUS_OFF
	         : status & FDCAN_PSR_EP ? PORT_BUS_PASSIVE
	                                 : PORT_BUS_ACTIVE;
	stuck = RD(FDCAN_CCCR) & (*state == PORT_BUS_OFF ? FDCAN_CCCR_INIT | FDCAN_CCCR_ASM : FDCAN_CCCR_ASM);
	if (stuck != 0)
		register_change(FDCAN_CCCR, stuck, 0);
	if (stuck & FDCAN_CCCR_ASM) /* it came too late to the message RAM and only listens since */
		can.errors++;
	return can.errors + can.lost;
}
