/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "firmware/port/stm32g474/adc.h"

#include "common/wire.h"
#include "firmware/port/stm32g474/registers.h"
#include "firmware/port/stm32g474/timer.h"

enum {
	SENSORS = 2,
	AXES = 3,
	REGULATOR_US = 25,         /* at least 20 */
	CALIBRATION_POLLS = 20000, /* 116 clocks of 42 MHz */
	READY_POLLS = 2000,
	STOP_POLLS = 200,
	SUM_MAX = 16 * 4095,
	/* A tenth of the bias voltage reaches the pin: 6 to 16 V are 0.6 to 1.6 V. A short gives 0, an open
	 * cable the supply's 22 V or more. */
	BIAS_MIN = SUM_MAX * 6 / 33,
	BIAS_MAX = SUM_MAX * 16 / 33,
	BIAS_FIRST = 2, /* word of a YZ scan */
};

enum axis { X, Y, Z };

/* code = (sum - offset) gain / 65536. */
static const struct calibration {
	int32_t offset, gain;
} calibration[SENSORS][AXES] = {
        {{SUM_MAX / 2, 32776}, {SUM_MAX / 2, 32776}, {SUM_MAX / 2, 32776}},
        {{SUM_MAX / 2, 32776}, {SUM_MAX / 2, 32776}, {SUM_MAX / 2, 32776}},
};

static volatile uint32_t x_words[ADC_X_SCANS * ADC_X_WORDS];
static volatile uint32_t yz_words[ADC_YZ_SCANS * ADC_YZ_WORDS];

/* Channels in the order of conversion. */
static const uint8_t adc1_inputs[ADC_YZ_WORDS] = {6, 7, 8, 9, 15};
static const uint8_t adc2_inputs[ADC_YZ_WORDS] = {3, 4, 17, 5, 11};
static const uint8_t adc3_inputs[ADC_X_WORDS] = {1};
static const uint8_t adc4_inputs[ADC_X_WORDS] = {3};

static const struct pair {
	uint32_t common, adc[SENSORS], trigger, request;
	const uint8_t *inputs[SENSORS];
	volatile uint32_t *words;
	uint8_t dma, scans, scan_words;
} pairs[ADC_GROUPS] = {
        [ADC_GROUP_X] = {ADC345,
                         {ADC3, ADC4},
                         ADC_TRIGGER_TIM4,
                         DMAMUX_ADC3,
                         {adc3_inputs, adc4_inputs},
                         x_words,
                         1,
                         ADC_X_SCANS,
                         ADC_X_WORDS},
        [ADC_GROUP_YZ] = {ADC12,
                          {ADC1, ADC2},
                          ADC_TRIGGER_TIM3,
                          DMAMUX_ADC1,
                          {adc1_inputs, adc2_inputs},
                          yz_words,
                          0,
                          ADC_YZ_SCANS,
                          ADC_YZ_WORDS},
};

static volatile uint16_t bias, bias_high; /* WIRE_IO_IEPE_* */

/* ---- start ---- */

static int enable(uint32_t adc)
{
	int result;

	WR(adc + ADC_CR, 0); /* out of deep power-down */
	WR(adc + ADC_CR, ADC_CR_ADVREGEN);
	timer_pause_us(REGULATOR_US);
	WR(adc + ADC_CR, ADC_CR_ADVREGEN | ADC_CR_ADCAL);
	result = register_wait(adc + ADC_CR, ADC_CR_ADCAL, 0, CALIBRATION_POLLS);
	if (result != 0)
		return result;
	timer_pause_us(1); /* 4 clocks at least between calibration and ADEN */
	WR(adc + ADC_ISR, ADC_ISR_ADRDY);
	WR(adc + ADC_CR, ADC_CR_ADVREGEN | ADC_CR_ADEN);
	return register_wait(adc + ADC_ISR, ADC_ISR_ADRDY, ADC_ISR_ADRDY, READY_POLLS);
}

static void set_sequence(uint32_t adc, const uint8_t *inputs, unsigned count)
{
	uint32_t sqr1 = count - 1u;

	for (unsigned i = 0; i < count && i < 4; i++)
		sqr1 |= (uint32_t)inputs[i] << (6 + 6 * i);
	WR(adc + ADC_SQR1, sqr1);
	WR(adc + ADC_SQR2, count > 4 ? inputs[4] : 0);
}

/* The slave needs the very settings of its master. */
static void adc_configure(const struct pair *pair, unsigned sensor)
{
	uint32_t adc = pair->adc[sensor];

	WR(adc + ADC_CFGR, ADC_CFGR_JQDIS | ADC_CFGR_EXTEN_RISING | ADC_CFGR_EXTSEL(pair->trigger));
	WR(adc + ADC_CFGR2, ADC_CFGR2_ROVSE | ADC_CFGR2_OVSR_16);
	WR(adc + ADC_SMPR1, ADC_SMPR1_ALL_24_5);
	WR(adc + ADC_SMPR2, ADC_SMPR2_ALL_24_5);
	set_sequence(adc, pair->inputs[sensor], pair->scan_words);
}

/* The common register first: it can be written only while both are disabled. */
static int adc_set_up(const struct pair *pair)
{
	int result = 0;

	WR(pair->common + ADC_CCR,
	   ADC_CCR_CKMODE_4 | ADC_CCR_MDMA_12 | ADC_CCR_DMACFG | ADC_CCR_DUAL_REGULAR);
	for (unsigned sensor = 0; sensor < SENSORS && result == 0; sensor++) {
		result = enable(pair->adc[sensor]);
		if (result == 0)
			adc_configure(pair, sensor);
	}
	return result;
}

int adc_setup(void)
{
	int result;

	register_set(RCC_AHB1ENR, RCC_AHB1ENR_DMA1 | RCC_AHB1ENR_DMAMUX);
	register_set(RCC_AHB2ENR, RCC_AHB2ENR_ADC12 | RCC_AHB2ENR_ADC345);
	(void)RD(RCC_AHB2ENR);
	bias = 0;
	bias_high = 0;
	result = adc_set_up(&pairs[ADC_GROUP_X]);
	return result == 0 ? adc_set_up(&pairs[ADC_GROUP_YZ]) : result;
}

/* DMA completely, then its request, then its enable (13.4.3), then the converters: starting the master starts
 * both. */
static void start_pair(const struct pair *pair)
{
	uint32_t control =
	        DMA_CCR_PL_HIGHEST | DMA_CCR_MSIZE_32 | DMA_CCR_PSIZE_32 | DMA_CCR_MINC | DMA_CCR_CIRC;

	WR(DMA1_IFCR, DMA_CLEAR(pair->dma));
	WR(DMA1_CPAR(pair->dma), pair->common + ADC_CDR);
	WR(DMA1_CMAR(pair->dma), (uint32_t)(uintptr_t)pair->words);
	WR(DMA1_CNDTR(pair->dma), (uint32_t)pair->scans * pair->scan_words);
	WR(DMA1_CCR(pair->dma), control);
	WR(DMAMUX_CCR(pair->dma), pair->request);
	WR(DMA1_CCR(pair->dma), control | DMA_CCR_EN);
	WR(pair->adc[0] + ADC_CR, ADC_CR_ADVREGEN | ADC_CR_ADSTART);
}

void adc_start(void)
{
	for (unsigned group = 0; group < ADC_GROUPS; group++)
		start_pair(&pairs[group]);
}

/* ---- running ---- */

static unsigned scans_done(const struct pair *pair)
{
	uint32_t left = RD(DMA1_CNDTR(pair->dma));

	if (RD(DMA1_ISR) & DMA_TCIF(pair->dma))
		return pair->scans;
	return ((uint32_t)pair->scans * pair->scan_words - left) / pair->scan_words;
}

/* Rounded to nearest. 32 bits hold it as long as |sum - offset| gain is below 2^31. */
static inline int16_t to_code(uint32_t sum, const struct calibration *channel)
{
	int32_t code = (((int32_t)sum - channel->offset) * channel->gain + 0x8000) >> 16;

	if (sum - 1 >= SUM_MAX - 1)
		return sum == 0 ? -WIRE_SAMPLE_FULL_SCALE : WIRE_SAMPLE_FULL_SCALE;
	if (code != (int16_t)code)
		return code < 0 ? -WIRE_SAMPLE_FULL_SCALE : WIRE_SAMPLE_FULL_SCALE;
	return (int16_t)code;
}

/* Both sensors' code of one word. */
static inline void read_word(uint32_t word, enum axis axis, int16_t *s1, int16_t *s2)
{
	*s1 = to_code(word & 0xFFFFu, &calibration[0][axis]);
	*s2 = to_code(word >> 16, &calibration[1][axis]);
}

/* Of the first scan, this millisecond's or the last one's. */
void adc_judge_bias(void)
{
	const volatile uint32_t *words = yz_words + BIAS_FIRST;
	static const uint16_t bits[SENSORS] = {WIRE_IO_IEPE_S1, WIRE_IO_IEPE_S2};
	uint16_t good = WIRE_IO_IEPE_S1 | WIRE_IO_IEPE_S2, high = 0;

#pragma GCC unroll 3
	for (unsigned axis = 0; axis < AXES; axis++)
#pragma GCC unroll 2
		for (unsigned sensor = 0; sensor < SENSORS; sensor++) {
			uint32_t sum = words[axis] >> (16 * sensor) & 0xFFFFu;

			if (sum < BIAS_MIN || sum > BIAS_MAX)
				good &= (uint16_t)~bits[sensor];
			if (sum > BIAS_MAX)
				high |= bits[sensor];
		}
	bias = good;
	bias_high = high;
}

bool adc_read(enum adc_group group, unsigned index, int16_t code[ADC_CODES])
{
	const struct pair *pair = &pairs[group];
	const volatile uint32_t *words = &pair->words[index * pair->scan_words];

	if (index >= scans_done(pair)) {
		for (unsigned i = 0; i < ADC_CODES; i++)
			code[i] = 0;
		return false;
	}
	if (group == ADC_GROUP_X) {
		read_word(words[0], X, &code[0], &code[1]);
	} else {
		read_word(words[0], Y, &code[0], &code[2]);
		read_word(words[1], Z, &code[1], &code[3]);
	}
	return true;
}

int adc_align(enum adc_group group)
{
	const struct pair *pair = &pairs[group];
	int result = 0;

	if (scans_done(pair) == pair->scans &&
	    RD(DMA1_CNDTR(pair->dma)) == (uint32_t)pair->scans * pair->scan_words)
		return 0;
	WR(pair->adc[0] + ADC_CR, ADC_CR_ADVREGEN | ADC_CR_ADSTP);
	for (unsigned sensor = 0; sensor < SENSORS && result == 0; sensor++)
		result = register_wait(pair->adc[sensor] + ADC_CR, ADC_CR_ADSTART, 0, STOP_POLLS);
	WR(DMA1_CCR(pair->dma), 0);
	if (result != 0)
		return result;
	for (unsigned sensor = 0; sensor < SENSORS; sensor++)
		WR(pair->adc[sensor] + ADC_ISR, ADC_ISR_OVR);
	start_pair(pair);
	return 1;
}

void adc_begin(enum adc_group group)
{
	WR(DMA1_IFCR, DMA_CLEAR(pairs[group].dma));
}

uint16_t adc_bias(void)
{
	return bias;
}

uint16_t adc_bias_high(void)
{
	return bias_high;
}
