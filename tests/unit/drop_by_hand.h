/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_UNIT_DROP_BY_HAND_H
#define DT_TESTS_UNIT_DROP_BY_HAND_H
/*
 * A drop whose every byte is made here from the wire's description, by none of the code under test: the
 * frames are laid out by hand and the checksums are computed bit by bit.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/frame.h"
#include "host/record/record.h"

enum { HAND_TICKS_MAX = 1024, HAND_PER_TICK = 27, HAND_PARAMETERS = 21 };

struct hand_drop {
	uint16_t drop_id, marks;
	uint32_t first_tick_ms, ticks;
	uint32_t trigger_us;
	uint16_t frame_speed_mm_s;
	int16_t camera_frame;
	uint32_t range_counts;                            /* parameter 0x2008 */
	int16_t sample[2][HAND_TICKS_MAX][HAND_PER_TICK]; /* 7 X, 10 Y, 10 Z */
};

/* xorshift64*; state must not be 0. */
uint32_t hand_random(uint64_t *state);

uint8_t hand_crc8(const uint8_t *bytes, size_t count, size_t skip);
uint32_t hand_crc32(const uint8_t *bytes, size_t count);

/* Random samples within the range of the sensor. */
void hand_fill(struct hand_drop *drop, uint32_t first_tick_ms, uint32_t ticks, uint64_t seed);

void hand_block(const struct hand_drop *drop, unsigned sensor, uint32_t tick, bool resent,
                struct frame *frame);
void hand_capture_end(const struct hand_drop *drop, struct frame *frame);
void hand_seal(struct frame *frame); /* again, after a change by hand */
/* What follows it: 0 what the drop measured, then the parameters. */
void hand_told(const struct hand_drop *drop, unsigned i, struct frame *frame);
uint32_t hand_drop_crc32(const struct hand_drop *drop);

/* candump -L text of a frame at time_us; returns its length. */
size_t hand_candump(const struct frame *frame, int64_t time_us, char line[256]);

/* Fails the test unless record holds exactly the samples of drop; a block whose held flag is false must be
 * lost. held NULL: all are held. */
void hand_check_samples(const struct record *record, const struct hand_drop *drop,
                        bool held[2][HAND_TICKS_MAX]);

/* Fails the test unless the two are equal in everything but file and format. NaN equals NaN. */
void hand_check_equal(const struct record *a, const struct record *b);

/* A file in the temporary folder; the name belongs to the caller until hand_unlink. */
char *hand_file(const char *ending, const void *bytes, size_t size);
void hand_unlink(char *file);

/* The whole of a file; *size bytes to be freed. */
char *hand_read(const char *file, size_t *size);

/* Damages the bytes in rounds different ways and reads each: a record or a one-line error that names the
 * file, never a crash. Prints the seed when it fails. */
void hand_fuzz(const void *bytes, size_t size, const char *columns, uint64_t seed, unsigned rounds);

#endif
