/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_INPUT_H
#define DT_FIRMWARE_INPUT_H
/*
 * Inputs without contact bounce and spikes: a bit changes when INPUT_READINGS readings in a row, one each
 * millisecond, agree on its new value. A bit on which no INPUT_READINGS readings have agreed yet is not
 * known, and 0.
 *
 * Context: input_read control; the members may be read, and input_io called, under port_lock in main. Bits
 * are those of wire.def's io word.
 */
#include <stdint.h>

enum { INPUT_READINGS = 3 };

struct input {
	uint16_t agreed; /* the inputs */
	uint16_t known;  /* those that have ever been agreed on */
	uint16_t before[INPUT_READINGS - 1];
	uint8_t readings; /* since the reset, no more than INPUT_READINGS */
};

void input_init(struct input *input);

/* Each millisecond: the pins as they stand. */
void input_read(struct input *input, uint16_t pins);

/* The outputs of `pins`, and the inputs as they are agreed on. */
uint16_t input_io(const struct input *input, uint16_t pins);

#endif
