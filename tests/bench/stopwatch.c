/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/bench/stopwatch.h"

#include <fcntl.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

enum { TIMES_MAX = 2000, TIMES_MIN = 15, STARTS = 25, PRODUCTS = 4096 };

#define SPAN_US 3e5
#define BATCH_US 20.0

static double now_us(void)
{
	struct timespec t;

	clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
	return (double)t.tv_sec * 1e6 + (double)t.tv_nsec * 1e-3;
}

static int compare(const void *a, const void *b)
{
	double x = *(const double *)a, y = *(const double *)b;

	return (x > y) - (x < y);
}

static struct stopwatch sum_up(double *time_us, int count)
{
	qsort(time_us, (size_t)count, sizeof(*time_us), compare);
	return (struct stopwatch){time_us[count / 2], time_us[0]};
}

static double batch(void (*work)(void *), void *context, int times)
{
	double start = now_us();

	for (int i = 0; i < times; i++)
		work(context);
	return (now_us() - start) / times;
}

struct stopwatch stopwatch_time(void (*work)(void *context), void *context)
{
	double time_us[TIMES_MAX], start = now_us(), one;
	int times = 1, count = 0;

	batch(work, context, 2);
	one = batch(work, context, 2);
	if (one < BATCH_US)
		times = (int)(BATCH_US / one) + 1;
	while (count < TIMES_MAX && (count < TIMES_MIN || now_us() - start < SPAN_US))
		time_us[count++] = batch(work, context, times);
	return sum_up(time_us, count);
}

static void products(void *context)
{
	const double *v = context;
	double sum[4] = {0};
	static volatile double keep;

	for (int i = 0; i < PRODUCTS; i += 4)
		for (int j = 0; j < 4; j++)
			sum[j] += v[i + j] * v[PRODUCTS - 1 - i - j];
	keep = sum[0] + sum[1] + sum[2] + sum[3];
	(void)keep;
}

struct stopwatch stopwatch_reference(void)
{
	static double value[PRODUCTS];

	for (int i = 0; i < PRODUCTS; i++)
		value[i] = 1 + i * 1e-3;
	return stopwatch_time(products, value);
}

static void become(char *const argv[])
{
	int nothing = open("/dev/null", O_WRONLY);

	if (nothing >= 0 && dup2(nothing, STDOUT_FILENO) >= 0)
		execv(argv[0], argv);
	_exit(127);
}

struct stopwatch stopwatch_program(char *const argv[], double *peak_mb)
{
	const struct stopwatch failed = {-1, -1};
	double time_us[STARTS];

	*peak_mb = 0;
	for (int i = 0; i < STARTS; i++) {
		pid_t child = fork();
		struct rusage usage;
		int status;

		if (child == 0)
			become(argv);
		if (child < 0 || wait4(child, &status, 0, &usage) != child || status != 0)
			return failed;
		time_us[i] = 1e6 * (double)(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
		             (double)(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
		if ((double)usage.ru_maxrss / 1024 > *peak_mb)
			*peak_mb = (double)usage.ru_maxrss / 1024;
	}
	return sum_up(time_us, STARTS);
}
