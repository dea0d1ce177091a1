/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_DROP_H
#define DT_HOST_RECORD_DROP_H
/*
 * The channels of a drop from the samples of its blocks, the same for everything that holds counts: the
 * join, an LCM message. Six channels S1X S1Y S1Z S2X S2Y S2Z, 7 and 10 samples a tick, counts / 32 g.
 *
 * drop_open, drop_put for every block held, fill the record's other fields, drop_close.
 */
#include <stdint.h>

#include "host/record/record.h"

enum {
	DROP_CHANNELS = 6,
	DROP_TICKS_MAX = 2048, /* more than the longest capture the tower can be set to */
};

/* Makes *record the drop of ticks first..last, all samples lost. DT_E_RANGE, DT_E_MEMORY. */
DT_MUST_USE int drop_open(struct record *record, uint32_t first_tick_ms, uint32_t last_tick_ms);

/* The samples of so many blocks one behind the other, tick being the first's place from 0: 7 of x, 10 of y
 * and z each. */
void drop_put(struct record *record, unsigned sensor, uint32_t tick, uint32_t ticks, const int16_t *x,
              const int16_t *y, const int16_t *z);

/* The opposite: false if the block is lost. A sample that was not taken is WIRE_SAMPLE_NOT_TAKEN. */
bool drop_get(const struct record *record, unsigned sensor, uint32_t tick, int16_t *x, int16_t *y,
              int16_t *z);

/* Whether a good sample of a drop can be of this value: a whole count, within full scale. */
bool drop_is_count(double value_g);

/* The sensors' range of a drop: by its parameters, if all of them are there and agree with their CRC-32, else
 * the tower's own. */
double drop_range_g(const struct record *record);

/* What a good sample of a drop is marked with: SAMPLE_CLIPPED beyond the channel's range, nothing within. */
uint8_t drop_mark(const struct channel *channel, double value_g);

/* The capture end as it must have come, with the record's seal. */
void drop_capture_end(const struct record *record, struct frame *frame);

/* Lists the gaps, compares the samples with record->crc32 if crc_known and the capture end with its seal,
 * puts range and clipped marks right, and finishes the record. crc_agrees is set before only by whoever has
 * compared the bytes that the samples are of. On DT_E_MEMORY the record is freed. */
DT_MUST_USE int drop_close(struct record *record);

/* Instead of drop_open to drop_close where nobody wants samples and gaps: a record without channels, of which
 * the blocks are counted and crc_agrees is of the bytes. DT_E_RANGE. */
DT_MUST_USE int drop_open_unheld(struct record *record, uint32_t first_tick_ms, uint32_t last_tick_ms);
void drop_close_unheld(struct record *record, uint32_t held);

/* Whether the channels are those of a drop of its ticks, whole blocks of them, with its range or, as
 * files had it before that was worked out, the tower's own, which drop_close puts right: 0, DT_E_RANGE for
 * the ticks, DT_E_FORMAT for the channels, DT_E_MEMORY. */
DT_MUST_USE int drop_check(const struct record *record);

/* Gives sensor and axis to the channels that have the names of a drop's. For those who know that they are:
 * what reads or simulates drops of the tower. drop_open and drop_close do it. */
void drop_set_axes(struct record *record);

/* Whether a channel is of the tower. */
bool drop_has_channel(const struct record *record);

/* Ticks of the window; the record must be a drop. */
uint32_t drop_ticks(const struct record *record);

#endif
