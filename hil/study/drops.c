/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "hil/study/study.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "host/record/read.h"

/* Where the signal, followed from its peak in steps of step, falls to level; samples after the peak. */
static double crossing(const double value[], size_t count, size_t peak, int step, double level)
{
	size_t k = peak;

	while (k > 0 && k + 1 < count && value[k] >= level)
		k = step > 0 ? k + 1 : k - 1;
	if (!(value[k] < level))
		return NAN;
	return (double)k - (double)step * (level - value[k]) / (value[step > 0 ? k - 1 : k + 1] - value[k]);
}

/* The sensor's high-pass undone and zero taken off, both by the 20 ms before the pulse. */
static size_t contact_restore(const struct channel *channel, double tau_s, double at_s, double value[],
                              size_t room)
{
	size_t first = (size_t)fmax(0.0, (at_s - 0.022) * channel->rate_hz),
	       quiet = (size_t)(0.020 * channel->rate_hz);
	size_t count = 0;
	double zero = 0.0, sum = 0.0;

	if (first + quiet + room / 4 > channel->count)
		return 0;
	for (size_t k = 0; k < quiet; k++)
		zero += channel->value_g[first + k] / (double)quiet;
	for (; count < room && first + count < channel->count; count++) {
		double v = channel->value_g[first + count] - zero;

		if (!isfinite(v))
			return 0;
		sum += v / channel->rate_hz;
		value[count] = v + sum / tau_s;
	}
	return count;
}

/* What the study read from its video, read from the record: how long X of the sensor on the box stands above
 * 1 % of its peak, in s. tau_s: time constant of the sensor's high-pass; at_s: about when the peak is. NAN
 * where samples of S1X are missing. */
static double contact_time(const struct record *record, double tau_s, double at_s)
{
	enum { ROOM = 500 };
	const struct channel *channel = record_channel(record, "S1X");
	double value[ROOM];
	size_t count = channel != NULL ? contact_restore(channel, tau_s, at_s, value, ROOM) : 0, peak = 0;
	double level;

	for (size_t k = 1; k < count; k++)
		if (value[k] > value[peak])
			peak = k;
	if (count == 0)
		return NAN;
	level = 0.01 * value[peak];
	return (crossing(value, count, peak, 1, level) - crossing(value, count, peak, -1, level)) /
	       channel->rate_hz;
}

struct reading {
	struct study *study;
	struct archive *archive;
	const char *folder;
	char *message;
};

/* The study's series that a drop belongs to; NULL when it is of no interest. */
static struct study_series *drops_place(struct reading *reading, const struct archive_drop *drop,
                                        size_t *geometry)
{
	for (size_t g = 0; g < STUDY_GEOMETRIES; g++)
		for (size_t a = 0; a < STUDY_ANGLES; a++)
			if (strcmp(drop->series.scene_name, reading->study->scene[g].name) == 0 &&
			    drop->series.angle_deg == study_angle_deg[a]) {
				*geometry = g;
				return &reading->study->series[g][a];
			}
	return NULL;
}

/* What stands in no column of a table of drops. */
static int drops_take_result(struct reading *reading, struct study_series *series, const char *name)
{
	struct record record;
	struct analysis analysis = {.channels = NULL};
	struct estimate_options options = {.tolerance = 0};
	struct result said;
	int status;

	record_init(&record);
	said = result_of(&record, &analysis, &options);
	status = archive_analysis(reading->archive, name, NULL, &said);
	if (status == 0) {
		series->s2_peak_s =
		        analysis.resultant_count > 1 ? analysis.resultants[1].time_s : (double)NAN;
		series->rebound[series->cell.drops] =
		        analysis.has_rebound ? analysis.rebound.velocity_ratio : (double)NAN;
	} else {
		snprintf(reading->message, STUDY_MESSAGE_MAX, "%s: no result", name);
	}
	free(analysis.channels);
	record_free(&record);
	return status;
}

static int take_log(struct reading *reading, struct study_series *series, double tau_s)
{
	struct record record;
	int status = read_record(&record, series->log, NULL, reading->message);

	if (status != 0)
		return status;
	series->contact_s[series->cell.drops] = contact_time(&record, tau_s, series->s2_peak_s);
	record_free(&record);
	return 0;
}

static int drops_take(void *context, const struct archive_drop *drop)
{
	struct reading *reading = context;
	size_t g = 0;
	struct study_series *series = drops_place(reading, drop, &g);
	char name[ARCHIVE_NAME_MAX + 16];
	int status;

	if (series == NULL || !archive_counts(drop, true))
		return 0;
	if (series->cell.drops == STUDY_DROPS_MAX) {
		snprintf(reading->message, STUDY_MESSAGE_MAX, "%s: more than %d drops", drop->series.name,
		         STUDY_DROPS_MAX);
		return DT_E_RANGE;
	}
	snprintf(name, sizeof(name), "%s/%u", drop->series.name, drop->number);
	snprintf(series->log, sizeof(series->log), "%.4000s/%s", reading->folder, drop->raw);
	status = drops_take_result(reading, series, name);
	series->contact_s[series->cell.drops] = NAN;
	if (status == 0 && g == 0)
		status = take_log(reading, series, reading->study->scene[g].sensor_iepe_time_constant_s);
	if (status == 0)
		archive_cell_add(&series->cell, drop);
	return status;
}

/* All three are compared, so that each must have a drop. */
static int need_all(const struct study *study, const char *folder, char *message)
{
	for (size_t g = 0; g < STUDY_GEOMETRIES; g++) {
		unsigned drops = 0;

		for (size_t a = 0; a < STUDY_ANGLES; a++)
			drops += study->series[g][a].cell.drops;
		if (drops > 0)
			continue;
		snprintf(message, STUDY_MESSAGE_MAX, "%.400s: no drop of %s at an angle of the study", folder,
		         study->scene[g].name);
		return DT_E_EMPTY;
	}
	return 0;
}

int study_read(struct study *study, const char *folder, char message[STUDY_MESSAGE_MAX])
{
	struct archive_filter filter = archive_filter_none();
	struct reading reading = {.study = study, .folder = folder, .message = message};
	int status;

	reading.archive = archive_open(folder, ARCHIVE_READ, message);
	if (reading.archive == NULL)
		return DT_E_SYSTEM;
	message[0] = '\0';
	status = archive_each_drop(reading.archive, &filter, drops_take, &reading);
	if (status != 0 && message[0] == '\0')
		snprintf(message, STUDY_MESSAGE_MAX, "%s", archive_message(reading.archive));
	archive_close(reading.archive);
	return status != 0 ? status : need_all(study, folder, message);
}
