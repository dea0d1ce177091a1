/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_PORT_H
#define DT_FIRMWARE_PORT_H
/*
 * The whole hardware boundary, resolved by the linker: a port is one folder that defines these functions
 * and calls the entry points of app.h.
 *
 * Contexts (app.h): "main" is app_poll, "control" the interrupt that app_on_tick and app_on_gate run in. The
 * sample interrupts above it call nothing of this. Functions marked both may be called from either.
 *
 * Times are us since reset, 32 bits, wrapping; compare them by signed difference. Outputs and inputs are
 * bits of wire.def's io word. Inputs are read as the pins stand: the core debounces. While the controller is
 * in reset the drivers hold their fail-safe levels by themselves: latch and dampers de-energised, magnet
 * energised.
 */
#include <stdbool.h>
#include <stdint.h>

#include "common/error.h"
#include "common/frame.h"

enum port_reset {
	PORT_RESET_POWER_ON,
	PORT_RESET_COMMAND, /* port_reset */
	PORT_RESET_WATCHDOG,
	PORT_RESET_BROWN_OUT,
	PORT_RESET_PIN, /* button, debugger, noise on the line */
	PORT_RESETS
};

enum port_bus { PORT_BUS_ACTIVE, PORT_BUS_PASSIVE, PORT_BUS_OFF };

/* Control, and main while interrupts are off: keeps one byte where no reset but the loss of power clears it;
 * the byte of before the reset, 0 after a loss of power. The core keeps its state there. */
void port_keep(uint8_t byte);
uint8_t port_kept(void);

/* Main: a number that nobody can foretell: from hardware on the board, the kernel on posix, the bench's seed
 * in lockstep. 0, or DT_E_SYSTEM when the generator does not deliver, with *value unchanged. */
DT_MUST_USE int port_random(uint32_t *value);

/* Both: the controller resets itself at its highest brown-out level (option bytes). */
bool port_brown_out_set(void);

/* Both: the clock that also stamps the gates and times the edges. */
uint32_t port_time_us(void);

/* Both: the inputs, and the outputs as they are at the pins, edges already made included. */
uint16_t port_io(void);

/* Both: of the sensors without their WIRE_IO_IEPE_* bit, those with an axis whose bias is above its window,
 * as such bits: a cable is open. That of the others is below: a cable is short. */
uint16_t port_bias_high(void);

/* Both: energises the outputs in `on`, de-energises those in `off`, leaves the others alone. */
void port_outputs(uint16_t on, uint16_t off);

/* Both: de-energises one output at time_us exactly, by hardware compare. There is one such edge for
 * MAGNET_HOLD and one for DAMPERS_RELIEVE; planned anew it replaces the one before. 0, or 1 if the time had
 * passed and it was done at once. */
int port_off_at(uint16_t output, uint32_t time_us);

/* Both: takes back a port_off_at that has not happened yet; else nothing. */
void port_off_cancel(uint16_t output);

/* Main, at rest, and once before anything is sent or received: sets the CAN controller up, classic at
 * 1 Mbit/s or FD with a data phase of data_kbit_s (2000, 5000, 8000). What the controller had taken and not
 * sent may be lost. 0, or DT_E_ARGUMENT for another rate, or for FD where controller or bus have none, with
 * the controller left as it was. At reset the core asks for FD first and for classic if that is refused. */
DT_MUST_USE int port_can_setup(bool classic, uint32_t data_kbit_s);

/* Main: 0 = the controller has taken the frame, DT_E_FULL = ask again later, also while bus-off. */
DT_MUST_USE int port_can_send(const struct frame *frame);

/* Main: 1 with a frame, 0 without. */
DT_MUST_USE int port_can_receive(struct frame *frame);

/* Main: bus errors and received frames lost since reset. *state tells the present one; the port restarts a
 * controller that is bus-off. */
uint32_t port_can_errors(enum port_bus *state);

/* Main: must come at least every 50 ms or the controller is reset with PORT_RESET_WATCHDOG. */
void port_watchdog_kick(void);

/* Main: restarts with PORT_RESET_COMMAND. May return; the restart then follows when app_poll returns. */
void port_reset(void);

/* Main: between these neither app_on_tick nor app_on_gate runs; samples may be taken. Short, not nested. */
void port_lock(void);
void port_unlock(void);

#endif
