/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_PORT_STM32G474_INTERRUPT_H
#define DT_FIRMWARE_PORT_STM32G474_INTERRUPT_H
/*
 * Who interrupts whom: the samples (TIM1 the millisecond, TIM3 10 kHz, TIM4 7 kHz) everybody; below them and
 * on one level the control interrupt (PendSV), the gates (TIM2) and CAN reception. On one level none
 * interrupts another, and of several that wait the first is the one named first here: PendSV, then by
 * position.
 *
 * Context: interrupt_setup at start-up, interrupt_control any. Source: PM0214 2.3.5, 4.3, 4.4.3, 4.4.8;
 * RM0440 14.3 (positions).
 */
#include <stdint.h>

enum {
	INTERRUPT_SAMPLES = 0x40, /* priorities; the chip has the upper four bits */
	INTERRUPT_CONTROL = 0x80,
};

/* Priorities, and lets all of them in as far as the processor's masks do. */
void interrupt_setup(void);

/* Requests the control interrupt. */
void interrupt_control(void);

#endif
