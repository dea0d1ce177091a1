/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/unit/report_by_hand.h"

#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/record/drop.h"

static const struct estimate_ringdown report_ring = {
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
static void make_channel(struct report_hand *f, size_t i, const char *name)
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
	        .ringdown = report_ring,
	};
}

static void make_scene(struct report_hand *f)
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

int report_set_up(void **state)
{
	static const char *const names[HAND_CHANNELS] = {"S1X", "S1Y", "S1Z", "S2X", "S2Y", "S2Z"};
	struct report_hand *f = calloc(1, sizeof(*f));

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
	for (size_t i = 0; i < HAND_CHANNELS; i++)
		make_channel(f, i, names[i]);
	drop_set_axes(&f->record);
	f->analysis = (struct analysis){
	        .channels = f->estimates,
	        .channel_count = HAND_CHANNELS,
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
	        .plate = report_ring,
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

int report_tear_down(void **state)
{
	struct report_hand *f = *state;

	record_free(&f->record);
	free(f);
	return 0;
}

void report_make_holes(struct report_hand *f)
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

char *report_print(const struct report *report)
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

size_t report_count_of(const char *text, const char *piece)
{
	size_t count = 0;

	for (const char *s = strstr(text, piece); s; s = strstr(s + 1, piece))
		count++;
	return count;
}

void report_check_has(const char *text, const char *piece)
{
	if (!strstr(text, piece))
		fail_msg("\"%s\" is not in:\n%s", piece, text);
}
