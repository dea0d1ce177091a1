/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The short set: one test for each group of scenes, at 1 g of noise, limits widened by three standard
 * deviations of the Monte Carlo itself. `make accuracy` is the long one.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <gsl/gsl_errno.h>

#include "tests/accuracy/cells.h"
#include "tests/unit/near.h"

enum { DROPS = 300 };

#define SLACK 3

static struct cells cells;

static int setup(void **state)
{
	const struct cells_options options = {.drops = DROPS, .jobs = 2};

	(void)state;
	gsl_set_error_handler_off();
	cells_run(&options, &cells);
	return 0;
}

static int teardown(void **state)
{
	(void)state;
	cells_free(&cells);
	return 0;
}

static void judge(void **state)
{
	unsigned judged,
	        failed = cells_judge(&cells, *(const enum group *)*state, SLACK, CELLS_FAILURES, &judged);

	assert_true(judged > 0);
	assert_int_equal(failed, 0);
}

/* The bounds themselves, against what the literature has in closed form: half-sine of N samples, and a decay
 * that is long and weakly damped, which ours is but for a few percent. */
static void bounds_agree_with_closed_forms(void **state)
{
	const struct scene scene = {.name = "half-sine", .noise_g = 1};
	double n = 21, a = 2 * 3.14159265358979 * 129 * 0.1 / sqrt(0.99), amplitude = 312;
	double peak = sqrt(2.466 / n), instant = sqrt(2 / n) / 3.14159265358979 / 485.1 * STAGE_CONTACT_S;
	double contact = sqrt(1.865 / n) / 485.1 * STAGE_CONTACT_S;
	double hz = 2 / 3.14159265358979 * sqrt(a * a * a / 7000) / amplitude;
	struct stage stage;
	struct bounds b;

	(void)state;
	stage_open(&stage, &scene);
	bounds_find(&stage, false, &b);
	stage_close(&stage);
	assert_near_part(b.peak_g[0], peak, 0.005);
	assert_near_part(b.peak_s[0], instant, 0.005);
	assert_near_part(b.contact_s[0], contact, 0.01);
	assert_near_part(b.velocity_m_s[0], 9.80665 * sqrt(0.9995 * STAGE_CONTACT_S / 7000), 0.005);
	assert_near_part(b.frequency_hz[0], hz, 0.06);
	assert_near_part(b.joint_hz, 1 / sqrt(pow(b.frequency_hz[0], -2) + pow(b.frequency_hz[1], -2)), 0.01);
}

int main(void)
{
	static enum group groups[GROUPS];
	struct CMUnitTest tests[GROUPS + 1] = {[GROUPS] = cmocka_unit_test(bounds_agree_with_closed_forms)};

	for (int i = 0; i < GROUPS; i++) {
		groups[i] = (enum group)i;
		tests[i] = (struct CMUnitTest){group_name(groups[i]), judge, NULL, NULL, &groups[i]};
	}
	return cmocka_run_group_tests_name("accuracy", tests, setup, teardown);
}
