/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "firmware/input.h"

#include "common/memory.h"
#include "common/wire.h"

void input_init(struct input *input)
{
	memset(input, 0, sizeof(*input));
}

void input_read(struct input *input, uint16_t pins)
{
	uint16_t all = pins & input->before[0] & input->before[1];
	uint16_t any = pins | input->before[0] | input->before[1];

	input->before[1] = input->before[0];
	input->before[0] = pins;
	if (input->readings < INPUT_READINGS && ++input->readings < INPUT_READINGS)
		return;
	input->agreed = (input->agreed | all) & any;
	input->known |= (uint16_t)(all | ~any);
}

uint16_t input_io(const struct input *input, uint16_t pins)
{
	return (uint16_t)((pins & WIRE_IO_OUTPUTS) | input->agreed);
}
