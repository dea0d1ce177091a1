/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_PORT_STM32G474_ADC_H
#define DT_FIRMWARE_PORT_STM32G474_ADC_H
/*
 * The converters. Both sensors are converted at the same instant, S1 by the master and S2 by the slave of a
 * pair:
 *
 *   ADC1 + ADC2   10 kHz   Y, Z, then the IEPE bias voltages of X, Y, Z
 *   ADC3 + ADC4    7 kHz   X
 *
 * At 42 MHz a conversion takes 24.5 + 12.5 clocks; 16 are added up in hardware, which makes one channel 14.1
 * us and 65520 full scale. Y and X are centred on their instant, Z comes 14.1 us after Y.
 *
 * Each pair has one DMA channel that fills the room of one millisecond again and again, scan k of the
 * millisecond in place k: however late the processor looks, a sample keeps its place. A pair that has lost a
 * trigger is restarted at the end of that millisecond; until then its scans count as not taken.
 *
 * Codes are 1/32 g. The front end is taken to turn +-512 g into 0 to 3.3 V about 1.65 V, so a count of the
 * sum is 1/64 g; the table in adc.c holds offset and gain of each channel. A sum at its limit becomes full
 * scale.
 *
 * Context: setup and start at start-up, adc_judge_bias control, adc_bias and adc_bias_high any, the rest the
 * sample interrupts'.
 * Source: RM0440 21.4.6, 21.4.8 to 21.4.11, 21.4.29, 21.4.30, 12.4, 13.4.3.
 */
#include <stdbool.h>
#include <stdint.h>

#include "common/error.h"

enum adc_group { ADC_GROUP_X, ADC_GROUP_YZ, ADC_GROUPS };

enum {
	ADC_X_SCANS = 7, /* in a millisecond */
	ADC_YZ_SCANS = 10,
	ADC_X_WORDS = 1, /* in a scan; a word is the pair's two sums, S1's below */
	ADC_YZ_WORDS = 5,
	ADC_CODES = 4, /* X: S1, S2; YZ: S1Y, S1Z, S2Y, S2Z */
};

/* Calibrates and enables, everything but the first trigger. 0 or DT_E_TIMEOUT. Needs timer_pause_us. */
DT_MUST_USE int adc_setup(void);

/* From now on triggers are heeded. */
void adc_start(void);

/* Scan `index` of this millisecond. True with the codes, false when it has not been converted. */
bool adc_read(enum adc_group group, unsigned index, int16_t code[ADC_CODES]);

/* When the last scan is over: restarts a pair that is behind. 0, 1 when it had to, DT_E_TIMEOUT. */
int adc_align(enum adc_group group);

/* At the tick, when the millisecond before has been read. */
void adc_begin(enum adc_group group);

/* Judges the bias voltages anew; once a millisecond. */
void adc_judge_bias(void);

/* WIRE_IO_IEPE_*: bias voltages inside their window, as last judged; and the sensors with one above it. */
uint16_t adc_bias(void);
uint16_t adc_bias_high(void);

#endif
