/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HIL_BENCH_H
#define DT_HIL_BENCH_H
/*
 * The bench: runs a firmware against the simulated tower. It answers every request of the sensor bus with
 * the tower at exactly that instant, carries the firmware's CAN frames through the fault injector to a
 * host and the host's back, and lifts the frame again after each drop. The host is whatever is on the
 * link, or the script of hil/script.h.
 *
 * Virtual time is the firmware's sample grid, so a run with the script and the same seed repeats bit for
 * bit: codes, frames, log.
 */
#include <stdbool.h>
#include <stdint.h>

#include "common/scenes/scene.h"
#include "common/sensorbus.h"
#include "hil/busfault.h"
#include "hil/event.h"
#include "hil/monitor.h"
#include "hil/script.h"
#include "hil/timeline.h"

enum {
	/* The program's exit statuses. */
	BENCH_DONE = 0,
	BENCH_NOT_SAFE = 1, /* a drop of the script did not end as it should */
	BENCH_USAGE = 2,
	BENCH_INPUT = 3,
	BENCH_LINK = 4, /* link, firmware, file system */
};

/* Virtual time 0 in log files, us since 1970. */
#define BENCH_EPOCH_US INT64_C(1000000000000000)

struct bench_options {
	struct scene scene;
	const char *link; /* by the clock; NULL: the script is the host, as fast as it goes */
	const struct sensorbus_inside *inside; /* the firmware in this program; NULL: a process of its own */
	const char *firmware;                  /* NULL: droptower-firmware beside this program */
	uint64_t seed;
	bool quiet; /* nothing is said of how it goes on */
	struct script_options script;
	unsigned lift_after_ms; /* how long the technician takes once the tower is safe; 0: 2 s, watched 0.1 s
	                         */
	bool ideal;
	double clock_ppm;            /* the firmware's clock is this much too fast */
	struct busfault_options bus; /* cut_resend counts for the way to the host */
	unsigned burst;              /* live blocks lost in a row after each impact */
	double burst_after_s;        /* so long after it */
	unsigned event_count;
	struct event events[EVENTS_MAX];
	const char *control; /* path of a socket that takes events as they come, NULL: none */
	/* A run that is watched does not fail by what happens in it: it ends when the script has done its
	 * drops, all events have happened and every counter was told since, or at end_s. */
	struct bench_watch *watch; /* NULL: nobody looks */
	const char *log;           /* candump text of the host's side of the bus, NULL: none */
	const char *truth;         /* codes as given to the firmware (hil/adc_log.h), NULL: none */
	int ready_fd;              /* gets one byte when the firmware runs; -1: none */
};

struct bench_watch {
	double end_s;
	bool soon;                 /* the counters need not be told */
	struct timeline *timeline; /* NULL: none */
	struct monitor monitor;
	double results[SCENARIO_RESULTS]; /* NAN: did not happen */
	double virtual_s, wall_s;
};

/* Runs until the script has ended or SIGINT, SIGTERM, SIGHUP; says what goes on and what is wrong on stderr;
 * returns the exit status. */
int bench_run(const struct bench_options *options);

/* "droptower-bench: ..." and a newline on stderr. */
void bench_say(const char *format, ...) __attribute__((format(printf, 1, 2)));

/* The same for how it goes on: nothing when quiet. */
void bench_tell(const struct bench_options *options, const char *format, ...)
        __attribute__((format(printf, 2, 3)));

#endif
