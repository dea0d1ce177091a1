/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_PORT_QEMU_QEMU_H
#define DT_FIRMWARE_PORT_QEMU_QEMU_H
/*
 * What the vectors lead to: start at reset, then thread mode and the two sample interrupts, which have one
 * priority. Where board_delivered and board_polled begin, the core's part of an interrupt and app_poll have
 * ended (count.c).
 */
_Noreturn void start(void);
_Noreturn void board_main(void);
void board_irq_x(void);
void board_irq_yz(void);
void board_delivered(void);
void board_polled(void);

#endif
