/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_PORT_STM32G474_RANDOM_H
#define DT_FIRMWARE_PORT_STM32G474_RANDOM_H
/*
 * The random number generator, clocked by the internal oscillator of 48 MHz, which runs for it alone. It
 * watches its clock and its noise: after an error of either it is started again and its pipeline emptied,
 * twice at most. A zero and the number of the time before are none.
 *
 * Context: main. Source: RM0440 26.3.5, 26.3.7, 26.7; 7.4.32.
 */
#include <stdint.h>

#include "common/error.h"

/* port_random. 0, or DT_E_SYSTEM within 0.5 ms. */
DT_MUST_USE int random_number(uint32_t *value);

#endif
