/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_PORT_STM32G474_RESET_H
#define DT_FIRMWARE_PORT_STM32G474_RESET_H
/*
 * Why the controller started, how it is restarted, its watchdog and its supply, and one byte that is there
 * again after any reset.
 *
 * RCC_CSR shows a power-on and a brown-out alike. They are told apart by a mark in RAM that start-up does not
 * clear: it survives a dip and not a real absence of power. A crash restarts by software at once, since a
 * reset lets go of latch and dampers, and is told by the same mark. The reset pin shows with every reset: it
 * was the pin when nothing else shows and the mark is there.
 *
 * The watchdog has a clock of its own, 29.5 to 34 kHz: 128 counts of 16 clocks are 60 to 69 ms.
 *
 * Context: reset_cause and watchdog_start at start-up, reset_keep control, the rest any. Source:
 * RM0440 3.7.8, 6.2, 7.4.28, 35.3; PM0214 4.4.5.
 */
#include <stdbool.h>
#include <stdint.h>

#include "firmware/port.h"

struct reset_mark {
	uint32_t word, inverse; /* in RAM that survives a reset */
	volatile uint32_t kept;
};

/* Reads and clears the flags, sets the mark. To be called once. */
enum port_reset reset_cause(struct reset_mark *mark);

/* port_keep and port_kept. */
void reset_keep(struct reset_mark *mark, uint8_t byte);
uint8_t reset_kept(const struct reset_mark *mark);

/* Neither returns on the target. */
void reset_by_command(void);
void reset_by_crash(struct reset_mark *mark);

/* 0, or DT_E_TIMEOUT: it runs, with its longest time. */
DT_MUST_USE int watchdog_start(void);
void watchdog_kick(void);

/* The controller's own 3.3 V against 2.9 V. */
void supply_watch(void);
bool supply_good(void);

/* The option bytes say that a brown-out resets at 2.8 V, the highest level. */
bool brown_out_set(void);

#endif
