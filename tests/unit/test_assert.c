/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What a broken invariant comes to: ring, capture and join are broken by hand in a process of their own,
 * which must end with 70 and say where. The same code whole goes on.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "common/assert.h"
#include "common/ring.h"
#include "firmware/sequence.h"
#include "host/estimate/cholesky.h"
#include "tests/unit/fake_port.h"

static struct parameters parameters;
static struct sequence sequence;
static uint32_t counters[WIRE_COUNTERS];

/* Exit code of what it does in a process of its own; what that says goes to said. */
static int outcome(void (*does)(void), char *said, size_t size)
{
	int status, out[2];
	ssize_t got;
	pid_t pid;

	assert_int_equal(pipe(out), 0);
	pid = fork();
	assert_true(pid >= 0);
	if (pid == 0) {
		dup2(out[1], STDERR_FILENO);
		does();
		_exit(0);
	}
	close(out[1]);
	got = read(out[0], said, size - 1);
	said[got > 0 ? got : 0] = '\0';
	close(out[0]);
	assert_int_equal(waitpid(pid, &status, 0), pid);
	assert_true(WIFEXITED(status));
	return WEXITSTATUS(status);
}

static void ends(void (*does)(void), const char *file)
{
	char said[512];

	assert_int_equal(outcome(does, said, sizeof(said)), 70);
	assert_non_null(strstr(said, file));
	assert_non_null(strstr(said, ": this cannot be: not "));
}

static void goes_on(void (*does)(void))
{
	char said[512];

	assert_int_equal(outcome(does, said, sizeof(said)), 0);
	assert_string_equal(said, "");
}

static void put_in_ring(uint32_t head)
{
	unsigned char storage[4] = {0}, byte = 1;
	struct ring ring = {.storage = storage, .count = 4, .entry_size = 1};

	ring.head = head;
	(void)!ring_put(&ring, &byte);
}

static void whole_ring(void)
{
	put_in_ring(4);
}

static void torn_ring(void)
{
	put_in_ring(5);
}

static void fault_in_state(uint8_t state)
{
	fake_init();
	sequence_init(&sequence, &parameters, counters, PORT_RESET_POWER_ON);
	sequence.state = state;
	sequence_fault(&sequence, WIRE_FAULT_DOOR);
}

static void whole_sequence(void)
{
	fault_in_state(WIRE_STATES - 1);
}

static void torn_sequence(void)
{
	fault_in_state(WIRE_STATES);
}

static void factor(unsigned size)
{
	double a[CHOLESKY_MAX][CHOLESKY_MAX] = {{0}};
	struct cholesky factor;

	for (unsigned i = 0; i < CHOLESKY_MAX; i++)
		a[i][i] = 1;
	(void)!cholesky_factor(&factor, size, a);
}

static void whole_factor(void)
{
	factor(CHOLESKY_MAX);
}

static void too_large_factor(void)
{
	factor(CHOLESKY_MAX + 1);
}

static void test_a_broken_invariant_ends_the_program_and_says_where(void **state)
{
	(void)state;
	ends(torn_ring, "common/ring.c:");
	ends(torn_sequence, "firmware/sequence.c:");
	ends(too_large_factor, "host/estimate/cholesky.c:");
}

static void test_at_the_last_good_value_it_goes_on(void **state)
{
	(void)state;
	goes_on(whole_ring);
	goes_on(whole_sequence);
	goes_on(whole_factor);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(test_a_broken_invariant_ends_the_program_and_says_where),
	        cmocka_unit_test(test_at_the_last_good_value_it_goes_on),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
