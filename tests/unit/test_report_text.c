/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * A record and an analysis made by hand (report_by_hand.h), told as text. What is expected is worked out here
 * from the hand-made numbers, not taken from the report's own code.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/unit/report_by_hand.h"

/* One line for each flag, naming every value that carries it, and none for a value that is not there. */
static void test_text_notes(void **state)
{
	struct report_hand *f = *state;
	char *text;

	f->estimates[0].peak.how.flags = ESTIMATE_FLAG_EXTRAPOLATED;
	f->estimates[3].peak.how.flags = ESTIMATE_FLAG_EXTRAPOLATED | ESTIMATE_FLAG_SPIKE;
	f->estimates[4].peak.value_g = (double)NAN;
	f->estimates[4].peak.how.flags = ESTIMATE_FLAG_EXTRAPOLATED;
	text = report_print(&f->report);
	report_check_has(text, "note: S1X peak, S2X peak:");
	report_check_has(text, " clipped; the value follows");
	report_check_has(text, "note: S2X peak: outliers");
	assert_int_equal(report_count_of(text, "note: "), 2);
	free(text);
}

/* Lines end at 90 columns: "Model sdof," and a blank are 12, the stop is one, 77 are left. */
static void test_text_lines_fit_the_table(void **state)
{
	static const char end[] = "the last of them.\n";
	struct report_hand *f = *state;
	char line[128];

	for (size_t length = 77; length <= 78; length++) {
		char *text;

		memset(f->prediction.reason, 'x', length);
		strcpy(f->prediction.reason + length - strlen("the last of them"), "the last of them");
		f->prediction.reason[length - strlen(" the last of them")] = ' ';
		text = report_print(&f->report);
		snprintf(line, sizeof(line), "Model sdof, %.*s", (int)length - 5, f->prediction.reason);
		report_check_has(text, line);
		report_check_has(text, length == 77 ? end : "the last of\n  them.\n");
		free(text);
	}
	for (size_t i = 0; i < HAND_CHANNELS; i++)
		f->estimates[i].peak.how.flags = ESTIMATE_FLAG_EXTRAPOLATED | ESTIMATE_FLAG_GAPS;
	{
		char *text = report_print(&f->report);

		for (const char *at = strstr(text, "note:"); at && *at; at += strcspn(at, "\n") + 1)
			assert_in_range(strcspn(at, "\n"), 0, 90);
		free(text);
	}
}

static void test_text(void **state)
{
	struct report_hand *f = *state;
	char *text = report_print(&f->report);

	report_check_has(text, "complete: every sample arrived");
	report_check_has(text, "drop 7");
	report_check_has(text, "25 deg, from 0.894 m");
	report_check_has(text,
	                 "300.33    0.34     3.500     1.1     2.800     5.700"); /* 103.5 ms, 0 at 100 ms */
	report_check_has(text, "500.25");
	report_check_has(text, "Y peaks -0.400 ms after X");
	report_check_has(text, "first 1.900");
	report_check_has(text, "largest 2.000");
	report_check_has(text, "correlation 1.600");
	report_check_has(text, "129.37 +- 0.02 Hz");
	report_check_has(text, "128.12");
	report_check_has(text, "because it is by hand");
	report_check_has(text, "363.0      340.5      0.4       +6.6 %");
	report_check_has(text, "S2X leaves 10 % of its peak");
	report_check_has(
	        text, "1 000 Hz video: time 0 is in frame 441, S2 X peaks in 442.\n"); /* 341 + 100, 101.5 */
	assert_null(strstr(text, "frames:"));
	free(text);
}

static void test_text_of_holes(void **state)
{
	struct report_hand *f = *state;
	char *text;

	report_make_holes(f);
	f->estimates[4].peak.value_g = (double)NAN;
	f->estimates[4].peak.how.status = ESTIMATE_NO_PEAK;
	text = report_print(&f->report);
	report_check_has(text, "INCOMPLETE: 54 samples lost in 1 gap, 2 blocks");
	report_check_has(text, "lost_samples:");
	report_check_has(text, "clipped:");
	report_check_has(text, "no_peak");
	report_check_has(text, "missing: S1 tick 61338 to 61339");
	report_check_has(text, "3 gaps");
	free(text);
}

static void test_verdicts(void **state)
{
	struct report_hand *f = *state;
	char line[160];

	assert_true(report_verdict(&f->report, line, sizeof(line)));
	f->record.crc_agrees = false;
	assert_false(report_verdict(&f->report, line, sizeof(line)));
	report_check_has(line, "CORRUPT");
	f->record.crc_known = false;
	assert_false(report_verdict(&f->report, line, sizeof(line)));
	assert_string_equal(line,
	                    "UNPROVEN: ends at tick 61733 (0.500 s) without a capture end; nothing says "
	                    "what the tower sent");
	f->record.is_drop = false;
	assert_true(report_verdict(&f->report, line, sizeof(line)));
	f->record.lost_samples = 3;
	assert_false(report_verdict(&f->report, line, sizeof(line)));
	assert_string_equal(line, "INCOMPLETE: 3 samples lost");
	f->record.lost_samples = 1;
	assert_false(report_verdict(&f->report, line, sizeof(line)));
	assert_string_equal(line, "INCOMPLETE: 1 sample lost");
}

/* A log that was cut off says where, and counts one as one. */
static void test_verdict_of_a_cut_log(void **state)
{
	struct report_hand *f = *state;
	char line[160], *text;

	report_make_holes(f);
	f->record.gaps[0].last_tick_ms = f->record.gaps[0].first_tick_ms;
	f->record.lost_samples = 27;
	f->record.crc_known = false;
	f->record.counters.gaps = 1;
	assert_false(report_verdict(&f->report, line, sizeof(line)));
	assert_string_equal(line,
	                    "INCOMPLETE: ends at tick 61733 (0.500 s) without a capture end; 27 samples "
	                    "lost in 1 gap, 1 block");
	text = report_print(&f->report);
	report_check_has(text, "1000 blocks held, 1 gap, ");
	free(text);
}

/* A flag that some channels have and others have not names those. */
static void test_text_names_flagged_channels(void **state)
{
	struct report_hand *f = *state;
	char *text;

	f->estimates[0].flags = f->estimates[3].flags = RECORD_FLAG_UNFILTERED;
	for (size_t i = 0; i < HAND_CHANNELS; i++)
		f->estimates[i].flags |= RECORD_FLAG_SHORT;
	text = report_print(&f->report);
	report_check_has(
	        text,
	        "  unfiltered: sampled too slowly for the low-pass asked for; left as it was (S1X, S2X)\n");
	report_check_has(text, "has hardly a sample\n");
	free(text);
}

/* The model counts cycles: it is held against what was counted, or against the fit where nothing was. */
static void test_frequency_against_model(void **state)
{
	struct report_hand *f = *state;
	char *text = report_print(&f->report);

	report_check_has(text, "plate, 3 cycles   Hz     121.00     128.12        -       -5.6 %");
	free(text);
	f->analysis.plate.three_cycle_frequency_hz = (double)NAN;
	text = report_print(&f->report);
	report_check_has(text, "plate frequency   Hz     121.00     129.37     0.02       -6.5 %");
	free(text);
}

static void test_video_frames(void **state)
{
	struct report_hand *f = *state;
	struct report_zero zero = {.time_s = 0.0123};
	char line[96];
	long frame;

	f->record.camera_frame = -13; /* the window begins before the release */
	assert_true(report_video(&f->report, &zero, line, sizeof(line)));
	assert_string_equal(line, "1 000 Hz video: time 0 is in frame -1, S2 X peaks in 88");
	assert_true(report_video_frame(&f->report, 0.01301, &frame));
	assert_int_equal(frame, 0);
	f->estimates[3].peak.time_s = (double)NAN;
	assert_true(report_video(&f->report, &zero, line, sizeof(line)));
	assert_string_equal(line, "1 000 Hz video: time 0 is in frame -1");
	assert_false(report_video_frame(&f->report, (double)NAN, &frame));
	f->record.crc_known = false;
	assert_false(report_video(&f->report, &zero, line, sizeof(line)));
	assert_string_equal(line, "");
	f->record.crc_known = true;
	f->record.is_drop = false;
	assert_false(report_video(&f->report, &zero, line, sizeof(line)));
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, report_set_up, report_tear_down)
	const struct CMUnitTest tests[] = {
	        TEST(test_text_notes),
	        TEST(test_text_lines_fit_the_table),
	        TEST(test_text),
	        TEST(test_text_of_holes),
	        TEST(test_verdicts),
	        TEST(test_verdict_of_a_cut_log),
	        TEST(test_text_names_flagged_channels),
	        TEST(test_frequency_against_model),
	        TEST(test_video_frames),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
