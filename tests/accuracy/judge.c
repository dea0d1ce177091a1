/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/accuracy/cells.h"

#include <math.h>
#include <stdio.h>

/* An error smaller than this part of the bound is not possible by honest means. */
#define RATIO_LOW 0.93

/* What the reported 2-sigma bars cover. */
#define COVER_LOW 0.93
#define COVER_HIGH 0.98

/* A decay is counted from where its drive has ended; a pulse that fades slowly leaves a little before that
 * to those who look. */
#define DECAY_LOW 0.85
#define SKEWED_DECAY_LOW 0.75 /* its last half is hardly there */
#define TWO_MODES_LOW 0.7     /* the early samples tell them apart */

struct limit {
	enum group group;
	enum quantity from, to;  /* inclusive */
	double ratio_low, ratio; /* at least and at most; ratio 0: not limited */
	double bias_bounds;      /* |mean error| in parts of the bound, at most; 0: not limited */
	double bias;             /* in the quantity's unit, at most; 0: not limited */
	double cover;            /* at least; from COVER_LOW on also at most COVER_HIGH; 0: not limited */
	double absent;           /* drops without a value, at most; NEVER_MIND: nor is any error gross */
};

#define NEVER_MIND 2
/* A test against chance refuses a few by chance. */
#define BY_CHANCE 0.01
/* Three spikes within five samples hide each other. */
#define RARELY 5e-4

#define PEAKS QUANTITY_PEAK_X, QUANTITY_PEAK_Y
#define PEAK_TIMES QUANTITY_PEAK_TIME_X, QUANTITY_PEAK_TIME_Y
#define JUST(quantity) QUANTITY_##quantity, QUANTITY_##quantity
#define WIDTH QUANTITY_WIDTH_X, QUANTITY_VELOCITY_X
#define FREQUENCIES QUANTITY_FREQUENCY_X, QUANTITY_FREQUENCY
#define DECAY QUANTITY_FREQUENCY_X, QUANTITY_DAMPING
#define LAGS QUANTITY_LAG_X, QUANTITY_LAG
#define PLATE_PEAKS QUANTITY_PLATE_PEAK_X, QUANTITY_PLATE_PEAK_Y
#define PLATE_TIMES QUANTITY_PLATE_TIME_X, QUANTITY_PLATE_TIME_Y
#define PLATE_RESULTANT QUANTITY_PLATE_RESULTANT, QUANTITY_PLATE_RESULTANT_TIME

static const struct limit limits[] = {
        {GROUP_KNOWN, PEAKS, RATIO_LOW, 1.04, 0.1, 0, COVER_LOW, 0},
        {GROUP_KNOWN, JUST(PEAK_Z), 0, 0, 0, 0, COVER_LOW, NEVER_MIND},
        {GROUP_KNOWN, PEAK_TIMES, RATIO_LOW, 1.04, 0.1, 0, COVER_LOW, 0},
        {GROUP_KNOWN, WIDTH, 0, 0, 0, 0, COVER_LOW, 0},
        {GROUP_KNOWN, JUST(CONTACT_X), RATIO_LOW, 1.04, 0.1, 0, COVER_LOW, BY_CHANCE},
        {GROUP_KNOWN, JUST(FITTED_VELOCITY_X), RATIO_LOW, 1.06, 0.1, 0, COVER_LOW, BY_CHANCE},
        {GROUP_KNOWN, JUST(RESULTANT), RATIO_LOW, 1.06, 0, 0, COVER_LOW, 0},
        {GROUP_KNOWN, JUST(RESULTANT_TIME), 0, 0, 0, 0, COVER_LOW, 0},
        {GROUP_KNOWN, DECAY, DECAY_LOW, 1.05, 0, 0, COVER_LOW, 0},
        {GROUP_KNOWN, LAGS, RATIO_LOW, 1.3, 0, 1e-6, COVER_LOW, BY_CHANCE},
        {GROUP_KNOWN, PLATE_PEAKS, RATIO_LOW, 1.1, 0, 0, COVER_LOW, 0},
        {GROUP_KNOWN, PLATE_TIMES, RATIO_LOW, 1.2, 0, 0, COVER_LOW, 0},
        {GROUP_KNOWN, PLATE_RESULTANT, 0, 0, 0, 0, COVER_LOW, 0},
        {GROUP_UNKNOWN, PEAKS, RATIO_LOW, 1.6, 0, 0, COVER_LOW, 0},
        {GROUP_UNKNOWN, JUST(PEAK_Z), 0, 0, 0, 0, COVER_LOW, NEVER_MIND},
        {GROUP_UNKNOWN, PEAK_TIMES, RATIO_LOW, 4.4, 0, 0, COVER_LOW, 0},
        {GROUP_UNKNOWN, WIDTH, 0, 0, 0, 0, COVER_LOW, 0},
        {GROUP_UNKNOWN, JUST(RESULTANT), RATIO_LOW, 1.5, 0, 0, COVER_LOW, 0},
        {GROUP_UNKNOWN, JUST(RESULTANT_TIME), 0, 0, 0, 0, COVER_LOW, 0},
        {GROUP_UNKNOWN, DECAY, DECAY_LOW, 1.05, 0, 0, COVER_LOW, 0},
        {GROUP_UNKNOWN, LAGS, RATIO_LOW, 1.3, 0, 1e-6, COVER_LOW, BY_CHANCE},
        {GROUP_UNKNOWN, PLATE_PEAKS, RATIO_LOW, 1.1, 0, 0, COVER_LOW, 0},
        {GROUP_UNKNOWN, PLATE_TIMES, RATIO_LOW, 1.2, 0, 0, COVER_LOW, 0},
        {GROUP_UNKNOWN, PLATE_RESULTANT, 0, 0, 0, 0, COVER_LOW, 0},
        {GROUP_SKEWED, PEAKS, 0, 0, 0, 0.3, COVER_LOW, 0},
        {GROUP_SKEWED, PEAK_TIMES, 0, 0, 0, 4e-6, 0.85, 0},
        {GROUP_SKEWED, JUST(RESULTANT), 0, 0, 0, 0.3, COVER_LOW, 0},
        {GROUP_SKEWED, DECAY, SKEWED_DECAY_LOW, 1.05, 0, 0, COVER_LOW, 0},
        {GROUP_SKEWED, PLATE_PEAKS, 0, 0, 0, 0.3, COVER_LOW, 0},
        {GROUP_SKEWED, PLATE_TIMES, 0, 0, 0, 4e-6, 0.85, 0},
        {GROUP_SKEWED, JUST(PLATE_RESULTANT), 0, 0, 0, 0.3, COVER_LOW, 0},
        {GROUP_SKEWED, JUST(PLATE_RESULTANT_TIME), 0, 0, 0, 4e-6, 0.85, 0},
        {GROUP_APART_KNOWN, JUST(RESULTANT), RATIO_LOW, 1.06, 0, 0, COVER_LOW, 0},
        {GROUP_APART, JUST(RESULTANT), RATIO_LOW, 1.5, 0, 0, COVER_LOW, 0},
        {GROUP_DISTURBED, DECAY, DECAY_LOW, 1.15, 0, 0, 0, RARELY},
        {GROUP_TWO_MODES, FREQUENCIES, TWO_MODES_LOW, 1.15, 0, 0, 0, 0},
        {GROUP_LOUD, JUST(FREQUENCY_X), 0, 0, 0, 0, 0, BY_CHANCE},
        {GROUP_LOUD, JUST(FREQUENCY_Y), 0, 0, 0, 0, 0, 1}, /* the weak axis may be given up */
        {GROUP_LOUD, JUST(FREQUENCY), 0, 0, 0, 0, 0, BY_CHANCE},
        {GROUP_CLIPPED, JUST(PEAK_X), RATIO_LOW, 1.1, 0, 0, COVER_LOW, 0},
        {GROUP_HOLE, JUST(PEAK_X), 0, 0, 0, 0.1, 0, 0},
};

/* Of the faults, those that can be cured must not harm the peak. */
#define CURED_G 0.5

static const char *const quantity_names[QUANTITIES] = {
        "peak X",    "peak Y",      "peak Z",    "peak time X", "peak time Y",  "10 % width X", "velocity X",
        "contact X", "fitted dv X", "resultant", "its time",    "frequency X",  "frequency Y",  "frequency",
        "natural",   "damping X",   "damping Y", "damping",     "lag X",        "lag Y",        "lag",
        "S1 peak X", "S1 peak Y",   "S1 time X", "S1 time Y",   "S1 resultant", "S1 its time",
};

struct judgement {
	const struct cells *cells;
	double slack;
	enum cells_print print;
	unsigned judged, failed;
};

static void say(struct judgement *j, const struct cell_scene *cell, const char *what, bool ok,
                const char *figures)
{
	j->judged++;
	j->failed += !ok;
	if (j->print == CELLS_NOTHING || (j->print == CELLS_FAILURES && ok))
		return;
	printf("# %-17s %-26s %s %5.1f g  %-12s %s  %s\n", group_name(cell->group), cell->name,
	       cell->geometry == GEOMETRY_2A ? "2A" : "2B", cell->scene.noise_g, what, figures,
	       ok ? "ok" : "FAIL");
}

/* Counts are binomial: their own scatter at the limit. */
static double scatter(double part, unsigned drops)
{
	return sqrt(part * (1 - part) / fmax(drops, 1));
}

static void judge_quantity(struct judgement *j, const struct cell_scene *cell, const struct limit *limit,
                           enum quantity quantity)
{
	const struct tally *t = &cell->tally[quantity];
	double n = fmax(t->values, 1), mean = t->error / n, rms = sqrt(t->square / n);
	double ratio = rms / t->bound, bias = fmax(0, fabs(mean) - 2 * rms / sqrt(n));
	double wide = 1 + j->slack / sqrt(2 * n), cover = t->covered / n, drops = fmax(cell->drops, 1);
	bool ok = true;
	char figures[200];
	int length;

	if (t->values == 0) {
		say(j, cell, quantity_names[quantity], limit->absent >= 1, "no value in any drop");
		return;
	}
	length = snprintf(figures, sizeof(figures), "ratio %7.3f", ratio);

	if (limit->ratio > 0) {
		ok &= ratio <= limit->ratio * wide && ratio >= limit->ratio_low / wide;
		length +=
		        snprintf(figures + length, sizeof(figures) - (size_t)length, " (%.2f)", limit->ratio);
	} else {
		length += snprintf(figures + length, sizeof(figures) - (size_t)length, " (    )");
	}
	length += snprintf(figures + length, sizeof(figures) - (size_t)length, "  bias %+10.3g %+6.2f bounds",
	                   mean, mean / t->bound);
	if (limit->bias_bounds > 0)
		ok &= bias <= limit->bias_bounds * t->bound;
	if (limit->bias > 0)
		ok &= bias <= limit->bias;
	length += snprintf(figures + length, sizeof(figures) - (size_t)length, "  covers %5.1f %%",
	                   100 * cover);
	if (limit->cover > 0)
		ok &= cover >= limit->cover - j->slack * scatter(limit->cover, t->values);
	if (limit->cover >= COVER_LOW)
		ok &= cover <= COVER_HIGH + j->slack * scatter(COVER_HIGH, t->values);
	snprintf(figures + length, sizeof(figures) - (size_t)length, "  absent %5.2f %%  gross %5.2f %%",
	         100 * (1 - t->values / drops), 100 * t->gross / drops);
	if (limit->absent < NEVER_MIND)
		ok &= t->gross == 0 && drops - t->values <= limit->absent * drops;
	say(j, cell, quantity_names[quantity], ok, figures);
}

static void judge_part(struct judgement *j, const struct cell_scene *cell, const char *what, unsigned found,
                       double least, double most)
{
	double part = (double)found / fmax(cell->drops, 1);
	bool ok = part >= least - j->slack * scatter(least, cell->drops) &&
	          part <= most + j->slack * scatter(most, cell->drops);
	char figures[160];

	snprintf(figures, sizeof(figures), "%5.1f %% of the drops (%.1f to %.1f)", 100 * part, 100 * least,
	         100 * most);
	say(j, cell, what, ok, figures);
}

static void judge_scene(struct judgement *j, const struct cell_scene *cell)
{
	const struct synthetic_scene *scene = &cell->scene;

	for (unsigned i = 0; i < sizeof(limits) / sizeof(limits[0]); i++)
		for (enum quantity q = limits[i].from; limits[i].group == cell->group && q <= limits[i].to;
		     q++)
			judge_quantity(j, cell, &limits[i], q);
	if (cell->group == GROUP_KNOWN || cell->group == GROUP_UNKNOWN || cell->group == GROUP_SKEWED)
		judge_part(j, cell, "second mode", cell->second, 0, 0.005);
	if (cell->group == GROUP_TWO_MODES)
		judge_part(j, cell, "second mode", cell->second, 0.99, 1);
	if (cell->group == GROUP_CLIPPED || cell->group == GROUP_FAULT || scene->hum_g > 0 ||
	    scene->spikes > 0)
		judge_part(j, cell, "flagged", cell->marked, 1, 1);
	if (cell->group == GROUP_WRONG)
		judge_part(j, cell, "refused", cell->marked, 0.99, 1);
	if (cell->group == GROUP_FAULT && scene->clip_g <= 0 && !scene->cut)
		judge_quantity(j, cell, &(struct limit){.group = GROUP_FAULT, .bias = CURED_G},
		               QUANTITY_PEAK_X);
}

unsigned cells_judge(const struct cells *cells, enum group group, double slack, enum cells_print print,
                     unsigned *judged)
{
	struct judgement j = {cells, slack, print, 0, 0};

	for (unsigned i = 0; i < cells->count; i++)
		if (cells->scene[i].group == group)
			judge_scene(&j, &cells->scene[i]);
	*judged = j.judged;
	return j.failed;
}
