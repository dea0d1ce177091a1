/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/log_capture.h"

#include <math.h>
#include <nettle/sha2.h>
#include <stdio.h>

#include "host/record/drop.h"

void log_capture_of_record(const struct record *record, struct log_capture *capture)
{
	capture->ended = record->crc_known;
	capture->drop_id = record->drop_id;
	capture->marks = record->marks;
	capture->first_tick_ms = record->first_tick_ms;
	capture->last_tick_ms = record->last_tick_ms;
	capture->crc32 = record->crc_known ? record->crc32 : 0;
	capture->frame_speed_mm_s =
	        isfinite(record->frame_speed_m_s) ? (uint16_t)lround(record->frame_speed_m_s * 1e3) : 0;
	capture->crc_agrees = record->crc_agrees;
	capture->seal_known = record->seal_known;
	capture->seal_agrees = record->seal_known && !(record->flags & RECORD_FLAG_ALTERED);
	capture->seal = record->seal_known ? record->seal : 0;
	capture->counters = record->counters;
}

uint32_t log_capture_blocks(const struct log_capture *capture)
{
	return WIRE_SENSORS * (capture->last_tick_ms - capture->first_tick_ms + 1);
}

uint32_t log_capture_missing(const struct log_capture *capture)
{
	uint64_t held = capture->counters.blocks;
	uint32_t all = log_capture_blocks(capture);

	return held < all ? all - (uint32_t)held : 0;
}

static bool counters_equal(const struct record_counters *a, const struct record_counters *b)
{
	return a->blocks == b->blocks && a->repeated == b->repeated && a->reordered == b->reordered &&
	       a->gaps == b->gaps && a->resent == b->resent && a->conflicting == b->conflicting;
}

bool log_capture_equal(const struct log_capture *a, const struct log_capture *b)
{
	return a->ended == b->ended && a->drop_id == b->drop_id && a->marks == b->marks &&
	       a->first_tick_ms == b->first_tick_ms && a->last_tick_ms == b->last_tick_ms &&
	       a->crc32 == b->crc32 && a->frame_speed_mm_s == b->frame_speed_mm_s &&
	       a->crc_agrees == b->crc_agrees && a->seal_known == b->seal_known &&
	       a->seal_agrees == b->seal_agrees && a->seal == b->seal &&
	       counters_equal(&a->counters, &b->counters);
}

/* Counts are what every format keeps: block by block, and whether it is held. */
static void hash_samples(const struct record *record, uint8_t digest[SHA256_DIGEST_SIZE])
{
	struct sha256_ctx hash;

	sha256_init(&hash);
	for (uint32_t tick = 0; tick < drop_ticks(record); tick++) {
		for (unsigned sensor = 1; sensor <= WIRE_SENSORS; sensor++) {
			struct wire_block block = {0};
			struct frame frame;
			uint8_t held = drop_get(record, sensor, tick, block.x, block.y, block.z);

			wire_pack_block(&frame, WIRE_ID_BLOCK_S1, &block);
			sha256_update(&hash, 1, &held);
			sha256_update(&hash, WIRE_SAMPLE_BYTES, frame.data + WIRE_SAMPLE_OFFSET);
		}
	}
	sha256_digest(&hash, SHA256_DIGEST_SIZE, digest);
}

void log_capture_key(const struct record *record, char key[LOG_CAPTURE_KEY_CHARS])
{
	uint8_t digest[SHA256_DIGEST_SIZE];
	int used = snprintf(key, LOG_CAPTURE_KEY_CHARS, "%u:%u-%u:", (unsigned)record->drop_id,
	                    (unsigned)record->first_tick_ms, (unsigned)record->last_tick_ms);

	if (record->crc_known) {
		snprintf(key + used, (size_t)(LOG_CAPTURE_KEY_CHARS - used), "%08x", (unsigned)record->crc32);
		return;
	}
	hash_samples(record, digest);
	for (unsigned i = 0; i < 16; i++) /* half of it names a capture well enough */
		used += snprintf(key + used, (size_t)(LOG_CAPTURE_KEY_CHARS - used), "%02x", digest[i]);
}

int64_t log_capture_time_s(const struct log_capture *capture)
{
	static const int64_t some_year_us = (int64_t)100000000 * 1000000;

	return capture->time_us > some_year_us ? capture->time_us / 1000000 : 0;
}
