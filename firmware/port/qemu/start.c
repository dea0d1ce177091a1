/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * From reset to board_main, and the end of everything that goes wrong: a fault says where and ends the
 * emulator with 70 + the number of the exception. Source: Armv7-M Architecture Reference Manual (DDI 0403),
 * B1.5, B3.5.
 *
 * The floating-point unit stays off: the firmware uses none, and an instruction that does is a fault.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/assert.h"
#include "common/memory.h"
#include "firmware/port/qemu/qemu.h"
#include "firmware/port/qemu/semihost.h"

extern uint32_t link_stack_begin[], link_stack_end[], link_data_begin[], link_data_end[], link_data_image[],
        link_bss_begin[], link_bss_end[];

#define SHCSR (*(volatile uint32_t *)0xE000ED24u)
#define CFSR (*(volatile uint32_t *)0xE000ED28u)
#define MMFAR (*(volatile uint32_t *)0xE000ED34u)
#define BFAR (*(volatile uint32_t *)0xE000ED38u)
#define MPU_CONTROL (*(volatile uint32_t *)0xE000ED94u)
#define MPU_BASE (*(volatile uint32_t *)0xE000ED9Cu)
#define MPU_SIZE (*(volatile uint32_t *)0xE000EDA0u)

enum {
	EXIT_FAULT = 70,
	VECTORS = 16 + 10,
	EXCEPTION_NMI = 2,
	FRAME_WORDS = 8, /* what an exception pushes: r0-r3, r12, lr, pc, xPSR */
	FRAME_PC = 6,
	SHCSR_FAULTS = 7 << 16, /* memory, bus, usage: each its own exception */
	CFSR_MMFAR_VALID = 1 << 7,
	CFSR_BFAR_VALID = 1 << 15,
	MPU_ON = 1,
	MPU_VALID = 1 << 4, /* in MPU_BASE: the region number comes along */
};

#define MPU_NO_ACCESS 0u
#define MPU_READ_WRITE (3u << 24)
#define MPU_READ_ONLY (6u << 24)
#define MPU_NO_EXECUTE (1u << 28)

/* ---- what goes wrong ---- */

static void say_address(uint32_t status)
{
	if (status & CFSR_MMFAR_VALID)
		semihost_say_number(", address 0x", MMFAR, 16);
	if (status & CFSR_BFAR_VALID)
		semihost_say_number(", address 0x", BFAR, 16);
}

/* frame: the stack pointer at the exception; it can point outside of the stack. */
__attribute__((used)) static _Noreturn void fault(const uint32_t *frame)
{
	bool on_stack = frame >= link_stack_begin && frame + FRAME_WORDS <= link_stack_end;
	uint32_t number, status = CFSR;

	__asm__ volatile("mrs %0, ipsr" : "=r"(number));
	if (number == EXCEPTION_NMI)
		board_watchdog();
	semihost_say("droptower-firmware-qemu: ");
	semihost_say(number == EXCEPTION_NMI ? "watchdog" : "fault");
	semihost_say_number(", exception ", number, 10);
	if (on_stack)
		semihost_say_number(", pc 0x", frame[FRAME_PC], 16);
	else
		semihost_say(", stack overflow");
	semihost_say_number(", CFSR 0x", status, 16);
	say_address(status);
	semihost_say("\n");
	semihost_exit(EXIT_FAULT + (int)number);
}

void assert_failed(const char *file, int line, const char *condition)
{
	semihost_say("droptower-firmware-qemu: ");
	semihost_say(file);
	semihost_say_number(", line ", (uint32_t)line, 10);
	semihost_say(": this cannot be: not ");
	semihost_say(condition);
	semihost_say("\n");
	semihost_exit(ASSERT_EXIT);
}

/* Nothing returns from here, so the whole stack is free again. */
__attribute__((naked)) static void on_fault(void)
{
	__asm__ volatile("mov r0, sp\n\tldr r1, =link_stack_end\n\tmov sp, r1\n\tb fault");
}

/* ---- reset ---- */

/* log2_size: of the region, which begins at a multiple of its size. */
static void mpu_region(uint32_t number, uint32_t begin, uint32_t log2_size, uint32_t attributes)
{
	MPU_BASE = begin | MPU_VALID | number;
	MPU_SIZE = attributes | (log2_size - 1) << 1 | 1;
}

/* Everything else, below and above the RAM for instance, is out of bounds. */
static void protect(void)
{
	mpu_region(0, 0x00000000, 16, MPU_READ_ONLY); /* code */
	mpu_region(1, 0x00000000, 10,
	           MPU_NO_ACCESS | MPU_NO_EXECUTE); /* vectors, which the core reads: NULL */
	mpu_region(2, 0x20000000, 17, MPU_READ_WRITE | MPU_NO_EXECUTE); /* RAM */
	mpu_region(3, 0x40000000, 16, MPU_READ_WRITE | MPU_NO_EXECUTE); /* timers, watchdog */
	MPU_CONTROL = MPU_ON;
	SHCSR |= SHCSR_FAULTS;
	__asm__ volatile("dsb\n\tisb" ::: "memory");
}

_Noreturn void start(void)
{
	memcpy(link_data_begin, link_data_image, (size_t)((char *)link_data_end - (char *)link_data_begin));
	memset(link_bss_begin, 0, (size_t)((char *)link_bss_end - (char *)link_bss_begin));
	protect();
	board_main();
}

/* The first word is the stack pointer. */
__attribute__((used, section(".vectors"))) static void (*const vectors[VECTORS])(void) = {
        (void (*)(void))link_stack_end,
        start,
        on_fault, /* NMI: the watchdog */
        on_fault, /* HardFault */
        on_fault, /* MemManage */
        on_fault, /* BusFault */
        on_fault, /* UsageFault */
        on_fault,
        on_fault,
        on_fault,
        on_fault,
        on_fault, /* SVCall */
        on_fault, /* DebugMonitor */
        on_fault,
        board_pendsv,
        on_fault, /* SysTick */
        on_fault,
        on_fault,
        on_fault,
        on_fault,
        on_fault,
        on_fault,
        on_fault,
        on_fault,
        board_irq_x,
        board_irq_yz,
};
