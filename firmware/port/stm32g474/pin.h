/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_PORT_STM32G474_PIN_H
#define DT_FIRMWARE_PORT_STM32G474_PIN_H
/*
 * The pins: what each is set to, and the io word of wire.def as it stands at them. The wiring is README.md's
 * table. Analogue pins stay as reset leaves them.
 *
 * Inputs have pull-downs: an open wire reads as "not so". They are taken over once a millisecond, a bit when
 * it has been the same three times; the light gates are shown as they are, and the supply is good only while
 * the controller's own is.
 *
 * Context: pin_setup at start-up, pin_tick control, the rest both. Source: RM0440 9.4.
 */
#include <stdint.h>

/* After output_setup and timer_setup: hands the pins to the timers, so that the magnet's never drops. */
void pin_setup(void);

void pin_tick(void);

/* Inputs and outputs; IEPE is the converter's to say. */
uint16_t pin_io(void);

/* The camera trigger, the one output that is no compare channel. */
void pin_camera(uint16_t on, uint16_t off);

#endif
