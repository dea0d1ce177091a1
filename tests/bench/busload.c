/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * make busload: how much of the bus the wire takes at worst. Everything wire.def sends regularly, every frame
 * as long as bit stuffing can make it.
 */
#include <stdio.h>

#include "common/segment.h"
#include "common/wire.h"
#include "common/link/canbits.h"

enum {
	BLOCKS_PER_S = 2000,
	WINDOW_TICKS = 500, /* pre_trigger_ms + post_trigger_ms as they are at first */
	SAMPLE_BYTES_PER_S = 2 * 1000 * WIRE_SAMPLE_BYTES,
};

static const double data_rates[] = {2, 5, 8};
enum { RATES = sizeof(data_rates) / sizeof(data_rates[0]) };

/* What goes over the bus whether something falls or not; all of it fits classic frames. */
static const struct {
	uint32_t id;
	unsigned length, per_s;
} regular[] = {
        {WIRE_ID_SYNC, WIRE_LENGTH_sync, 1},
        {WIRE_ID_TIME, WIRE_LENGTH_time, 1},
        {WIRE_ID_STATUS, WIRE_LENGTH_status, 10},
        {WIRE_ID_COUNTER, WIRE_LENGTH_counter, 10},
        {WIRE_ID_HEARTBEAT_TOWER, WIRE_LENGTH_heartbeat, 10},
        {WIRE_ID_HEARTBEAT_HOST, WIRE_LENGTH_heartbeat, 10},
};

/* us of bus in a second */
static double regular_us(void)
{
	double sum = 0;

	for (unsigned i = 0; i < sizeof(regular) / sizeof(regular[0]); i++)
		sum += regular[i].per_s * canbits_us(canbits_classic(regular[i].id, regular[i].length), 1, 1);
	return sum;
}

static double pair_us(uint32_t s1, uint32_t s2, double rate)
{
	return canbits_us(canbits_fd(s1, WIRE_LENGTH_block), 1, rate) +
	       canbits_us(canbits_fd(s2, WIRE_LENGTH_block), 1, rate);
}

static double live_us(double rate)
{
	return BLOCKS_PER_S / 2 * pair_us(WIRE_ID_BLOCK_S1, WIRE_ID_BLOCK_S2, rate) + regular_us();
}

static void print_fd(void)
{
	printf("CAN FD, live, 1 Mbit/s arbitration      data 2 Mbit/s   5 Mbit/s   8 Mbit/s\n");
	printf("  a block, us                          ");
	for (unsigned i = 0; i < RATES; i++)
		printf("     %6.1f", pair_us(WIRE_ID_BLOCK_S1, WIRE_ID_BLOCK_S2, data_rates[i]) / 2);
	printf("\n  2 000 blocks/s                       ");
	for (unsigned i = 0; i < RATES; i++)
		printf("     %5.1f%%", (live_us(data_rates[i]) - regular_us()) / 1e4);
	printf("\n  with all regular messages            ");
	for (unsigned i = 0; i < RATES; i++)
		printf("     %5.1f%%", live_us(data_rates[i]) / 1e4);
	printf("\n  left for resent blocks, 1/s          ");
	for (unsigned i = 0; i < RATES; i++)
		printf("     %6.0f", (1e6 - live_us(data_rates[i])) * 2 /
		                             pair_us(WIRE_ID_RESENT_S1, WIRE_ID_RESENT_S2, data_rates[i]));
	printf("\n");
}

static void print_classic(void)
{
	double segment_us = canbits_us(canbits_classic(WIRE_ID_RESENT_S1, WIRE_LENGTH_segment), 1, 1);
	double blocks = 2.0 * WINDOW_TICKS;
	double free_share = 1 - regular_us() / 1e6;
	unsigned pieces = segment_count(WIRE_LENGTH_block);

	printf("Classic CAN, 1 Mbit/s\n");
	printf("  live would take                       %5.0f%% in segments, %.0f%% with nothing but samples "
	       "in "
	       "every frame\n",
	       BLOCKS_PER_S * pieces * segment_us / 1e4, SAMPLE_BYTES_PER_S / 8.0 * segment_us / 1e4);
	printf("  regular messages                      %5.1f%%\n", regular_us() / 1e4);
	printf("  upload of a window of %u ms          %.2f s, %.2f s if nothing is stuffed\n", WINDOW_TICKS,
	       blocks * pieces * segment_us / 1e6 / free_share, blocks * pieces * 111 / 1e6 / free_share);
}

int main(void)
{
	print_fd();
	print_classic();
	return 0;
}
