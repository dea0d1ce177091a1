/* SPDX-License-Identifier: GPL-2.0-or-later */
#ifndef DT_HIL_BOARD_BOARD_H
#define DT_HIL_BOARD_BOARD_H
/*
 * The board: the image of firmware/port/stm32g474 from its reset vector, on an emulated Cortex-M4
 * (libunicorn), with models of the peripherals that it touches. What its files share; README.md says what is
 * modelled.
 *
 * Time is a count of clocks of 168 MHz since the process began, one for each instruction. It is ahead of what
 * runs by at most the block of instructions that runs. Whatever the firmware must not do (board_fail) ends
 * the process. One instance, one thread.
 */
#include <stdbool.h>
#include <stdint.h>

#include "common/sensorbus.h"

enum {
	BOARD_CLOCKS_PER_US = 168,
	BOARD_CLOCKS_PER_MS = 168000,
	BOARD_EXIT_OTHERWISE = 1,
	BOARD_EXIT_USAGE = 2,
	BOARD_EXIT_LINK = 4,
	BOARD_EXIT_FAIL = 70,
};

#define BOARD_NEVER INT64_MAX

enum {
	BOARD_FLASH = 0x08000000,
	BOARD_FLASH_BYTES = 512 * 1024,
	BOARD_SRAM = 0x20000000,
	BOARD_SRAM_BYTES = 96 * 1024,
	BOARD_CCM = 0x10000000,
	BOARD_CCM_BYTES = 32 * 1024,
	BOARD_STACK_BYTES = 4096, /* at its bottom */
};

/* Numbers of exceptions: 16 and on are the interrupts. */
enum {
	BOARD_PENDSV = 14,
	BOARD_FDCAN = 16 + 21,
	BOARD_TIM1 = 16 + 25,
	BOARD_TIM2 = 16 + 28,
	BOARD_TIM3 = 16 + 29,
	BOARD_TIM4 = 16 + 30,
	BOARD_EXCEPTIONS = 48,
};

enum board_reset { BOARD_POWER_ON, BOARD_COMMAND, BOARD_WATCHDOG, BOARD_BROWN_OUT, BOARD_PIN, BOARD_RESETS };

struct board_options {
	const char *bus, *image;
	const char *counts;  /* write the instruction counts there; NULL: nowhere */
	const char *record;  /* write the requests and the answers of the bench there; NULL: nowhere */
	const char *preempt; /* such a record instead of a bench: interrupt it everywhere (preempt.c) */
	const char *compare; /* such a record instead of a bench: end at a request that is another one */
	const char *shared;  /* with it: memory that main and control share without a lock */
	const char *only;    /* with it: main, control, CAN or gate; NULL: all */
	unsigned every, share, shares;
	unsigned cause, kept;
	unsigned half_clocks; /* an instruction takes: 2, 3 or 4 */
};

struct board {
	struct board_options options;
	uint8_t *flash, *sram, *ccm;
	uint32_t app_poll, mark;              /* addresses in the image */
	uint32_t lock, unlock, on_gate, look; /* look: main looks for a frame */
	int64_t now;
	bool over;         /* the bench has ended the run */
	bool reset_wanted; /* by software or watchdog, as reset_cause says */
	enum board_reset reset_cause;
	bool wrote; /* a register other than the watchdog's, since the flag was cleared */
	bool woken; /* something that main can use has come */
	bool hung;  /* the bench wants the main loop to hang */
};

extern struct board board;

/* main.c */
_Noreturn void board_fail(const char *format, ...) __attribute__((format(printf, 1, 2)));

/* image.c: the file into the flash, the addresses of the two names. */
void image_load(const char *path);

/* registers.c: what is stored of each register, and what the table of legal writes says. */
uint32_t *registers_at(uint32_t address);
void registers_reset(void);
void registers_check_write(uint32_t address, uint32_t value);
bool registers_clocked(uint32_t address);
uint32_t registers_read(uint32_t address);
void registers_write(uint32_t address, uint32_t value);

/* exception.c: who waits, who may, who interrupts whom. */
void exception_open(void);
void exception_reset(void);
void exception_line(unsigned exception, bool high);
void exception_pend(unsigned exception);
void exception_enable(uint64_t exceptions); /* a bit each */
unsigned exception_next(void);              /* that is to be taken now, 0: none */
void exception_take(void);                  /* that one, if any */
void exception_leave(void);                 /* the handler that runs returns */
unsigned exception_depth(void);             /* of what runs; 0: main */
unsigned exception_that_runs(void);
uint32_t *exception_instructions(void); /* that it has run */
uint32_t exception_stack(void);         /* bytes of it that were needed */
bool exception_masks_all(void);
bool exception_masks_control(void);

/* core.c: processor, idle. */
void core_open(void);
void core_run(void);
bool core_waits(void); /* main has nothing to do until something comes */
uint32_t core_pc(void);
uint32_t core_get(int name); /* a register, by libunicorn's name */
void core_set(int name, uint32_t value);
void core_entered(unsigned exception, unsigned depth);
void core_left(unsigned exception, unsigned depth, uint32_t instructions);
void core_report(const char *path);

/* What preempt.c does with it. Depth 0 is main, an interrupt's 1 and more. */
struct core_watch {
	void (*poll)(void); /* the next one begins */
	void (*block)(unsigned depth, uint32_t address);
	void (*instruction)(unsigned depth, uint32_t address); /* is next */
	void (*entered)(unsigned exception, unsigned depth);   /* what was interrupted at depth - 1 */
	void (*left)(unsigned exception, unsigned depth);
	void (*access)(unsigned depth, uint32_t address, unsigned bytes, bool write); /* of the SRAM */
};

void core_boot(const struct core_watch *watch);
void core_pass(void);           /* to the next event, interrupt, end of a poll or pause */
void core_pause(void);          /* out of watch.instruction: before this instruction */
void core_hold(unsigned depth); /* what runs at this depth stands still; CORE_HOLDS_NONE */
uint32_t core_register(unsigned number);

#define CORE_HOLDS_NONE UINT32_MAX

/* sharing.c: what core_watch.access may be; says, by the file of --shared, what is shared, and ends with 1.
 */
void sharing_access(unsigned depth, uint32_t address, unsigned bytes, bool write);
void sharing_judge(const char *path);

/* preempt.c: what a file calls with all that it keeps, so that a state can be saved and come back. */
void preempt_run(void);
void preempt_where(void); /* on stderr; nothing where nobody preempts */
void preempt_keep(void *at, size_t bytes);
void preempt_sent(const struct frame *frame);
void core_state(void);
void exception_state(void);
void registers_state(void);
void system_state(void);
void timer_state(void);
void sampling_state(void);
void can_state(void);
void plant_state(void);
void core_save(void);
void core_restore(void);

/* system.c: clocks, flash, watchdog, random numbers, pins. */
void system_reset(enum board_reset cause);
bool system_read(uint32_t address, uint32_t *value);
void system_write(uint32_t address, uint32_t value);
int64_t system_next(void);
void system_event(void);
uint32_t system_can_hz(void);
void system_pins(int64_t time); /* what the outputs are now; an edge was at `time` */
void system_inputs(uint16_t inputs);
uint16_t system_outputs(void);

/* timer.c */
void timer_reset(void);
bool timer_read(uint32_t address, uint32_t *value);
void timer_write(uint32_t address, uint32_t value);
int64_t timer_next(void);
int64_t timer_next_edge(void); /* that is planned for an output */
void timer_event(void);
bool timer_level(uint32_t timer, unsigned channel); /* its output is enabled: what it is */
bool timer_drives(uint32_t timer, unsigned channel);
void timer_estop(bool open);
void timer_capture(unsigned capture, uint32_t time_us);
unsigned timer_gates(void);     /* captures of the gates so far */
int64_t timer_start_time(void); /* of TIM1; negative: it stands */
uint32_t timer_us(int64_t time);

/* sampling.c: converters and DMA. */
void sampling_reset(void);
bool sampling_read(uint32_t address, uint32_t *value);
void sampling_write(uint32_t address, uint32_t value);
int64_t sampling_next(void);
void sampling_event(void);
void sampling_trigger(unsigned source, int64_t time); /* ADC trigger 4: TIM3, 12: TIM4 */
void sampling_answer(unsigned group, const struct sensorbus_answer *answer);

/* can.c */
void can_reset(void);
bool can_read(uint32_t address, uint32_t *value);
void can_write(uint32_t address, uint32_t value);
void can_answer(const struct sensorbus_answer *answer);
void can_receive(const struct frame *frame);
void can_again(void);       /* the last frame comes again */
unsigned can_waiting(void); /* received frames that the firmware has not taken */

/* plant.c: the other end of the sensor bus. */
void plant_open(const struct board_options *options);
void plant_reset(void);
void plant_edge(unsigned output, uint32_t time_us);
bool plant_send(const struct frame *frame); /* false: no room until the next exchange */
int64_t plant_next(void);
void plant_event(void);
void plant_inputs_off(uint16_t inputs); /* in place of what the answers say */
uint32_t plant_random(void);

#endif
