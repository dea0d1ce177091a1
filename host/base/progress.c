/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/base/progress.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

static const double SOON_S = 0.5; /* before, nothing is known of the speed */
static const double AGAIN_S = 0.2;

static double now_s(void)
{
	struct timespec now;

	clock_gettime(CLOCK_MONOTONIC, &now);
	return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

void progress_begin(struct progress *progress, double after_s)
{
	*progress = (struct progress){
	        .begun_s = now_s(), .after_s = after_s, .terminal = isatty(STDERR_FILENO) == 1};
}

double progress_seconds(const struct progress *progress)
{
	return now_s() - progress->begun_s;
}

void progress_tell(struct progress *progress, double part, const char *format, ...)
{
	double passed_s = progress_seconds(progress), rest_s;
	char end[32] = "?";
	va_list words;
	struct tm day;
	time_t at;

	if (!progress->terminal || passed_s < progress->after_s ||
	    (progress->shown && passed_s < progress->told_s + AGAIN_S && part < 1.0))
		return;
	if (part > 0.0 && passed_s > SOON_S) {
		rest_s = passed_s * (1.0 - part) / part;
		at = time(NULL) + (time_t)fmin(rest_s, 1e9);
		strftime(end, sizeof(end), rest_s < 72000 ? "%H:%M:%S" : "%F %H:%M", localtime_r(&at, &day));
	}
	fputc('\r', stderr);
	va_start(words, format);
	vfprintf(stderr, format, words);
	va_end(words);
	fprintf(stderr, ", ends %s \033[K", end);
	fflush(stderr);
	progress->told_s = passed_s;
	progress->shown = true;
}

void progress_end(struct progress *progress)
{
	if (progress->shown)
		fputs("\r\033[K", stderr);
	progress->shown = false;
}
