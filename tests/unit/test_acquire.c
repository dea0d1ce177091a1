/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Samples into ticks: every sample in its place, missing ones marked and counted, clipping, clocks, and the
 * bytes of a block.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <string.h>

#include "firmware/acquire.h"

static struct acquire acquire;
static struct parameters parameters;
static uint32_t counters[WIRE_COUNTERS];

static int begin(void **state)
{
	(void)state;
	memset(counters, 0, sizeof(counters));
	parameters_init(&parameters);
	acquire_init(&acquire, &parameters, counters);
	acquire_turn(&acquire);
	return acquire_close(&acquire) == 1 ? 0 : -1;
}

static void open_tick(uint32_t tick_ms)
{
	acquire_open(&acquire,
	             &(struct acquire_head){.tick_ms = tick_ms, .drop_id = 3, .io = 0xD234, .state = 5});
}

/* The next millisecond begins. */
static void close_tick(void)
{
	acquire_turn(&acquire);
	assert_int_equal(acquire_close(&acquire), 1);
}

static void give_x(int16_t s1, int16_t s2)
{
	acquire_x(&acquire, (const int16_t[]){s1, s2}, true);
}

static void give_yz(int16_t y1, int16_t z1, int16_t y2, int16_t z2)
{
	acquire_yz(&acquire, (const int16_t[]){y1, y2}, (const int16_t[]){z1, z2}, true);
}

/* Sample k of a channel is 100 x channel + k. */
static void fill_tick(unsigned x_count, unsigned yz_count)
{
	for (int k = 0; k < (int)x_count; k++)
		give_x((int16_t)(100 + k), (int16_t)(400 + k));
	for (int k = 0; k < (int)yz_count; k++)
		give_yz((int16_t)(200 + k), (int16_t)(300 + k), (int16_t)(500 + k), (int16_t)(600 + k));
}

static void samples_keep_their_places(void **state)
{
	struct acquire_tick tick;

	(void)state;
	assert_int_equal(acquire_take(&acquire, &tick), DT_E_EMPTY);
	open_tick(77);
	fill_tick(7, 10);
	assert_int_equal(acquire_take(&acquire, &tick), DT_E_EMPTY); /* not before it is closed */
	close_tick();
	assert_int_equal(acquire_take(&acquire, &tick), 0);
	assert_int_equal(tick.tick_ms, 77);
	assert_int_equal(tick.drop_id, 3);
	assert_int_equal(tick.io, 0xD234);
	assert_int_equal(tick.marks, 0);
	for (unsigned s = 0; s < 2; s++) {
		assert_int_equal(tick.status[s], 5);
		for (unsigned k = 0; k < 7; k++)
			assert_int_equal(tick.sensor[s].x[k], 100 + 300 * s + k);
		for (unsigned k = 0; k < 10; k++) {
			assert_int_equal(tick.sensor[s].y[k], 200 + 300 * s + k);
			assert_int_equal(tick.sensor[s].z[k], 300 + 300 * s + k);
		}
	}
	assert_int_equal(counters[WIRE_COUNTER_samples_overrun], 0);
}

static void missing_samples_are_marked_and_counted(void **state)
{
	struct acquire_tick tick;

	(void)state;
	open_tick(1);
	fill_tick(3, 4);
	acquire_x(&acquire, (const int16_t[]){1, 2}, false);
	acquire_yz(&acquire, (const int16_t[]){1, 2}, (const int16_t[]){3, 4}, false);
	give_x(55, 66);
	close_tick();
	assert_int_equal(acquire_take(&acquire, &tick), 0);
	assert_int_equal(tick.sensor[1].x[2], 402);
	assert_int_equal(tick.sensor[1].x[3], WIRE_SAMPLE_NOT_TAKEN);
	assert_int_equal(tick.sensor[1].x[4], 66);
	assert_int_equal(tick.sensor[0].x[5], WIRE_SAMPLE_NOT_TAKEN);
	assert_int_equal(tick.sensor[0].x[6], WIRE_SAMPLE_NOT_TAKEN);
	for (unsigned k = 4; k < 10; k++) {
		assert_int_equal(tick.sensor[0].y[k], WIRE_SAMPLE_NOT_TAKEN);
		assert_int_equal(tick.sensor[1].z[k], WIRE_SAMPLE_NOT_TAKEN);
	}
	assert_int_equal(tick.io, 0xD234);
	assert_int_equal(tick.marks, WIRE_MARK_OVERRUN);
	assert_int_equal(counters[WIRE_COUNTER_samples_overrun], 3 * 2 + 6 * 4);
	open_tick(2); /* one sample too many changes nothing */
	fill_tick(8, 11);
	close_tick();
	assert_int_equal(acquire_take(&acquire, &tick), 0);
	assert_int_equal(tick.sensor[0].x[6], 106);
	assert_int_equal(tick.sensor[0].y[0], 200);
	assert_int_equal(tick.marks, 0);
}

static void clipping_is_marked_per_axis_and_sensor(void **state)
{
	struct acquire_tick tick;

	(void)state;
	open_tick(1);
	for (unsigned k = 0; k < 7; k++)
		give_x(16000, k == 3 ? -16001 : 0); /* range: 16000 itself is inside */
	for (unsigned k = 0; k < 10; k++)
		give_yz(k == 0 ? 32767 : 0, 0, 0, k == 9 ? -32768 : 0);
	close_tick();
	assert_int_equal(acquire_take(&acquire, &tick), 0);
	assert_int_equal(tick.status[0], 5 | WIRE_STATUS_CLIP_Y);
	assert_int_equal(tick.status[1], 5 | WIRE_STATUS_CLIP_X | WIRE_STATUS_CLIP_Z);
	assert_int_equal(tick.marks, WIRE_MARK_CLIPPED | WIRE_MARK_FULL_SCALE);
	assert_int_equal(tick.sensor[1].z[9], -32767); /* -32768 would say: not taken */
	assert_int_equal(counters[WIRE_COUNTER_samples_clipped], 3);
	assert_int_equal(counters[WIRE_COUNTER_samples_full_scale], 2);
	assert_int_equal(counters[WIRE_COUNTER_samples_overrun], 0);
}

static void lost_bias_is_marked(void **state)
{
	static const uint16_t lost[] = {WIRE_IO_IEPE_S1, WIRE_IO_IEPE_S2, WIRE_IO_IEPE_S1 | WIRE_IO_IEPE_S2,
	                                0};
	struct acquire_tick tick;

	(void)state;
	for (size_t i = 0; i < sizeof(lost) / sizeof(lost[0]); i++) {
		acquire_open(&acquire, &(struct acquire_head){.io = (uint16_t)(0xFFFF & ~lost[i])});
		fill_tick(7, 10);
		close_tick();
		assert_int_equal(acquire_take(&acquire, &tick), 0);
		assert_int_equal(tick.marks, lost[i] ? WIRE_MARK_CABLE : 0);
	}
}

static void channels_by_number(void **state)
{
	struct acquire_tick tick;

	(void)state;
	open_tick(1);
	fill_tick(7, 10);
	close_tick();
	assert_int_equal(acquire_take(&acquire, &tick), 0);
	for (unsigned channel = 0; channel < 6; channel++) {
		unsigned count = 0;
		const int16_t *code = acquire_channel(&tick, channel, &count);

		assert_int_equal(count, channel % 3 ? 10 : 7);
		for (unsigned k = 0; k < count; k++)
			assert_int_equal(code[k], 100 * (channel + 1) + k);
	}
}

static void clocks_must_be_seven_to_ten(void **state)
{
	static const struct {
		unsigned x, yz;
		bool good;
	} runs[] = {{700, 1000, true},
	            {699, 1000, false},
	            {701, 1000, false},
	            {700, 999, false},
	            {700, 1000, true}};
	struct acquire_tick tick;

	(void)state;
	for (size_t i = 0; i < sizeof(runs) / sizeof(runs[0]); i++) {
		for (unsigned t = 0; t < 100; t++) {
			bool last = t == 99;

			open_tick(t);
			fill_tick(last ? runs[i].x - 693 : 7, last ? runs[i].yz - 990 : 10);
			close_tick();
			assert_int_equal(acquire_take(&acquire, &tick), 0);
		}
		assert_int_equal(acquire.clocks_good, runs[i].good);
	}
}

static void full_queue_is_counted(void **state)
{
	struct acquire_tick tick;

	(void)state;
	for (unsigned t = 0; t < ACQUIRE_QUEUE + 2; t++) {
		open_tick(t);
		fill_tick(7, 10);
		close_tick();
	}
	assert_int_equal(counters[WIRE_COUNTER_samples_overrun], 2 * 54);
	for (unsigned t = 0; t < ACQUIRE_QUEUE; t++) {
		assert_int_equal(acquire_take(&acquire, &tick), 0);
		assert_int_equal(tick.tick_ms, t);
	}
	assert_int_equal(acquire_take(&acquire, &tick), DT_E_EMPTY);
}

/* The samples go on while control has the millisecond before, and a call without a turn does nothing. */
static void pages_are_apart(void **state)
{
	struct acquire_tick tick;

	(void)state;
	open_tick(1);
	fill_tick(7, 10);
	acquire_turn(&acquire);
	give_x(-1, -2); /* of the next, before control has looked */
	give_yz(-3, -4, -5, -6);
	assert_int_equal(acquire_close(&acquire), 1);
	open_tick(2);
	assert_int_equal(acquire_close(&acquire), 0);
	for (unsigned k = 1; k < 10; k++) {
		if (k < 7)
			give_x(-1, -2);
		give_yz(-3, -4, -5, -6);
	}
	close_tick();
	assert_int_equal(acquire_take(&acquire, &tick), 0);
	assert_int_equal(tick.tick_ms, 1);
	assert_int_equal(tick.marks, 0);
	assert_int_equal(tick.sensor[0].x[0], 100);
	assert_int_equal(tick.sensor[1].z[0], 600);
	assert_int_equal(acquire_take(&acquire, &tick), 0);
	assert_int_equal(tick.tick_ms, 2);
	assert_int_equal(tick.marks, 0);
	assert_int_equal(tick.sensor[1].x[0], -2);
	assert_int_equal(tick.sensor[0].y[9], -3);
	assert_int_equal(acquire_take(&acquire, &tick), DT_E_EMPTY);
	assert_int_equal(counters[WIRE_COUNTER_samples_overrun], 0);
}

/* Control comes two milliseconds late: the first is whole, the second is lost and counted, the third goes on.
 */
static void late_control_is_counted(void **state)
{
	struct acquire_tick tick;

	(void)state;
	open_tick(1);
	fill_tick(7, 10);
	acquire_turn(&acquire);
	fill_tick(6, 9);
	acquire_turn(&acquire);
	give_x(-1, -2);
	give_yz(-3, -4, -5, -6);
	assert_int_equal(acquire_close(&acquire), 2);
	assert_int_equal(counters[WIRE_COUNTER_samples_overrun], 54);
	open_tick(3);
	for (unsigned k = 1; k < 10; k++) {
		if (k < 7)
			give_x(-1, -2);
		give_yz(-3, -4, -5, -6);
	}
	close_tick();
	assert_int_equal(acquire_take(&acquire, &tick), 0);
	assert_int_equal(tick.tick_ms, 1);
	assert_int_equal(tick.marks, 0);
	assert_int_equal(tick.sensor[0].x[6], 106);
	assert_int_equal(acquire_take(&acquire, &tick), 0);
	assert_int_equal(tick.tick_ms, 3);
	assert_int_equal(tick.marks, 0);
	assert_int_equal(tick.sensor[0].x[0], -1);
	assert_int_equal(tick.sensor[1].z[9], -6);
	assert_int_equal(acquire_take(&acquire, &tick), DT_E_EMPTY);
	assert_int_equal(counters[WIRE_COUNTER_samples_overrun], 54);
}

/* What comes before the first millisecond belongs to none. */
static void before_the_first_turn_nothing_counts(void **state)
{
	struct acquire_tick tick;

	(void)state;
	acquire_init(&acquire, &parameters, counters);
	assert_int_equal(acquire_close(&acquire), 0);
	fill_tick(5, 5);
	close_tick();
	open_tick(0);
	assert_int_equal(acquire_take(&acquire, &tick), DT_E_EMPTY);
	fill_tick(7, 10);
	close_tick();
	assert_int_equal(acquire_take(&acquire, &tick), 0);
	assert_int_equal(tick.tick_ms, 0);
	assert_int_equal(tick.marks, 0);
	assert_int_equal(counters[WIRE_COUNTER_samples_overrun], 0);
}

/* With the widest range a sample at full scale is not beyond it, and told all the same. */
static void full_scale_inside_the_range(void **state)
{
	struct acquire_tick tick;

	(void)state;
	parameters.value[WIRE_PARAMETER_range_counts] = 32767;
	open_tick(1);
	for (unsigned k = 0; k < 7; k++)
		give_x(k == 6 ? 32767 : 32766, -32766);
	for (unsigned k = 0; k < 10; k++)
		give_yz(0, 0, 0, 0);
	close_tick();
	assert_int_equal(acquire_take(&acquire, &tick), 0);
	assert_int_equal(tick.marks, WIRE_MARK_FULL_SCALE);
	assert_int_equal(tick.status[0], 5);
	assert_int_equal(counters[WIRE_COUNTER_samples_clipped], 0);
	assert_int_equal(counters[WIRE_COUNTER_samples_full_scale], 1);
}

static void block_has_the_bytes_of_the_wire(void **state)
{
	static const uint8_t head[9] = {3, 0, 0x04, 0x03, 0x02, 0x01, 5, 0x34, 0xD2};
	struct acquire_tick tick;
	struct frame frame;

	(void)state;
	open_tick(0x01020304);
	for (int k = 0; k < 7; k++)
		give_x(0, (int16_t)(0x1100 + k));
	for (int k = 0; k < 10; k++)
		give_yz(0, 0, (int16_t)(0x2200 + k), (int16_t)(-1 - k));
	close_tick();
	assert_int_equal(acquire_take(&acquire, &tick), 0);
	acquire_pack(&tick, 1, WIRE_ID_RESENT_S2, &frame);
	assert_int_equal(frame.id, 0x481);
	assert_int_equal(frame.length, 64);
	assert_memory_equal(frame.data, head, sizeof(head));
	assert_int_equal(wire_check_block(&frame), 0);
	for (unsigned k = 0; k < 7; k++) {
		assert_int_equal(frame.data[10 + 2 * k], k);
		assert_int_equal(frame.data[11 + 2 * k], 0x11);
	}
	for (unsigned k = 0; k < 10; k++) {
		assert_int_equal(frame.data[24 + 2 * k], k);
		assert_int_equal(frame.data[25 + 2 * k], 0x22);
		assert_int_equal(frame.data[44 + 2 * k], 0xFF - k);
		assert_int_equal(frame.data[45 + 2 * k], 0xFF);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test_setup(samples_keep_their_places, begin),
	        cmocka_unit_test_setup(missing_samples_are_marked_and_counted, begin),
	        cmocka_unit_test_setup(clipping_is_marked_per_axis_and_sensor, begin),
	        cmocka_unit_test_setup(lost_bias_is_marked, begin),
	        cmocka_unit_test_setup(channels_by_number, begin),
	        cmocka_unit_test_setup(clocks_must_be_seven_to_ten, begin),
	        cmocka_unit_test_setup(full_queue_is_counted, begin),
	        cmocka_unit_test_setup(pages_are_apart, begin),
	        cmocka_unit_test_setup(late_control_is_counted, begin),
	        cmocka_unit_test_setup(before_the_first_turn_nothing_counts, begin),
	        cmocka_unit_test_setup(full_scale_inside_the_range, begin),
	        cmocka_unit_test_setup(block_has_the_bytes_of_the_wire, begin),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
