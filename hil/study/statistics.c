/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "hil/study/study.h"

#include <math.h>
#include <gsl/gsl_statistics_double.h>

/* Of those that are there. */
static struct study_value statistics(const double value[], size_t count)
{
	struct study_value v = {NAN, NAN};
	double there[STUDY_DROPS_MAX];
	size_t n = 0;

	for (size_t i = 0; i < count; i++)
		if (isfinite(value[i]))
			there[n++] = value[i];
	if (n > 0)
		v.mean = gsl_stats_mean(there, 1, n);
	if (n > 1)
		v.sd = gsl_stats_sd(there, 1, n);
	return v;
}

static struct study_value from_archive(const struct study_series *series, enum archive_value value)
{
	const struct archive_mean *mean = &series->cell.value[value];
	struct study_value v = {NAN, NAN};

	if (mean->n > 0) {
		v.mean = mean->mean;
		v.sd = mean->sd;
	}
	return v;
}

struct study_value study_peak(const struct study_series *series, size_t sensor, enum study_quantity quantity)
{
	static const enum archive_value value[STUDY_SENSORS][STUDY_QUANTITIES] = {
	        {ARCHIVE_S1_X, ARCHIVE_S1_Y, ARCHIVE_S1_R, ARCHIVE_S1_Z},
	        {ARCHIVE_S2_X, ARCHIVE_S2_Y, ARCHIVE_S2_R, ARCHIVE_S2_Z}};

	return from_archive(series, value[sensor][quantity]);
}

struct study_value study_mean(const struct study_series *series, enum study_feature feature)
{
	switch (feature) {
	case STUDY_LAG:
		return from_archive(series, ARCHIVE_LAG);
	case STUDY_FREQUENCY:
		return from_archive(series, ARCHIVE_THREE_CYCLE);
	case STUDY_DAMPING:
		return from_archive(series, ARCHIVE_DAMPING);
	case STUDY_CONTACT:
		return statistics(series->contact_s, series->cell.drops);
	default:
		return statistics(series->rebound, series->cell.drops);
	}
}

double study_difference(const struct study_series *series, size_t sensor, enum study_quantity quantity)
{
	double published = series->published[sensor][quantity].mean;

	return 100.0 * (study_peak(series, sensor, quantity).mean - published) / published;
}

void study_write_csv(const struct study *study, FILE *out)
{
	static const char *const name = "XYRZ";

	fputs("# published: positive away from the mat; here: means over the drops\n"
	      "geometry,angle_deg,sensor,drops",
	      out);
	for (size_t q = 0; q < STUDY_QUANTITIES; q++)
		fprintf(out, ",%c_published_g,%c_published_sd_g,%c_g,%c_sd_g,%c_planar_g", name[q], name[q],
		        name[q], name[q], name[q]);
	fputc('\n', out);
	for (size_t row = 0; row < STUDY_GEOMETRIES * STUDY_ANGLES * STUDY_SENSORS; row++) {
		size_t g = row / (STUDY_ANGLES * STUDY_SENSORS), a = row / STUDY_SENSORS % STUDY_ANGLES,
		       s = row % STUDY_SENSORS;
		const struct study_series *series = &study->series[g][a];
		const double planar[STUDY_QUANTITIES] = {series->planar.peak[2 * s].value_g,
		                                         series->planar.peak[2 * s + 1].value_g,
		                                         series->planar.resultant[s].value_g, NAN};

		if (series->cell.drops == 0)
			continue;
		fprintf(out, "%s,%g,S%zu,%u", study_geometry[g], study_angle_deg[a], s + 1,
		        series->cell.drops);
		for (size_t q = 0; q < STUDY_QUANTITIES; q++) {
			struct study_value here = study_peak(series, s, (enum study_quantity)q),
			                   published = series->published[s][q];

			fprintf(out, ",%.1f,%.1f,%.2f,%.2f,%.2f", published.mean, published.sd, here.mean,
			        here.sd, planar[q]);
		}
		fputc('\n', out);
	}
}
