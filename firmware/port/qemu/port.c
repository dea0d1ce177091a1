/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The board half of the port: mps2-an386 with two sample timers, a dual timer that checks them, a watchdog,
 * and the sensor bus on two FIFOs of the host. Source: Arm, Cortex-M System Design Kit TRM (DDI 0479), AN386.
 *
 * The YZ timer has a period of exactly 2 500 cycles. 25 MHz / 7 000 is no whole number, so the X timer is put
 * in phase with the YZ timer at every tick and makes periods of 3 571 cycles. The timers wake; which sample
 * is due, and when, the dual timer says.
 */
#include "common/sensorbus.h"
#include "firmware/app.h"
#include "firmware/port/lockstep.h"
#include "firmware/port/qemu/qemu.h"
#include "firmware/port/qemu/semihost.h"

struct timer {
	volatile uint32_t control, value, reload, interrupt_clear;
};

struct dual_timer {
	volatile uint32_t load, value, control;
};

struct watchdog {
	volatile uint32_t load, value, control, interrupt_clear;
};

#define TIMER_X ((struct timer *)0x40000000u)
#define TIMER_YZ ((struct timer *)0x40001000u)
#define DUAL_TIMER ((struct dual_timer *)0x40002000u)
#define WATCHDOG ((struct watchdog *)0x40008000u)
#define NVIC_ENABLE (*(volatile uint32_t *)0xE000E100u)
#define NVIC_DISABLE (*(volatile uint32_t *)0xE000E180u)
#define NVIC_PEND (*(volatile uint32_t *)0xE000E200u)
#define NVIC_PRIORITY ((volatile uint8_t *)0xE000E400u)
#define ICSR (*(volatile uint32_t *)0xE000ED04u)
#define SHPR3 (*(volatile uint32_t *)0xE000ED20u)
#define AIRCR (*(volatile uint32_t *)0xE000ED0Cu)

enum {
	IRQ_X = 8,
	IRQ_YZ = 9,
	IRQS = 1 << IRQ_X | 1 << IRQ_YZ,
	PRIORITY_SAMPLES = 0x40, /* both, so that they do not nest; faults and the watchdog are above */
	PRIORITY_CONTROL = 0x80, /* PendSV */
	SHPR3_PENDSV = 16,
	ICSR_PENDSVSET = 1 << 28,
	TIMER_ENABLE = 1 << 0,
	TIMER_INTERRUPT = 1 << 3,
	DUAL_TIMER_ENABLE = 1 << 7,
	DUAL_TIMER_32_BITS = 1 << 1,
	WATCHDOG_INTERRUPT = 1 << 0,
	AIRCR_RESET = 0x05FA0004,
	CYCLES_PER_MS = 25000,
	CYCLES_YZ = CYCLES_PER_MS / WIRE_YZ_PER_TICK,
	CYCLES_X = CYCLES_PER_MS / WIRE_X_PER_TICK,
	CYCLES_WATCHDOG =
	        (LOCKSTEP_WATCHDOG_MS + 2) * CYCLES_PER_MS, /* later than main, of a hang it was asked for */
	CYCLES_PER_US = CYCLES_PER_MS / 1000,
	WATCHDOG_EVERY_US = 1000,
	CLOCK_ERROR_MAX = 25, /* cycles between a sample timer and the dual timer: reading takes a few */
	LINE_BYTES = 256,
	LAST_X = LOCKSTEP_INSTANTS - 2, /* instant of a tick's last X sample */
	EXIT_USAGE = 2,
	EXIT_LINK = 4,
	EXIT_CLOCKS = 71,
};

/* What a restart leaves; zero at power-on. */
static struct {
	bool restarted;
	enum port_reset cause;
	uint8_t byte; /* port_keep */
	int request, answer;
} kept __attribute__((section(".kept")));

static struct {
	const char *bus;
	enum port_reset cause;
	uint8_t kept;
	bool timers, preempt, report, classic; /* preempt: with timers */
} options;

static volatile bool poll_due;
static unsigned next_instant;
static uint32_t kicked_us;          /* the watchdog, in lockstep's time */
static uint32_t ticks, first_cycle; /* ticks begun; the dual timer at the first */
static int32_t clock_error_max;     /* cycles */
static uint32_t late_max;           /* cycles from when a sample was due to its interrupt */

/* ---- interrupts held ---- */

static uint32_t base_priority(void)
{
	uint32_t value;

	__asm__ volatile("mrs %0, basepri" : "=r"(value)::"memory");
	return value;
}

static void set_base_priority(uint32_t value)
{
	__asm__ volatile("msr basepri, %0\n\tisb" ::"r"(value) : "memory");
}

uint32_t lockstep_hold(void)
{
	uint32_t before = base_priority();

	set_base_priority(PRIORITY_SAMPLES);
	return before;
}

void lockstep_release(uint32_t before)
{
	set_base_priority(before);
}

/* Only control: what main shares with the samples are single words and rings. */
void port_lock(void)
{
	set_base_priority(PRIORITY_CONTROL);
}

void port_unlock(void)
{
	set_base_priority(0);
}

int port_random(uint32_t *value)
{
	*value = lockstep_random();
	return 0;
}

void port_watchdog_kick(void)
{
	uint32_t now_us = port_time_us();

	if (now_us - kicked_us >= WATCHDOG_EVERY_US) /* the emulator takes long for it */
		WATCHDOG->interrupt_clear = 1;
	kicked_us = now_us;
}

/* ---- the sensor bus ---- */

int port_can_send(const struct frame *frame)
{
	return lockstep_can_send(frame);
}

int port_can_receive(struct frame *frame)
{
	return lockstep_can_receive(frame);
}

static _Noreturn void end(int code, const char *what, const char *detail)
{
	semihost_say("droptower-firmware-qemu: ");
	semihost_say(what);
	semihost_say(detail);
	semihost_say("\n");
	semihost_exit(code);
}

int lockstep_write(const void *bytes, size_t count)
{
	return semihost_write(kept.request, bytes, count) == 0 ? 0 : LOCKSTEP_GONE;
}

int lockstep_read(void *bytes, size_t size, size_t *count)
{
	size_t left = semihost_read(kept.answer, bytes, size);

	*count += size - left;
	return left < size ? 0 : LOCKSTEP_GONE;
}

static int open_pipe(const char *suffix, int mode)
{
	char path[LINE_BYTES + 16];
	size_t length = 0;
	int handle;

	for (const char *p = options.bus; *p != '\0'; p++)
		path[length++] = *p;
	do
		path[length++] = *suffix;
	while (*suffix++ != '\0');
	handle = semihost_open(path, mode);
	if (handle < 0)
		end(EXIT_LINK, "cannot open ", path);
	return handle;
}

/* ---- samples ---- */

static _Noreturn void end_run(int result)
{
	if (result != LOCKSTEP_GONE)
		end(EXIT_LINK, "the sensor bus's answer is none", "");
	if (options.report) {
		semihost_say_number("droptower-firmware-qemu: ", ticks, 10);
		semihost_say(" ticks of 7 and 10 samples, sample clocks 0 ticks off");
		semihost_say_number(" (at most ", (uint32_t)clock_error_max, 10);
		semihost_say_number(" of 25000 cycles), a sample late by at most ", late_max / CYCLES_PER_US,
		                    10);
		semihost_say(" us\n");
	}
	semihost_exit(0);
}

/* Since the latest interrupt of the YZ timer, which comes with 0; the reload is a cycle later. */
static uint32_t cycles_since_yz(void)
{
	return (CYCLES_YZ - TIMER_YZ->value) % CYCLES_YZ;
}

static void start_timer(struct timer *timer, uint32_t period, uint32_t gone)
{
	timer->control = 0;
	timer->reload = period - 1;
	timer->value = period - 1 - gone;
	timer->interrupt_clear = 1;
	timer->control = TIMER_ENABLE | TIMER_INTERRUPT;
}

/* Cycles since the present tick began, by the timer that nobody touches. */
static uint32_t cycles_of_tick(void)
{
	return ~DUAL_TIMER->value - first_cycle - (ticks - 1) * CYCLES_PER_MS;
}

/* A tick begins. The YZ timer against the dual timer: a period lost or invented shows here. */
static void begin_tick(void)
{
	uint32_t phase = cycles_since_yz();
	int32_t gone, error;

	if (ticks++ == 0)
		first_cycle = ~DUAL_TIMER->value - phase;
	gone = (int32_t)cycles_of_tick();
	error = (gone - (int32_t)phase) % CYCLES_YZ;
	if (error > CYCLES_YZ / 2)
		error -= CYCLES_YZ;
	if (error < -CYCLES_YZ / 2)
		error += CYCLES_YZ;
	if (error < 0)
		error = -error;
	if (error > clock_error_max)
		clock_error_max = error;
	if (error > CLOCK_ERROR_MAX)
		end(EXIT_CLOCKS, "the sample timer differs from the dual timer", "");
	start_timer(TIMER_X, CYCLES_X, gone > 0 ? (uint32_t)gone % CYCLES_X : 0);
}

/* Whether the next sample's time has come; the first of all is due with its interrupt, and without timers
 * each. */
static bool is_due(void)
{
	uint32_t due =
	        lockstep_instant_us(next_instant) * CYCLES_PER_US + (next_instant == 0 ? CYCLES_PER_MS : 0);
	uint32_t now;

	if (ticks == 0)
		return true;
	now = cycles_of_tick() + CLOCK_ERROR_MAX;
	if (now >= due && now - due > late_max)
		late_max = now - due;
	return now >= due;
}

/* The samples stay off when the interrupt returns, so that none comes before control and app_poll have run.
 */
static void delivered(bool control)
{
	if (control)
		ICSR = ICSR_PENDSVSET;
	poll_due = true;
	if (options.timers && !options.preempt)
		NVIC_DISABLE = IRQS;
}

/* A sample whose time has come; the timers' interrupts, or ask(), only wake. Of what came while control or
 * app_poll took long nothing is lost: one interrupt takes all that is due with --preempt, else each asks for
 * the next. */
static void sample(void)
{
	while (is_due()) {
		unsigned instant = next_instant;
		int result;

		if (instant == 0 && options.timers)
			begin_tick();
		next_instant = (instant + 1) % LOCKSTEP_INSTANTS;
		result = lockstep_exchange(instant);
		if (result != 0)
			end_run(result);
		delivered(lockstep_deliver());
		if (!options.preempt)
			return;
	}
}

void board_irq_x(void)
{
	TIMER_X->interrupt_clear = 1;
	if (next_instant >= LAST_X)
		TIMER_X->control = 0; /* the next is the tick's */
	sample();
}

void board_irq_yz(void)
{
	TIMER_YZ->interrupt_clear = 1;
	sample();
}

void board_pendsv(void)
{
	lockstep_control();
}

/* ---- start ---- */

static bool equal(const char *a, const char *b)
{
	while (*a == *b && *a != '\0') {
		a++;
		b++;
	}
	return *a == *b;
}

/* Ends the word at *rest and returns it, NULL after the last. */
static const char *next_word(char **rest)
{
	char *word = *rest;
	char *p;

	while (*word == ' ')
		word++;
	for (p = word; *p != ' ' && *p != '\0'; p++) {
	}
	*rest = *p == '\0' ? p : p + 1;
	*p = '\0';
	return *word == '\0' ? NULL : word;
}

static void take_cause(const char *word)
{
	if (word == NULL || *word < '0' || *word >= '0' + PORT_RESETS || word[1] != '\0')
		end(EXIT_USAGE, "--reset-cause takes 0 to 4", "");
	options.cause = (enum port_reset)(*word - '0');
}

static void take_kept(const char *word)
{
	unsigned value = 0;

	for (const char *p = word; p != NULL && *p >= '0' && *p <= '9' && value <= UINT8_MAX; p++) {
		value = 10 * value + (unsigned)(*p - '0');
		if (p[1] == '\0' && value <= UINT8_MAX) {
			options.kept = (uint8_t)value;
			return;
		}
	}
	end(EXIT_USAGE, "--kept takes 0 to 255", "");
}

static void read_options(void)
{
	static char line[LINE_BYTES];
	char *rest = line;
	const char *word;

	if (semihost_command_line(line, sizeof(line)) != 0)
		end(EXIT_USAGE, "the command line is too long", "");
	(void)next_word(&rest); /* the program's name */
	while ((word = next_word(&rest)) != NULL) {
		if (equal(word, "--bus"))
			options.bus = next_word(&rest);
		else if (equal(word, "--reset-cause"))
			take_cause(next_word(&rest));
		else if (equal(word, "--kept"))
			take_kept(next_word(&rest));
		else if (equal(word, "--timers"))
			options.timers = true;
		else if (equal(word, "--preempt"))
			options.timers = options.preempt = true;
		else if (equal(word, "--report"))
			options.report = true;
		else if (equal(word, "--classic"))
			options.classic = true;
		else
			end(EXIT_USAGE, "no such option: ", word);
	}
	if (options.bus == NULL)
		end(EXIT_USAGE, "--bus PREFIX is needed", "");
}

static void start_clocks(void)
{
	WATCHDOG->load = CYCLES_WATCHDOG;
	WATCHDOG->control = WATCHDOG_INTERRUPT;
	DUAL_TIMER->control = DUAL_TIMER_ENABLE | DUAL_TIMER_32_BITS;
	NVIC_PRIORITY[IRQ_X] = PRIORITY_SAMPLES;
	NVIC_PRIORITY[IRQ_YZ] = PRIORITY_SAMPLES;
	SHPR3 = (uint32_t)PRIORITY_CONTROL << SHPR3_PENDSV;
	NVIC_ENABLE = IRQS;
	if (options.timers)
		start_timer(TIMER_YZ, CYCLES_YZ, 0);
}

static _Noreturn void restart(enum port_reset cause)
{
	set_base_priority(PRIORITY_SAMPLES);
	kept.restarted = true;
	kept.cause = cause;
	kept.byte = lockstep_kept();
	AIRCR = AIRCR_RESET;
	for (;;) {
	}
}

void board_watchdog(void)
{
	if (lockstep_hung())
		restart(PORT_RESET_WATCHDOG);
}

/* Without timers nothing wakes: a sample is taken where its interrupt would have come. */
static void ask(void)
{
	set_base_priority(PRIORITY_SAMPLES);
	sample();
	set_base_priority(0);
}

static void polled(void)
{
	if (lockstep_reset_wanted())
		restart(PORT_RESET_COMMAND);
	if (!options.timers)
		ask();
	else if (!options.preempt && is_due())
		NVIC_PEND = 1 << IRQ_YZ;
	if (options.timers)
		NVIC_ENABLE = IRQS;
}

/* Not "wait for interrupt": the emulator then loses timer periods or invents some. */
static void wait_for_sample(void)
{
	while (!poll_due) {
	}
}

/* In lockstep app_poll runs once after each sample and takes no virtual time, as in the posix port: a sample
 * that comes meanwhile waits. With --preempt it does not. */
_Noreturn void board_main(void)
{
	read_options();
	if (!kept.restarted) {
		kept.request = open_pipe(".request", SEMIHOST_WRITE);
		kept.answer = open_pipe(".answer", SEMIHOST_READ);
		kept.cause = options.cause;
		kept.byte = options.kept;
	}
	lockstep_boot(kept.cause, kept.byte, options.classic, !options.preempt);
	start_clocks();
	if (!options.timers)
		ask();
	for (;;) {
		wait_for_sample();
		poll_due = false;
		if (!lockstep_hung())
			app_poll();
		else if (port_time_us() - kicked_us >= LOCKSTEP_WATCHDOG_MS * 1000)
			restart(PORT_RESET_WATCHDOG);
		polled();
	}
}
