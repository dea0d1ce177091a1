/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_PORT_STM32G474_CLOCK_H
#define DT_FIRMWARE_PORT_STM32G474_CLOCK_H
/*
 * The clock tree: 168 MHz for the core, all buses and timers, from a crystal of 24 or 40 MHz on HSE. Which of
 * the two is fitted is measured against the internal 16 MHz oscillator, since the wrong PLL factors would run
 * the core at 280 MHz.
 *
 * 168 MHz is needed for whole timer counts at 7 and 10 kHz, a multiple of 40 MHz for exact CAN data rates of
 * 5 and 8 Mbit/s, and the PLL cannot give both: its outputs Q and R divide one VCO of at most 344 MHz by 2,
 * 4, 6 or 8, and 7 would have to divide it as well as 80 MHz. So CAN is clocked by HSE itself when that is 40
 * MHz (1, 2, 5, 8 Mbit/s exact), else by the PLL's Q at 56 MHz (1, 2, 8 exact, 5 not).
 *
 * From then on the clock security system watches the crystal: when it stops an NMI comes, on the internal
 * oscillator, and an NMI is a crash (start.c).
 *
 * Context: before interrupts, on the reset clock of 16 MHz. Source:
 * RM0440 6.1.5, 7.2.4, 7.2.7, 7.2.8, 7.2.16.
 */
#include <stdint.h>

#include "common/error.h"

enum {
	CLOCK_HZ = 168000000,
};

/* *can_hz: the kernel clock of FDCAN, 40 or 56 MHz. 0, DT_E_TIMEOUT when the crystal, the PLL or the switch
 * does not come in time, DT_E_LINK when the crystal is neither 24 nor 40 MHz. */
DT_MUST_USE int clock_setup(uint32_t *can_hz);

#endif
