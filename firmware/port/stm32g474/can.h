/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_PORT_STM32G474_CAN_H
#define DT_FIRMWARE_PORT_STM32G474_CAN_H
/*
 * FDCAN1: 1 Mbit/s, with data phases of 2, 5 or 8 Mbit/s in FD. Rates are exact or refused: with the kernel
 * clock of 40 MHz all of them are there, with 56 MHz 5 Mbit/s is not (clock.h). The sample point is near 80
 * %. In the data phase transmitter delay compensation is on, its second sample point where the first is.
 *
 * Only the identifiers that wire.def has for a host are received, and no remote frames: all else on the bus
 * is rejected by the controller, uncounted, and cannot fill its FIFO. The three elements of receive FIFO 0
 * are emptied by interrupt into a ring; what one of the two loses is counted as a bus error. Frames are sent
 * in the order they come, three at a time.
 *
 * Bus-off is left at once: can_errors lets the controller start its 129 x 11 recessive bits and says so until
 * they are over. Frames it had taken before stay and are sent then.
 *
 * Context: can_interrupt interrupt, the rest main; can_setup keeps control out and lets samples come. Source:
 * RM0440 44.3, 44.4.
 */
#include <stdbool.h>
#include <stdint.h>

#include "common/error.h"
#include "common/frame.h"
#include "firmware/port.h"

/* kernel_hz as clock_setup gave it. 0, DT_E_ARGUMENT for a rate that is not exact, DT_E_TIMEOUT. */
DT_MUST_USE int can_setup(uint32_t kernel_hz, bool classic, uint32_t data_kbit_s);

/* 0, or DT_E_FULL, also while bus-off. */
DT_MUST_USE int can_send(const struct frame *frame);

/* 1 with a frame, 0 without. */
DT_MUST_USE int can_receive(struct frame *frame);

/* port_can_errors. */
uint32_t can_errors(enum port_bus *state);

void can_interrupt(void);

#endif
