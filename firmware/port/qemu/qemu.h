/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_PORT_QEMU_QEMU_H
#define DT_FIRMWARE_PORT_QEMU_QEMU_H
/*
 * What the vectors lead to: start at reset, then thread mode, the two sample interrupts, which have one
 * priority, and PendSV below them, the control interrupt.
 */

_Noreturn void start(void);
_Noreturn void board_main(void);
void board_irq_x(void);
void board_irq_yz(void);
void board_pendsv(void);
void board_watchdog(void); /* returns when the hang was nobody's wish */

#endif
