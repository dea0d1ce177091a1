/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "hil/study/holdout.h"

#include <math.h>
#include <string.h>

#include "hil/study/trial.h"

/* ---- what each refinement is worth ---- */

static const struct {
	const char *what;
	unsigned refinements, free; /* that are left */
	bool sharp;
} without[] = {
        {"all of them", MODEL_REFINEMENTS, TRIAL_ALL, false},
        {"without wedge", MODEL_REFINEMENTS & ~MODEL_WEDGE, TRIAL_ALL, false},
        {"without grip", MODEL_REFINEMENTS & ~MODEL_GRIP, TRIAL_ALL & ~(1u << TRIAL_GRIP), false},
        {"without mounts' softening", MODEL_REFINEMENTS, TRIAL_ALL & ~(1u << TRIAL_SOFTENING), false},
        {"stiffness from 3.0 ms", MODEL_REFINEMENTS & ~MODEL_STIFFNESS, TRIAL_ALL & ~(1u << TRIAL_STIFFNESS),
         false},
        {"balance of the box's own corner", MODEL_REFINEMENTS, TRIAL_ALL & ~(1u << TRIAL_BALANCE), true},
        {"without S1's yaw in 2B", MODEL_REFINEMENTS, TRIAL_ALL & ~(1u << TRIAL_YAW), false},
};
enum { WITHOUT = sizeof(without) / sizeof(without[0]) };

/* AICc by which a refinement must be better than its absence. */
#define PAYS 2.0

static bool tell_refinements(const struct study *study, struct sheet *sheet, struct trial *all)
{
	static const struct sheet_column columns[] = {{"", "", -34},   {"", "fitted", 8}, {"", "chi2", 9},
	                                              {"", "AICc", 8}, {"", "worth", 8},  {"", "", 14}};
	bool pays = true;

	sheet_heading(sheet, "What each refinement is worth");
	sheet_say(sheet,
	          "The planar model fitted to %d printed numbers (60 means, contact time, lags, frequencies, "
	          "dampings), and the same with one thing less. worth: by how much AICc rises without it; "
	          "below %.0f it does not pay.",
	          TRIAL_DATA, PAYS);
	sheet_table(sheet, columns, sizeof(columns) / sizeof(columns[0]));
	for (size_t i = 0; i < WITHOUT; i++) {
		struct trial t = {.study = study,
		                  .refinements = without[i].refinements,
		                  .free = without[i].free,
		                  .sharp = without[i].sharp,
		                  .geometry = -1};
		bool fails = trial_fit(&t) != 0;

		if (i == 0)
			*all = t;
		if (fails || all->data == 0) {
			sheet_row(sheet, "%s|-|-|-|-|%s", without[i].what, "no fit*");
			pays = pays && i > 0;
			continue;
		}
		if (i > 0 && !(t.aicc - all->aicc > PAYS))
			pays = false;
		sheet_row(sheet, "%s|%zu|%.1f|%.1f|%s%.1f|%s", without[i].what, t.fitted, t.chi2, t.aicc,
		          t.aicc < all->aicc ? "" : "+", t.aicc - all->aicc,
		          i == 0                      ? ""
		          : t.aicc - all->aicc > PAYS ? "pays"
		                                      : "does not pay*");
	}
	sheet_table_end(sheet);
	return pays;
}

static void tell_values(const struct trial *all, struct sheet *sheet)
{
	static const struct sheet_column columns[] = {
	        {"", "", -40}, {"", "", -13}, {"", "scenes", 8}, {"", "fitted", 8}, {"", "+-", 8}};
	const struct scene *soft = &all->study->scene[1];
	const double shipped[TRIAL_PARAMETERS] = {soft->contact_stiffness_n_m15,
	                                          soft->contact_tangential_ratio,
	                                          soft->product_balance_angle_deg,
	                                          soft->mount_softening,
	                                          soft->mount_damping_n_s_m / soft->mount_stiffness_n_m,
	                                          all->study->scene[2].sensor_s1_yaw_deg};

	sheet_say(sheet, "The numbers, fitted again, beside those of the scenes, which were rounded:");
	sheet_table(sheet, columns, sizeof(columns) / sizeof(columns[0]));
	for (size_t i = 0; i < TRIAL_PARAMETERS; i++)
		sheet_row(sheet, "%s|%s|%.3f|%.3f|%.3f", trial_parameters[i].what, trial_parameters[i].unit,
		          shipped[i] * trial_parameters[i].scale, all->value[i] * trial_parameters[i].scale,
		          all->sd[i] * trial_parameters[i].scale);
	sheet_table_end(sheet);
}

/* ---- what is left out ---- */

/* Sums of absolute deviations in percent of S1 on the plate and of the sensors on the box. */
struct apart {
	double sum[2][2]; /* of the resultant, of X and Y */
	size_t count[2];
};

static void apart_add(struct apart *d, size_t g,
                      const struct study_value published[STUDY_SENSORS][STUDY_QUANTITIES],
                      const double value[STUDY_SENSORS][STUDY_R + 1])
{
	for (size_t s = 0; s < STUDY_SENSORS; s++) {
		size_t on = g == 0 || s == 1;
		double off[STUDY_R + 1];

		for (size_t q = 0; q <= STUDY_R; q++)
			off[q] = 100.0 * fabs(value[s][q] / published[s][q].mean - 1.0);
		d->sum[on][0] += off[STUDY_R];
		d->sum[on][1] += 0.5 * (off[STUDY_X] + off[STUDY_Y]);
		d->count[on]++;
	}
}

/* Of the drops that a fit left out, or of all. */
static void apart_of(const struct trial *t, struct apart *d)
{
	for (size_t g = 0; g < STUDY_GEOMETRIES; g++)
		for (size_t a = 0; a < STUDY_ANGLES; a++) {
			const struct model_prediction *p = &t->drop[g][a];
			const double value[STUDY_SENSORS][STUDY_R + 1] = {
			        {p->peak[0].value_g, p->peak[1].value_g, p->resultant[0].value_g},
			        {p->peak[2].value_g, p->peak[3].value_g, p->resultant[1].value_g}};

			if ((!t->angles && t->geometry < 0) || trial_left_out(t, g, a))
				apart_add(d, g, t->study->series[g][a].published, value);
		}
}

/* A constant for each box: the mean of the other angles stands for the one left out. */
static void apart_of_constants(const struct study *study, struct apart *d)
{
	for (size_t i = 0; i < STUDY_GEOMETRIES * STUDY_ANGLES; i++) {
		const struct study_series *box = study->series[i / STUDY_ANGLES];
		double value[STUDY_SENSORS][STUDY_R + 1] = {{0}};

		for (size_t k = 0; k < STUDY_ANGLES * STUDY_SENSORS * (STUDY_R + 1); k++) {
			size_t a = k % STUDY_ANGLES, s = k / STUDY_ANGLES % STUDY_SENSORS,
			       q = k / (STUDY_ANGLES * STUDY_SENSORS);

			if (a != i % STUDY_ANGLES)
				value[s][q] += box[a].published[s][q].mean / (STUDY_ANGLES - 1);
		}
		apart_add(d, i / STUDY_ANGLES, box[i % STUDY_ANGLES].published, value);
	}
}

/* Percent of the plate's resultant; of the box's where there is no plate. */
static double apart_tell(const struct apart *d, const char *what, const char *how, const struct trial *box,
                         struct sheet *sheet)
{
	char cells[128];
	size_t at = 0;

	for (size_t on = 0; on < 2; on++)
		for (size_t k = 0; k < 2; k++)
			at += (size_t)(d->count[on] > 0 ? snprintf(cells + at, sizeof(cells) - at, "%.1f|",
			                                           d->sum[on][k] / (double)d->count[on])
			                                : snprintf(cells + at, sizeof(cells) - at, "-|"));
	if (box != NULL && box->geometry > 0)
		snprintf(cells + at, sizeof(cells) - at, "%.0f|%.2f",
		         box->drop[box->geometry][TRIAL_MIDDLE].plate_frequency_hz,
		         1e3 * box->drop[box->geometry][TRIAL_MIDDLE].lag_s);
	else
		snprintf(cells + at, sizeof(cells) - at, "-|-");
	sheet_row(sheet, "%s|%s|%s", what, how, cells);
	return d->sum[d->count[0] == 0][0] / (double)d->count[d->count[0] == 0];
}

static const struct {
	const char *what;
	int geometry;
	unsigned free;
} boxes[] = {
        {"2B from 1 and 2A", 2, TRIAL_ALL & ~(1u << TRIAL_YAW)},
        {"2B from 1 and 2A, linear mounts", 2, TRIAL_ALL & ~(1u << TRIAL_YAW | 1u << TRIAL_SOFTENING)},
        {"2A from 1 and 2B", 1, TRIAL_ALL},
        {"1 from 2A and 2B", 0, TRIAL_ALL},
};
enum { BOXES = sizeof(boxes) / sizeof(boxes[0]) };

/* Percent of S1's resultant: of an angle left out, of a box left out. */
#define LIMIT_ANGLE 4.0
#define LIMIT_BOX 5.0

/* Percent of the plate's resultant; NAN where a fit fails. */
static double tell_angles(const struct study *study, struct sheet *sheet)
{
	struct apart d = {.count = {0}};

	for (int a = 0; a < STUDY_ANGLES; a++) {
		struct trial t = {.study = study,
		                  .refinements = MODEL_REFINEMENTS,
		                  .free = TRIAL_ALL,
		                  .angles = 1u << a,
		                  .geometry = -1};

		if (trial_fit(&t) != 0)
			return (double)NAN;
		apart_of(&t, &d);
	}
	return apart_tell(&d, "one angle left out, five times", "predicted", NULL, sheet);
}

static bool tell_left_out(const struct study *study, struct sheet *sheet, const struct trial *all)
{
	static const struct sheet_column columns[] = {
	        {"", "", -34},    {"", "", -11},         {"plate", "XY", 7}, {"plate", "X and Y", 9},
	        {"box", "XY", 7}, {"box", "X and Y", 9}, {"", "ring Hz", 9}, {"", "lag ms", 8},
	};
	struct apart fitted = {.count = {0}}, constant = {.count = {0}};
	double error[BOXES], angle_percent;
	bool holds;

	sheet_heading(sheet, "What was left out of the fit, predicted");
	sheet_say(sheet,
	          "Mean absolute deviation from the printed means, percent; XY is the resultant. fitted: "
	          "these means were in the fit; predicted: they were not. The study's rings: 129 Hz in 2A, "
	          "177 in 2B; its lags: 2.0 and 1.2 ms. Of 2B nothing is known but its cubes' size, so that "
	          "S1's yaw in it, and with it Y, cannot be predicted.");
	sheet_table(sheet, columns, sizeof(columns) / sizeof(columns[0]));
	apart_of(all, &fitted);
	apart_tell(&fitted, "all angles, all boxes", "fitted", NULL, sheet);
	angle_percent = tell_angles(study, sheet);
	holds = angle_percent < LIMIT_ANGLE;
	apart_of_constants(study, &constant);
	apart_tell(&constant, "a constant: mean of the other angles", "no model", NULL, sheet);
	for (size_t i = 0; i < BOXES; i++) {
		struct trial t = {.study = study,
		                  .refinements = MODEL_REFINEMENTS,
		                  .free = boxes[i].free,
		                  .geometry = boxes[i].geometry};
		struct apart d = {.count = {0}};

		if (trial_fit(&t) != 0)
			return false;
		apart_of(&t, &d);
		error[i] = apart_tell(&d, boxes[i].what, "predicted", &t, sheet);
		/* linear mounts are there to be beaten */
		holds = holds && (error[i] < LIMIT_BOX || !(boxes[i].free >> TRIAL_SOFTENING & 1u));
	}
	sheet_table_end(sheet);
	sheet_say(sheet, "On the plate's resultant a constant is off by %.1f %%, the model by %.1f %%%s.",
	          constant.sum[0][0] / (double)constant.count[0], angle_percent,
	          constant.sum[0][0] / (double)constant.count[0] < angle_percent
	                  ? ": that number ranks no model; X, Y and the box do"
	                  : "");
	sheet_say(
	        sheet,
	        "The softening of the mounts, found in 2A, predicts the other cubes: %.1f %% of the plate's "
	        "resultant in 2B, %.1f %% with linear mounts.",
	        error[0], error[1]);
	return holds && error[0] < error[1];
}

/* ---- whether the bars hold ---- */

enum { HELD = TRIAL_AXES + STUDY_SENSORS }; /* X and Y of S1 and S2, their resultants */

/* How many left-out means of X and Y, and of resultants, are within two bars of what is predicted. */
struct held {
	unsigned count[2], within[2], fits;
	double bars[2]; /* sum, as shares of the resultant */
};

static double held_percent(const struct held *h, int which)
{
	return 100.0 * h->within[which] / h->count[which];
}

static int bits_of(unsigned mask)
{
	int count = 0;

	for (; mask; mask &= mask - 1)
		count++;
	return count;
}

static double held_of(const struct model_prediction *p, size_t row)
{
	return row < TRIAL_AXES ? p->peak[row].value_g : p->resultant[row - TRIAL_AXES].value_g;
}

/* A standard deviation of one parameter to each side; half of what it changes. */
static bool held_slope(const struct trial *t, size_t parameter, double slope[STUDY_ANGLES][HELD])
{
	struct model_prediction drop[2][STUDY_GEOMETRIES][STUDY_ANGLES];
	double sd = sqrt(t->covariance[parameter][parameter]);

	for (int side = 0; side < 2; side++) {
		double value[TRIAL_PARAMETERS], move = side == 0 ? -sd : sd;

		memcpy(value, t->value, sizeof(value));
		value[parameter] = trial_parameters[parameter].logarithm ? value[parameter] * exp(move)
		                                                         : value[parameter] + move;
		value[TRIAL_SOFTENING] = fmax(value[TRIAL_SOFTENING], 0.0);
		if (trial_solve(t, value, drop[side], true) != 0)
			return false;
	}
	for (size_t a = 0; a < STUDY_ANGLES; a++)
		for (size_t row = 0; row < HELD; row++)
			slope[a][row] = 0.5 * (held_of(&drop[1][t->geometry][a], row) -
			                       held_of(&drop[0][t->geometry][a], row));
	return true;
}

static void held_add(struct held *h, const struct trial *t, size_t a, size_t row,
                     const double slope[TRIAL_PARAMETERS][STUDY_ANGLES][HELD])
{
	size_t sensor = row < TRIAL_AXES ? row / 2 : row - TRIAL_AXES,
	       quantity = row < TRIAL_AXES ? row % 2 : STUDY_R;
	const struct study_value *v = t->study->series[t->geometry][a].published[sensor];
	double error = trial_error(v, quantity), variance = error * error;
	double off = held_of(&t->drop[t->geometry][a], row) - v[quantity].mean;

	for (size_t i = 0; i < TRIAL_PARAMETERS; i++)
		for (size_t j = 0; j < TRIAL_PARAMETERS; j++)
			if (t->covariance[i][i] > 0.0 && t->covariance[j][j] > 0.0)
				variance += t->covariance[i][j] /
				            sqrt(t->covariance[i][i] * t->covariance[j][j]) *
				            slope[i][a][row] * slope[j][a][row];
	h->count[row >= TRIAL_AXES]++;
	h->within[row >= TRIAL_AXES] += fabs(off) <= 2.0 * sqrt(variance);
	h->bars[row >= TRIAL_AXES] += sqrt(variance) / v[STUDY_R].mean;
}

/* One box, fitted to some of its angles alone. */
static bool held_by(const struct study *study, int geometry, unsigned angles, struct held *h)
{
	struct trial t = {.study = study,
	                  .refinements = MODEL_REFINEMENTS,
	                  .free = TRIAL_ALL & ~(geometry < 2 ? 1u << TRIAL_YAW : 0u) &
	                          ~(geometry < 1 ? 1u << TRIAL_SOFTENING | 1u << TRIAL_DAMPING : 0u),
	                  .angles = ~angles,
	                  .geometry = geometry,
	                  .alone = true};
	double slope[TRIAL_PARAMETERS][STUDY_ANGLES][HELD] = {{{0.0}}};

	if (trial_fit(&t) != 0)
		return false;
	for (size_t i = 0; i < TRIAL_PARAMETERS; i++)
		if (t.covariance[i][i] > 0.0 && !held_slope(&t, i, slope[i]))
			return false;
	h->fits++;
	for (size_t a = 0; a < STUDY_ANGLES; a++)
		for (size_t row = 0; row < HELD && !(angles >> a & 1u); row++)
			held_add(h, &t, a, row, (const double(*)[STUDY_ANGLES][HELD])slope);
	return true;
}

static void held_tell(const struct held *h, const char *what, int angles, struct sheet *sheet)
{
	sheet_row(sheet, "%s|%d|%u|%.0f|%.1f|%.0f|%.1f", what, angles, h->fits, held_percent(h, 0),
	          100.0 * h->bars[0] / h->count[0], held_percent(h, 1), 100.0 * h->bars[1] / h->count[1]);
}

/* Percent of the means left out that must be within two bars. */
#define LIMIT_HELD 90.0

static bool tell_held(const struct study *study, struct sheet *sheet)
{
	static const struct sheet_column columns[] = {
	        {"", "", -14},       {"", "angles", 7}, {"", "fits", 5},  {"X and", "Y in", 7},
	        {"their", "bar", 6}, {"XY", "in", 5},   {"its", "bar", 6}};
	struct held of_all[2] = {{.fits = 0}, {.fits = 0}};
	bool fitted = true;

	sheet_heading(sheet, "How often the bars hold");
	sheet_say(sheet, "One box, fitted to each two or three of its angles and to nothing else but weak "
	                 "knowledge of any "
	                 "product; in: percent of the other angles' printed means within two bars of what is "
	                 "predicted. "
	                 "bar: of parameters, mean and the model's own 3 %% of a resultant, in percent of "
	                 "the resultant.");
	sheet_table(sheet, columns, sizeof(columns) / sizeof(columns[0]));
	for (int few = 0; few < 2; few++) {
		for (int g = 0; g < STUDY_GEOMETRIES; g++) {
			struct held h = {.fits = 0};

			for (unsigned angles = 0; angles < 1u << STUDY_ANGLES; angles++)
				if (bits_of(angles) == few + 2)
					fitted = held_by(study, g, angles, &h) && fitted;
			held_tell(&h, study->scene[g].name, few + 2, sheet);
			for (int k = 0; k < 2; k++) {
				of_all[few].count[k] += h.count[k];
				of_all[few].within[k] += h.within[k];
				of_all[few].bars[k] += h.bars[k];
			}
			of_all[few].fits += h.fits;
		}
		held_tell(&of_all[few], "all", few + 2, sheet);
	}
	sheet_table_end(sheet);
	for (int few = 0; few < 2; few++)
		for (int k = 0; k < 2; k++)
			fitted = fitted && held_percent(&of_all[few], k) >= LIMIT_HELD;
	return fitted;
}

bool holdout_tell(const struct study *study, struct sheet *sheet)
{
	struct trial all;
	bool pays = tell_refinements(study, sheet, &all), predicts, holds;

	if (all.data == 0)
		return false;
	tell_values(&all, sheet);
	predicts = tell_left_out(study, sheet, &all);
	holds = tell_held(study, sheet);
	if (!pays)
		sheet_say(sheet, "A REFINEMENT DOES NOT PAY: it asks for more numbers than it explains.");
	if (!predicts)
		sheet_say(sheet,
		          "WHAT WAS LEFT OUT IS NOT PREDICTED: within %.0f %% of an angle's resultant on S1, "
		          "%.0f %% of a box's, and better than with linear mounts.",
		          LIMIT_ANGLE, LIMIT_BOX);
	if (!holds)
		sheet_say(
		        sheet,
		        "THE BARS DO NOT HOLD: less than %.0f %% of what was left out is within two of them.",
		        LIMIT_HELD);
	return pays && predicts && holds;
}
