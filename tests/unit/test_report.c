/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * A record and an analysis made by hand, told as text, JSON, page and gnuplot script. What is expected is
 * worked out here from the hand-made numbers, not taken from the report's own code.
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
#include <sys/stat.h>
#include <unistd.h>

#include <cjson/cJSON.h>

#include "common/wire.h"
#include "host/record/drop.h"
#include "host/report/facts.h"
#include "host/report/picture.h"
#include "host/report/traces.h"
#include "tests/unit/scratch.h"

enum { CHANNELS = 6 };

struct fixture {
	struct record record;
	struct analysis analysis;
	struct estimate_channel estimates[CHANNELS];
	struct scene scene;
	struct model_prediction prediction;
	struct report report;
};

static const struct estimate_ringdown ring = {
        .frequency_hz = 129.37,
        .sigma_hz = 0.02,
        .natural_frequency_hz = 130.02,
        .damping_ratio = 0.1,
        .sigma_damping = 1.0 / 7.0,
        .small_swing_hz = (double)NAN,
        .second_frequency_hz = (double)NAN,
        .three_cycle_frequency_hz = 128.125,
        .how = {.method = "least_squares", .status = ESTIMATE_OK},
};

/* Half-sine of 3 ms at 100 ms; S1 later and smaller. */
static void make_channel(struct fixture *f, size_t i, const char *name)
{
	double rate_hz = name[2] == 'X' ? 7000.0 : 10000.0, peak_g = name[1] == '1' ? 300.0 : 450.0;
	double at_s = name[1] == '1' ? 0.102 : 0.100;
	struct channel *c = record_add_channel(&f->record, name, rate_hz, (size_t)(rate_hz / 2.0));

	assert_non_null(c);
	c->range_g = 500.0;
	for (size_t k = 0; k < c->count; k++) {
		double t = ((double)k / rate_hz - at_s) / 0.003;

		c->value_g[k] = t > 0.0 && t < 1.0 ? peak_g * sin(3.14159265358979 * t) : 0.0;
		c->sample[k] = 0;
	}
	f->estimates[i] = (struct estimate_channel){
	        .baseline = {.offset_g = 0.125, .noise_g = 1.0, .samples = 600},
	        .peak = {peak_g + 1.0 / 3.0,
	                 0.34,
	                 at_s + 0.0015,
	                 1.1e-6,
	                 {.method = "poly4/poly6", .status = ESTIMATE_OK}},
	        .pulse = {.duration_s = 0.0028,
	                  .sigma_duration_s = 1e-5,
	                  .velocity_change_m_s = 5.7,
	                  .sigma_velocity_m_s = 0.01,
	                  .start_s = at_s,
	                  .end_s = at_s + 0.0028,
	                  .status = ESTIMATE_OK},
	        .ringdown = ring,
	};
}

static void make_scene(struct fixture *f)
{
	f->scene = (struct scene){
	        .name = "hand-made",
	        .title = "Box <b>& \"plate\"</b>",
	        .drop_height_m = 0.894,
	        .drop_angle_deg = 25.0,
	        .product_case_mass_kg = 0.169,
	        .product_length_m = 0.289,
	        .product_width_m = 0.101,
	        .product_balance_angle_deg = 25.0,
	        .product_inertia_ratio = 1.0,
	        .contact_duration_s = 0.003,
	        .contact_duration_height_m = 0.894,
	        .contact_mass_kg = 0.169,
	        .contact_restitution = 0.5,
	        .mount_plate_mass_kg = 0.014,
	        .mount_stiffness_n_m = 7550.0,
	        .mount_damping_ratio = 0.1,
	        .sensor_s2_offset_m = 0.065,
	};
	f->prediction = (struct model_prediction){
	        .fidelity = "sdof",
	        .reason = "because it is by hand",
	        .has_plate = true,
	        .impact_speed_m_s = 4.1875,
	        .velocity_change_m_s = 6.28125,
	        .contact_time_s = 0.003,
	        .plate_frequency_hz = 121.0,
	        .plate_damping_ratio = 0.1,
	        .peak = {{330.0, 0.0032}, {150.0, 0.0032}, {300.0, 0.0015}, {140.0, 0.0015}},
	        .resultant = {{363.0, 0.0032}, {331.0, 0.0015}},
	        .lag_s = 0.0017,
	};
}

static int set_up(void **state)
{
	static const char *const names[CHANNELS] = {"S1X", "S1Y", "S1Z", "S2X", "S2Y", "S2Z"};
	struct fixture *f = calloc(1, sizeof(*f));

	assert_non_null(f);
	record_init(&f->record);
	snprintf(f->record.file, sizeof(f->record.file), "drops/a \"quoted\" <name>.log");
	snprintf(f->record.format, sizeof(f->record.format), "candump");
	f->record.is_drop = true;
	f->record.drop_id = 7;
	f->record.first_tick_ms = 61234;
	f->record.last_tick_ms = 61733;
	f->record.trigger_s = 0.1004;
	f->record.frame_speed_m_s = 3.703;
	f->record.crc32 = 0xFEDCBA98u;
	f->record.camera_frame = 341;
	f->record.crc_known = true;
	f->record.crc_agrees = true;
	f->record.counters.blocks = 1000;
	for (size_t i = 0; i < CHANNELS; i++)
		make_channel(f, i, names[i]);
	drop_set_axes(&f->record);
	f->analysis = (struct analysis){
	        .channels = f->estimates,
	        .channel_count = CHANNELS,
	        .resultants = {{.sensor = "S1",
	                        .peak_g = 340.5,
	                        .sigma_g = 0.4,
	                        .time_s = 0.1035,
	                        .sigma_time_s = 2e-6,
	                        .axes_coincide = true,
	                        .axes_apart_s = 1e-5},
	                       {.sensor = "S2",
	                        .peak_g = 500.25,
	                        .sigma_g = 0.5,
	                        .time_s = 0.1015,
	                        .sigma_time_s = 2e-6,
	                        .axes_apart_s = -4e-4}},
	        .resultant_count = 2,
	        .has_lag = true,
	        .lag = {.first_peak_s = 0.0019,
	                .largest_peak_s = 0.002,
	                .cross_correlation_s = 0.0016,
	                .spread_s = 0.0004,
	                .sigma_s = 1e-6},
	        .has_plate = true,
	        .plate = ring,
	};
	make_scene(f);
	f->report = (struct report){.record = &f->record,
	                            .analysis = &f->analysis,
	                            .scene = &f->scene,
	                            .prediction = &f->prediction,
	                            .version = "test <version>"};
	*state = f;
	return 0;
}

static int tear_down(void **state)
{
	struct fixture *f = *state;

	record_free(&f->record);
	free(f);
	return 0;
}

/* ---- JSON ---- */

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
	struct fixture *f = *state;
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
	struct fixture *f = *state;

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
	struct fixture *f = *state;
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
	struct fixture *f = *state;
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

/* ---- a drop with holes ---- */

/* Takes ticks 104 and 105 of S1 away and marks an S2 sample as clipped. */
static void make_holes(struct fixture *f)
{
	f->record.gaps = calloc(1, sizeof(*f->record.gaps));
	assert_non_null(f->record.gaps);
	f->record.gaps[0] = (struct record_gap){1, 61338, 61339};
	f->record.gap_count = 1;
	f->record.crc_agrees = false;
	f->record.counters.gaps = 3;
	for (size_t i = 0; i < 3; i++) {
		struct channel *c = &f->record.channels[i];

		for (size_t k = 0; k < c->count; k++)
			if (k / (size_t)(c->rate_hz / 1000.0) - 104 < 2) {
				c->sample[k] = SAMPLE_LOST;
				c->value_g[k] = (double)NAN;
			}
	}
	f->record.channels[3].sample[710] |= SAMPLE_CLIPPED;
	f->estimates[3].peak.how.status = ESTIMATE_CLIPPED;
	record_finish(&f->record);
}

static void test_json_of_holes(void **state)
{
	struct fixture *f = *state;
	cJSON *root;

	make_holes(f);
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
	struct fixture *f = *state;
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

/* ---- text ---- */

static char *print(const struct report *report)
{
	char *text = NULL;
	size_t length;
	FILE *out = open_memstream(&text, &length);

	assert_non_null(out);
	assert_int_equal(report_text(report, out), 0);
	assert_int_equal(fclose(out), 0);
	for (const char *s = text; *s; s += strcspn(s, "\n") + 1)
		if (strcspn(s, "\n") > 110)
			fail_msg("line too long: %.*s", (int)strcspn(s, "\n"), s);
	assert_null(strstr(text, "nan"));
	return text;
}

static size_t count_of(const char *text, const char *piece)
{
	size_t count = 0;

	for (const char *s = strstr(text, piece); s; s = strstr(s + 1, piece))
		count++;
	return count;
}

static void check_has(const char *text, const char *piece)
{
	if (!strstr(text, piece))
		fail_msg("\"%s\" is not in:\n%s", piece, text);
}

/* One line for each flag, naming every value that carries it, and none for a value that is not there. */
static void test_text_notes(void **state)
{
	struct fixture *f = *state;
	char *text;

	f->estimates[0].peak.how.flags = ESTIMATE_FLAG_EXTRAPOLATED;
	f->estimates[3].peak.how.flags = ESTIMATE_FLAG_EXTRAPOLATED | ESTIMATE_FLAG_SPIKE;
	f->estimates[4].peak.value_g = (double)NAN;
	f->estimates[4].peak.how.flags = ESTIMATE_FLAG_EXTRAPOLATED;
	text = print(&f->report);
	check_has(text, "note: S1X peak, S2X peak:");
	check_has(text, " clipped; the value follows");
	check_has(text, "note: S2X peak: outliers");
	assert_int_equal(count_of(text, "note: "), 2);
	free(text);
}

/* Lines end at 90 columns: "Model sdof," and a blank are 12, the stop is one, 77 are left. */
static void test_text_lines_fit_the_table(void **state)
{
	static const char end[] = "the last of them.\n";
	struct fixture *f = *state;
	char line[128];

	for (size_t length = 77; length <= 78; length++) {
		char *text;

		memset(f->prediction.reason, 'x', length);
		strcpy(f->prediction.reason + length - strlen("the last of them"), "the last of them");
		f->prediction.reason[length - strlen(" the last of them")] = ' ';
		text = print(&f->report);
		snprintf(line, sizeof(line), "Model sdof, %.*s", (int)length - 5, f->prediction.reason);
		check_has(text, line);
		check_has(text, length == 77 ? end : "the last of\n  them.\n");
		free(text);
	}
	for (size_t i = 0; i < CHANNELS; i++)
		f->estimates[i].peak.how.flags = ESTIMATE_FLAG_EXTRAPOLATED | ESTIMATE_FLAG_GAPS;
	{
		char *text = print(&f->report);

		for (const char *at = strstr(text, "note:"); at && *at; at += strcspn(at, "\n") + 1)
			assert_in_range(strcspn(at, "\n"), 0, 90);
		free(text);
	}
}

static void test_text(void **state)
{
	struct fixture *f = *state;
	char *text = print(&f->report);

	check_has(text, "complete: every sample arrived");
	check_has(text, "drop 7");
	check_has(text, "25 deg, from 0.894 m");
	check_has(text, "300.33    0.34     3.500     1.1     2.800     5.700"); /* 103.5 ms, 0 at 100 ms */
	check_has(text, "500.25");
	check_has(text, "Y peaks -0.400 ms after X");
	check_has(text, "first 1.900");
	check_has(text, "largest 2.000");
	check_has(text, "correlation 1.600");
	check_has(text, "129.37 +- 0.02 Hz");
	check_has(text, "128.12");
	check_has(text, "because it is by hand");
	check_has(text, "363.0      340.5      0.4       +6.6 %");
	check_has(text, "S2X leaves 10 % of its peak");
	check_has(text,
	          "1 000 Hz video: time 0 is in frame 441, S2 X peaks in 442.\n"); /* 341 + 100, 101.5 */
	assert_null(strstr(text, "frames:"));
	free(text);
}

/* What was done, in one line of the text and in the JSON; nothing of it of a foreign record's. */
static void check_processing(const struct report *report, const char *text, const char *filter,
                             double cutoff_hz, double undone_s)
{
	char *table = print(report), line[200];
	cJSON *root = parse(report);

	snprintf(line, sizeof(line), "\nprocessing: %s\n", text);
	if (text[0])
		check_has(table, line);
	assert_int_equal(count_of(table, "processing:"), text[0] ? 1 : 0);
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
	struct fixture *f = *state;
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
	for (size_t i = 0; i < CHANNELS; i++)
		f->record.channels[i].sensor = 0;
	check_processing(&f->report, "filter lowpass 1650 Hz", "lowpass 1650 Hz", 1650, 0);
	done->lowpass_hz = 0;
	check_processing(&f->report, "", NULL, 0, 0);
}

static void test_text_of_holes(void **state)
{
	struct fixture *f = *state;
	char *text;

	make_holes(f);
	f->estimates[4].peak.value_g = (double)NAN;
	f->estimates[4].peak.how.status = ESTIMATE_NO_PEAK;
	text = print(&f->report);
	check_has(text, "INCOMPLETE: 54 samples lost in 1 gap, 2 blocks");
	check_has(text, "lost_samples:");
	check_has(text, "clipped:");
	check_has(text, "no_peak");
	check_has(text, "missing: S1 tick 61338 to 61339");
	check_has(text, "3 gaps");
	free(text);
}

static void test_verdicts(void **state)
{
	struct fixture *f = *state;
	char line[160];

	assert_true(report_verdict(&f->report, line, sizeof(line)));
	f->record.crc_agrees = false;
	assert_false(report_verdict(&f->report, line, sizeof(line)));
	check_has(line, "CORRUPT");
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
	struct fixture *f = *state;
	char line[160], *text;

	make_holes(f);
	f->record.gaps[0].last_tick_ms = f->record.gaps[0].first_tick_ms;
	f->record.lost_samples = 27;
	f->record.crc_known = false;
	f->record.counters.gaps = 1;
	assert_false(report_verdict(&f->report, line, sizeof(line)));
	assert_string_equal(line,
	                    "INCOMPLETE: ends at tick 61733 (0.500 s) without a capture end; 27 samples "
	                    "lost in 1 gap, 1 block");
	text = print(&f->report);
	check_has(text, "1000 blocks held, 1 gap, ");
	free(text);
}

/* A flag that some channels have and others have not names those. */
static void test_text_names_flagged_channels(void **state)
{
	struct fixture *f = *state;
	char *text;

	f->estimates[0].flags = f->estimates[3].flags = RECORD_FLAG_UNFILTERED;
	for (size_t i = 0; i < CHANNELS; i++)
		f->estimates[i].flags |= RECORD_FLAG_SHORT;
	text = print(&f->report);
	check_has(text,
	          "  unfiltered: sampled too slowly for the low-pass asked for; left as it was (S1X, S2X)\n");
	check_has(text, "has hardly a sample\n");
	free(text);
}

/* One axis has no peak: nothing is said of the other's distance, and no "nan". */
static void test_resultant_of_one_axis(void **state)
{
	struct fixture *f = *state;
	cJSON *root;
	char *text;

	for (size_t i = 0; i < 2; i++) {
		f->analysis.resultants[i].axes_coincide = false;
		f->analysis.resultants[i].axes_apart_s = (double)NAN;
	}
	text = print(&f->report);
	assert_null(strstr(text, "Y peaks"));
	check_has(text, "S2 XY");
	free(text);
	root = parse(&f->report);
	assert_true(cJSON_IsNull(item(root, "resultants.0.axes_apart_s")));
	cJSON_Delete(root);
}

/* The model counts cycles: it is held against what was counted, or against the fit where nothing was. */
static void test_frequency_against_model(void **state)
{
	struct fixture *f = *state;
	char *text = print(&f->report);

	check_has(text, "plate, 3 cycles   Hz     121.00     128.12        -       -5.6 %");
	free(text);
	f->analysis.plate.three_cycle_frequency_hz = (double)NAN;
	text = print(&f->report);
	check_has(text, "plate frequency   Hz     121.00     129.37     0.02       -6.5 %");
	free(text);
}

static void test_video_frames(void **state)
{
	struct fixture *f = *state;
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

/* ---- pictures ---- */

static char *channel_script(const struct fixture *f, size_t channel)
{
	struct report_zero zero = report_zero(&f->report);
	char *text = NULL;
	size_t length;
	FILE *out = open_memstream(&text, &length);

	assert_non_null(out);
	assert_true(traces_channel(out, &f->report, &zero, channel));
	assert_int_equal(fclose(out), 0);
	return text;
}

/* The points of block $name that lie in [from, to), and the breaks between points. */
static size_t points_in(const char *script, const char *name, double from_ms, double to_ms, size_t *breaks)
{
	char head[32];
	const char *s;
	size_t points = 0;

	snprintf(head, sizeof(head), "$%s << EOD\n", name);
	s = strstr(script, head);
	assert_non_null(s);
	*breaks = 0;
	for (s = strchr(s, '\n') + 1; strncmp(s, "EOD", 3) != 0; s = strchr(s, '\n') + 1) {
		double t = strtod(s, NULL);

		*breaks += *s == '\n';
		points += *s != '\n' && t >= from_ms && t < to_ms;
	}
	return points;
}

static void test_traces_keep_gaps_open(void **state)
{
	struct fixture *f = *state;
	size_t breaks;
	char *script = channel_script(f, 1);

	/* whole: 10 samples a millisecond, no break */
	assert_int_equal(points_in(script, "measured", 3.95, 5.95, &breaks), 20);
	assert_int_equal(breaks, 0);
	assert_null(strstr(script, "set object"));
	free(script);
	make_holes(f);
	script = channel_script(f, 1);
	assert_int_equal(points_in(script, "measured", 3.95, 5.95, &breaks), 0);
	assert_true(breaks >= 1);
	check_has(script, "set object rectangle from 3.900000, graph 0 to 6.000000");
	free(script);
	script = channel_script(f, 3);
	assert_int_equal(points_in(script, "clipped", -100, 100, &breaks), 1);
	free(script);
}

/* gnuplot runs commands a script asks for. */
static void test_no_foreign_text_in_scripts(void **state)
{
	struct fixture *f = *state;
	char *script;

	snprintf(f->record.channels[0].name, sizeof(f->record.channels[0].name), "'; system('evil'); '");
	snprintf(f->scene.title, sizeof(f->scene.title), "evil");
	snprintf(f->record.file, sizeof(f->record.file), "evil");
	script = channel_script(f, 0);
	assert_null(strstr(script, "evil"));
	free(script);
}

static void test_picture(void **state)
{
	static const char good[] = "set terminal svg\n$d << EOD\n1 2\n2 3\nEOD\nplot $d with lines\n";
	static const char wrong[] = "set terminal svg\nplot $nothing with lines\n";
	char message[200] = "", *svg = NULL;

	(void)state;
	assert_int_equal(picture_draw(good, strlen(good), &svg, message, sizeof(message)), 0);
	check_has(svg, "<svg");
	check_has(svg, "</svg>");
	free(svg);
	svg = NULL;
	assert_int_equal(picture_draw(wrong, strlen(wrong), &svg, message, sizeof(message)), DT_E_SYSTEM);
	assert_null(svg);
	check_has(message, "gnuplot failed: ");
	check_has(message, "nothing");
}

/* ---- the page ---- */

static void make_folder(char path[SCRATCH_MAX])
{
	assert_non_null(mkdtemp(scratch_name(path, "report")));
}

static char *read_file(const char *path)
{
	FILE *in = fopen(path, "r");
	char *text = calloc(1, 1 << 22);

	assert_non_null(in);
	assert_non_null(text);
	assert_true(fread(text, 1, (1 << 22) - 1, in) > 1000);
	fclose(in);
	return text;
}

/* Makes the page in a folder of its own, which must hold nothing else afterwards. */
static char *make_page(const struct report *report)
{
	char folder[SCRATCH_MAX], path[SCRATCH_MAX + 32], message[200] = "";
	char *page;

	make_folder(folder);
	snprintf(path, sizeof(path), "%s/page.html", folder);
	if (report_html(report, path, message, sizeof(message)))
		fail_msg("%s", message);
	page = read_file(path);
	assert_int_equal(unlink(path), 0);
	assert_int_equal(rmdir(folder), 0);
	return page;
}

static void check_self_contained(const char *page)
{
	static const char xmlns[] = "xmlns=\"http://www.w3.org/2000/svg\"";
	static const char xlink[] = "xmlns:xlink=\"http://www.w3.org/1999/xlink\"";

	assert_int_equal(count_of(page, "http:"), count_of(page, xmlns) + count_of(page, xlink));
	assert_int_equal(count_of(page, "https:"), 0);
	assert_int_equal(count_of(page, "<script"), 0);
	assert_int_equal(count_of(page, "<link"), 0);
	assert_int_equal(count_of(page, "<img"), 0);
	assert_int_equal(count_of(page, "src="), 0);
	assert_int_equal(count_of(page, "@import"), 0);
	assert_int_equal(count_of(page, "nan"), 0);
	assert_int_equal(count_of(page, "<?xml"), 0);
	assert_int_equal(count_of(page, "<svg"), count_of(page, "</svg>"));
	assert_int_equal(count_of(page, "<figure"), count_of(page, "</figure>"));
	assert_int_equal(count_of(page, "<table"), count_of(page, "</table>"));
	assert_int_equal(count_of(page, "<div"), count_of(page, "</div>"));
	assert_int_equal(count_of(page, "<defs>"), 1); /* its names may stand only once */
	assert_int_equal(strcmp(page + strlen(page) - 8, "</html>\n"), 0);
}

static void test_html(void **state)
{
	struct fixture *f = *state;
	char *page;

	f->report.options = (struct estimate_options){.cfc = 180, .iepe_time_constant_s = 0.3};
	page = make_page(&f->report);
	check_self_contained(page);
	assert_int_equal(count_of(page, "<svg"), 6 + 1 + 2 + 1); /* traces, resultants, ring-down, whole */
	check_has(page, "<h1>Box &lt;b&gt;&amp; &quot;plate&quot;&lt;/b&gt;</h1>");
	assert_null(strstr(page, "<b>&"));
	check_has(page, "&lt;name&gt;.log");
	check_has(page, "test &lt;version&gt;");
	check_has(page, "complete: every sample arrived, and the CRC-32 agrees</div>\n"
	                "<p class=\"soft\">Processing: filter CFC180; sensor high-pass of 0.3 s undone.</p>");
	check_has(page, "300.33 &plusmn; 0.34");
	check_has(page, "time 0 is in frame 441, S2 X peaks in 442. ");
	check_has(page, "+6.6 %");
	check_has(page, "129.37 &plusmn; 0.02 Hz");
	check_has(page, "because it is by hand");
	check_has(page, "Y peaks 0.400 ms before X");
	assert_null(strstr(page, "as the swing vanishes"));
	free(page);
}

static void test_html_of_holes(void **state)
{
	struct fixture *f = *state;
	char *page;

	make_holes(f);
	f->analysis.plate.small_swing_hz = 139.7;
	f->analysis.resultants[1].axes_apart_s = (double)NAN;
	page = make_page(&f->report);
	check_self_contained(page);
	check_has(page, "INCOMPLETE: 54 samples lost");
	check_has(page, "<td>61338</td><td>61339</td><td>2</td>");
	check_has(page, "samples missing");
	check_has(page, "as the swing vanishes</td><td>139.70 Hz</td>");
	check_has(page, "one axis has no peak");
	assert_int_equal(count_of(page, "Y peaks "), 1);
	check_has(page, "beyond the sensor's range");
	free(page);
}

/* Channels of any name and number, no scene, one of them without a single sample. */
static void test_html_foreign(void **state)
{
	struct fixture *f = *state;
	struct estimate_channel *many = calloc(15, sizeof(*many));
	char *page;

	assert_non_null(many);
	memcpy(many, f->estimates, sizeof(f->estimates));
	for (size_t i = CHANNELS; i < 15; i++) {
		assert_non_null(record_add_channel(&f->record, "<i>strange</i>", 1e6, i == 8 ? 0 : 50));
		many[i].peak = (struct estimate_peak){(double)NAN,
		                                      (double)NAN,
		                                      (double)NAN,
		                                      (double)NAN,
		                                      {.method = "sample", .status = ESTIMATE_SHORT}};
		many[i].pulse.status = ESTIMATE_SHORT;
	}
	for (size_t i = 0; i < CHANNELS; i++)
		f->record.channels[i].sensor = 0; /* whatever its name */
	f->analysis = (struct analysis){.channels = many, .channel_count = 15};
	f->record.is_drop = false;
	f->report.scene = NULL;
	f->report.prediction = NULL;
	f->report.version = NULL;
	page = make_page(&f->report);
	check_self_contained(page);
	assert_int_equal(count_of(page, "<svg"), 6 + 1); /* the other channels hold nothing */
	check_has(page, "&lt;i&gt;strange");
	assert_int_equal(count_of(page, "<i>strange"), 0);
	assert_null(strstr(page, "Processing"));
	check_has(page, "The first 12 of 15 channels");
	free(page);
	free(many);
}

static void test_html_unwritable(void **state)
{
	struct fixture *f = *state;
	char message[200] = "", folder[SCRATCH_MAX], path[SCRATCH_MAX + 32];
	struct stat stat_before, stat_after;

	assert_int_equal(report_html(&f->report, "/nowhere/at/all/page.html", message, sizeof(message)),
	                 DT_E_SYSTEM);
	check_has(message, "/nowhere/at/all/page.html: ");
	make_folder(folder);
	snprintf(path, sizeof(path), "%s/sub", folder);
	assert_int_equal(mkdir(path, 0700), 0); /* a folder stands where the page should go */
	assert_int_equal(stat(folder, &stat_before), 0);
	assert_int_equal(report_html(&f->report, path, message, sizeof(message)), DT_E_SYSTEM);
	assert_int_equal(stat(folder, &stat_after), 0);
	assert_int_equal(rmdir(path), 0);
	assert_int_equal(rmdir(folder), 0); /* nothing was left behind */
}

static void test_html_without_gnuplot(void **state)
{
	struct fixture *f = *state;
	char message[200] = "", folder[SCRATCH_MAX], path[SCRATCH_MAX + 32],
	     *old = strdup(getenv("PATH") ? getenv("PATH") : "");

	assert_non_null(old);
	make_folder(folder);
	snprintf(path, sizeof(path), "%s/page.html", folder);
	assert_int_equal(setenv("PATH", folder, 1), 0);
	assert_int_equal(report_html(&f->report, path, message, sizeof(message)), DT_E_SYSTEM);
	assert_int_equal(setenv("PATH", old, 1), 0);
	check_has(message, "gnuplot-nox");
	assert_int_equal(rmdir(folder), 0); /* no page, no part of one */
	free(old);
}

/* A stream that takes nothing. */
static void test_write_errors(void **state)
{
	struct fixture *f = *state;
	FILE *full = fopen("/dev/full", "w");

	assert_non_null(full);
	assert_int_equal(report_text(&f->report, full), DT_E_SYSTEM);
	clearerr(full);
	assert_int_equal(report_json(&f->report, full), DT_E_SYSTEM);
	fclose(full);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
	const struct CMUnitTest tests[] = {
	        TEST(test_json),
	        TEST(test_json_keeps_every_digit),
	        TEST(test_json_unknown_is_null),
	        TEST(test_json_foreign),
	        TEST(test_json_of_holes),
	        TEST(test_json_how),
	        TEST(test_text_notes),
	        TEST(test_text_lines_fit_the_table),
	        TEST(test_text),
	        TEST(test_processing),
	        TEST(test_text_of_holes),
	        TEST(test_verdicts),
	        TEST(test_verdict_of_a_cut_log),
	        TEST(test_text_names_flagged_channels),
	        TEST(test_resultant_of_one_axis),
	        TEST(test_frequency_against_model),
	        TEST(test_video_frames),
	        TEST(test_traces_keep_gaps_open),
	        TEST(test_no_foreign_text_in_scripts),
	        TEST(test_picture),
	        TEST(test_html),
	        TEST(test_html_of_holes),
	        TEST(test_html_foreign),
	        TEST(test_html_unwritable),
	        TEST(test_html_without_gnuplot),
	        TEST(test_write_errors),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
