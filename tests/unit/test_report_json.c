/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * A record and an analysis made by hand (report_by_hand.h), told as JSON. What is expected is worked out here
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

#include <cjson/cJSON.h>

#include "tests/unit/report_by_hand.h"

static cJSON *parse(const struct report *report)
{
	char *text = NULL;
	size_t length;
	FILE *out = open_memstream(&text, &length);
	cJSON *root;

	assert_non_null(out);
	assert_int_equal(report_json(report, out), 0);
	assert_int_equal(fclose(out), 0);
	assert_int_equal(strcspn(text, "\n"), length - 1); /* one line */
	root = cJSON_Parse(text);
	assert_non_null(root);
	free(text);
	return root;
}

/* The item at "a.b.2.c". */
static cJSON *item(cJSON *root, const char *path)
{
	char copy[128], *rest = copy;

	snprintf(copy, sizeof(copy), "%s", path);
	for (char *key = strsep(&rest, "."); key; key = strsep(&rest, ".")) {
		root = cJSON_IsArray(root) ? cJSON_GetArrayItem(root, atoi(key))
		                           : cJSON_GetObjectItemCaseSensitive(root, key);
		if (!root)
			fail_msg("%s: no %s", path, key);
	}
	return root;
}

static void check_number(cJSON *root, const char *path, double expected)
{
	cJSON *found = item(root, path);

	if (!cJSON_IsNumber(found) || !(found->valuedouble == expected))
		fail_msg("%s: %.17g, expected %.17g", path, found->valuedouble, expected);
}

static void check_string(cJSON *root, const char *path, const char *expected)
{
	cJSON *found = item(root, path);

	assert_true(cJSON_IsString(found));
	assert_string_equal(found->valuestring, expected);
}

static void check_json_channel(cJSON *root)
{
	check_string(root, "channels.0.name", "S1X");
	check_string(root, "channels.5.name", "S2Z");
	check_number(root, "channels.0.rate_hz", 7000);
	check_number(root, "channels.0.count", 3500);
	check_number(root, "channels.1.count", 5000);
	check_number(root, "channels.0.baseline.offset_g", 0.125);
	check_number(root, "channels.0.peak.value_g", 300.0 + 1.0 / 3.0);
	check_number(root, "channels.0.peak.sigma_g", 0.34);
	check_number(root, "channels.0.peak.time_s", 0.102 + 0.0015);
	check_number(root, "channels.0.peak.sigma_time_s", 1.1e-6);
	check_string(root, "channels.0.peak.method", "poly4/poly6");
	check_string(root, "channels.0.peak.status", "ok");
	check_number(root, "channels.3.pulse.duration_s", 0.0028);
	check_number(root, "channels.3.pulse.velocity_change_m_s", 5.7);
	check_number(root, "channels.3.ringdown.frequency_hz", 129.37);
	check_number(root, "channels.3.ringdown.sigma_damping", 1.0 / 7.0);
}

static void test_json(void **state)
{
	struct report_hand *f = *state;
	cJSON *root = parse(&f->report);

	check_string(root, "file", "drops/a \"quoted\" <name>.log");
	check_string(root, "format", "candump");
	assert_int_equal(cJSON_GetArraySize(item(root, "flags")), 0);
	check_number(root, "lost_samples", 0);
	check_number(root, "drop.drop_id", 7);
	check_number(root, "drop.camera_frame", 341);
	check_number(root, "drop.crc32", 4275878552.0);
	assert_true(cJSON_IsTrue(item(root, "drop.crc_agrees")));
	check_number(root, "drop.counters.blocks", 1000);
	check_number(root, "scene.angle_deg", 25);
	check_json_channel(root);
	check_string(root, "resultants.0.sensor", "S1");
	check_number(root, "resultants.1.peak_g", 500.25);
	assert_true(cJSON_IsFalse(item(root, "resultants.1.axes_coincide")));
	check_number(root, "lag.largest_peak_s", 0.002);
	check_number(root, "lag.cross_correlation_s", 0.0016);
	check_number(root, "plate.frequency_hz", 129.37);
	check_string(root, "plate.status", "ok");
	check_string(root, "model.fidelity", "sdof");
	check_string(root, "model.reason", "because it is by hand");
	check_number(root, "model.predicted.s1x_peak_g", 330.0);
	check_number(root, "model.predicted.lag_s", 0.0017);
	check_number(root, "model.predicted.velocity_change_m_s", 6.28125);
	check_number(root, "model.difference_percent.s1_resultant_g", 100.0 * (363.0 - 340.5) / 340.5);
	check_number(root, "model.difference_percent.plate_frequency_hz",
	             100.0 * (121.0 - 128.125) / 128.125);
	cJSON_Delete(root);
}

/* Numbers that a shorter print would change. */
static void test_json_keeps_every_digit(void **state)
{
	const double values[] = {0.1 + 0.2, 1.0 / 3.0,         4.9e-324, 1.7976931348623157e308,
	                         -2.5e-7,   100.00000000000001};
	struct report_hand *f = *state;

	for (size_t i = 0; i < sizeof(values) / sizeof(values[0]); i++) {
		cJSON *root;

		f->estimates[2].peak.value_g = values[i];
		root = parse(&f->report);
		check_number(root, "channels.2.peak.value_g", values[i]);
		cJSON_Delete(root);
	}
}

static void test_json_unknown_is_null(void **state)
{
	struct report_hand *f = *state;
	cJSON *root;

	f->estimates[0].peak.value_g = (double)NAN;
	f->estimates[0].peak.sigma_g = (double)INFINITY;
	f->estimates[0].peak.how.status = ESTIMATE_NO_PEAK;
	f->record.trigger_s = (double)NAN;
	root = parse(&f->report);
	assert_true(cJSON_IsNull(item(root, "channels.0.peak.value_g")));
	assert_true(cJSON_IsNull(item(root, "channels.0.peak.sigma_g")));
	check_string(root, "channels.0.peak.status", "no_peak");
	assert_true(cJSON_IsNull(item(root, "drop.trigger_s")));
	assert_true(cJSON_IsNull(item(root, "model.difference_percent.s1x_peak_g")));
	check_number(root, "model.predicted.s1x_peak_g", 330.0);
	cJSON_Delete(root);
}

static void test_json_foreign(void **state)
{
	static const char bad_utf8[] = "caf\xe9 \xc3\xa9 \xed\x9f\xbf\xff \xed\xa0\x80 \xf4\x90\x80\x80.csv";
	struct report_hand *f = *state;
	cJSON *root;

	f->record.is_drop = false;
	f->analysis.has_lag = false;
	f->analysis.has_plate = false;
	f->analysis.resultant_count = 0;
	f->report.scene = NULL;
	f->report.prediction = NULL;
	memcpy(f->record.file, bad_utf8, sizeof(bad_utf8));
	root = parse(&f->report);
	check_string(root, "file", "caf? \xc3\xa9 \xed\x9f\xbf? ??? ????.csv");
	assert_true(cJSON_IsNull(item(root, "drop")));
	assert_true(cJSON_IsNull(item(root, "scene")));
	assert_true(cJSON_IsNull(item(root, "lag")));
	assert_true(cJSON_IsNull(item(root, "plate")));
	assert_true(cJSON_IsNull(item(root, "model")));
	assert_int_equal(cJSON_GetArraySize(item(root, "resultants")), 0);
	cJSON_Delete(root);
}

static void test_json_of_holes(void **state)
{
	struct report_hand *f = *state;
	cJSON *root;

	report_make_holes(f);
	f->estimates[4].flags = RECORD_FLAG_UNEVEN; /* found by the analysis */
	root = parse(&f->report);
	check_number(root, "lost_samples", 54);
	check_string(root, "flags.3", "uneven_sampling");
	check_string(root, "channels.4.flags.0", "uneven_sampling");
	check_number(root, "drop.gaps.0.sensor", 1);
	check_number(root, "drop.gaps.0.first_tick_ms", 61338);
	check_number(root, "drop.gaps.0.last_tick_ms", 61339);
	check_number(root, "drop.counters.gaps", 3);
	assert_true(cJSON_IsFalse(item(root, "drop.crc_agrees")));
	check_string(root, "flags.0", "lost_samples");
	assert_true(cJSON_IsNull(item(root, "model.difference_percent.s2x_peak_g")));
	assert_true(cJSON_IsNumber(item(root, "model.difference_percent.s2y_peak_g")));
	cJSON_Delete(root);
}

/* How a value was got travels with it. */
static void test_json_how(void **state)
{
	struct report_hand *f = *state;
	cJSON *root;

	f->estimates[0].peak.how = (struct estimate_how){
	        .method = "half-sine",
	        .path = {"poly4/poly6", "half-sine"},
	        .chi_square = 1.25,
	        .flags = ESTIMATE_FLAG_EXTRAPOLATED | ESTIMATE_FLAG_TOLERANCE,
	        .status = ESTIMATE_CLIPPED,
	};
	f->analysis.lag.driven_s = 0.0019026;
	f->analysis.has_rebound = true;
	f->analysis.rebound = (struct estimate_rebound){.velocity_ratio = 0.5, .flight_ratio = (double)NAN};
	root = parse(&f->report);
	check_string(root, "channels.0.peak.method", "half-sine");
	check_string(root, "channels.0.peak.path.0", "poly4/poly6");
	check_string(root, "channels.0.peak.path.1", "half-sine");
	assert_int_equal(cJSON_GetArraySize(item(root, "channels.0.peak.path")), 2);
	check_number(root, "channels.0.peak.chi_square", 1.25);
	check_string(root, "channels.0.peak.flags.0", "extrapolated");
	check_string(root, "channels.0.peak.flags.1", "tolerance_not_met");
	check_string(root, "channels.0.peak.status", "clipped");
	check_string(root, "channels.1.pulse.contact.family", "auto");
	check_number(root, "lag.driven.lag_s", 0.0019026);
	check_number(root, "rebound.velocity_ratio", 0.5);
	assert_true(cJSON_IsNull(item(root, "rebound.flight_ratio")));
	cJSON_Delete(root);
}

/* What was done, in one line of the text and in the JSON; nothing of it of a foreign record's. */
static void check_processing(const struct report *report, const char *text, const char *filter,
                             double cutoff_hz, double undone_s)
{
	char *table = report_print(report), line[200];
	cJSON *root = parse(report);

	snprintf(line, sizeof(line), "\nprocessing: %s\n", text);
	if (text[0])
		report_check_has(table, line);
	assert_int_equal(report_count_of(table, "processing:"), text[0] ? 1 : 0);
	assert_int_equal(cJSON_IsNull(item(root, "processing.filter")), filter == NULL);
	assert_int_equal(cJSON_IsNull(item(root, "processing.cutoff_hz")), filter == NULL);
	if (filter) {
		check_string(root, "processing.filter", filter);
		check_number(root, "processing.cutoff_hz", cutoff_hz);
	}
	if (undone_s > 0)
		check_number(root, "processing.highpass_undone_s", undone_s);
	else
		assert_true(cJSON_IsNull(item(root, "processing.highpass_undone_s")));
	cJSON_Delete(root);
	free(table);
}

static void test_processing(void **state)
{
	struct report_hand *f = *state;
	struct estimate_options *done = &f->report.options;

	check_processing(&f->report, "", NULL, 0, 0); /* a scene without such sensors */
	f->scene.sensor_iepe_time_constant_s = 0.3;
	check_processing(&f->report, "sensor high-pass of 0.3 s not undone", NULL, 0, 0);
	done->iepe_time_constant_s = 0.25;
	check_processing(&f->report, "sensor high-pass of 0.25 s undone", NULL, 0, 0.25);
	done->cfc = 180;
	check_processing(&f->report, "filter CFC180; sensor high-pass of 0.25 s undone", "CFC180", 300, 0.25);
	done->lowpass_hz = 1650;
	check_processing(&f->report, "filter CFC180, lowpass 1650 Hz; sensor high-pass of 0.25 s undone",
	                 "CFC180, lowpass 1650 Hz", 300, 0.25);
	*done = (struct estimate_options){.lowpass_hz = 1650};
	f->report.scene = NULL;
	f->report.prediction = NULL;
	check_processing(&f->report,
	                 "filter lowpass 1650 Hz; sensor high-pass not undone, which takes --scene or --iepe",
	                 "lowpass 1650 Hz", 1650, 0);
	for (size_t i = 0; i < HAND_CHANNELS; i++)
		f->record.channels[i].sensor = 0;
	check_processing(&f->report, "filter lowpass 1650 Hz", "lowpass 1650 Hz", 1650, 0);
	done->lowpass_hz = 0;
	check_processing(&f->report, "", NULL, 0, 0);
}

/* One axis has no peak: nothing is said of the other's distance, and no "nan". */
static void test_resultant_of_one_axis(void **state)
{
	struct report_hand *f = *state;
	cJSON *root;
	char *text;

	for (size_t i = 0; i < 2; i++) {
		f->analysis.resultants[i].axes_coincide = false;
		f->analysis.resultants[i].axes_apart_s = (double)NAN;
	}
	text = report_print(&f->report);
	assert_null(strstr(text, "Y peaks"));
	report_check_has(text, "S2 XY");
	free(text);
	root = parse(&f->report);
	assert_true(cJSON_IsNull(item(root, "resultants.0.axes_apart_s")));
	cJSON_Delete(root);
}

/* A stream that takes nothing. */
static void test_write_errors(void **state)
{
	struct report_hand *f = *state;
	FILE *full = fopen("/dev/full", "w");

	assert_non_null(full);
	assert_int_equal(report_text(&f->report, full), DT_E_SYSTEM);
	clearerr(full);
	assert_int_equal(report_json(&f->report, full), DT_E_SYSTEM);
	fclose(full);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, report_set_up, report_tear_down)
	const struct CMUnitTest tests[] = {
	        TEST(test_json),         TEST(test_json_keeps_every_digit), TEST(test_json_unknown_is_null),
	        TEST(test_json_foreign), TEST(test_json_of_holes),          TEST(test_json_how),
	        TEST(test_processing),   TEST(test_resultant_of_one_axis),  TEST(test_write_errors),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
