/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "common/assert.h"
#include "firmware/app.h"
#include "firmware/port/stm32g474/adc.h"
#include "firmware/port/stm32g474/board.h"
#include "firmware/port/stm32g474/can.h"
#include "firmware/port/stm32g474/clock.h"
#include "firmware/port/stm32g474/interrupt.h"
#include "firmware/port/stm32g474/output.h"
#include "firmware/port/stm32g474/pin.h"
#include "firmware/port/stm32g474/random.h"
#include "firmware/port/stm32g474/registers.h"
#include "firmware/port/stm32g474/timer.h"

/* TIM1 counts of the millisecond at which a scan's interrupt, SCANNED after its trigger, is due at the
 * earliest. */
#define DUE_AFTER(scanned) (((scanned)-TIMER_LEAD) / 7 - 5 * TIMER_COUNTS_PER_US)

static struct {
	uint32_t can_hz;
	uint8_t taken[ADC_GROUPS]; /* scans of this millisecond handed to the core */
	volatile int start_result; /* for the debugger: what went wrong at start-up */
} port;

/* ---- what the core calls ---- */

void port_keep(uint8_t byte)
{
	reset_keep(&board_mark, byte);
}

uint8_t port_kept(void)
{
	return reset_kept(&board_mark);
}

int port_random(uint32_t *value)
{
	return random_number(value);
}

bool port_brown_out_set(void)
{
	return brown_out_set();
}

uint32_t port_time_us(void)
{
	return timer_us();
}

uint16_t port_io(void)
{
	return (uint16_t)(pin_io() | adc_bias());
}

uint16_t port_bias_high(void)
{
	return adc_bias_high();
}

void port_outputs(uint16_t on, uint16_t off)
{
	output_set(on, off);
	pin_outputs(on, off);
}

int port_off_at(uint16_t output, uint32_t time_us)
{
	return output_off_at(output, time_us);
}

void port_off_cancel(uint16_t output)
{
	output_off_cancel(output);
}

int port_can_setup(bool classic, uint32_t data_kbit_s)
{
	return can_setup(port.can_hz, classic, data_kbit_s);
}

int port_can_send(const struct frame *frame)
{
	return can_send(frame);
}

int port_can_receive(struct frame *frame)
{
	return can_receive(frame);
}

uint32_t port_can_errors(enum port_bus *state)
{
	return can_errors(state);
}

void port_watchdog_kick(void)
{
	watchdog_kick();
}

void port_reset(void)
{
	reset_by_command();
}

void port_lock(void)
{
	register_mask(INTERRUPT_CONTROL);
}

void port_unlock(void)
{
	register_mask(0);
}

/* ---- sample interrupts ---- */

static void hand_over(enum adc_group group)
{
	int16_t code[ADC_CODES];
	bool ready = adc_read(group, port.taken[group]++, code);

	if (group == ADC_GROUP_X)
		app_on_x(code[0], code[1], ready);
	else
		app_on_yz(code[0], code[1], code[2], code[3], ready);
}

/* The scans of this millisecond up to `due`; mostly the one that has just ended. */
static void hand_over_until(enum adc_group group, unsigned due)
{
	while (port.taken[group] < due)
		hand_over(group);
}

/* What is late of the millisecond that ends, then the next. */
void board_on_turn(void)
{
	timer_clear_tick();
	hand_over_until(ADC_GROUP_X, ADC_X_SCANS);
	hand_over_until(ADC_GROUP_YZ, ADC_YZ_SCANS);
	for (enum adc_group group = ADC_GROUP_X; group < ADC_GROUPS; group++) {
		adc_begin(group);
		port.taken[group] = 0;
	}
	app_on_turn();
	interrupt_control();
}

/* `rate` scans a millisecond, the first due at `first` counts of it. */
static void on_scan(enum adc_group group, unsigned rate, uint32_t first)
{
	uint32_t counts = timer_counts();

	if (counts < first)
		return; /* of the millisecond before, and handed over with its tick */
	hand_over_until(group, (counts - first) * rate / TIMER_COUNTS_PER_MS + 1);
	if (port.taken[group] == rate)
		(void)adc_align(group); /* what it could not mend shows as samples not taken */
}

void board_on_yz(void)
{
	timer_clear_yz();
	on_scan(ADC_GROUP_YZ, ADC_YZ_SCANS, DUE_AFTER(TIMER_YZ_SCANNED));
}

void board_on_x(void)
{
	timer_clear_x();
	on_scan(ADC_GROUP_X, ADC_X_SCANS, DUE_AFTER(TIMER_X_SCANNED));
}

/* ---- control interrupts ---- */

void board_on_gate(void)
{
	uint32_t time_us;

	for (unsigned gate = 0; gate < 2; gate++)
		if (timer_gate(gate, &time_us))
			app_on_gate(gate, time_us);
}

void board_on_control(void)
{
	uint32_t time_us;

	board_on_gate();
	if (timer_keeper(&time_us))
		app_on_keeper(time_us);
	adc_judge_bias();
	app_on_tick();
}

/* ---- start ---- */

/* Without its clock the controller has nothing to offer: it waits for the watchdog to try again, pins as in
 * reset. */
static void start_clock(void)
{
	int result = watchdog_start();

	if (result == 0)
		result = clock_setup(&port.can_hz);
	port.start_result = result;
	while (port.start_result != 0) {
	}
}

/* Without converters it does run: every sample is not taken, no sensor is ever fit, and the host can ask why.
 */
static void start_converters(void)
{
	port.start_result = adc_setup();
	if (port.start_result == 0)
		adc_start();
}

_Noreturn void board_main(void)
{
	enum port_reset cause = reset_cause(&board_mark);

	start_clock();
	supply_watch();
	timer_setup();
	output_setup();
	pin_setup();
	watchdog_kick();
	app_init(cause);
	start_converters();
	port.taken[ADC_GROUP_X] = ADC_X_SCANS; /* none before the first tick */
	port.taken[ADC_GROUP_YZ] = ADC_YZ_SCANS;
	interrupt_setup();
	watchdog_kick();
	timer_start();
	register_release(0);
	for (;;)
		app_poll();
}

void assert_failed(const char *file, int line, const char *condition)
{
	(void)file, (void)line, (void)condition;
	board_crash();
}

/* A reset lets go of latch and dampers at once, and pulls the magnet up. */
_Noreturn void board_crash(void)
{
	reset_by_crash(&board_mark);
	for (;;) {
	}
}
