/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_BENCH_STOPWATCH_H
#define DT_TESTS_BENCH_STOPWATCH_H
/*
 * How much processor time something takes: the median and the best of many repetitions, each long enough for
 * the clock. What else a machine does is in it only as far as it shares caches and units of the processor.
 * Times in us.
 */
struct stopwatch {
	double median_us, best_us;
};

/* Calls work(context) over and over, for about a third of a second or 15 times. */
struct stopwatch stopwatch_time(void (*work)(void *context), void *context);

/* A loop that is the same everywhere: 4096 products summed up in four strands. */
struct stopwatch stopwatch_reference(void);

/* Runs argv with its output thrown away, 25 times; *peak_mb is the largest resident size of any. median_us is
 * negative when it does not exit with 0. */
struct stopwatch stopwatch_program(char *const argv[], double *peak_mb);

#endif
