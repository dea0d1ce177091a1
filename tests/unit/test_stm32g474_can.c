/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The board's FDCAN driver against a register model: bit rates and sample points worked out from the
 * registers, what is written when, elements of the message RAM by hand.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "firmware/port/stm32g474/can.h"
#include "firmware/port/stm32g474/registers.h"
#include "tests/unit/stm32g474_model.h"

/* The message RAM of FDCAN1, RM0440 44.3.6 and 2.2.2. */
#define RX_ELEMENT(i) (0x4000A4B0u + 72u * (i))
#define TX_ELEMENT(i) (0x4000A678u + 72u * (i))

static struct {
	bool deaf_to_init, never_leaves; /* the kernel clock is missing */
	unsigned fill, get;              /* receive FIFO 0 */
	unsigned protected_writes;
} hardware;

static bool is_protected(uint32_t address)
{
	return address == FDCAN_NBTP || address == FDCAN_DBTP || address == FDCAN_TDCR ||
	       address == FDCAN_RXGFC || address == FDCAN_TXBC || address == FDCAN_CKDIV;
}

static uint32_t write_cccr(uint32_t written, uint32_t kept)
{
	bool open = (kept & 3) == 3;

	if ((written & 1) == 0) /* leaving INIT clears CCE */
		return hardware.never_leaves ? kept : written & ~2u;
	if (hardware.deaf_to_init)
		return kept;
	if ((kept & 1) == 0)
		written &= ~2u; /* CCE only while INIT is set */
	if (!open)
		written = (written & ~0x300u) | (kept & 0x300u); /* FDOE and BRSE only while both are */
	return written;
}

static uint32_t on_write(uint32_t address, uint32_t written, uint32_t kept)
{
	if (address == FDCAN_CCCR)
		return write_cccr(written, kept);
	if (is_protected(address)) {
		assert_int_equal(model_get(FDCAN_CCCR) & 3, 3);
		assert_int_equal(model.masked, 0x80);
		hardware.protected_writes++;
	}
	if (address == FDCAN_TXBAR)
		assert_int_equal(model_get(FDCAN_CCCR) & 3, 0);
	if (address == FDCAN_IR)
		return kept & ~written;
	if (address == FDCAN_RXF0A) {
		assert_int_equal(written, hardware.get);
		hardware.get = (hardware.get + 1) % 3;
		hardware.fill--;
	}
	return written;
}

static uint32_t on_read(uint32_t address, uint32_t kept)
{
	if (address == FDCAN_RXF0S)
		return hardware.fill | hardware.get << 8;
	if (address == FDCAN_ECR) {
		model_put(FDCAN_ECR, kept & ~0xFF0000u); /* cleared by reading */
		return kept;
	}
	return kept;
}

static void reset_hardware(void)
{
	model_init();
	memset(&hardware, 0, sizeof(hardware));
	model_put(FDCAN_CCCR, 1);
	model_put(FDCAN_IR, 0x00800005); /* from before */
	model.on_read = on_read;
	model.on_write = on_write;
}

static void set_up(void)
{
	reset_hardware();
	assert_int_equal(can_setup(40000000, false, 5000), 0);
	assert_int_equal(model.masks, 2); /* control is kept out meanwhile, samples are not */
	assert_int_equal(model.masked, 0);
	assert_int_equal(model.held, 0);
}

/* ---- bit timing ---- */

static void check_nominal(double kernel_hz)
{
	uint32_t r = model_get(FDCAN_NBTP); /* 44.4.7 */
	unsigned brp = (r >> 16 & 511) + 1, seg1 = (r >> 8 & 255) + 1, seg2 = (r & 127) + 1,
	         sjw = (r >> 25) + 1;

	assert_true(kernel_hz / brp / (1 + seg1 + seg2) == 1e6);
	assert_true(fabs((1.0 + seg1) / (1 + seg1 + seg2) - 0.80) < 0.01);
	assert_true(sjw <= seg2);
}

static void check_data(double kernel_hz, double rate_hz)
{
	uint32_t r = model_get(FDCAN_DBTP); /* 44.4.3 */
	unsigned brp = (r >> 16 & 31) + 1, seg1 = (r >> 8 & 31) + 1, seg2 = (r >> 4 & 15) + 1,
	         sjw = (r & 15) + 1;
	double sample = (1.0 + seg1) / (1 + seg1 + seg2);

	assert_true(kernel_hz / brp / (1 + seg1 + seg2) == rate_hz);
	assert_true(sample >= 0.70 && sample <= 0.81);
	assert_true(sjw <= seg2);
	assert_true(brp <= 2); /* or delay compensation does not work */
	assert_int_equal(r >> 23 & 1, 1);
	assert_int_equal(model_get(FDCAN_TDCR), brp * (1 + seg1) << 8); /* second sample point = first */
	assert_true(brp * (1 + seg1) + 255e-9 * kernel_hz <= 127);      /* with the longest loop delay */
}

static void rates(void **state)
{
	static const uint32_t kbit_s[] = {2000, 5000, 8000};
	static const uint32_t kernel_hz[] = {40000000, 56000000};

	(void)state;
	for (unsigned k = 0; k < 2; k++)
		for (unsigned i = 0; i < 3; i++) {
			if (kernel_hz[k] % (1000 * kbit_s[i]) != 0)
				continue; /* refused, see below */
			reset_hardware();
			assert_int_equal(can_setup(kernel_hz[k], false, kbit_s[i]), 0);
			check_nominal(kernel_hz[k]);
			check_data(kernel_hz[k], 1e3 * kbit_s[i]);
			assert_int_equal(model_get(FDCAN_CCCR), 0x300);
		}
}

static void classic(void **state)
{
	(void)state;
	for (uint32_t kernel_hz = 40000000; kernel_hz <= 56000000; kernel_hz += 16000000) {
		reset_hardware();
		assert_int_equal(can_setup(kernel_hz, true, 5000), 0);
		check_nominal(kernel_hz);
		assert_int_equal(model_get(FDCAN_CCCR), 0);
		assert_int_equal(model_count(FDCAN_DBTP), 0);
	}
	assert_int_equal(can_setup(40000000, false, 2000), 0); /* and back */
	assert_int_equal(model_get(FDCAN_CCCR), 0x300);
	assert_int_equal(can_setup(40000000, true, 2000), 0);
	assert_int_equal(model_get(FDCAN_CCCR), 0);
}

static void refused(void **state)
{
	static const uint32_t never[] = {0, 1, 1000, 4000, 5001, 10000};

	(void)state;
	reset_hardware();
	for (unsigned i = 0; i < sizeof(never) / sizeof(never[0]); i++)
		assert_int_equal(can_setup(40000000, false, never[i]), DT_E_ARGUMENT);
	assert_int_equal(can_setup(56000000, false, 5000), DT_E_ARGUMENT); /* 11.2 quanta a bit */
	assert_int_equal(can_setup(0, true, 2000), DT_E_ARGUMENT);
	assert_int_equal(model.writes, 0);
}

static void order(void **state)
{
	int init, open, mode, timing, leave;

	(void)state;
	set_up();
	assert_int_equal(hardware.protected_writes, 6); /* the hook has seen INIT and CCE at each */
	init = model_find(FDCAN_CCCR, 3, 1, 0);
	open = model_find(FDCAN_CCCR, 3, 3, 0);
	mode = model_find(FDCAN_CCCR, 0x303, 0x303, 0);
	timing = model_find(FDCAN_NBTP, 0, 0, 0);
	leave = model_find(FDCAN_CCCR, 3, 0, 0);
	assert_true(0 <= init && init < open && open < mode && mode < timing && timing < leave);
	assert_int_equal(leave, model.writes - 1);
	assert_true(model_find(RCC_APB1ENR1, 1u << 25, 1u << 25, 0) < init);
	for (uint32_t offset = 0; offset < 0x350; offset += 4) /* all of its message RAM, and no more */
		assert_int_equal(model_count(0x4000A400 + offset), 1);
	assert_int_equal(model_count(0x4000A750), 0);
	assert_int_equal(model_get(FDCAN_IR), 0);
	assert_int_equal(model_get(FDCAN_IE), 5);
	assert_int_equal(model_get(FDCAN_ILE), 1);
}

static void silence(void **state)
{
	(void)state;
	reset_hardware();
	model_put(FDCAN_CCCR, 0);
	hardware.deaf_to_init = true;
	assert_int_equal(can_setup(40000000, false, 5000), DT_E_TIMEOUT);
	reset_hardware();
	hardware.never_leaves = true;
	assert_int_equal(can_setup(40000000, false, 5000), DT_E_TIMEOUT);
	assert_int_equal(model.held, 0);
}

/* ---- filters ---- */

/* Standard filter elements and their list, RM0440 44.3.10, 44.4.20: the hardware's decision, played. */
static bool passes(uint32_t id)
{
	uint32_t global = model_get(FDCAN_RXGFC);

	for (unsigned i = 0; i < (global >> 16 & 31); i++) {
		uint32_t element = model_get(0x4000A400u + 4 * i);
		uint32_t first = element >> 16 & 0x7FF, second = element & 0x7FF;
		bool match = false;

		switch (element >> 30) {
		case 0:
			match = id >= first && id <= second;
			break;
		case 1:
			match = id == first || id == second;
			break;
		case 2:
			match = (id & second) == (first & second);
			break;
		default:
			break;
		}
		if (match)
			return (element >> 27 & 7) == 1;
	}
	return (global >> 4 & 3) == 0;
}

static void filters(void **state)
{
	unsigned passed = 0;

	(void)state;
	for (unsigned classic = 0; classic < 2; classic++) {
		reset_hardware();
		assert_int_equal(can_setup(40000000, classic, 5000), 0);
		passed = 0;
		for (uint32_t id = 0; id < 0x800; id++)
			passed += passes(id);
		assert_int_equal(passed, 5); /* NMT, command, resend, parameter, host heartbeat */
		assert_true(passes(0x000) && passes(0x201) && passes(0x301) && passes(0x601) &&
		            passes(0x77F));
		assert_true((model_get(FDCAN_RXGFC) >> 2 & 3) >= 2);    /* no extended identifier */
		assert_int_equal(model_get(FDCAN_RXGFC) >> 24 & 15, 0); /* by no filter */
		assert_int_equal(model_get(FDCAN_RXGFC) & 3, 3);        /* no remote frame */
	}
}

/* ---- sending ---- */

static void send_long(void **state)
{
	struct frame frame = {.id = 0x181, .flags = FRAME_FD | FRAME_BRS, .length = 64};

	(void)state;
	set_up();
	for (unsigned i = 0; i < 64; i++)
		frame.data[i] = (uint8_t)(i + 1);
	model_put(FDCAN_TXFQS, 2u << 16 | 1); /* one free, element 2 */
	assert_int_equal(can_send(&frame), 0);
	assert_int_equal(model_get(TX_ELEMENT(2)), 0x06040000);     /* 0x181 << 18 */
	assert_int_equal(model_get(TX_ELEMENT(2) + 4), 0x003F0000); /* FDF BRS DLC 15 */
	assert_int_equal(model_get(TX_ELEMENT(2) + 8), 0x04030201);
	assert_int_equal(model_get(TX_ELEMENT(2) + 68), 0x403F3E3D);
	assert_int_equal(TX_ELEMENT(2) + 72, 0x4000A750); /* ends where the next controller's begins */
	assert_int_equal(model.log[model.writes - 1].address, FDCAN_TXBAR); /* last */
	assert_int_equal(model.log[model.writes - 1].value, 4);
}

static void send_short(void **state)
{
	static const struct {
		uint8_t length, code;
	} dlc[] = {{0, 0}, {1, 1}, {8, 8}, {12, 9}, {16, 10}, {20, 11}, {24, 12}, {32, 13}, {48, 14}};
	struct frame frame = {.id = 0x7FF, .length = 3, .data = {0xA1, 0xB2, 0xC3}};

	(void)state;
	set_up();
	assert_int_equal(can_send(&frame), 0);
	assert_int_equal(model_get(TX_ELEMENT(0)), 0x1FFC0000);
	assert_int_equal(model_get(TX_ELEMENT(0) + 4), 0x00030000);
	assert_int_equal(model_get(TX_ELEMENT(0) + 8), 0x00C3B2A1);
	frame.id = 0x12345678;
	frame.flags = FRAME_EXTENDED | FRAME_REMOTE;
	assert_int_equal(can_send(&frame), 0);
	assert_int_equal(model_get(TX_ELEMENT(0)), 0x72345678);
	frame.flags = FRAME_FD;
	for (unsigned i = 0; i < sizeof(dlc) / sizeof(dlc[0]); i++) {
		frame.length = dlc[i].length;
		assert_int_equal(can_send(&frame), 0);
		assert_int_equal(model_get(TX_ELEMENT(0) + 4), 1u << 21 | (uint32_t)dlc[i].code << 16);
	}
}

static void no_room(void **state)
{
	struct frame frame = {.id = 0x181};
	int writes;

	(void)state;
	set_up();
	writes = model.writes;
	model_put(FDCAN_TXFQS, 1u << 21);
	assert_int_equal(can_send(&frame), DT_E_FULL);
	model_put(FDCAN_TXFQS, 3);
	model_put(FDCAN_PSR, 1u << 7);
	assert_int_equal(can_send(&frame), DT_E_FULL);
	model_put(FDCAN_PSR, 0);
	model_put(FDCAN_CCCR, 0x301);
	assert_int_equal(can_send(&frame), DT_E_FULL);
	assert_int_equal(model.writes, writes);
}

/* ---- receiving ---- */

static void put_received(uint32_t r0, uint32_t r1, uint32_t r2, uint32_t r3)
{
	uint32_t element = RX_ELEMENT((hardware.get + hardware.fill) % 3);

	model_put(element, r0);
	model_put(element + 4, r1);
	model_put(element + 8, r2);
	model_put(element + 12, r3);
	hardware.fill++;
	model_put(FDCAN_IR, model_get(FDCAN_IR) | 1);
}

static void expect(uint32_t id, uint8_t flags, uint8_t length)
{
	struct frame frame;

	assert_int_equal(can_receive(&frame), 1);
	assert_int_equal(frame.id, id);
	assert_int_equal(frame.flags, flags);
	assert_int_equal(frame.length, length);
	for (unsigned i = 0; i < length && i < 8 && (flags & FRAME_REMOTE) == 0; i++)
		assert_int_equal(frame.data[i], i + 1);
	for (unsigned i = length; i < FRAME_DATA_MAX; i++)
		assert_int_equal(frame.data[i], 0);
}

static void receive(void **state)
{
	struct frame frame;

	(void)state;
	set_up();
	hardware.get = 2; /* across the end of the FIFO */
	assert_int_equal(can_receive(&frame), 0);
	put_received(0x201u << 18, 0x80080000 | 0x1234, 0x04030201, 0x08070605); /* ANMF and a time stamp */
	put_received(0x40000000 | 0x1ABCDEF0, 0x003F0000, 0x04030201, 0x08070605);
	put_received(0x80000000 | 0x77Fu << 18, 0x00250000, 0x04030201, 0x08070605);
	can_interrupt();
	assert_int_equal(hardware.fill, 0);
	assert_int_equal(model_get(FDCAN_IR), 0);
	put_received(0x20000000 | 0x301u << 18, 0x000F0000, 0xFFFFFFFF, 0xFFFFFFFF);
	put_received(0x601u << 18, 0x000F0000, 0x04030201, 0x08070605);
	put_received(0x000u << 18, 0x00020000, 0xFFFF0201,
	             0xFFFFFFFF); /* what is beyond the length is not data */
	can_interrupt();
	expect(0x201, 0, 8);
	assert_int_equal(can_receive(&frame), 1);
	assert_int_equal(frame.id, 0x1ABCDEF0);
	assert_int_equal(frame.flags, FRAME_EXTENDED | FRAME_FD | FRAME_BRS);
	assert_int_equal(frame.length, 64);
	assert_int_equal(frame.data[7], 8);
	expect(0x77F, FRAME_FD | FRAME_ESI, 5);
	expect(0x301, FRAME_REMOTE, 8);
	expect(0x601, 0, 8); /* classic: 9 to 15 mean 8 */
	expect(0x000, 0, 2);
	assert_int_equal(can_receive(&frame), 0);
}

static void losses(void **state)
{
	struct frame frame;
	enum port_bus bus;
	uint32_t before;
	unsigned kept = 0;

	(void)state;
	set_up();
	before = can_errors(&bus);
	for (unsigned i = 0; i < 20; i++) {
		put_received(i << 18, 0, 0, 0);
		can_interrupt();
	}
	while (can_receive(&frame) == 1)
		assert_int_equal(frame.id, kept++);
	assert_int_equal(can_errors(&bus) - before, 20 - kept);
	assert_true(kept >= 16);
	model_put(FDCAN_IR, 1u << 2); /* RF0L: the FIFO itself was full */
	can_interrupt();
	assert_int_equal(can_errors(&bus) - before, 21 - kept);
}

/* ---- errors ---- */

static void bus_off(void **state)
{
	uint32_t before;
	enum port_bus bus = PORT_BUS_OFF;
	int writes;

	(void)state;
	set_up();
	before = can_errors(&bus);
	assert_int_equal(bus, PORT_BUS_ACTIVE);
	model_put(FDCAN_ECR, 5u << 16 | 0x40);
	assert_int_equal(can_errors(&bus) - before, 5);
	assert_int_equal(can_errors(&bus) - before, 5); /* cleared by reading */
	model_put(FDCAN_CCCR, 0x301);                   /* bus-off sets INIT */
	model_put(FDCAN_PSR, 1u << 7);
	model_put(FDCAN_ECR, 32u << 16);
	assert_int_equal(can_errors(&bus) - before, 37);
	assert_int_equal(bus, PORT_BUS_OFF);
	assert_int_equal(model_get(FDCAN_CCCR), 0x300); /* recovery begins, the mode is kept */
	writes = model.writes;
	(void)can_errors(&bus);
	assert_int_equal(bus, PORT_BUS_OFF); /* it lasts 129 x 11 bits */
	assert_int_equal(model.writes, writes);
	model_put(FDCAN_PSR, 0);
	(void)can_errors(&bus);
	assert_int_equal(bus, PORT_BUS_ACTIVE);
}

static void passive(void **state)
{
	enum port_bus bus = PORT_BUS_OFF;

	(void)state;
	set_up();
	model_put(FDCAN_PSR, 1u << 6); /* a warning is none */
	(void)can_errors(&bus);
	assert_int_equal(bus, PORT_BUS_ACTIVE);
	model_put(FDCAN_PSR, 1u << 5 | 1u << 6);
	(void)can_errors(&bus);
	assert_int_equal(bus, PORT_BUS_PASSIVE);
	assert_int_equal(model_get(FDCAN_CCCR), 0x300); /* it goes on */
	model_put(FDCAN_PSR, 1u << 7 | 1u << 5 | 1u << 6);
	(void)can_errors(&bus);
	assert_int_equal(bus, PORT_BUS_OFF);
}

static void restricted(void **state)
{
	uint32_t before;
	enum port_bus bus;

	(void)state;
	set_up();
	before = can_errors(&bus);
	model_put(FDCAN_CCCR, 0x304);
	assert_int_equal(can_errors(&bus) - before, 1);
	assert_int_equal(model_get(FDCAN_CCCR), 0x300);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(rates),      cmocka_unit_test(classic), cmocka_unit_test(refused),
	        cmocka_unit_test(order),      cmocka_unit_test(silence), cmocka_unit_test(send_long),
	        cmocka_unit_test(send_short), cmocka_unit_test(no_room), cmocka_unit_test(receive),
	        cmocka_unit_test(losses),     cmocka_unit_test(bus_off), cmocka_unit_test(restricted),
	        cmocka_unit_test(filters),    cmocka_unit_test(passive),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
