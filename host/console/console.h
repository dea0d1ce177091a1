/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CONSOLE_CONSOLE_H
#define DT_HOST_CONSOLE_CONSOLE_H
/*
 * The parts of a running console, as each finds the others.
 */
#include "host/console/job.h"
#include "host/console/live.h"
#include "host/console/tower.h"
#include "host/console/work.h"

struct console {
	struct live *live;
	struct tower *tower;
	struct work *work;
	struct job_queue tower_queue, work_queue;
};

#endif
