/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_PORT_STM32G474_TIMER_H
#define DT_FIRMWARE_PORT_STM32G474_TIMER_H
/*
 * All the time there is, from one clock of 168 MHz:
 *
 *   TIM1   1 kHz, 7 x 24 000 counts
 *          the tick's interrupt, and the camera's frame sync, high for the first half
 *   TIM2   1 MHz, 32 bits
 *          port_time_us, the gates' captures, the edges of magnet and dampers
 *   TIM3   10 kHz, 16 800 counts
 *          triggers ADC1 and 2; its interrupt when a scan of theirs is over
 *   TIM4   7 kHz, 24 000 counts
 *          triggers ADC3 and 4; likewise
 *   TIM5   1 MHz, 32 bits
 *          the latch's pulse, the keeper current's capture
 *
 * TIM1's start starts TIM2, 3 and 4 (their trigger mode); from then on their phases cannot change, since 7 x
 * 24 000 = 10 x 16 800 = 168 000 = one millisecond. They start TIMER_LEAD before the first tick: a sample is
 * the mean of 16 conversions that take 2 368 clocks, and so the middle of the first channel's falls on the
 * tick.
 *
 * Gates and keeper are captured where their pin falls: beam, current or wire broken. TIM2_ETR is the
 * emergency stop; while it is open both timers clear the channels that output.h lets it.
 *
 * Context: setup and start at start-up, TIM5 runs from the setup on; timer_gate and timer_keeper control,
 * timer_counts the samples' interrupts; timer_us both. Source: RM0440 29.4, 30.4, tables 291 and 296.
 */
#include <stdbool.h>
#include <stdint.h>

enum {
	TIMER_LEAD =
	        172 * 7, /* clocks of 168 MHz from the start, and the first triggers, to the first tick */
	TIMER_COUNTS_PER_US = 24,    /* TIM1 */
	TIMER_COUNTS_PER_MS = 24000, /* TIM1 */
	TIMER_YZ_CLOCKS = 16800,
	TIMER_X_CLOCKS = 24000,
	TIMER_YZ_SCANNED = 80 * 168, /* clocks from the trigger to the interrupt */
	TIMER_X_SCANNED = 20 * 168,
};

void timer_setup(void);
void timer_start(void);

uint32_t timer_us(void);

/* How far the millisecond has come, in counts of TIM1. */
uint32_t timer_counts(void);

/* Waits on TIM5, that long or a little longer. */
void timer_pause_us(uint32_t us);

/* True when the gate (0 upper, 1 lower) has been captured since it was last asked. */
bool timer_gate(unsigned gate, uint32_t *time_us);

/* The same for the keeper current, in the time of TIM2. */
bool timer_keeper(uint32_t *time_us);

/* Take back the request of the interrupt that is being served. */
void timer_clear_tick(void);
void timer_clear_yz(void);
void timer_clear_x(void);

#endif
