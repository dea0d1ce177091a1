/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "host/result/quantity.h"
#include "tests/unit/near.h"

static bool ends_in(const char *text, const char *end)
{
	size_t length = strlen(text), tail = strlen(end);

	return length >= tail && strcmp(text + length - tail, end) == 0;
}

/* A key says its unit: what is shown in another one is scaled, and by how much. */
static void check_unit(const struct quantity *q)
{
	static const struct {
		const char *shown, *end;
		double scale;
	} units[] = {{"ms", "_s", 1e3},          {"us", "_s", 1e6},      {"s", "_s", 1},
	             {"mm", "_m", 1e3},          {"g", "_g", 1},         {"g/s", "_g_s", 1},
	             {"Hz", "_hz", 1},           {"m/s", "_m_s", 1},     {"ppm", "_ppm", 1},
	             {"m/s2", "_m_s2", 1},       {"ms", "_ms", 1},       {"Hz", "natural_hz", 1},
	             {"m/s", "velocity_m_s", 1}, {"rad/s", "_rad_s", 1}, {"deg", "_deg", 1}};

	for (size_t i = 0; i < sizeof(units) / sizeof(units[0]); i++)
		if (strcmp(q->shown, units[i].shown) == 0 && ends_in(q->key, units[i].end) &&
		    quantity_scale(q) == units[i].scale)
			return;
	fail_msg("%s is shown in %s, times %g", q->key, q->shown, quantity_scale(q));
}

static void test_lines_agree_with_themselves(void **state)
{
	int lines = 0;

	(void)state;
	for (enum quantity_object o = 0; o < QUANTITY_OBJECTS; o++) {
		const struct quantity *q = NULL;

		while ((q = quantity_next(o, q))) {
			const char *at = strchr(q->text, '%');

			lines++;
			assert_ptr_equal(quantity_find(o, q->key), q); /* no key twice */
			assert_true(q->meaning[0] != '\0');
			assert_true(q->sigma[0] == '\0' || quantity_find(o, q->sigma) != NULL);
			if (q->text[0] != '\0')
				assert_true(at != NULL && strchr(at + 1, '%') == NULL);
			if (q->shown[0] != '\0')
				check_unit(q);
		}
	}
	assert_in_range(lines, 100, 1000);
}

static void test_values_come_from_their_members(void **state)
{
	struct estimate_lag lag = {.largest_peak_s = 1.5, .sigma_s = 0.25, .driven_axis_s = {7, 8}};
	struct estimate_baseline baseline = {.samples = 41};
	struct channel channel = {.range_g = 500};
	struct record record = {.lost_samples = UINT64_C(5000000000), .last_tick_ms = 4000000000u};
	struct measured measured = {.calibrated = true};

	(void)state;
	assert_near(quantity_number(quantity_find(QUANTITY_LAG, "largest_peak_s"), &lag), 1.5, 0);
	assert_near(quantity_sigma(quantity_find(QUANTITY_LAG, "largest_peak_s"), &lag), 0.25, 0);
	assert_true(isnan(quantity_sigma(quantity_find(QUANTITY_LAG, "spread_s"), &lag)));
	assert_near(quantity_number(quantity_find(QUANTITY_DRIVEN, "y_lag_s"), &lag), 8, 0);
	assert_near(quantity_number(quantity_find(QUANTITY_BASELINE, "samples"), &baseline), 41, 0);
	assert_near(quantity_number(quantity_find(QUANTITY_SAMPLES, "range_g"), &channel), 500, 0);
	channel.range_g = 0;
	assert_true(isnan(quantity_number(quantity_find(QUANTITY_SAMPLES, "range_g"), &channel)));
	assert_near(quantity_number(quantity_find(QUANTITY_RECORD, "lost_samples"), &record), 5e9, 0);
	assert_near(quantity_number(quantity_find(QUANTITY_DROP, "last_tick_ms"), &record), 4e9, 0);
	assert_near(quantity_number(quantity_find(QUANTITY_TOWER, "calibrated"), &measured), 1, 0);
	assert_true(isnan(quantity_number(quantity_find(QUANTITY_LAG, "status"), &lag)));
	assert_null(quantity_find(QUANTITY_LAG, "lag_s"));
}

static void test_no_value_is_never_ok(void **state)
{
	struct estimate_rebound rebound = {.velocity_ratio = 0.4, .flight_ratio = NAN};
	const struct quantity *velocity = quantity_find(QUANTITY_REBOUND, "velocity_ratio");
	const struct quantity *flight = quantity_find(QUANTITY_REBOUND, "flight_ratio");

	(void)state;
	assert_int_equal(quantity_status(velocity, &rebound), ESTIMATE_OK);
	assert_int_equal(quantity_status(flight, &rebound), ESTIMATE_SHORT);
	rebound.status = ESTIMATE_CLIPPED;
	assert_int_equal(quantity_status(velocity, &rebound), ESTIMATE_CLIPPED);
	assert_int_equal(quantity_status(flight, &rebound), ESTIMATE_CLIPPED);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(test_lines_agree_with_themselves),
	        cmocka_unit_test(test_values_come_from_their_members),
	        cmocka_unit_test(test_no_value_is_never_ok),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
