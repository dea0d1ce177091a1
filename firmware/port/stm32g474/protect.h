/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_PORT_STM32G474_PROTECT_H
#define DT_FIRMWARE_PORT_STM32G474_PROTECT_H
/*
 * The memory protection unit: flash read-only, the data, the stack and the peripherals not executable,
 * everything else out of bounds: NULL, what lies below the stack, the CCM's second address.
 *
 * Context: protect_setup at start-up, before anything else. Source: PM0214 4.2; RM0440 2.2.
 */
void protect_setup(void);

#endif
