/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/report/fitted.h"
#include "host/base/html.h"

#include <math.h>

enum { COLUMNS_MAX = 16 };

/* A page has the bar in the value's own cell: columns of bars alone, which have no key, are left out. */
static void begin_table(struct table *table, struct table_column kept[COLUMNS_MAX],
                        const struct table_column *columns, size_t count)
{
	size_t n = 0;

	for (size_t i = 0; i < count; i++)
		if (table->format != TABLE_HTML || columns[i].key)
			kept[n++] = columns[i];
	table_begin(table, kept, n);
}

struct parameter_row {
	const char *name, *status;
	struct table_value value;
};

static const struct table_column parameter_columns[] = {
        TABLE_COLUMN(WORDS, struct parameter_row, name, .key = "name", .title = "parameter", .width = -18,
                     .own = true),
        TABLE_COLUMN(VALUE, struct parameter_row, value, .key = "value", .sigma = "u", .title = "value",
                     .width = 12, .digits = TABLE_DIGITS_G),
        TABLE_COLUMN(NUMBER, struct parameter_row, value.sigma, .title = "+-", .width = 11, .digits = -3),
        TABLE_COLUMN(WORDS, struct parameter_row, status, .key = "status", .title = "", .width = -16,
                     .gap = " "),
};

struct drop_row {
	const char *name;
	struct table_value angle, contact, restitution, spin, lag, s1, s2;
	double pull;
};

static const struct table_column drop_columns[] = {
        TABLE_COLUMN(WORDS, struct drop_row, name, .key = "drop", .title = "drop", .width = -16),
        TABLE_COLUMN(VALUE, struct drop_row, angle, .key = "angle_deg", .sigma = "sigma_angle_deg",
                     .title = "angle", .unit = "deg", .width = 7, .digits = 2),
        TABLE_COLUMN(VALUE, struct drop_row, contact, .key = "contact_time_s",
                     .sigma = "sigma_contact_time_s", .title = "contact", .unit = "ms", .width = 7,
                     .digits = 3, .scale = 1e3),
        TABLE_COLUMN(NUMBER, struct drop_row, contact.sigma, .title = "+-", .width = 7, .digits = 3,
                     .scale = 1e3),
        TABLE_COLUMN(VALUE, struct drop_row, restitution, .key = "restitution_of_centre",
                     .sigma = "sigma_restitution_of_centre", .title = "e of c.o.g.", .width = 7, .digits = 4),
        TABLE_COLUMN(NUMBER, struct drop_row, restitution.sigma, .title = "+-", .width = 7, .digits = 4),
        TABLE_COLUMN(VALUE, struct drop_row, spin, .key = "spin_rad_s", .sigma = "sigma_spin_rad_s",
                     .title = "spin", .unit = "rad/s", .width = 7, .digits = 2),
        TABLE_COLUMN(VALUE, struct drop_row, lag, .key = "lag_s", .sigma = "sigma_lag_s", .title = "lag",
                     .unit = "ms", .width = 7, .digits = 4, .scale = 1e3),
        TABLE_COLUMN(NUMBER, struct drop_row, lag.sigma, .title = "+-", .width = 7, .digits = 4,
                     .scale = 1e3),
        TABLE_COLUMN(VALUE, struct drop_row, s1, .key = "s1_resultant_g", .sigma = "sigma_s1_resultant_g",
                     .title = "S1", .unit = "g", .width = 7, .digits = 1),
        TABLE_COLUMN(VALUE, struct drop_row, s2, .key = "s2_resultant_g", .sigma = "sigma_s2_resultant_g",
                     .title = "S2", .unit = "g", .width = 7, .digits = 1),
        TABLE_COLUMN(NUMBER, struct drop_row, pull, .key = "pull"),
};

bool fitted_holds(const struct fit *fit)
{
	bool holds = fit->doubt.words[0] == '\0';

	for (size_t i = 0; i < MOTION_SHARED; i++)
		holds = holds && fit->status[i] != FIT_BEYOND;
	return holds;
}

/* Where the model does not hold, no bar does. */
static double fit_bar(const struct fit *fit, double sd)
{
	return fitted_holds(fit) ? sd : (double)NAN;
}

void fitted_parameters(const struct fit *fit, enum table_format format, FILE *out)
{
	static const char *const status[] = {"identified", "not identified", "beyond what is allowed",
	                                     "no plate"};
	struct table table = {.out = out, .format = format};
	struct table_column kept[COLUMNS_MAX];

	begin_table(&table, kept, parameter_columns, TABLE_COUNT(parameter_columns));
	for (size_t i = 0; i < MOTION_SHARED; i++) {
		double slope, value = motion_value((enum motion_shared)i, fit->common[i], &slope);
		struct parameter_row row = {scene_fitted[i],
		                            fitted_holds(fit) || fit->status[i] == FIT_BEYOND
		                                    ? status[fit->status[i]]
		                                    : "doubtful",
		                            {value, 0, false}};

		row.value.sigma = fit_bar(fit, slope * fit->sd[i]);
		if (fit->status[i] != FIT_ABSENT)
			table_row(&table, &row);
	}
	(void)table_end(&table);
}

static struct table_value fit_derived(const struct fit *fit, unsigned k, enum motion_derived d)
{
	return (struct table_value){fit->drop[k].derived[d], fit_bar(fit, fit->drop[k].derived_sd[d]), false};
}

void fitted_drops(const struct fitted *f, enum table_format format, FILE *out)
{
	struct table table = {.out = out, .format = format};
	struct table_column kept[COLUMNS_MAX];

	begin_table(&table, kept, drop_columns, TABLE_COUNT(drop_columns));
	for (unsigned k = 0; k < f->fit->drops; k++) {
		const struct fit_drop_result *r = &f->fit->drop[k];
		struct drop_row row = {f->name[k],
		                       {r->own[FIT_GAMMA_DEG], fit_bar(f->fit, r->sd[FIT_GAMMA_DEG]), false},
		                       fit_derived(f->fit, k, MOTION_CONTACT_S),
		                       fit_derived(f->fit, k, MOTION_RESTITUTION),
		                       fit_derived(f->fit, k, MOTION_SPIN_RAD_S),
		                       fit_derived(f->fit, k, MOTION_LAG_S),
		                       fit_derived(f->fit, k, MOTION_S1R_G),
		                       fit_derived(f->fit, k, MOTION_S2R_G),
		                       r->pull};

		table_row(&table, &row);
	}
	(void)table_end(&table);
}

struct prediction_row {
	double angle_deg;
	struct table_value contact, restitution, lag, s1, s2;
};

static const struct table_column prediction_columns[] = {
        TABLE_COLUMN(NUMBER, struct prediction_row, angle_deg, .key = "angle_deg", .title = "predicted",
                     .unit = "deg", .width = 13),
        TABLE_COLUMN(VALUE, struct prediction_row, contact, .key = "contact_time_s",
                     .sigma = "sigma_contact_time_s", .title = "contact", .unit = "ms", .width = 8,
                     .digits = 3, .scale = 1e3),
        TABLE_COLUMN(NUMBER, struct prediction_row, contact.sigma, .title = "+-", .width = 7, .digits = 3,
                     .scale = 1e3),
        TABLE_COLUMN(VALUE, struct prediction_row, restitution, .key = "restitution_of_centre",
                     .sigma = "sigma_restitution_of_centre", .title = "e of c.o.g.", .width = 8, .digits = 4),
        TABLE_COLUMN(NUMBER, struct prediction_row, restitution.sigma, .title = "+-", .width = 7,
                     .digits = 4),
        TABLE_COLUMN(VALUE, struct prediction_row, lag, .key = "lag_s", .sigma = "sigma_lag_s",
                     .title = "lag", .unit = "ms", .width = 8, .digits = 4, .scale = 1e3),
        TABLE_COLUMN(NUMBER, struct prediction_row, lag.sigma, .title = "+-", .width = 7, .digits = 4,
                     .scale = 1e3),
        TABLE_COLUMN(VALUE, struct prediction_row, s1, .key = "s1_resultant_g",
                     .sigma = "sigma_s1_resultant_g", .title = "S1", .unit = "g", .width = 8, .digits = 1),
        TABLE_COLUMN(NUMBER, struct prediction_row, s1.sigma, .title = "+-", .width = 7, .digits = 2),
        TABLE_COLUMN(VALUE, struct prediction_row, s2, .key = "s2_resultant_g",
                     .sigma = "sigma_s2_resultant_g", .title = "S2", .unit = "g", .width = 8, .digits = 1),
        TABLE_COLUMN(NUMBER, struct prediction_row, s2.sigma, .title = "+-", .width = 7, .digits = 2),
};

void fitted_predictions(const struct fit *fit, enum table_format format, FILE *out)
{
	struct table table = {.out = out, .format = format};
	struct table_column kept[COLUMNS_MAX];
	struct scene at = fit->scene;

	begin_table(&table, kept, prediction_columns, TABLE_COUNT(prediction_columns));
	for (int angle = FITTED_FROM_DEG; angle <= FITTED_TO_DEG && fitted_holds(fit);
	     angle += FITTED_STEP_DEG) {
		double value[MOTION_DERIVED], sd[MOTION_DERIVED];
		struct prediction_row row;

		at.drop_angle_deg = angle;
		if (fit_predict(&at, value, sd) != 0)
			continue;
		row = (struct prediction_row){angle,
		                              {value[MOTION_CONTACT_S], sd[MOTION_CONTACT_S], false},
		                              {value[MOTION_RESTITUTION], sd[MOTION_RESTITUTION], false},
		                              {value[MOTION_LAG_S], sd[MOTION_LAG_S], false},
		                              {value[MOTION_S1R_G], sd[MOTION_S1R_G], false},
		                              {value[MOTION_S2R_G], sd[MOTION_S2R_G], false}};
		table_row(&table, &row);
	}
	(void)table_end(&table);
}

void fitted_json(const struct fitted *f, FILE *out)
{
	const struct fit *fit = f->fit;

	fprintf(out, "{\"holds\":%s,\"parameters\":", fitted_holds(fit) ? "true" : "false");
	fitted_parameters(fit, TABLE_JSON, out);
	fprintf(out, ",\"drops\":");
	fitted_drops(f, TABLE_JSON, out);
	fprintf(out, ",\"predicted\":");
	fitted_predictions(fit, TABLE_JSON, out);
	fprintf(out, ",\"covariance\":");
	for (size_t i = 0; i < MOTION_SHARED; i++)
		for (size_t j = 0; j < MOTION_SHARED; j++)
			fprintf(out, "%s%.9g", j > 0 ? "," : i > 0 ? "],[" : "[[", fit->covariance[i][j]);
	fprintf(out, "]]");
	fprintf(out, ",\"chi2\":%.9g,\"samples\":%zu,\"starts\":%u,\"agreed\":%u,\"windows\":{",
	        fit->doubt.chi2, fit->doubt.samples, fit->starts, fit->agreed);
	for (size_t a = 0; a < MOTION_AXES; a++) {
		fprintf(out, "%s\"%s\":", a > 0 ? "," : "", fit_axis_names[a]);
		for (size_t w = 0; w < FIT_WINDOWS; w++)
			fprintf(out, "%s%.4g", w > 0 ? "," : "[", fit->doubt.window_z[a][w]);
		fprintf(out, "]");
	}
	fprintf(out, "},\"widened\":%.4g", fit->widened);
	fprintf(out, ",\"periodogram\":%.6g,\"periodogram_hz\":%.6g,\"pull\":%.6g,\"group\":%.6g",
	        fit->doubt.periodogram, fit->doubt.periodogram_hz, fit->doubt.pull, fit->doubt.group);
	fprintf(out,
	        ",\"next\":{\"angle_deg\":%.4g,\"height_m\":%.6g,\"gain\":%.4g,\"largest\":\"%s\",\"u\":%.4g}"
	        "}"
	        "\n",
	        fit->next.angle_deg, fit->next.height_m, fit->next.d_gain,
	        fit->next.largest >= 0 ? scene_fitted[fit->next.largest] : "", fit->next.largest_sd);
}

void fitted_next(const struct fit *fit, enum table_format format, FILE *out)
{
	bool page = format == TABLE_HTML;

	if (fit->next.largest >= 0 && fitted_holds(fit))
		fprintf(out,
		        "next drop: %.0f deg from %.3f m tells most of %d to %d deg (%.1f in the log of the "
		        "information); the weakest is then %s%s%s\n",
		        fit->next.angle_deg, fit->next.height_m, FIT_JUDGED_FROM_DEG, FIT_JUDGED_TO_DEG,
		        fit->next.d_gain, page ? (char[]){HTML_OWN, '\0'} : "",
		        scene_fitted[fit->next.largest], page ? (char[]){HTML_OWN_END, '\0'} : "");
}

void fitted_text(const struct fitted *f, FILE *out)
{
	const struct fit *fit = f->fit;

	fitted_parameters(fit, TABLE_TEXT, out);
	fprintf(out, "\n");
	fitted_drops(f, TABLE_TEXT, out);
	fprintf(out, "\n");
	fitted_predictions(fit, TABLE_TEXT, out);
	fprintf(out,
	        "\nresiduals: %.3f of the noise's squares over %zu samples; largest oscillation left %.1f at "
	        "%.0f Hz; "
	        "drops pull %.1f, gains together %.1f\n",
	        fit->doubt.chi2 / (double)fit->doubt.samples, fit->doubt.samples, fit->doubt.periodogram,
	        fit->doubt.periodogram_hz, fit->doubt.pull, fit->doubt.group);
	if (fit->widened > 1.0)
		fprintf(out, "gains scatter more than --gain-sd says: all variances are taken %.1f times\n",
		        fit->widened);
	fprintf(out, "starts: %u of %u came to the same\n", fit->agreed, fit->starts);
	fitted_next(fit, TABLE_TEXT, out);
}
