/* SPDX-License-Identifier: GPL-2.0-or-later */
#include <math.h>
#include <string.h>

#include "hil/board/chip.h"

enum {
	WORD_CLOCKS = 16 * (49 + 25) / 2 * 4, /* 16 conversions of 24.5 + 12.5 clocks of 42 MHz */
	ISR = 0x00,
	CR = 0x08,
	CFGR = 0x0C,
	CFGR2 = 0x10,
	SMPR1 = 0x14,
	SMPR2 = 0x18,
	SQR1 = 0x30,
	SQR2 = 0x34,
	CCR = 0x308,
	CDR = 0x30C,
	SLAVE = 0x100,
	ADEN = 1 << 0,
	ADSTART = 1 << 2,
	ADSTP = 1 << 4,
	FULL_SCALE = 16 * 4095,
	MIDDLE = FULL_SCALE / 2,
	BIAS_GOOD = 21800,
	IEPE_S1 = 14, /* bits of the inputs */
	WORDS_MAX = 16,
};

#define ADVREGEN (1u << 28)
#define DEEPPWD (1u << 29)
#define ADCAL (1u << 31)
#define GAIN 32776 /* a count of the sum is 1/64 g, to what the front end gives at full scale */

/* What lies at an input: sensor and axis, axes 3 to 5 being the bias of X, Y, Z. By the wiring table. */
struct input {
	uint8_t converter, channel, sensor, axis; /* converter 1 to 4 */
};

static const struct input inputs[] = {
        {1, 6, 0, 1}, {1, 7, 0, 2},  {1, 8, 0, 3}, {1, 9, 0, 4},  {1, 15, 0, 5}, {2, 3, 1, 1},
        {2, 4, 1, 2}, {2, 17, 1, 3}, {2, 5, 1, 4}, {2, 11, 1, 5}, {3, 1, 0, 0},  {4, 3, 1, 0},
};

static struct pair {
	uint32_t base;
	unsigned first;   /* its master's number */
	unsigned group;   /* of the sensor bus, what is asked for */
	unsigned request; /* of the DMA multiplexer */
	int64_t stored;   /* when the scan under way is over */
} pairs[] = {
        {.base = ADC12, .first = 1, .group = SENSORBUS_YZ, .request = 5},
        {.base = ADC345, .first = 3, .group = SENSORBUS_X, .request = 37},
};

enum { PAIRS = 2, CHANNELS = 2 };

static struct {
	uint16_t sum[2][6];
	uint8_t ready; /* SENSORBUS_X, SENSORBUS_YZ */
	uint32_t reload[CHANNELS], place[CHANNELS];
} sampling;

static uint32_t *at(uint32_t address)
{
	return registers_at(address);
}

void sampling_reset(void)
{
	memset(&sampling, 0, sizeof(sampling));
	for (unsigned i = 0; i < PAIRS; i++)
		pairs[i].stored = BOARD_NEVER;
	for (unsigned i = 0; i < PAIRS; i++) /* deep power-down */
		*at(pairs[i].base + CR) = *at(pairs[i].base + SLAVE + CR) = 1u << 29;
}

void sampling_state(void)
{
	preempt_keep(&sampling, sizeof(sampling));
	preempt_keep(pairs, sizeof(pairs));
}

/* ---- what the sensors give ---- */

static int code_of(int sum)
{
	return ((sum - MIDDLE) * GAIN + 0x8000) >> 16;
}

/* The sum whose conversion gives the code again. */
static uint16_t sum_of(int code)
{
	int sum = (int)lround(code * 65536.0 / GAIN) + MIDDLE;

	if (code >= 32767 || code <= -32767)
		return code > 0 ? FULL_SCALE : 0;
	sum += (code_of(sum) < code) - (code_of(sum) > code);
	return (uint16_t)(sum < 0 ? 0 : sum > FULL_SCALE ? FULL_SCALE : sum);
}

void sampling_answer(unsigned group, const struct sensorbus_answer *answer)
{
	for (unsigned sensor = 0; sensor < 2; sensor++) {
		bool good = answer->inputs >> (IEPE_S1 + sensor) & 1, high = answer->bias_high >> sensor & 1;

		if (group & SENSORBUS_X)
			sampling.sum[sensor][0] = sum_of(answer->codes[3 * sensor]);
		for (unsigned axis = 1; axis < 3 && group & SENSORBUS_YZ; axis++)
			sampling.sum[sensor][axis] = sum_of(answer->codes[3 * sensor + axis]);
		for (unsigned axis = 3; axis < 6; axis++)
			sampling.sum[sensor][axis] = good ? BIAS_GOOD : high ? FULL_SCALE : 0;
	}
	sampling.ready = (uint8_t)((sampling.ready & ~group) | (answer->ready & group));
}

/* ---- a scan ---- */

static unsigned scan_words(const struct pair *pair)
{
	return (*at(pair->base + SQR1) & 15) + 1;
}

void sampling_trigger(unsigned source, int64_t time)
{
	for (unsigned i = 0; i < PAIRS; i++) {
		struct pair *pair = &pairs[i];
		uint32_t settings = *at(pair->base + CFGR);

		if (!(*at(pair->base + CR) & ADSTART) || (settings >> 5 & 31) != source ||
		    (settings >> 10 & 3) != 1)
			continue;
		if (pair->stored != BOARD_NEVER)
			board_fail("a trigger of ADC%u came while it converted", pair->first);
		pair->stored = time + (int64_t)scan_words(pair) * WORD_CLOCKS;
	}
}

static uint16_t converted(unsigned converter, uint32_t base, unsigned rank)
{
	unsigned channel =
	        (rank < 4 ? *at(base + SQR1) >> (6 + 6 * rank) : *at(base + SQR2) >> (6 * (rank - 4))) & 31;

	for (unsigned i = 0; i < sizeof(inputs) / sizeof(inputs[0]); i++)
		if (inputs[i].converter == converter && inputs[i].channel == channel)
			return sampling.sum[inputs[i].sensor][inputs[i].axis];
	return 0; /* nothing is wired to it */
}

static void dma_store(const struct pair *pair, uint32_t word)
{
	for (unsigned channel = 0; channel < CHANNELS; channel++) {
		uint32_t base = DMA1 + 0x14 * channel, settings = *at(base + 0x08), place;

		if (!(settings & 1) || (*at(DMAMUX + 4 * channel) & 0x7F) != pair->request ||
		    *at(base + 0x10) != pair->base + CDR || *at(base + 0x0C) == 0)
			continue;
		place = sampling.place[channel];
		if (place < BOARD_SRAM || place - BOARD_SRAM > BOARD_SRAM_BYTES - 4)
			board_fail("the DMA writes to 0x%08X", place);
		memcpy(board.sram + (place - BOARD_SRAM), &word, 4);
		sampling.place[channel] += settings >> 7 & 1 ? 4 : 0;
		if (--*at(base + 0x0C) == 0) {
			*at(DMA1) |= 2u << (4 * channel);
			*at(base + 0x0C) = settings >> 5 & 1 ? sampling.reload[channel] : 0;
			sampling.place[channel] = *at(base + 0x14);
		}
	}
}

int64_t sampling_next(void)
{
	return pairs[0].stored < pairs[1].stored ? pairs[0].stored : pairs[1].stored;
}

void sampling_event(void)
{
	for (unsigned i = 0; i < PAIRS; i++) {
		struct pair *pair = &pairs[i];

		if (pair->stored > board.now)
			continue;
		pair->stored = BOARD_NEVER;
		if (!(sampling.ready & pair->group))
			continue;
		for (unsigned rank = 0; rank < scan_words(pair); rank++)
			dma_store(pair, converted(pair->first, pair->base, rank) |
			                        (uint32_t)converted(pair->first + 1, pair->base + SLAVE, rank)
			                                << 16);
	}
}

/* ---- registers ---- */

static struct pair *pair_at(uint32_t address)
{
	for (unsigned i = 0; i < PAIRS; i++)
		if (address - pairs[i].base < 0x400)
			return &pairs[i];
	return NULL;
}

bool sampling_read(uint32_t address, uint32_t *value)
{
	if (pair_at(address) == NULL && address - DMA1 >= 0x1000)
		return false;
	*value = *at(address);
	return true;
}

static bool is_on(uint32_t adc)
{
	return *at(adc + CR) & ADEN;
}

/* Its slave must have the same settings, or the two drift apart. */
static void check_pair(const struct pair *pair)
{
	static const uint8_t same[] = {CFGR, CFGR2, SMPR1, SMPR2};

	for (unsigned i = 0; i < sizeof(same); i++)
		if (*at(pair->base + same[i]) != *at(pair->base + SLAVE + same[i]))
			board_fail("ADC%u and its slave differ in the register at 0x%02X", pair->first,
			           same[i]);
	if ((*at(pair->base + SQR1) & 15) != (*at(pair->base + SLAVE + SQR1) & 15))
		board_fail("ADC%u and its slave convert different numbers of channels", pair->first);
	if (!is_on(pair->base) || !is_on(pair->base + SLAVE))
		board_fail("ADC%u is started before both of its pair are on", pair->first);
	if (*at(pair->base + CCR) != (6u | 1u << 13 | 2u << 14 | 3u << 16))
		board_fail("ADC%u is started in another mode than both at once, by DMA, at HCLK/4",
		           pair->first);
	if ((*at(pair->base + CFGR2) & 0x1FD) != (1 | 3 << 2))
		board_fail("ADC%u adds up other than 16 conversions", pair->first);
	if (*at(pair->base + SMPR1) != 0x1B6DB6DB || *at(pair->base + SMPR2) != 0x036DB6DB)
		board_fail("ADC%u samples other than 24.5 clocks", pair->first);
}

static void write_control(struct pair *pair, uint32_t adc, uint32_t value)
{
	uint32_t before = *at(adc + CR), after;

	if (value & ADCAL && (!(before & ADVREGEN) || before & ADEN))
		board_fail("a converter is calibrated without its regulator, or while it is on");
	if (value & ADEN && !(before & ADVREGEN))
		board_fail("a converter is enabled without its regulator");
	if (before & ADEN && (value & (ADVREGEN | DEEPPWD)) != ADVREGEN)
		board_fail("a converter that is on loses its regulator");
	if (value & ADSTART && adc == pair->base)
		check_pair(pair);
	after = (value & ~(ADCAL | ADSTP)) | (before & (ADEN | ADSTART));
	if (value & ADSTP) {
		after &= ~(uint32_t)ADSTART;
		pair->stored = BOARD_NEVER;
	}
	*at(adc + CR) = after;
	if (value & ADEN)
		*at(adc + ISR) |= 1;
}

static void write_dma(uint32_t address, uint32_t value)
{
	unsigned channel = (address - DMA1 - 8) / 0x14, offset = (address - DMA1 - 8) % 0x14;
	bool on = *at(DMA1 + 0x08 + 0x14 * channel) & 1;

	if (offset != 0 && on)
		board_fail("channel %u of the DMA is set while it is on", channel + 1);
	*at(address) = value;
	if (offset == 0 && value & 1 && !on) {
		sampling.reload[channel] = *at(DMA1 + 0x0C + 0x14 * channel);
		sampling.place[channel] = *at(DMA1 + 0x14 + 0x14 * channel);
		if ((value & 0xF00) != 0xA00)
			board_fail("channel %u of the DMA moves other than words", channel + 1);
	}
}

void sampling_write(uint32_t address, uint32_t value)
{
	struct pair *pair = pair_at(address);
	uint32_t adc;

	if (address == DMA1 + 4) {
		*at(DMA1) &= ~value;
		return;
	}
	if (pair == NULL) {
		if (address - DMA1 < 0x800)
			write_dma(address, value);
		else
			*at(address) = value;
		return;
	}
	adc = address & ~0xFFu;
	if (address == pair->base + CCR && (is_on(pair->base) || is_on(pair->base + SLAVE)))
		board_fail("the common register of ADC%u is written while one is on", pair->first);
	if (address == adc + CR)
		write_control(pair, adc, value);
	else if (address == adc + ISR)
		*at(address) &= ~value;
	else if (address != pair->base + CCR && *at(adc + CR) & ADSTART)
		board_fail("ADC%u is set while it converts", pair->first);
	else
		*at(address) = value;
}
