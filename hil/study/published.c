/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "hil/study/study.h"

#include <errno.h>
#include <math.h>
#include <string.h>

static const char file[] = "hil/study/published.csv";

const char *const study_geometry[STUDY_GEOMETRIES] = {"1", "2A", "2B"};
const double study_angle_deg[STUDY_ANGLES] = {15, 20, 25, 30, 35};

static struct study_series *published_find(struct study *study, const char *geometry, double angle_deg)
{
	for (size_t g = 0; g < STUDY_GEOMETRIES; g++)
		for (size_t a = 0; a < STUDY_ANGLES; a++)
			if (strcmp(geometry, study_geometry[g]) == 0 && angle_deg == study_angle_deg[a])
				return &study->series[g][a];
	return NULL;
}

/* "1,15,S1,..." are means and deviations, "2A/1,15,S1,..." ratios. */
static int published_take(struct study *study, const char *line)
{
	char geometry[8], sensor[4], of[8] = "";
	double angle, value[STUDY_QUANTITIES], sd[STUDY_QUANTITIES] = {NAN, NAN, NAN, NAN};
	int n = sscanf(line, "%7[^,/],%lf,%3[^,],%lf,%lf,%lf,%lf,%lf,%lf,%lf", geometry, &angle, sensor,
	               &value[STUDY_X], &value[STUDY_Y], &value[STUDY_R], &value[STUDY_Z], &sd[STUDY_X],
	               &sd[STUDY_Y], &sd[STUDY_Z]);
	struct study_series *series;
	size_t s;

	if (n == 1)
		n = sscanf(line, "%7[^,/]/%7[^,],%lf,%3[^,],%lf,%lf,%lf", geometry, of, &angle, sensor,
		           &value[STUDY_X], &value[STUDY_Y], &value[STUDY_R]);
	series = n == 10 || n == 7 ? published_find(study, geometry, angle) : NULL;
	if (series == NULL || (strcmp(sensor, "S1") != 0 && strcmp(sensor, "S2") != 0))
		return DT_E_FORMAT;
	s = (size_t)(sensor[1] - '1');
	for (size_t q = 0; q < STUDY_QUANTITIES; q++) {
		/* the study's signs are those of deceleration */
		struct study_value published = {q == STUDY_R ? value[q] : -value[q], sd[q]};

		if (of[0] == '\0')
			series->published[s][q] = published;
		else if (q != STUDY_Z)
			series->published_ratio[q] = value[q];
	}
	return 0;
}

static int read_published(struct study *study, char *message)
{
	FILE *in = fopen(file, "r");
	char line[256];
	int number = 0, rows = 0, status = 0;

	if (in == NULL) {
		snprintf(message, STUDY_MESSAGE_MAX, "%s: %s", file, strerror(errno));
		return DT_E_SYSTEM;
	}
	while (status == 0 && fgets(line, sizeof(line), in) != NULL) {
		number++;
		if (line[0] == '#' || strncmp(line, "geometry,", 9) == 0)
			continue;
		status = published_take(study, line);
		rows++;
	}
	fclose(in);
	if (status != 0)
		snprintf(message, STUDY_MESSAGE_MAX, "%s:%d: no row of the study", file, number);
	else if (rows != STUDY_GEOMETRIES * STUDY_ANGLES * STUDY_SENSORS + 2 * STUDY_ANGLES) {
		snprintf(message, STUDY_MESSAGE_MAX, "%s: %d rows, expected 30 and 10 of ratios", file, rows);
		status = DT_E_FORMAT;
	}
	return status;
}

static int predict(struct study *study, size_t g, char *message)
{
	int status = 0;

	for (size_t a = 0; a < STUDY_ANGLES && status == 0; a++) {
		struct study_series *series = &study->series[g][a];
		struct scene scene = study->scene[g];

		scene.drop_angle_deg = study_angle_deg[a];
		status = model_solve(&scene, MODEL_PLANAR, NULL, &series->planar, message);
		if (status == 0)
			status = model_solve(&scene, MODEL_COUPLED, NULL, &series->coupled, message);
	}
	return status;
}

int study_open(struct study *study, char message[STUDY_MESSAGE_MAX])
{
	int status;

	memset(study, 0, sizeof(*study));
	for (size_t g = 0; g < STUDY_GEOMETRIES; g++)
		for (size_t a = 0; a < STUDY_ANGLES; a++)
			for (size_t q = 0; q < STUDY_QUANTITIES; q++)
				study->series[g][a].published_ratio[q] = NAN;
	status = read_published(study, message);
	for (size_t g = 0; g < STUDY_GEOMETRIES && status == 0; g++) {
		char scene[64];

		snprintf(scene, sizeof(scene), "common/scenes/geometry-%s.ini", study_geometry[g]);
		status = scene_read(&study->scene[g], scene, message);
		if (status == 0)
			status = predict(study, g, message);
	}
	return status;
}
