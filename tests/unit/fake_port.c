/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/unit/fake_port.h"

#include <stdlib.h>
#include <string.h>

struct fake_port fake;

void fake_init(void)
{
	memset(&fake, 0, sizeof(fake));
	fake.inputs = FAKE_ALL_GOOD;
	fake.can_room = UINT32_MAX;
	fake.outputs = WIRE_IO_MAGNET_HOLD;
	fake.random = 0x9E3779B9;
}

void fake_time(uint32_t now_us)
{
	for (unsigned i = 0; i < 16; i++)
		if ((fake.planned & 1u << i) && (int32_t)(now_us - fake.off_us[i]) >= 0) {
			fake.outputs &= (uint16_t) ~(1u << i);
			fake.planned &= (uint16_t) ~(1u << i);
		}
	fake.now_us = now_us;
}

void fake_receive(const struct frame *frame)
{
	if (fake.tape != NULL)
		fake.tape(frame);
	if (fake.received_next == fake.received_count)
		fake.received_next = fake.received_count = 0;
	if (fake.received_count == FAKE_RECEIVED_MAX)
		abort();
	fake.received[fake.received_count++] = *frame;
}

unsigned fake_count(uint32_t id)
{
	unsigned count = 0;

	for (unsigned i = 0; i < fake.sent_count; i++)
		count += fake.sent[i].id == id;
	return count;
}

const struct frame *fake_last(uint32_t id)
{
	for (unsigned i = fake.sent_count; i-- > 0;)
		if (fake.sent[i].id == id)
			return &fake.sent[i];
	return NULL;
}

uint32_t fake_random(uint32_t *seed)
{
	*seed ^= *seed << 13;
	*seed ^= *seed >> 17;
	*seed ^= *seed << 5;
	return *seed;
}

/* Main may be interrupted here. */
static void interrupt(void)
{
	if (fake.interrupt != NULL && fake.locks == 0)
		fake.interrupt();
}

uint32_t port_time_us(void)
{
	return fake.now_us;
}

uint16_t port_io(void)
{
	return fake.inputs | fake.outputs;
}

uint16_t port_bias_high(void)
{
	return fake.bias_high;
}

void port_outputs(uint16_t on, uint16_t off)
{
	if (on & off)
		abort(); /* says nothing */
	fake.outputs = (uint16_t)((fake.outputs & ~off) | on);
}

int port_off_at(uint16_t output, uint32_t time_us)
{
	for (unsigned i = 0; i < 16; i++)
		if (output & 1u << i)
			fake.off_us[i] = time_us;
	if ((int32_t)(time_us - fake.now_us) < 0) {
		port_outputs(0, output);
		return 1;
	}
	fake.planned |= output;
	return 0;
}

void port_off_cancel(uint16_t output)
{
	fake.planned &= (uint16_t)~output;
}

int port_can_setup(bool classic, uint32_t data_kbit_s)
{
	if (fake.no_setup || (fake.no_fd && !classic))
		return DT_E_ARGUMENT;
	if (data_kbit_s != 2000 && data_kbit_s != 5000 && data_kbit_s != 8000)
		return DT_E_ARGUMENT;
	fake.classic = classic;
	fake.data_kbit_s = data_kbit_s;
	fake.setups++;
	return 0;
}

int port_can_send(const struct frame *frame)
{
	interrupt();
	if (fake.can_full || fake.bus == PORT_BUS_OFF || fake.can_room == 0)
		return DT_E_FULL;
	if (fake.sent_count == FAKE_SENT_MAX)
		abort();
	fake.can_room -= fake.can_room != UINT32_MAX;
	fake.sent[fake.sent_count++] = *frame;
	return 0;
}

int port_can_receive(struct frame *frame)
{
	interrupt();
	if (fake.received_next == fake.received_count)
		return 0;
	*frame = fake.received[fake.received_next++];
	return 1;
}

void port_keep(uint8_t byte)
{
	fake.kept = byte;
}

uint8_t port_kept(void)
{
	return fake.kept;
}

int port_random(uint32_t *value)
{
	if (fake.no_random)
		return DT_E_SYSTEM;
	*value = fake.random;
	fake.random = fake.random * 1664525u + 1013904223u;
	return 0;
}

bool port_brown_out_set(void)
{
	return !fake.brown_out_unset;
}

uint32_t port_can_errors(enum port_bus *state)
{
	*state = fake.bus;
	return fake.bus_errors;
}

void port_watchdog_kick(void)
{
	interrupt();
	fake.kicks++;
}

void port_reset(void)
{
	fake.resets++;
}

void port_lock(void)
{
	interrupt();
	if (fake.locks++ != 0)
		abort(); /* not nested */
}

void port_unlock(void)
{
	if (--fake.locks != 0)
		abort();
	interrupt();
}
