/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "hil/timeline.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/base/process.h"
#include "common/base/text.h"
#include "common/sensorbus.h"
#include "common/wire.h"
#include "common/wire_table.h"

enum {
	WIDE_POINTS = 1200, /* of the whole run's trace; the drop has one each ms */
	BEFORE_DROP_MS = 50,
	DROP_MS = 1050,
};

/* One ms of the run. */
struct point {
	double time_s;
	uint16_t io;
	uint8_t state;
	int16_t low, high; /* S2, X and Y, counts */
};

struct timeline {
	struct point *points;
	size_t count, room;
	int failed; /* no memory: nothing is drawn */
};

/* From the top: what is shown of the io word, with the level that is drawn high. */
static const struct {
	uint16_t mask;
	const char *name;
} lanes[] = {
        {WIRE_IO_LATCH_OPEN, "latch open"},
        {WIRE_IO_MAGNET_HOLD, "magnet holds"},
        {WIRE_IO_DAMPERS_RELIEVE, "dampers relieved"},
        {WIRE_IO_CAMERA, "camera"},
        {WIRE_IO_WARNING, "warning"},
        {WIRE_IO_LATCH_CLOSED, "latch closed"},
        {WIRE_IO_PRODUCT_HELD, "product held"},
        {WIRE_IO_DAMPERS_ENGAGED, "dampers in"},
        {WIRE_IO_GATE_UPPER, "upper gate"},
        {WIRE_IO_GATE_LOWER, "lower gate"},
        {WIRE_IO_FRAME_DOWN, "frame down"},
        {WIRE_IO_DOOR_CLOSED, "door closed"},
        {WIRE_IO_ESTOP_CLEAR, "stop clear"},
        {WIRE_IO_SUPPLY_GOOD, "supply good"},
        {WIRE_IO_IEPE_S1, "S1 bias"},
        {WIRE_IO_IEPE_S2, "S2 bias"},
};
enum { LANES = sizeof(lanes) / sizeof(lanes[0]) };

struct timeline *timeline_create(void)
{
	return calloc(1, sizeof(struct timeline));
}

void timeline_destroy(struct timeline *timeline)
{
	if (timeline != NULL)
		free(timeline->points);
	free(timeline);
}

static struct point *add_point(struct timeline *timeline)
{
	if (timeline->count == timeline->room) {
		size_t room = timeline->room ? 2 * timeline->room : 8192;
		struct point *points = realloc(timeline->points, room * sizeof(*points));

		if (points == NULL) {
			timeline->failed = 1;
			return NULL;
		}
		timeline->points = points;
		timeline->room = room;
	}
	return &timeline->points[timeline->count++];
}

void timeline_sample(struct timeline *timeline, double time_s, uint16_t io, uint8_t state, unsigned group,
                     const int16_t codes[6])
{
	struct point *point;

	if (timeline == NULL || timeline->failed)
		return;
	point = timeline->count ? &timeline->points[timeline->count - 1] : NULL;
	if (point == NULL || time_s - point->time_s >= 0.001 - 1e-9) {
		point = add_point(timeline);
		if (point == NULL)
			return;
		*point = (struct point){time_s, 0, 0, INT16_MAX, INT16_MIN};
	}
	point->io = io;
	point->state = state;
	for (unsigned axis = 0; axis < 2; axis++) {
		int16_t code = codes[3 + axis];

		if (!(group & (axis == 0 ? SENSORBUS_X : SENSORBUS_YZ)))
			continue;
		point->low = code < point->low ? code : point->low;
		point->high = code > point->high ? code : point->high;
	}
}

/* ---- drawing ---- */

/* gnuplot's text in single quotes; its enhanced mode is off. */
static void timeline_put_text(FILE *out, const char *text)
{
	fputc('\'', out);
	for (; *text != '\0'; text++) {
		if (*text == '\'')
			fputc('\'', out);
		fputc(*text, out);
	}
	fputc('\'', out);
}

/* Where state or io changed, as steps: time, state, lanes from the top. */
static void put_levels(const struct timeline *timeline, FILE *out)
{
	const struct point *before = NULL;

	fputs("$levels << END\n", out);
	for (size_t i = 0; i < timeline->count; i++) {
		const struct point *point = &timeline->points[i];

		if (before != NULL && point->io == before->io && point->state == before->state &&
		    i + 1 < timeline->count)
			continue;
		fprintf(out, "%.6f %d", point->time_s, point->state == UINT8_MAX ? 0 : point->state);
		for (unsigned lane = 0; lane < LANES; lane++)
			fprintf(out, " %g",
			        (double)(LANES - lane) - 0.35 + (point->io & lanes[lane].mask ? 0.6 : 0.0));
		fputc('\n', out);
		before = point;
	}
	fputs("END\n", out);
}

/* The trace from one point to another, low and high of each `step` points, in g. */
static void put_trace(const struct timeline *timeline, const char *name, size_t first, size_t last,
                      size_t step, FILE *out)
{
	fprintf(out, "$%s << END\n", name);
	for (size_t i = first; i < last; i += step) {
		struct point sum = timeline->points[i];

		for (size_t k = i + 1; k < i + step && k < last; k++) {
			const struct point *point = &timeline->points[k];

			sum.low = point->low < sum.low ? point->low : sum.low;
			sum.high = point->high > sum.high ? point->high : sum.high;
		}
		fprintf(out, "%.6f %.1f\n%.6f %.1f\n", sum.time_s, (double)sum.low / WIRE_COUNTS_PER_G,
		        sum.time_s, (double)sum.high / WIRE_COUNTS_PER_G);
	}
	fputs("END\n", out);
}

/* The point at which the latch was opened first; count: never. */
static size_t timeline_find_drop(const struct timeline *timeline)
{
	size_t i = 0;

	while (i < timeline->count && !(timeline->points[i].io & WIRE_IO_LATCH_OPEN))
		i++;
	return i;
}

static void put_emergencies(const struct monitor *monitor, double from_s, double to_s, FILE *out)
{
	const struct monitor_notes *notes = &monitor->emcy;

	fputs("unset arrow\nunset label\n", out);
	for (unsigned i = 0; i < notes->count && i < MONITOR_NOTES; i++) {
		double time_s = notes->note[i].time_s;

		if (time_s < from_s || time_s > to_s)
			continue;
		fprintf(out,
		        "set arrow from %.6f, graph 0 to %.6f, graph 1 nohead lc rgb '#c00000' dt 2\n"
		        "set label \"%s\" at %.6f, graph 0.98 right rotate by 90 offset -0.5,0 "
		        "tc rgb '#c00000' font ',10'\n",
		        time_s, time_s,
		        notes->note[i].number == WIRE_FAULT_NONE ? "EMCY cleared"
		                                                 : wire_fault_name(notes->note[i].number),
		        time_s);
	}
}

/* One column of three panels between two times. */
static void put_column(const struct monitor *monitor, const char *trace, double left, double right,
                       double from_s, double to_s, FILE *out)
{
	fprintf(out, "set lmargin at screen %g\nset rmargin at screen %g\nset xrange [%.6f:%.6f]\n", left,
	        right, from_s, to_s);
	fputs("set format x ''\nset xlabel ''\nset ylabel ''\nset ytics (", out);
	for (unsigned i = 0; i < WIRE_STATES; i++)
		fprintf(out, "%s'%s' %u", i ? ", " : "", wire_state_name(i), i);
	fprintf(out, ")\nset yrange [-0.7:%u.7]", WIRE_STATES - 1);
	fputs("\nset tmargin at screen 0.92\nset bmargin at screen 0.67\n", out);
	put_emergencies(monitor, from_s, to_s, out);
	fputs("plot $levels using 1:2 with steps lw 2 lc rgb '#205090'\nunset label\n", out);
	fprintf(out, "set yrange [0.3:%u.7]\nset ytics (", LANES);
	for (unsigned i = 0; i < LANES; i++)
		fprintf(out, "%s'%s' %u", i ? ", " : "", lanes[i].name, LANES - i);
	fputs(")\nset tmargin at screen 0.65\nset bmargin at screen 0.30\nplot for [lane=3:", out);
	fprintf(out, "%u] $levels using 1:lane with steps lw 1.5 lc rgb (lane < 8 ? 0xb05010 : 0x307030)\n",
	        LANES + 2);
	fputs("set ylabel 'S2 X, Y (g)'\nset yrange [*:*]\nset ytics auto\nset format x '%g'\n"
	      "set xlabel 'virtual time (s)'\nset tmargin at screen 0.28\nset bmargin at screen 0.08\n",
	      out);
	fprintf(out, "plot $%s using 1:2 with lines lw 0.8 lc rgb '#404040'\n", trace);
}

static void put_picture(const struct timeline *timeline, const struct monitor *monitor, const char *title,
                        const char *file, FILE *out)
{
	size_t count = timeline->count, drop = timeline_find_drop(timeline), first, last;
	bool dropped = drop < count;
	double end_s = timeline->points[count - 1].time_s;

	fputs("set terminal svg size 1500,850 font 'sans-serif,11' noenhanced background '#ffffff'\nset "
	      "output ",
	      out);
	timeline_put_text(out, file);
	fputc('\n', out);
	put_levels(timeline, out);
	put_trace(timeline, "wide", 0, count, 1 + count / WIDE_POINTS, out);
	fputs("unset key\nset grid x lc rgb '#d0d0d0'\nset tics nomirror font ',9'\nset multiplot title ",
	      out);
	timeline_put_text(out, title);
	fputc('\n', out);
	put_column(monitor, "wide", 0.095, dropped ? 0.52 : 0.985, 0, end_s, out);
	if (dropped) {
		first = drop > BEFORE_DROP_MS ? drop - BEFORE_DROP_MS : 0;
		last = drop + DROP_MS < count ? drop + DROP_MS : count;
		put_trace(timeline, "drop", first, last, 1, out);
		put_column(monitor, "drop", 0.625, 0.985, timeline->points[first].time_s,
		           timeline->points[last - 1].time_s, out);
	}
	fputs("unset multiplot\n", out);
}

int timeline_draw(const struct timeline *timeline, const struct monitor *monitor, const char *title,
                  const char *file)
{
	static const char *const gnuplot[] = {"gnuplot", "--default-settings", NULL};
	struct process_streams streams;
	struct text script;
	int result;

	if (timeline == NULL || timeline->count == 0)
		return 0;
	if (timeline->failed) {
		errno = ENOMEM;
		return DT_E_SYSTEM;
	}
	result = text_open(&script);
	if (result != 0)
		return result;
	put_picture(timeline, monitor, title, file, script.out);
	result = text_close(&script, 0);
	if (result != 0)
		return result;
	result = process_streams_open(&streams, script.bytes, script.size);
	free(script.bytes);
	if (result != 0)
		return DT_E_SYSTEM;
	result = process_filter(gnuplot, &streams);
	process_streams_close(&streams);
	return result == 0 ? 0 : DT_E_SYSTEM;
}
