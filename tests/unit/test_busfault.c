/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <string.h>
#include <cmocka.h>

#include "common/wire.h"
#include "hil/busfault.h"

enum { FRAMES = 20000, SEED = 20240131 };

/* What came out: the number each frame carried in its data, and its identifier. */
static uint32_t numbers[2 * FRAMES];
static uint32_t ids[2 * FRAMES];

/* Passes FRAMES numbered frames with ids in turn (0: end of the list); returns how many came out. */
static unsigned pass_all(struct busfault *fault, const uint32_t turn[4])
{
	unsigned count = 0, next = 0;

	for (uint32_t i = 0; i < FRAMES; i++) {
		struct frame frame = {.id = turn[next], .length = 4, .flags = FRAME_FD};
		struct frame out[BUSFAULT_OUT_MAX];

		next = next < 3 && turn[next + 1] ? next + 1 : 0;
		memcpy(frame.data, &i, 4);
		for (unsigned k = 0, n = busfault_pass(fault, &frame, out); k < n; k++) {
			assert_true(n <= BUSFAULT_OUT_MAX);
			assert_int_equal(out[k].length, 4);
			assert_int_equal(out[k].flags, FRAME_FD);
			memcpy(&numbers[count], out[k].data, 4);
			ids[count++] = out[k].id;
		}
	}
	assert_true(fault->counters.taken == FRAMES);
	assert_true(fault->counters.given == count);
	assert_true(FRAMES + fault->counters.duplicated ==
	            count + fault->counters.lost + fault->counters.burst_lost + fault->counters.cut +
	                    busfault_held(fault));
	return count;
}

static unsigned pass_with(struct busfault_options options, uint64_t seed, struct busfault *fault)
{
	static const uint32_t turn[4] = {WIRE_ID_BLOCK_S1, WIRE_ID_BLOCK_S2, WIRE_ID_STATUS};

	print_message("seed %llu\n", (unsigned long long)seed);
	busfault_init(fault, &options, seed);
	return pass_all(fault, turn);
}

static void good_bus_changes_nothing(void **state)
{
	struct busfault fault;

	(void)state;
	assert_int_equal(pass_with((struct busfault_options){0}, SEED, &fault), FRAMES);
	for (uint32_t i = 0; i < FRAMES; i++)
		assert_int_equal(numbers[i], i);
}

/* 5 % of 20 000 is 1 000, standard deviation 30.8: five of them either way. */
static void loses_as_many_as_asked(void **state)
{
	struct busfault fault;
	unsigned count = pass_with((struct busfault_options){.loss = 0.05}, SEED, &fault);

	(void)state;
	assert_in_range(fault.counters.lost, 846, 1154);
	assert_int_equal(count, FRAMES - fault.counters.lost);
	for (unsigned i = 1; i < count; i++)
		assert_true(numbers[i] > numbers[i - 1]);
	assert_int_equal(pass_with((struct busfault_options){.loss = 1.0}, SEED, &fault), 0);
}

static void doubles_frames_side_by_side(void **state)
{
	struct busfault fault;
	unsigned count = pass_with((struct busfault_options){.duplicate = 0.05}, SEED, &fault);
	unsigned twice = 0;

	(void)state;
	assert_in_range(fault.counters.duplicated, 846, 1154);
	for (unsigned i = 1; i < count; i++) {
		assert_in_range(numbers[i], numbers[i - 1], numbers[i - 1] + 1);
		twice += numbers[i] == numbers[i - 1];
	}
	assert_int_equal(twice, fault.counters.duplicated);
	assert_int_equal(count, FRAMES + twice);
}

/* How many of the frames that came out before number i were sent after it. */
static unsigned passed_by(unsigned i)
{
	unsigned count = 0;

	for (unsigned k = i < 16 ? 0 : i - 16; k < i; k++)
		count += numbers[k] > numbers[i];
	return count;
}

/* A frame held back alone comes behind one, two or three others, each in a third of 200 cases (deviation 7).
 */
static void holds_back_behind_one_to_three(void **state)
{
	struct busfault fault;
	unsigned count = pass_with((struct busfault_options){.reorder = 0.01}, SEED, &fault);
	unsigned seen[17] = {0};

	(void)state;
	for (unsigned i = 0; i < count; i++)
		seen[passed_by(i)]++;
	for (unsigned d = 1; d <= 3; d++)
		assert_in_range(seen[d], 35, 100);
}

/* Every frame counted as reordered was passed, no other one was, and none is held for ever: before each of
 * three passing frames at most two others held back can be let go. */
static void counts_only_true_reorders(void **state)
{
	static const double probability[] = {0.05, 0.9, 1.0};
	struct busfault fault;

	(void)state;
	for (unsigned p = 0; p < 3; p++) {
		unsigned count =
		        pass_with((struct busfault_options){.reorder = probability[p]}, SEED, &fault);
		unsigned passed = 0;

		for (unsigned i = 0; i < count; i++) {
			assert_in_range(passed_by(i), 0, 9);
			passed += passed_by(i) > 0;
		}
		assert_in_range(passed, 500, FRAMES);
		assert_int_equal(passed, fault.counters.reordered - busfault_held(&fault));
	}
}

static void burst_takes_live_blocks_only(void **state)
{
	static const uint32_t turn[4] = {WIRE_ID_BLOCK_S1, WIRE_ID_BLOCK_S2, WIRE_ID_STATUS,
	                                 WIRE_ID_RESENT_S1};
	struct busfault_options options = {0};
	struct busfault fault;
	unsigned count;

	(void)state;
	busfault_init(&fault, &options, SEED);
	busfault_burst(&fault, 50);
	count = pass_all(&fault, turn);
	assert_int_equal(fault.counters.burst_lost, 50);
	assert_int_equal(count, FRAMES - 50);
	/* The first 50 blocks are the first 100 frames: of these only every third and fourth came through. */
	for (unsigned i = 0; i < 50; i++) {
		assert_int_equal(numbers[i], 4 * (i / 2) + 2 + i % 2);
		assert_int_equal(ids[i], i % 2 ? WIRE_ID_RESENT_S1 : WIRE_ID_STATUS);
	}
	assert_int_equal(numbers[50], 100);
}

static void cut_stops_resent_blocks_only(void **state)
{
	static const uint32_t turn[4] = {WIRE_ID_RESENT_S1, WIRE_ID_BLOCK_S1, WIRE_ID_RESENT_S2,
	                                 WIRE_ID_CAPTURE_END};
	struct busfault_options options = {.cut_resend = true};
	struct busfault fault;
	unsigned count;

	(void)state;
	busfault_init(&fault, &options, SEED);
	count = pass_all(&fault, turn);
	assert_int_equal(count, FRAMES / 2);
	assert_int_equal(fault.counters.cut, FRAMES / 2);
	for (unsigned i = 0; i < count; i++)
		assert_int_equal(ids[i], i % 2 ? WIRE_ID_CAPTURE_END : WIRE_ID_BLOCK_S1);
}

static void silence_takes_all_and_ends(void **state)
{
	static const uint32_t turn[4] = {WIRE_ID_BLOCK_S1, WIRE_ID_STATUS};
	struct busfault_options options = {0};
	struct busfault fault;

	(void)state;
	busfault_init(&fault, &options, SEED);
	busfault_silence(&fault, true);
	for (unsigned i = 0; i < 10; i++) {
		struct frame out[BUSFAULT_OUT_MAX], frame = {.id = turn[i % 2]};

		assert_int_equal(busfault_pass(&fault, &frame, out), 0);
	}
	assert_int_equal(fault.counters.silenced, 10);
	busfault_silence(&fault, false);
	fault.counters = (struct busfault_counters){0};
	assert_int_equal(pass_all(&fault, turn), FRAMES);
}

/* The same frames are lost whatever else is switched on, and other ones with another seed. */
static void seed_decides(void **state)
{
	static uint8_t lost[3][FRAMES];
	static const struct busfault_options options[3] = {
	        {.loss = 0.1}, {.loss = 0.1, .duplicate = 0.2}, {.loss = 0.1}};
	struct busfault fault;

	(void)state;
	for (unsigned run = 0; run < 3; run++) {
		unsigned count = pass_with(options[run], run == 2 ? SEED + 1 : SEED, &fault);

		memset(lost[run], 1, FRAMES);
		for (unsigned i = 0; i < count; i++)
			lost[run][numbers[i]] = 0;
	}
	assert_memory_equal(lost[0], lost[1], FRAMES);
	assert_memory_not_equal(lost[0], lost[2], FRAMES);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(good_bus_changes_nothing),
	        cmocka_unit_test(loses_as_many_as_asked),
	        cmocka_unit_test(doubles_frames_side_by_side),
	        cmocka_unit_test(holds_back_behind_one_to_three),
	        cmocka_unit_test(counts_only_true_reorders),
	        cmocka_unit_test(burst_takes_live_blocks_only),
	        cmocka_unit_test(cut_stops_resent_blocks_only),
	        cmocka_unit_test(silence_takes_all_and_ends),
	        cmocka_unit_test(seed_decides),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
