/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/base/interrupt.h"

#include <signal.h>
#include <string.h>

static volatile sig_atomic_t came;

static void interrupt_on_signal(int number)
{
	came = number;
}

void interrupt_catch(void)
{
	struct sigaction action, before;

	memset(&action, 0, sizeof(action));
	action.sa_handler = interrupt_on_signal;
	sigemptyset(&action.sa_mask);
	sigaction(SIGINT, &action, NULL);
	sigaction(SIGTERM, &action, NULL);
	if (sigaction(SIGHUP, NULL, &before) == 0 && before.sa_handler != SIG_IGN)
		sigaction(SIGHUP, &action, NULL);
	signal(SIGPIPE, SIG_IGN);
}

int interrupt_came(void)
{
	return came;
}
