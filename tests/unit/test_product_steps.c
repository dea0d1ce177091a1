/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * How long the product's steps may be: what is read at the samples against a tenth of them.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "common/units.h"
#include "hil/product.h"
#include "tests/unit/near.h"
#include "tests/unit/shipped.h"

#define IMPACT_M_S 4.188 /* from 0.894 m */
#define G 9.81

/* As between two samples; the steps taken. */
static unsigned go_on(struct product *p)
{
	unsigned steps = 0;

	for (double left_s = 100e-6; left_s > 0; steps++)
		left_s -= product_step(p, left_s);
	return steps;
}

/* From the first touch until it has come down again, against a tenth of the steps. */
static void samples_are_steps_enough(void **state)
{
	static const char *const geometry[] = {"1", "2A", "2B"};

	(void)state;
	for (int c = 0; c < 9; c++) {
		const struct scene scene = shipped_scene(geometry[c % 3]);
		struct product p, fine;
		struct product_reading a, b;
		unsigned steps = 0;

		product_init(&p, &scene, UNITS_RAD(15 + 2.5 * c));
		product_strike(&p, IMPACT_M_S);
		fine = p;
		fine.contact_step_s = p.contact_step_s / 10;
		fine.mount_step_s = p.mount_step_s / 10;
		for (int i = 0; i < 2000; i++) {
			steps += go_on(&p);
			(void)go_on(&fine);
			product_read(&p, &a);
			product_read(&fine, &b);
			assert_near(hypot(a.s1_x - b.s1_x, a.s1_y - b.s1_y), 0, 2e-3 * G);
			assert_near(hypot(a.s2_x - b.s2_x, a.s2_y - b.s2_y), 0, 2e-3 * G);
		}
		assert_in_range(steps, 2000, 4500); /* in flight one or two each */
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(samples_are_steps_enough),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
