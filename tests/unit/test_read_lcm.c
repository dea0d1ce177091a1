/* SPDX-License-Identifier: GPL-3.0-or-later */
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
#include <lcm/lcm.h>

#include "common/wire.h"
#include "host/record/join.h"
#include "host/record/lcm_codec.h"
#include "host/record/lcm_log.h"
#include "host/record/log_walk.h"
#include "host/record/read.h"
#include "host/record/write.h"
#include "tests/unit/drop_by_hand.h"

static struct hand_drop drop;

/* The record of drop, but for the blocks of tick 10 to 12 of S2 if losses are asked for. */
static struct record make_record(bool losses)
{
	struct join *join = join_create();
	struct record record;
	struct frame frame;

	assert_non_null(join);
	for (uint32_t tick = 0; tick < drop.ticks; tick++) {
		for (unsigned sensor = 1; sensor <= 2; sensor++) {
			if (losses && sensor == 2 && tick >= 10 && tick <= 12)
				continue;
			hand_block(&drop, sensor, tick, false, &frame);
			join_feed(join, &frame);
			if (losses && tick == 20)
				join_feed(join, &frame); /* a counter that is not 0 */
		}
	}
	hand_capture_end(&drop, &frame);
	assert_int_equal(join_feed(join, &frame), 1);
	assert_int_equal(join_take(join, &record), 0);
	join_destroy(join);
	return record;
}

static void read_back(const char *file, struct record *record)
{
	char message[READ_MESSAGE_MAX] = "";

	if (read_record(record, file, NULL, message))
		fail_msg("%s", message);
	assert_string_equal(record->format, "lcm");
}

static int read_bytes(const void *bytes, size_t size, struct record *record, char *message)
{
	char *file = hand_file("", bytes, size);
	int error = read_record(record, file, NULL, message);

	hand_unlink(file);
	return error;
}

/* ---- messages ---- */

static void test_a_block_there_and_back(void **state)
{
	droptower_block block;
	struct frame frame, again = {0};

	(void)state;
	hand_fill(&drop, UINT32_MAX - 5, 10, 1);
	for (unsigned i = 0; i < 40; i++) {
		hand_block(&drop, 1 + i % 2, i / 4, i / 2 % 2, &frame);
		frame.time_us = 1000 + i;
		frame.data[6] = 0xF7; /* every status and io bit arrives */
		frame.data[8] = 0x80;
		frame.data[9] = hand_crc8(frame.data, 64, 9);
		assert_int_equal(lcm_codec_block(&frame, &block), 0);
		assert_int_equal(block.utime, 1000 + i);
		assert_int_equal(block.drop_id, 3);
		assert_int_equal(block.tick_ms, (uint32_t)(UINT32_MAX - 5 + i / 4));
		assert_int_equal(block.sensor, 1 + i % 2);
		assert_int_equal(block.resent, i / 2 % 2);
		assert_int_equal(block.status, 0xF7);
		assert_int_equal(block.io, 0x8000);
		assert_memory_equal(block.x, drop.sample[i % 2][i / 4], 14);
		assert_memory_equal(block.y, drop.sample[i % 2][i / 4] + 7, 20);
		assert_memory_equal(block.z, drop.sample[i % 2][i / 4] + 17, 20);
		assert_int_equal(lcm_codec_frame(&block, &again), 0);
		assert_memory_equal(&again, &frame, sizeof(frame));
	}
	frame.data[30] ^= 1;
	assert_int_equal(lcm_codec_block(&frame, &block), DT_E_CORRUPT);
	frame.length = 48;
	assert_int_equal(lcm_codec_block(&frame, &block), DT_E_LENGTH);
	frame.id = 0x681;
	assert_int_equal(lcm_codec_block(&frame, &block), DT_E_UNKNOWN);
}

static void test_blocks_that_do_not_fit_the_wire(void **state)
{
	const droptower_block good = {.sensor = 1};
	droptower_block bad[] = {good, good, good, good, good, good, good, good};
	struct frame frame = {.id = 77};

	(void)state;
	bad[0].sensor = 0;
	bad[1].sensor = 3;
	bad[2].drop_id = 65536;
	bad[3].drop_id = -1;
	bad[4].tick_ms = (int64_t)1 << 32;
	bad[5].tick_ms = -1;
	bad[6].status = 256;
	bad[7].io = -1;
	for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); i++)
		assert_int_equal(lcm_codec_frame(&bad[i], &frame), DT_E_RANGE);
	assert_int_equal(frame.id, 77);
	assert_int_equal(lcm_codec_frame(&good, &frame), 0);
}

static void test_a_status(void **state)
{
	struct frame frame = {
	        .id = 0x682, .length = 8, .time_us = 99, .data = {3, 2, 0x34, 0x12, 0x78, 0x96, 0xBC, 0x9A}};
	droptower_state message = {.utime = 5, .counter = 6, .result = -7, .drop_id = 8};

	(void)state;
	assert_int_equal(lcm_codec_state(&frame, &message), 0);
	assert_int_equal(message.state, 3);
	assert_int_equal(message.fault, 2);
	assert_int_equal(message.checks, 0x96781234); /* all 32, and no sign */
	assert_int_equal(message.io, 0x9ABC);
	assert_int_equal(message.utime, 5); /* what is the publisher's stays */
	assert_int_equal(message.counter, 6);
	assert_int_equal(message.result, -7);
	assert_int_equal(message.drop_id, 8);
	frame.id = 0x683;
	assert_int_equal(lcm_codec_state(&frame, &message), DT_E_UNKNOWN);
}

/* What is said of a drop without its samples is what its record says. */
static void check_outline(const droptower_drop *message, const struct record *record)
{
	struct log_capture of_record = {.number = 1}, of_outline = {.number = 2};
	struct record outline;

	assert_int_equal(lcm_codec_outline(message, &outline), 0);
	assert_int_equal(outline.channel_count, 0);
	assert_int_equal(outline.gap_count, 0);
	assert_int_equal(outline.flags & RECORD_FLAG_ALTERED, record->flags & RECORD_FLAG_ALTERED);
	log_capture_of_record(record, &of_record);
	log_capture_of_record(&outline, &of_outline);
	assert_true(log_capture_equal(&of_record, &of_outline));
	assert_int_equal(of_record.counters.corrupt, of_outline.counters.corrupt);
	record_free(&outline);
}

static void check_outline_of_cut(const uint8_t *bytes, size_t size)
{
	droptower_drop message;
	struct record record;

	if (lcm_codec_decode_drop(bytes, size, true, &message) != 0)
		return;
	assert_int_equal(lcm_codec_record(&message, &record), 0);
	check_outline(&message, &record);
	record_free(&record);
	lcm_codec_free_drop(&message);
}

static void test_a_drop_there_and_back(void **state)
{
	droptower_drop message, decoded, refused;
	struct record record, again;

	(void)state;
	for (int losses = 0; losses < 2; losses++) {
		uint8_t *bytes;
		int size;

		hand_fill(&drop, UINT32_MAX - 30, 50, 2);
		drop.sample[0][5][0] = -32768;
		drop.sample[1][6][26] = 16001;
		drop.marks = losses ? 1u << 1 : 0; /* no impact: the time of the trigger is unknown */
		record = make_record(losses);
		assert_int_equal(lcm_codec_drop(&record, 1234, &message), 0);
		assert_int_equal(message.utime, 1234);
		assert_int_equal(message.drop_id, 3);
		assert_int_equal(message.trigger_us, 10123); /* as sent, whatever the mark says of it */
		assert_int_equal(message.x_count, 350);
		assert_int_equal(message.s2_z[6 * 10 + 9], 16001);
		assert_int_equal(message.gap_count, losses);
		assert_int_equal(message.crc_agrees, !losses);
		size = droptower_drop_encoded_size(&message);
		bytes = malloc((size_t)size);
		assert_non_null(bytes);
		assert_int_equal(droptower_drop_encode(bytes, 0, size, &message), size);
		assert_int_equal(lcm_codec_decode_drop(bytes, (size_t)size, false, &decoded), 0);
		assert_int_equal(lcm_codec_record(&decoded, &again), 0);
		hand_check_equal(&again, &record);
		check_outline(&decoded, &record);
		for (int cut = 0; cut < size; cut++) { /* every truncation is refused */
			assert_int_equal(lcm_codec_decode_drop(bytes, (size_t)cut, false, &refused),
			                 DT_E_FORMAT);
			check_outline_of_cut(bytes, (size_t)cut);
		}
		lcm_codec_free_drop(&decoded);
		lcm_codec_free_drop(&message);
		free(bytes);
		record_free(&again);
		record.trigger_s =
		        NAN; /* not told, though a capture end was there: as a text that lost the line */
		record.marks = 0;
		assert_int_equal(lcm_codec_drop(&record, 1234, &message), 0);
		assert_int_equal(message.trigger_us, -1);
		lcm_codec_free_drop(&message);
		record.crc_known = false; /* nothing has told it then */
		assert_int_equal(lcm_codec_drop(&record, 1234, &message), 0);
		assert_int_equal(message.trigger_us, -1);
		lcm_codec_free_drop(&message);
		record_free(&record);
	}
}

static void test_drops_that_do_not_fit(void **state)
{
	struct record record, foreign;
	droptower_drop message, bad;

	(void)state;
	hand_fill(&drop, 1000, 20, 3);
	record = make_record(false);
	assert_int_equal(lcm_codec_drop(&record, 0, &message), 0);
	record_free(&record);
#define REFUSE(field, value)                                            \
	bad = message;                                                  \
	bad.field = value;                                              \
	assert_int_equal(lcm_codec_outline(&bad, &record), DT_E_RANGE); \
	assert_int_equal(lcm_codec_record(&bad, &record), DT_E_RANGE)
	REFUSE(drop_id, 70000);
	REFUSE(marks, -1);
	REFUSE(first_tick_ms, -1);
	REFUSE(first_tick_ms, 1001);
	REFUSE(last_tick_ms, (int64_t)1 << 40);
	REFUSE(crc32, -1);
	REFUSE(frame_speed_mm_s, 70000);
	REFUSE(x_count, 139);
	REFUSE(yz_count, 201);
	REFUSE(gap_count, 1000);
	for (int i = 0; i < 2; i++) {
		int64_t hostile = i ? -1 : ((int64_t)1 << 53) + 1;

		REFUSE(blocks, hostile);
		REFUSE(repeated, hostile);
		REFUSE(reordered, hostile);
		REFUSE(corrupt, hostile);
		REFUSE(gaps, hostile);
		REFUSE(resent, hostile);
		REFUSE(conflicting, hostile);
	}
#undef REFUSE
	message.crc_agrees = 0; /* not believed, computed */
	assert_int_equal(lcm_codec_record(&message, &record), 0);
	assert_true(record.crc_agrees);
	check_outline(&message, &record);
	record_free(&record);
	message.s2_y[17] ^= 1;
	message.crc_agrees = 1;
	assert_int_equal(lcm_codec_record(&message, &record), 0);
	assert_int_equal(record.flags, RECORD_FLAG_INCOMPLETE);
	check_outline(&message, &record);
	record_free(&record);
	message.seal ^= 1;
	message.blocks = 7; /* fewer than are there */
	assert_int_equal(lcm_codec_record(&message, &record), 0);
	assert_true(record.flags & RECORD_FLAG_ALTERED);
	check_outline(&message, &record);
	record_free(&record);
	lcm_codec_free_drop(&message);
	record_init(&foreign);
	assert_int_equal(lcm_codec_drop(&foreign, 0, &message), DT_E_ARGUMENT);
}

/* ---- logs ---- */

static void test_a_written_log(void **state)
{
	char message[READ_MESSAGE_MAX] = "", *file = hand_file(".lcm", "", 0), *bytes;
	struct record record, again;
	lcm_eventlog_event_t *event;
	lcm_eventlog_t *log;
	size_t size;

	(void)state;
	hand_fill(&drop, 1000, 500, 4);
	record = make_record(true);
	assert_int_equal(write_record(&record, file, message), 0);
	read_back(file, &again);
	hand_check_equal(&again, &record);
	/* the library reads it as well */
	log = lcm_eventlog_create(file, "r");
	assert_non_null(log);
	event = lcm_eventlog_read_next_event(log);
	assert_non_null(event);
	assert_string_equal(event->channel, "DT_DROP");
	assert_int_equal(event->timestamp, 1500000);
	assert_in_range(event->datalen, 54000, 60000);
	lcm_eventlog_free_event(event);
	event = lcm_eventlog_read_next_event(log);
	assert_non_null(event);
	assert_string_equal(event->channel, "DT_SEAL");
	lcm_eventlog_free_event(event);
	assert_null(lcm_eventlog_read_next_event(log));
	lcm_eventlog_destroy(log);
	assert_true(again.file_sealed);
	record_free(&again);
	/* what stands in place of the digits is not printed, whatever it is */
	bytes = hand_read(file, &size);
	bytes[size - 1] = '\n';
	assert_int_equal(read_bytes(bytes, size, &again, message), DT_E_CORRUPT);
	assert_non_null(strstr(message, ": altered: the seal of its drop is no SHA-256, expected "));
	assert_null(strchr(message, '\n'));
	free(bytes);
	record_free(&record);
	hand_unlink(file);
}

struct seen {
	unsigned drops;
	struct log_capture last;
};

static int see(void *context, const struct log_capture *capture, struct record *unwanted)
{
	struct seen *seen = context;

	assert_null(unwanted);
	seen->drops++;
	seen->last = *capture;
	return 0;
}

static void unlink_listed(char *file)
{
	char index[200];

	snprintf(index, sizeof(index), "%s.index", file);
	unlink(index);
	hand_unlink(file);
}

/* A list is of what the tower's own checksums prove; the file's is for who reads the samples. */
static void test_a_list_does_without_the_seal(void **state)
{
	char message[READ_MESSAGE_MAX] = "", *file = hand_file(".lcm", "", 0), *bytes, *altered;
	struct seen seen = {0};
	struct log_visitor visitor = {.context = &seen, .capture = see};
	struct record record;
	size_t size;

	(void)state;
	hand_fill(&drop, 1000, 50, 4);
	record = make_record(false);
	assert_int_equal(write_record(&record, file, message), 0);
	bytes = hand_read(file, &size);
	bytes[size - 1] ^= 1; /* of the seal's digits */
	altered = hand_file(".lcm", bytes, size);
	assert_int_equal(read_list(altered, &visitor, message), 0);
	assert_int_equal(seen.drops, 1);
	assert_true(seen.last.crc_agrees);
	assert_int_equal(seen.last.to, size);
	assert_int_equal(read_nth(&record, altered, NULL, 1, message), DT_E_CORRUPT);
	bytes[size - 1000] ^= 1; /* of a sample */
	unlink_listed(altered);
	altered = hand_file(".lcm", bytes, size);
	assert_int_equal(read_list(altered, &visitor, message), 0);
	assert_int_equal(seen.drops, 2);
	assert_false(seen.last.crc_agrees);
	free(bytes);
	record_free(&record);
	unlink_listed(altered);
	hand_unlink(file);
}

/* As frames it would have no capture end any more, and so no doubt either. */
static void test_an_altered_drop_is_no_log_of_frames(void **state)
{
	char message[READ_MESSAGE_MAX] = "", *log = hand_file(".log", "", 0),
	     *file = hand_file(".lcm", "", 0);
	struct record record, again;

	(void)state;
	hand_fill(&drop, 1000, 500, 4);
	record = make_record(true);
	record.seal ^= 1;
	record.seal_agrees = false;
	assert_int_equal(write_record(&record, file, message), 0);
	read_back(file, &again);
	assert_true(again.flags & RECORD_FLAG_ALTERED);
	assert_int_equal(write_record(&again, log, message), DT_E_ARGUMENT);
	assert_non_null(strstr(message, ": altered: the capture end is not what the tower sealed"));
	record_free(&again);
	record_free(&record);
	hand_unlink(file);
	hand_unlink(log);
}

/* A log that ends within its drop: the ticks that are whole are there, the others lost and marked. */
static void test_a_log_cut_in_its_drop(void **state)
{
	enum {
		TICKS = 16,
		SEAL = 28 + 7 + 7 + 64,
		MAC = 32,
		END = 1 + 8 + 8,
		PARAMETERS = 4 + 8 * 21,
		MEASURED = 1 + 12 + 8 + 8 + 2 + 4
	};
	enum { FRONT = 28 + 7 + 8 + 8 + 8 + 32 + 2 + 4 + 2 + END + PARAMETERS + MEASURED + 56 + 12 };
	char *file = hand_file(".lcm", "", 0), *bytes, message[READ_MESSAGE_MAX];
	struct record record, again;
	size_t size;
	unsigned whole = 0;

	(void)state;
	hand_fill(&drop, 1000, TICKS, 9);
	record = make_record(false);
	assert_int_equal(write_record(&record, file, message), 0);
	bytes = hand_read(file, &size);
	assert_int_equal(size, FRONT + 2 * 27 * 2 * TICKS + MAC + SEAL);
	size -= SEAL;
	for (size_t cut = 1; cut < size; cut++) {
		size_t samples = cut > FRONT ? (cut - FRONT) / 2 : 0;
		/* 7 X, 10 Y, 10 Z of all ticks of S1, then of S2 */
		size_t s1 = samples <= 17 * TICKS ? 0 : (samples - 17 * TICKS) / 10;
		size_t s2 = samples <= 44 * TICKS ? 0 : (samples - 44 * TICKS) / 10;
		bool held[2][HAND_TICKS_MAX] = {{false}};
		char *part = hand_file(".lcm", bytes, cut);
		int error = read_record(&again, part, NULL, message);

		s1 = s1 < TICKS ? s1 : TICKS;
		s2 = s2 < TICKS ? s2 : TICKS; /* behind these comes the MAC */
		assert_int_equal(error == 0, s1 > 0);
		if (!error) {
			for (size_t k = 0; k < TICKS; k++) {
				held[0][k] = k < s1;
				held[1][k] = k < s2;
			}
			hand_check_samples(&again, &drop, held);
			assert_int_equal(again.flags,
			                 s2 < TICKS ? RECORD_FLAG_INCOMPLETE | RECORD_FLAG_LOST : 0);
			assert_false(again.file_sealed);
			assert_int_equal(again.counters.corrupt, record.counters.corrupt + 1);
			assert_int_equal(again.drop_id, record.drop_id);
			record_free(&again);
			whole++;
		}
		hand_unlink(part);
	}
	assert_true(whole > size / 2);
	free(bytes);
	record_free(&record);
	hand_unlink(file);
}

/* A log as lcm-logger makes it, written by the library: blocks in that state, things of others, and drops if
 * asked. */
static char *make_log_in(unsigned wire_state, bool drops, size_t *size)
{
	char *file = hand_file(".lcm", "", 0), *bytes, block_channel[] = "DT_BLOCK", other[] = "OTHER";
	lcm_eventlog_t *log = lcm_eventlog_create(file, "w");
	uint8_t data[512];

	assert_non_null(log);
	for (unsigned i = 0; i < 2 * drop.ticks; i++) {
		lcm_eventlog_event_t event = {
		        .timestamp = 1000 * i, .channel = block_channel, .channellen = 8, .data = data};
		droptower_block block;
		struct frame frame;

		hand_block(&drop, 1 + i % 2, i / 2, false, &frame);
		assert_int_equal(lcm_codec_block(&frame, &block), 0);
		block.status = (int16_t)((block.status & ~15) | (int)wire_state);
		event.datalen = droptower_block_encode(data, 0, sizeof(data), &block);
		assert_true(event.datalen > 0);
		assert_int_equal(lcm_eventlog_write_event(log, &event), 0);
		if (i % 10 == 3) {
			event.channel = other;
			event.channellen = 5;
			assert_int_equal(lcm_eventlog_write_event(log, &event), 0);
		}
	}
	lcm_eventlog_destroy(log);
	bytes = hand_read(file, size);
	if (drops && wire_state != WIRE_STATE_CAPTURED)
		drop.drop_id++; /* that of the blocks never ended */
	if (drops) {
		struct record record = make_record(true);
		char message[READ_MESSAGE_MAX], *more;
		size_t more_size;

		assert_int_equal(write_record(&record, file, message), 0);
		more = hand_read(file, &more_size);
		bytes = realloc(bytes, *size + more_size);
		assert_non_null(bytes);
		memcpy(bytes + *size, more, more_size);
		*size += more_size;
		free(more);
		record_free(&record);
	}
	hand_unlink(file);
	return bytes;
}

static char *make_log(bool drops, size_t *size)
{
	return make_log_in(WIRE_STATE_CAPTURED, drops, size);
}

/* By its number it is read with its samples, whatever came before it. */
static void test_a_drop_behind_one_that_never_ended(void **state)
{
	char message[READ_MESSAGE_MAX] = "", *bytes, *file;
	struct record record, expected;
	size_t size;

	(void)state;
	hand_fill(&drop, 1000, 100, 7);
	bytes = make_log_in(WIRE_STATE_FALLING, true, &size);
	file = hand_file(".lcm", bytes, size);
	expected = make_record(true);
	assert_int_equal(read_nth(&record, file, NULL, 2, message), 0);
	hand_check_equal(&record, &expected);
	record_free(&record);
	assert_int_equal(read_nth(&record, file, NULL, 1, message), 0);
	assert_int_equal(record.drop_id, 3);
	assert_int_equal(record.flags, RECORD_FLAG_NO_CRC);
	record_free(&record);
	record_free(&expected);
	free(bytes);
	unlink_listed(file);
}

static void test_blocks_without_a_drop(void **state)
{
	char message[READ_MESSAGE_MAX] = "", *bytes;
	struct record record;
	size_t size;

	(void)state;
	hand_fill(&drop, 1000, 100, 5);
	bytes = make_log(false, &size);
	assert_int_equal(read_bytes(bytes, size, &record, message), 0);
	hand_check_samples(&record, &drop, NULL);
	assert_int_equal(record.flags, RECORD_FLAG_NO_CRC);
	assert_int_equal(record.counters.blocks, 200);
	assert_int_equal(record.counters.corrupt, 0);
	record_free(&record);
	free(bytes);
}

static void test_a_drop_goes_before_blocks(void **state)
{
	char message[READ_MESSAGE_MAX] = "", *bytes;
	struct record record, expected;
	size_t size;

	(void)state;
	hand_fill(&drop, 1000, 100, 6);
	expected = make_record(true);
	bytes = make_log(true, &size);
	assert_int_equal(read_bytes(bytes, size, &record, message), 0);
	hand_check_equal(&record, &expected);
	record_free(&record);
	record_free(&expected);
	free(bytes);
}

/* One bad byte ends the library's reader. Ours loses that event and no other. */
static void test_bad_bytes_cost_one_event_each(void **state)
{
	char message[READ_MESSAGE_MAX] = "", *bytes;
	struct record record;
	size_t size, event;

	(void)state;
	hand_fill(&drop, 1000, 100, 7);
	bytes = make_log(false, &size);
	event = 28 + 8 + 8 + 8 + 4 + 8 + 1 + 1 + 2 + 4 + 54; /* header, name, fingerprint, the fields */
	assert_memory_equal(bytes + event, "\xED\xA1\xDA\x01", 4);
	bytes[0] ^= 1;              /* tick 0 of S1: the sync word */
	bytes[event + 26] = 1;      /* tick 0 of S2: a length over the next events, */
	bytes[2 * event + 24] = 64; /* tick 1 of S1: and one beyond the end */
	assert_int_equal(read_bytes(bytes, size - 5, &record, message), 0);
	assert_int_equal(record.first_tick_ms, 1001);
	assert_int_equal(record.last_tick_ms, 1099);
	assert_int_equal(record.counters.blocks, 200 - 4);
	assert_int_equal(record.counters.corrupt, 2); /* three at the beginning in one stretch, the cut end */
	assert_int_equal(record.gap_count, 2);
	record_free(&record);
	free(bytes);
}

static void test_events_in_turn(void **state)
{
	struct log_file log = {.file = "log", .descriptor = -1}, text = {.file = "text", .descriptor = -1};
	struct lcm_log_walk walk = {0};
	struct lcm_log_event event;

	(void)state;
	hand_fill(&drop, 1000, 5, 8);
	log.whole.bytes = make_log(false, &log.whole.size);
	log.size = log.whole.size;
	assert_true(lcm_log_is(&log));
	for (unsigned i = 0; i < 10; i++) {
		assert_true(lcm_log_next(&log, &walk, &event));
		assert_string_equal(event.channel, "DT_BLOCK");
		assert_int_equal(event.time_us, 1000 * i);
		assert_int_equal(event.size, 90);
		if (i == 3) {
			assert_true(lcm_log_next(&log, &walk, &event));
			assert_string_equal(event.channel, "OTHER");
		}
	}
	assert_false(lcm_log_next(&log, &walk, &event));
	assert_int_equal(walk.events, 11);
	assert_int_equal(walk.skipped, 0);
	text.whole.bytes = log.whole.bytes + 4;
	text.size = text.whole.size = 40;
	assert_false(lcm_log_is(&text));
	free(log.whole.bytes);
}

static void test_refusals(void **state)
{
	char message[READ_MESSAGE_MAX] = "", *bytes;
	struct record record;
	size_t size;

	(void)state;
	hand_fill(&drop, 1000, 5, 9);
	bytes = make_log(false, &size);
	for (size_t i = 0; i + 8 < size; i++)
		if (memcmp(bytes + i, "DT_BLOCK", 8) == 0)
			bytes[i + 8] ^= 1; /* the fingerprint: another version's message */
	assert_int_equal(read_bytes(bytes, size, &record, message), DT_E_EMPTY);
	assert_non_null(strstr(message, ": no message of a drop tower in 11 events, 10 refused as damaged or "
	                                "of another version, expected DT_DROP"));
	free(bytes);
}

static void test_damage(void **state)
{
	size_t size;
	char *bytes;

	(void)state;
	hand_fill(&drop, 1000, 20, 10);
	bytes = make_log(true, &size);
	hand_fuzz(bytes, size, NULL, 43, 300);
	/* the drop message alone, so that most of the damage is to its counts */
	hand_fuzz(bytes + size - 1400, 1400, NULL, 44, 100);
	free(bytes);
	bytes = make_log(false, &size);
	hand_fuzz(bytes, size, NULL, 45, 300);
	free(bytes);
}

/* Every byte of the counts that the generated decoder would believe. */
static void test_damaged_counts(void **state)
{
	struct record record;
	droptower_drop message, decoded;
	uint8_t bytes[8192];
	int size;

	(void)state;
	hand_fill(&drop, 1000, 20, 11);
	record = make_record(true);
	assert_int_equal(lcm_codec_drop(&record, 0, &message), 0);
	size = droptower_drop_encode(bytes, 0, sizeof(bytes), &message);
	assert_true(size > 0);
	for (int at = 100; at < 160; at++) {
		for (int value = 1; value < 256; value++) {
			bytes[at] = (uint8_t)(bytes[at] ^ value);
			if (lcm_codec_decode_drop(bytes, (size_t)size, false, &decoded) == 0)
				lcm_codec_free_drop(&decoded);
			bytes[at] = (uint8_t)(bytes[at] ^ value);
		}
	}
	lcm_codec_free_drop(&message);
	record_free(&record);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(test_a_block_there_and_back),
	        cmocka_unit_test(test_blocks_that_do_not_fit_the_wire),
	        cmocka_unit_test(test_a_status),
	        cmocka_unit_test(test_a_drop_there_and_back),
	        cmocka_unit_test(test_drops_that_do_not_fit),
	        cmocka_unit_test(test_a_written_log),
	        cmocka_unit_test(test_a_list_does_without_the_seal),
	        cmocka_unit_test(test_an_altered_drop_is_no_log_of_frames),
	        cmocka_unit_test(test_a_log_cut_in_its_drop),
	        cmocka_unit_test(test_blocks_without_a_drop),
	        cmocka_unit_test(test_a_drop_behind_one_that_never_ended),
	        cmocka_unit_test(test_a_drop_goes_before_blocks),
	        cmocka_unit_test(test_bad_bytes_cost_one_event_each),
	        cmocka_unit_test(test_events_in_turn),
	        cmocka_unit_test(test_refusals),
	        cmocka_unit_test(test_damage),
	        cmocka_unit_test(test_damaged_counts),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
