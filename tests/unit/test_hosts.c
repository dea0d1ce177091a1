/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The hosts that are heard: who is here, who is silent, whose key an ARM carries.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <string.h>

#include "firmware/hosts.h"

static struct hosts hosts;
static struct parameters parameters;
static uint32_t counters[WIRE_COUNTERS];

static int begin(void **state)
{
	(void)state;
	memset(counters, 0, sizeof(counters));
	parameters_init(&parameters); /* host_timeout_ms 500 */
	hosts_init(&hosts, &parameters, counters);
	return 0;
}

static void a_silent_host_is_forgotten_and_counted(void **state)
{
	(void)state;
	hosts_tick(&hosts, 5000);
	assert_false(hosts_here(&hosts, 0));
	assert_int_equal(counters[WIRE_COUNTER_host_heartbeats_lost], 0); /* never was there */
	hosts_heard(&hosts, 5000, 7, true);
	hosts_tick(&hosts, 5500);
	assert_true(hosts_here(&hosts, 0));
	assert_true(hosts_here(&hosts, 7));
	assert_false(hosts_here(&hosts, 8));
	hosts_tick(&hosts, 5501);
	assert_false(hosts_here(&hosts, 7));
	hosts_tick(&hosts, 5502);
	assert_int_equal(counters[WIRE_COUNTER_host_heartbeats_lost], 1);
	hosts_heard(&hosts, UINT32_MAX - 100, 7, true); /* over the wrap of the ms */
	hosts_tick(&hosts, 399);
	assert_true(hosts_here(&hosts, 7));
	hosts_tick(&hosts, 400);
	assert_false(hosts_here(&hosts, 7));
}

static void another_wire_is_no_host(void **state)
{
	(void)state;
	hosts_heard(&hosts, 0, 0x10007, false);
	assert_false(hosts_here(&hosts, 0));
	assert_true(hosts_hash_differs(&hosts, 7));
	assert_false(hosts_hash_differs(&hosts, 8));
	hosts_heard(&hosts, 0, 0x20008, true);
	assert_true(hosts_here(&hosts, 0));
	assert_false(hosts_here(&hosts, 0x10007));
	hosts_heard(&hosts, 0, 0x10007, true);
	assert_false(hosts_hash_differs(&hosts, 7));
	hosts_tick(&hosts, 501);
	assert_false(hosts_hash_differs(&hosts, 7));
}

/* The answers of test_wire: nonce CAFEF00D, set A7DEE12E, sessions 51E7A0D3 and 12345678. */
static void an_answer_belongs_to_a_session_a_nonce_and_a_set(void **state)
{
	uint32_t session = 99;

	(void)state;
	assert_int_equal(hosts_find(&hosts, 0xA0D3, 0x311A4681, 0xCAFEF00D, 0xA7DEE12E, &session),
	                 DT_E_SESSION);
	hosts_heard(&hosts, 0, 0x1234A0D3, true); /* the same low half */
	assert_int_equal(hosts_find(&hosts, 0xA0D3, 0x311A4681, 0xCAFEF00D, 0xA7DEE12E, &session),
	                 DT_E_PARAMETERS);
	assert_int_equal(session, 99);
	hosts_heard(&hosts, 0, 0x51E7A0D3, true);
	assert_int_equal(hosts_find(&hosts, 0xA0D3, 0x311A4681, 0xCAFEF00D, 0xA7DEE12E, &session), 0);
	assert_int_equal(session, 0x51E7A0D3);
	assert_int_equal(hosts_find(&hosts, 0xA0D3, 0x311A4681, 0xCAFEF00D, 0xA7DEE12F, &session),
	                 DT_E_PARAMETERS);
	assert_int_equal(hosts_find(&hosts, 0xA0D3, 0x311A4680, 0xCAFEF00D, 0xA7DEE12E, &session),
	                 DT_E_PARAMETERS);
	assert_int_equal(hosts_find(&hosts, 0x5678, 0xAC75D793, 0xCAFEF00D, 0x9ABCDEF0, &session),
	                 DT_E_SESSION);
	assert_int_equal(hosts_find(&hosts, 0xA0D3, 0x311A4681, 0, 0xA7DEE12E, &session), DT_E_PARAMETERS);
	assert_int_equal(hosts_find(&hosts, 0xA0D3, 0x051A15FF, 0, 0xA7DEE12E, &session), 0);
	hosts_heard(&hosts, 0, 0x51E7A0D3, false);
	assert_int_equal(hosts_find(&hosts, 0xA0D3, 0x311A4681, 0xCAFEF00D, 0xA7DEE12E, &session),
	                 DT_E_PARAMETERS);
}

/* Whoever beats with ever new sessions does not push out those that are here. */
static void a_fifth_waits(void **state)
{
	(void)state;
	for (uint32_t i = 1; i <= 100; i++)
		hosts_heard(&hosts, 0, i, true);
	for (uint32_t i = 1; i <= 100; i++)
		assert_int_equal(hosts_here(&hosts, i), i <= 4);
	for (uint32_t i = 1; i <= 4; i++)
		if (i != 2)
			hosts_heard(&hosts, 400, i, true);
	hosts_tick(&hosts, 501);
	hosts_heard(&hosts, 501, 50, true);
	hosts_heard(&hosts, 501, 51, true);
	assert_true(hosts_here(&hosts, 50));
	assert_false(hosts_here(&hosts, 2));
	assert_false(hosts_here(&hosts, 51));
}

/* The fourth is a host like the others. */
static void the_last_place_counts(void **state)
{
	uint32_t session = 0;

	(void)state;
	for (uint32_t i = 1; i <= 3; i++)
		hosts_heard(&hosts, 0, i, true);
	hosts_heard(&hosts, 0, 0x51E7A0D3, true);
	assert_int_equal(hosts_find(&hosts, 0xA0D3, 0x311A4681, 0xCAFEF00D, 0xA7DEE12E, &session), 0);
	assert_int_equal(session, 0x51E7A0D3);
	hosts_heard(&hosts, 0, 0x51E7A0D3, false);
	assert_true(hosts_hash_differs(&hosts, 0xA0D3));
	hosts_tick(&hosts, 501);
	assert_int_equal(counters[WIRE_COUNTER_host_heartbeats_lost], 4);
	assert_false(hosts_hash_differs(&hosts, 0xA0D3));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test_setup(a_silent_host_is_forgotten_and_counted, begin),
	        cmocka_unit_test_setup(another_wire_is_no_host, begin),
	        cmocka_unit_test_setup(an_answer_belongs_to_a_session_a_nonce_and_a_set, begin),
	        cmocka_unit_test_setup(a_fifth_waits, begin),
	        cmocka_unit_test_setup(the_last_place_counts, begin),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
