/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The vectors and the way from reset to board_main. Whatever has no handler is a crash.
 *
 * Source: RM0440 14.3 (positions), 2.2 (memories); PM0214 2.3.4, 4.4.4. The floating-point unit stays off.
 */
#include <stdint.h>

#include "common/memory.h"
#include "firmware/port/stm32g474/board.h"
#include "firmware/port/stm32g474/can.h"
#include "firmware/port/stm32g474/protect.h"
#include "firmware/port/stm32g474/registers.h"

extern uint32_t link_stack_end[], link_data_begin[], link_data_end[], link_data_image[], link_bss_begin[],
        link_bss_end[];

struct reset_mark board_mark __attribute__((section(".noinit")));

_Noreturn void start_reset(void);

enum {
	EXCEPTIONS = 16,
	INTERRUPTS = 31, /* as far as any is enabled */
};

#define BYTES(begin, end) ((size_t)((uintptr_t)(end) - (uintptr_t)(begin)))

extern const uintptr_t start_vectors[EXCEPTIONS + INTERRUPTS];
__attribute__((section(".vectors"), used)) const uintptr_t start_vectors[EXCEPTIONS + INTERRUPTS] = {
        (uintptr_t)link_stack_end,
        (uintptr_t)start_reset,
        (uintptr_t)board_crash, /* NMI: the crystal has stopped */
        (uintptr_t)board_crash, /* HardFault */
        (uintptr_t)board_crash, /* MemManage */
        (uintptr_t)board_crash, /* BusFault */
        (uintptr_t)board_crash, /* UsageFault */
        0,
        0,
        0,
        0,
        (uintptr_t)board_crash, /* SVCall */
        (uintptr_t)board_crash, /* DebugMonitor */
        0,
        (uintptr_t)board_on_control, /* PendSV */
        (uintptr_t)board_crash,      /* SysTick */
        [EXCEPTIONS + 21] = (uintptr_t)can_interrupt,
        [EXCEPTIONS + 25] = (uintptr_t)board_on_turn,
        [EXCEPTIONS + 28] = (uintptr_t)board_on_gate,
        [EXCEPTIONS + 29] = (uintptr_t)board_on_yz,
        [EXCEPTIONS + 30] = (uintptr_t)board_on_x,
};

/* Interrupts stay off until board_main lets them in. */
_Noreturn void start_reset(void)
{
	(void)register_hold();
	WR(SCB_VTOR, (uint32_t)(uintptr_t)start_vectors);
	protect_setup();
	memcpy(link_data_begin, link_data_image, BYTES(link_data_begin, link_data_end));
	memset(link_bss_begin, 0, BYTES(link_bss_begin, link_bss_end));
	board_main();
}
