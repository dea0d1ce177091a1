/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CONSOLE_CONSOLE_H
#define DT_HOST_CONSOLE_CONSOLE_H
/*
 * The parts of a running console, as each finds the others.
 */
#include <stdatomic.h>

#include "host/console/job.h"

struct live;
struct tower;
struct work;

struct console {
	struct live *live;
	struct tower *tower;
	struct work *work;
	struct job_queue tower_queue, work_queue;
	atomic_bool at_rest; /* nothing falls, is about to, or is being fetched; the tower's thread knows */
};

#endif
