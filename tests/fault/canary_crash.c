/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Dies in the second of three tests: tests/run must count the two that are missing as failed. */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <signal.h>

static void passes(void **state)
{
	(void)state;
}

static void dies(void **state)
{
	(void)state;
	raise(SIGKILL);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(passes),
	        cmocka_unit_test(dies),
	        cmocka_unit_test(passes),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
