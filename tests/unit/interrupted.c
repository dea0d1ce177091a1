/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/time.h>
#include <time.h>
#include <cmocka.h>

#include "tests/unit/interrupted.h"

static volatile sig_atomic_t alarms;

static void on_alarm(int number)
{
	(void)number;
	alarms = alarms + 1;
}

void interrupted_receive(struct link *link)
{
	struct sigaction action = {.sa_handler = on_alarm};
	struct itimerval often = {{0, 2000}, {0, 2000}}, never = {{0, 0}, {0, 0}};
	struct timespec before, after;
	struct frame frame;

	alarms = 0;
	(void)sigaction(SIGALRM, &action, NULL);
	(void)setitimer(ITIMER_REAL, &often, NULL);
	(void)clock_gettime(CLOCK_MONOTONIC, &before);
	assert_int_equal(link_receive(link, &frame, 60), 0);
	(void)clock_gettime(CLOCK_MONOTONIC, &after);
	(void)setitimer(ITIMER_REAL, &never, NULL);
	assert_true((after.tv_sec - before.tv_sec) * 1000000000 + after.tv_nsec - before.tv_nsec >= 60000000);
	assert_true(alarms > 0);
}
