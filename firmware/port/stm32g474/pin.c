/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "firmware/port/stm32g474/pin.h"

#include "common/wire.h"
#include "firmware/port/stm32g474/registers.h"
#include "firmware/port/stm32g474/reset.h"

enum port_letter { A, B, C };

enum { INPUT, OUTPUT, ALTERNATE };

enum { NO_PULL, PULL_UP, PULL_DOWN };

enum { SLOW, MEDIUM, FAST };

enum { OPEN, CLOSED };

static const struct pin {
	uint8_t port, number, mode, alternate, pull, speed;
	uint8_t contact; /* CLOSED: the bit is set while the pin is low: contact open, or wire broken */
	uint16_t io;     /* the bit it shows in the io word */
} pins[] = {
        {A, 0, ALTERNATE, 1, PULL_DOWN, SLOW, CLOSED, WIRE_IO_GATE_UPPER}, /* TIM2_CH1 */
        {A, 1, ALTERNATE, 1, PULL_DOWN, SLOW, CLOSED, WIRE_IO_GATE_LOWER}, /* TIM2_CH2 */
        {A, 8, ALTERNATE, 6, NO_PULL, MEDIUM, OPEN, 0},                    /* TIM1_CH1, frame sync */
        {A, 11, ALTERNATE, 9, PULL_UP, SLOW, OPEN, 0}, /* FDCAN1_RX, recessive without a transceiver */
        {A, 12, ALTERNATE, 9, NO_PULL, FAST, OPEN, 0}, /* FDCAN1_TX */
        {A, 15, ALTERNATE, 14, PULL_DOWN, SLOW, OPEN, WIRE_IO_ESTOP_CLEAR}, /* TIM2_ETR */
        {B, 2, ALTERNATE, 2, NO_PULL, SLOW, OPEN, WIRE_IO_LATCH_OPEN},      /* TIM5_CH1 */
        {B, 5, OUTPUT, 0, NO_PULL, MEDIUM, OPEN, WIRE_IO_CAMERA},
        {B, 10, ALTERNATE, 1, NO_PULL, SLOW, OPEN, WIRE_IO_MAGNET_HOLD},     /* TIM2_CH3 */
        {B, 11, ALTERNATE, 1, NO_PULL, SLOW, OPEN, WIRE_IO_DAMPERS_RELIEVE}, /* TIM2_CH4 */
        {C, 6, INPUT, 0, PULL_DOWN, SLOW, OPEN, WIRE_IO_LATCH_CLOSED},
        {C, 7, INPUT, 0, PULL_DOWN, SLOW, CLOSED, WIRE_IO_FRAME_DOWN},
        {C, 8, INPUT, 0, PULL_DOWN, SLOW, OPEN, WIRE_IO_DAMPERS_ENGAGED},
        {C, 9, INPUT, 0, PULL_DOWN, SLOW, OPEN, WIRE_IO_DOOR_CLOSED},
        {C, 10, OUTPUT, 0, NO_PULL, SLOW, OPEN, WIRE_IO_WARNING},
        {C, 11, INPUT, 0, PULL_DOWN, SLOW, OPEN, WIRE_IO_SUPPLY_GOOD},
        {C, 12, ALTERNATE, 1, PULL_DOWN, SLOW, OPEN, WIRE_IO_PRODUCT_HELD}, /* TIM5_CH2 */
};

#define PINS (sizeof(pins) / sizeof(pins[0]))

static void two_bits(uint32_t address, unsigned number, uint32_t value)
{
	register_change(address, 3u << (2 * number), value << (2 * number));
}

/* The mode last: with it the pin leaves its reset state. */
static void set_up_pin(const struct pin *pin)
{
	uint32_t base = GPIO(pin->port);
	unsigned shift = 4u * (pin->number % 8u);

	register_change(base + GPIO_AFR + 4u * (pin->number / 8u), 0xFu << shift,
	                (uint32_t)pin->alternate << shift);
	two_bits(base + GPIO_OSPEEDR, pin->number, pin->speed);
	two_bits(base + GPIO_PUPDR, pin->number, pin->pull);
	two_bits(base + GPIO_MODER, pin->number, pin->mode);
}

void pin_setup(void)
{
	register_set(RCC_AHB2ENR, RCC_AHB2ENR_GPIOABC);
	(void)RD(RCC_AHB2ENR);
	for (unsigned i = 0; i < PINS; i++)
		set_up_pin(&pins[i]);
}

uint16_t pin_io(void)
{
	uint32_t read[3];
	uint16_t io = 0;

	for (unsigned port = A; port <= C; port++)
		read[port] = RD(GPIO(port) + GPIO_IDR);
#pragma GCC unroll 32 /* twice a millisecond, in control: what the table says becomes three instructions a \
                         pin */
	for (unsigned i = 0; i < PINS; i++)
		if ((read[pins[i].port] >> pins[i].number & 1u) != pins[i].contact)
			io |= pins[i].io;
	return supply_good() ? io : (uint16_t)(io & ~WIRE_IO_SUPPLY_GOOD);
}

void pin_outputs(uint16_t on, uint16_t off)
{
#pragma GCC unroll 32
	for (unsigned i = 0; i < PINS; i++) {
		uint32_t bsrr = GPIO(pins[i].port) + GPIO_BSRR, bit = 1u << pins[i].number;

		if (pins[i].mode != OUTPUT)
			continue;
		if (on & pins[i].io)
			WR(bsrr, bit);
		else if (off & pins[i].io)
			WR(bsrr, bit << 16);
	}
}
