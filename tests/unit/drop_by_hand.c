/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/unit/drop_by_hand.h"

#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "host/record/read.h"

uint32_t hand_random(uint64_t *state)
{
	*state ^= *state >> 12;
	*state ^= *state << 25;
	*state ^= *state >> 27;
	return (uint32_t)(*state * 2685821657736338717u >> 32);
}

uint8_t hand_crc8(const uint8_t *bytes, size_t count, size_t skip)
{
	unsigned crc = 0xFF;

	for (size_t i = 0; i < count; i++) {
		if (i == skip)
			continue;
		crc ^= bytes[i];
		for (int bit = 0; bit < 8; bit++)
			crc = crc & 0x80 ? (crc << 1 ^ 0x2F) & 0xFF : crc << 1 & 0xFF;
	}
	return (uint8_t)(crc ^ 0xFF);
}

uint32_t hand_crc32(const uint8_t *bytes, size_t count)
{
	uint32_t crc = 0xFFFFFFFF;

	for (size_t i = 0; i < count; i++) {
		crc ^= bytes[i];
		for (int bit = 0; bit < 8; bit++)
			crc = crc & 1 ? crc >> 1 ^ 0xEDB88320 : crc >> 1;
	}
	return ~crc;
}

void hand_fill(struct hand_drop *drop, uint32_t first_tick_ms, uint32_t ticks, uint64_t seed)
{
	*drop = (struct hand_drop){.drop_id = 3,
	                           .first_tick_ms = first_tick_ms,
	                           .ticks = ticks,
	                           .trigger_us = ticks * 200 + 123,
	                           .frame_speed_mm_s = 3912,
	                           .camera_frame = 341,
	                           .range_counts = 16000};
	for (unsigned s = 0; s < 2; s++)
		for (uint32_t tick = 0; tick < ticks; tick++)
			for (unsigned i = 0; i < HAND_PER_TICK; i++)
				drop->sample[s][tick][i] =
				        (int16_t)((int)(hand_random(&seed) % 32001) - 16000);
}

static void put_le(uint8_t *to, uint32_t value, unsigned bytes)
{
	for (unsigned i = 0; i < bytes; i++)
		to[i] = (uint8_t)(value >> 8 * i);
}

void hand_block(const struct hand_drop *drop, unsigned sensor, uint32_t tick, bool resent,
                struct frame *frame)
{
	static const uint32_t ids[2][2] = {{0x181, 0x381}, {0x281, 0x481}};

	*frame = (struct frame){
	        .id = ids[sensor - 1][resent], .flags = FRAME_FD | FRAME_BRS, .length = 64, .time_us = 1};
	put_le(frame->data, drop->drop_id, 2);
	put_le(frame->data + 2, drop->first_tick_ms + tick, 4);
	frame->data[6] = 7; /* CAPTURED */
	for (unsigned i = 0; i < HAND_PER_TICK; i++)
		put_le(frame->data + 10 + 2 * i, (uint16_t)drop->sample[sensor - 1][tick][i], 2);
	frame->data[9] = hand_crc8(frame->data, 64, 9);
}

uint32_t hand_drop_crc32(const struct hand_drop *drop)
{
	uint8_t *bytes = malloc((size_t)drop->ticks * 108), *at = bytes;
	uint32_t crc;

	assert_non_null(bytes);
	for (uint32_t tick = 0; tick < drop->ticks; tick++)
		for (unsigned s = 0; s < 2; s++)
			for (unsigned i = 0; i < HAND_PER_TICK; i++, at += 2)
				put_le(at, (uint16_t)drop->sample[s][tick][i], 2);
	crc = hand_crc32(bytes, (size_t)drop->ticks * 108);
	free(bytes);
	return crc;
}

/* Not one is as at first, and each another. */
static uint32_t parameter(const struct hand_drop *drop, unsigned i)
{
	return i == 8 ? drop->range_counts : 100000 + 7 * i;
}

static uint32_t parameters_crc32(const struct hand_drop *drop)
{
	uint8_t bytes[4 * HAND_PARAMETERS];

	for (unsigned i = 0; i < HAND_PARAMETERS; i++)
		put_le(bytes + 4 * i, parameter(drop, i), 4);
	return hand_crc32(bytes, sizeof(bytes));
}

void hand_told(const struct hand_drop *drop, unsigned i, struct frame *frame)
{
	*frame = (struct frame){.id = 0x687, .flags = FRAME_FD | FRAME_BRS, .length = 8, .time_us = 1};
	put_le(frame->data, drop->drop_id, 2);
	if (i > 0) {
		put_le(frame->data + 2, 0x2000 + i - 1, 2);
		put_le(frame->data + 4, parameter(drop, i - 1), 4);
		return;
	}
	frame->id = 0x686;
	frame->length = 24;
	put_le(frame->data + 2, 8123, 2);    /* drop-out, us */
	put_le(frame->data + 4, 8000, 2);    /* used */
	put_le(frame->data + 6, 3870, 2);    /* mm/s */
	put_le(frame->data + 8, 780123, 4);  /* um */
	put_le(frame->data + 12, 9712, 2);   /* mm/s2 */
	put_le(frame->data + 14, 0xFFFF, 2); /* latch: not measured */
	put_le(frame->data + 16, 0xFFFD, 2); /* -3 ppm */
	put_le(frame->data + 18, 70, 2);     /* us */
	put_le(frame->data + 20, hand_crc32(frame->data, 20), 4);
}

void hand_seal(struct frame *frame)
{
	put_le(frame->data + 28, hand_crc32(frame->data, 28), 4);
}

void hand_capture_end(const struct hand_drop *drop, struct frame *frame)
{
	*frame = (struct frame){.id = 0x681, .flags = FRAME_FD | FRAME_BRS, .length = 32, .time_us = 1};
	put_le(frame->data, drop->drop_id, 2);
	put_le(frame->data + 2, drop->marks, 2);
	put_le(frame->data + 4, drop->first_tick_ms, 4);
	put_le(frame->data + 8, drop->first_tick_ms + drop->ticks - 1, 4);
	put_le(frame->data + 12, drop->trigger_us, 4);
	put_le(frame->data + 16, hand_drop_crc32(drop), 4);
	put_le(frame->data + 20, drop->frame_speed_mm_s, 2);
	put_le(frame->data + 22, (uint16_t)drop->camera_frame, 2);
	put_le(frame->data + 24, parameters_crc32(drop), 4);
	hand_seal(frame);
}

size_t hand_candump(const struct frame *frame, int64_t time_us, char line[256])
{
	int used = snprintf(line, 256, "(%lld.%06lld) can0 %03X#", (long long)(time_us / 1000000),
	                    (long long)(time_us % 1000000), frame->id);

	if (frame->flags & FRAME_FD)
		used += snprintf(line + used, 8, "#1");
	for (unsigned i = 0; i < frame->length; i++)
		used += snprintf(line + used, 8, "%02X", frame->data[i]);
	used += snprintf(line + used, 8, "\n");
	return (size_t)used;
}

void hand_check_samples(const struct record *record, const struct hand_drop *drop,
                        bool held[2][HAND_TICKS_MAX])
{
	static const char *const names[6] = {"S1X", "S1Y", "S1Z", "S2X", "S2Y", "S2Z"};

	assert_int_equal(record->channel_count, 6);
	for (unsigned c = 0; c < 6; c++) {
		const struct channel *channel = &record->channels[c];
		unsigned per_tick = c % 3 == 0 ? 7 : 10, at = c % 3 == 0 ? 0 : c % 3 == 1 ? 7 : 17;

		assert_string_equal(channel->name, names[c]);
		assert_int_equal(channel->count, drop->ticks * per_tick);
		assert_true(channel->rate_hz == 1000.0 * per_tick);
		assert_true(channel->start_s == 0);
		for (size_t k = 0; k < channel->count; k++) {
			int counts = drop->sample[c / 3][k / per_tick][at + k % per_tick];

			if (held && !held[c / 3][k / per_tick]) {
				assert_int_equal(channel->sample[k], SAMPLE_LOST);
				assert_true(isnan(channel->value_g[k]));
			} else if (counts == -32768) {
				assert_int_equal(channel->sample[k], SAMPLE_BAD);
				assert_true(isnan(channel->value_g[k]));
			} else {
				assert_int_equal(channel->sample[k],
				                 abs(counts) > 16000 ? SAMPLE_CLIPPED : 0);
				assert_true(channel->value_g[k] == counts * 0.03125);
			}
		}
	}
}

static bool same(double a, double b)
{
	return a == b || (isnan(a) && isnan(b));
}

void hand_check_equal(const struct record *a, const struct record *b)
{
	assert_int_equal(a->channel_count, b->channel_count);
	for (size_t c = 0; c < a->channel_count; c++) {
		const struct channel *p = &a->channels[c], *q = &b->channels[c];

		assert_string_equal(p->name, q->name);
		assert_true(p->rate_hz == q->rate_hz && p->start_s == q->start_s && p->range_g == q->range_g);
		assert_int_equal(p->flags, q->flags);
		assert_int_equal(p->count, q->count);
		assert_memory_equal(p->sample, q->sample, p->count);
		for (size_t k = 0; k < p->count; k++)
			assert_true(same(p->value_g[k], q->value_g[k]));
	}
	assert_int_equal(a->is_drop, b->is_drop);
	assert_int_equal(a->drop_id, b->drop_id);
	assert_int_equal(a->marks, b->marks);
	assert_int_equal(a->first_tick_ms, b->first_tick_ms);
	assert_int_equal(a->last_tick_ms, b->last_tick_ms);
	assert_true(same(a->trigger_s, b->trigger_s));
	assert_true(same(a->frame_speed_m_s, b->frame_speed_m_s));
	assert_int_equal(a->crc32, b->crc32);
	assert_int_equal(a->crc_known, b->crc_known);
	assert_int_equal(a->camera_frame, b->camera_frame);
	assert_int_equal(a->crc_agrees, b->crc_agrees);
	assert_int_equal(a->seal_known, b->seal_known);
	assert_int_equal(a->seal, b->seal);
	assert_int_equal(a->seal_agrees, b->seal_agrees);
	assert_int_equal(a->parameters_crc32, b->parameters_crc32);
	assert_int_equal(a->parameters_held, b->parameters_held);
	assert_int_equal(a->parameters_known, b->parameters_known);
	for (unsigned i = 0; i < HAND_PARAMETERS; i++)
		if (a->parameters_held >> i & 1)
			assert_int_equal(a->parameters[i], b->parameters[i]);
	assert_int_equal(a->measured_known, b->measured_known);
	if (a->measured_known) {
		assert_int_equal(a->measured.dropout_us, b->measured.dropout_us);
		assert_int_equal(a->measured.dropout_used_us, b->measured.dropout_used_us);
		assert_int_equal(a->measured.separation_mm_s, b->measured.separation_mm_s);
		assert_int_equal(a->measured.separation_um, b->measured.separation_um);
		assert_int_equal(a->measured.acceleration_mm_s2, b->measured.acceleration_mm_s2);
		assert_int_equal(a->measured.latch_delay_us, b->measured.latch_delay_us);
		assert_int_equal(a->measured.clock_ppm, b->measured.clock_ppm);
		assert_int_equal(a->measured.trigger_latency_us, b->measured.trigger_latency_us);
	}
	assert_memory_equal(&a->counters, &b->counters, sizeof(a->counters));
	assert_int_equal(a->gap_count, b->gap_count);
	for (size_t i = 0; i < a->gap_count; i++)
		assert_memory_equal(&a->gaps[i], &b->gaps[i], sizeof(a->gaps[i]));
	assert_int_equal(a->lost_samples, b->lost_samples);
	assert_int_equal(a->flags, b->flags);
}

char *hand_file(const char *ending, const void *bytes, size_t size)
{
	const char *folder = getenv("TMPDIR");
	size_t room = 64 + strlen(folder ? folder : "/tmp") + strlen(ending);
	char *file = malloc(room);
	int descriptor;

	assert_non_null(file);
	snprintf(file, room, "%s/droptower-XXXXXX%s", folder ? folder : "/tmp", ending);
	descriptor = mkstemps(file, (int)strlen(ending));
	assert_true(descriptor >= 0);
	assert_int_equal(write(descriptor, bytes, size), size);
	close(descriptor);
	return file;
}

void hand_unlink(char *file)
{
	unlink(file);
	free(file);
}

char *hand_read(const char *file, size_t *size)
{
	FILE *in = fopen(file, "rb");
	char *bytes;

	assert_non_null(in);
	fseek(in, 0, SEEK_END);
	*size = (size_t)ftell(in);
	rewind(in);
	bytes = malloc(*size + 1);
	assert_non_null(bytes);
	assert_int_equal(fread(bytes, 1, *size, in), *size);
	bytes[*size] = '\0';
	fclose(in);
	return bytes;
}

/* One of: bytes changed, a stretch cut out, the end cut off, a stretch repeated. */
static size_t damage(uint8_t *bytes, size_t size, uint64_t *random)
{
	size_t at = hand_random(random) % size, length = hand_random(random) % (size - at) + 1;

	switch (hand_random(random) % 4) {
	case 0:
		for (unsigned i = 1u << hand_random(random) % 8; i > 0; i--)
			bytes[hand_random(random) % size] = (uint8_t)hand_random(random);
		return size;
	case 1:
		memmove(bytes + at, bytes + at + length, size - at - length);
		return size - length;
	case 2:
		return at + 1;
	default:
		memmove(bytes + hand_random(random) % (size - length + 1), bytes + at, length);
		return size;
	}
}

void hand_fuzz(const void *bytes, size_t size, const char *columns, uint64_t seed, unsigned rounds)
{
	uint8_t *damaged = malloc(size);
	uint64_t random = seed;

	assert_non_null(damaged);
	print_message("# seed %llu\n", (unsigned long long)seed); /* before a crash */
	for (unsigned round = 0; round < rounds; round++) {
		char message[READ_MESSAGE_MAX] = "";
		struct record record;
		char *file;
		int error;

		memcpy(damaged, bytes, size);
		file = hand_file("", damaged, damage(damaged, size, &random));
		error = read_record(&record, file, columns, message);
		if (error == 0)
			record_free(&record);
		if (error > 0 || (error < 0 && strncmp(message, file, strlen(file)) != 0))
			fail_msg("seed %llu, round %u: %d \"%s\"", (unsigned long long)seed, round, error,
			         message);
		hand_unlink(file);
	}
	free(damaged);
}
