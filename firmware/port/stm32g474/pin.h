/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_PORT_STM32G474_PIN_H
#define DT_FIRMWARE_PORT_STM32G474_PIN_H
/*
 * The pins: what each is set to, and the io word of wire.def as it stands at them. The wiring is README.md's
 * table. Analogue pins stay as reset leaves them.
 *
 * Inputs have pull-downs: an open wire reads as "not so", and where the contact is normally closed, at the
 * light gates and FRAME_DOWN, as "beam broken" and "frame down". Nothing is debounced here. The supply is
 * good only while the controller's own is.
 *
 * Context: pin_setup at start-up, the rest both. Source: RM0440 9.4.
 */
#include <stdint.h>

/* After output_setup and timer_setup: hands the pins to the timers, so that the magnet's never drops. */
void pin_setup(void);

/* Inputs and outputs; IEPE is the converter's to say. */
uint16_t pin_io(void);

/* port_outputs for camera trigger and warning, which are no compare channels; other bits are ignored. */
void pin_outputs(uint16_t on, uint16_t off);

#endif
