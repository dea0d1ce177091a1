/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_PORT_STM32G474_BOARD_H
#define DT_FIRMWARE_PORT_STM32G474_BOARD_H
/*
 * What start.c, which owns the vectors and the way from reset to board_main, shares with port.c.
 *
 * Context: board_main and board_crash do not return; board_on_* are the interrupts.
 */
#include "firmware/port/stm32g474/reset.h"

/* Not cleared at start-up. */
extern struct reset_mark board_mark;

_Noreturn void board_main(void);
_Noreturn void board_crash(void);

/* Samples. */
void board_on_turn(void);
void board_on_yz(void);
void board_on_x(void);

/* Below them: PendSV and the gates' timer. */
void board_on_control(void);
void board_on_gate(void);

#endif
