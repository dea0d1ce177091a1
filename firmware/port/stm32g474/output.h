/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_PORT_STM32G474_OUTPUT_H
#define DT_FIRMWARE_PORT_STM32G474_OUTPUT_H
/*
 * Latch, magnet and dampers: compare channels of the 1 MHz timers. On and off force the channel's level; a
 * planned edge is made by the channel itself when the counter reaches its time, whatever the processor does
 * then. Taking one back freezes the channel at the level it has, so there is no moment in which that could go
 * wrong.
 *
 * Latch and dampers are pulses: each time one is energised its channel will end that by itself
 * OUTPUT_PULSE_US later, unless an edge is planned, which is longer than any fall and not for ever. While the
 * emergency stop is open the timers hold both off, within 2 us and without the processor, and they stay off
 * when it closes again. The magnet is not cut by it: de-energising the magnet is the release.
 *
 * While the controller is in reset its pins are open: a pull-up at the magnet's driver, pull-downs at the
 * others.
 *
 * Context: output_setup at start-up, after timer_setup; the rest both. Source: RM0440 30.4.8
 * to 30.4.10, 30.4.15 (clearing a reference), 30.5.8.
 */
#include <stdint.h>

enum {
	OUTPUT_PULSE_US = 2000000,
};

/* Magnet on, latch and dampers off. The pins are not connected yet. */
void output_setup(void);

/* port_outputs, port_off_at and port_off_cancel for these three; other bits are ignored. */
void output_set(uint16_t on, uint16_t off);
int output_off_at(uint16_t output, uint32_t time_us);
void output_off_cancel(uint16_t output);

#endif
