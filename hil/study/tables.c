/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "hil/study/tables.h"

#include <math.h>
#include <string.h>

#include "common/units.h"

/* What the study says of itself besides its tables, at 25 deg where it says where. */
static const struct {
	const char *what;
	size_t geometry;
	enum study_feature feature;
	double published, scale;
	int decimals;
} features[] = {
        {"contact time, ms (video: 3.0 +- 0.2)", 0, STUDY_CONTACT, 3.0, 1e3, 2},
        {"rebound ratio of speeds (an empty box, video)", 0, STUDY_REBOUND, 0.5, 1, 3},
        {"plate's frequency, Hz, first three oscillations", 1, STUDY_FREQUENCY, 129, 1, 1},
        {"plate's frequency, Hz, first three oscillations", 2, STUDY_FREQUENCY, 177, 1, 1},
        {"plate's damping ratio", 1, STUDY_DAMPING, 0.1, 1, 3},
        {"plate's damping ratio", 2, STUDY_DAMPING, 0.1, 1, 3},
        {"S1's peak after S2's, ms (study: too short to tell)", 0, STUDY_LAG, NAN, 1e3, 3},
        {"S1's peak after S2's, ms", 1, STUDY_LAG, 2.0, 1e3, 3},
        {"S1's peak after S2's, ms", 2, STUDY_LAG, 1.2, 1e3, 3},
};
enum { FEATURE_ROWS = sizeof(features) / sizeof(features[0]) };

/* "12.3", or a dash. */
static const char *tables_shown(char text[16], int decimals, double value)
{
	if (isfinite(value)) /* no minus in front of a zero */
		snprintf(text, 16, "%.*f", decimals, fabs(value) < 0.5 * pow(10, -decimals) ? 0.0 : value);
	else
		strcpy(text, "-");
	return text;
}

static void tables_tell_row(const struct study_series *series, struct sheet *sheet, size_t a, size_t s)
{
	char cells[512] = "", t[16];
	size_t at = 0;

	for (size_t q = 0; q <= STUDY_R; q++) {
		double limit = q == STUDY_R ? STUDY_LIMIT_R : STUDY_LIMIT_XY;
		double difference = study_difference(series, s, (enum study_quantity)q);

		at += (size_t)snprintf(cells + at, sizeof(cells) - at, "|%.1f|%.1f|%+.1f%s",
		                       series->published[s][q].mean,
		                       study_peak(series, s, (enum study_quantity)q).mean, difference,
		                       fabs(difference) > limit ? "*" : " ");
	}
	at += (size_t)snprintf(cells + at, sizeof(cells) - at, "|%.1f|%s", series->published[s][STUDY_Z].mean,
	                       tables_shown(t, 1, study_peak(series, s, STUDY_Z).mean));
	for (size_t q = 0; q < STUDY_QUANTITIES; q++)
		if (q != STUDY_R)
			at += (size_t)snprintf(
			        cells + at, sizeof(cells) - at, "|%.1f|%s", series->published[s][q].sd,
			        tables_shown(t, 1, study_peak(series, s, (enum study_quantity)q).sd));
	sheet_row(sheet, "%.0f|S%zu%s", study_angle_deg[a], s + 1, cells);
}

static void tell_geometry(const struct study *study, struct sheet *sheet, size_t g)
{
	static const struct sheet_column columns[] = {
	        {"", "deg", 3},        {"", "", 4},          {"X, g", "study", 9}, {"X, g", "here", 7},
	        {"X, g", "%", 7},      {"Y, g", "study", 8}, {"Y, g", "here", 7},  {"Y, g", "%", 7},
	        {"XY, g", "study", 8}, {"XY, g", "here", 7}, {"XY, g", "%", 7},    {"Z, g", "study", 8},
	        {"Z, g", "here", 7},   {"SD X", "study", 8}, {"SD X", "here", 6},  {"SD Y", "study", 8},
	        {"SD Y", "here", 6},   {"SD Z", "study", 8}, {"SD Z", "here", 6},
	};
	char title[160];

	snprintf(title, sizeof(title), "Table %zu: geometry %s, %s", g + 1, study_geometry[g],
	         g == 0 ? "both sensors on the box: S1 at its centre, S2 65 mm up"
	                : "S1 on the plate, S2 on the box near its top");
	sheet_heading(sheet, title);
	sheet_table(sheet, columns, sizeof(columns) / sizeof(columns[0]));
	for (size_t a = 0; a < STUDY_ANGLES; a++)
		for (size_t s = 0; s < STUDY_SENSORS && study->series[g][a].cell.drops > 0; s++)
			tables_tell_row(&study->series[g][a], sheet, a, s);
	sheet_table_end(sheet);
}

/* Peak of a sensor over the same of a sensor in another geometry. */
static double ratio_here(const struct study *study, size_t a, size_t g, size_t s, size_t of_g, size_t of_s,
                         enum study_quantity q)
{
	return study_peak(&study->series[g][a], s, q).mean /
	       study_peak(&study->series[of_g][a], of_s, q).mean;
}

static double ratio_published(const struct study *study, size_t a, size_t g, size_t s, size_t of_g,
                              size_t of_s)
{
	return study->series[g][a].published[s][STUDY_R].mean /
	       study->series[of_g][a].published[of_s][STUDY_R].mean;
}

static void tell_ratios(const struct study *study, struct sheet *sheet)
{
	static const struct sheet_column columns[] = {
	        {"", "deg", 3},       {"2A X", "study", 9},  {"2A X", "here", 7},  {"2A Y", "study", 9},
	        {"2A Y", "here", 7},  {"2A XY", "study", 9}, {"2A XY", "here", 7}, {"2B X", "study", 9},
	        {"2B X", "here", 7},  {"2B Y", "study", 9},  {"2B Y", "here", 7},  {"2B XY", "study", 9},
	        {"2B XY", "here", 7},
	};

	sheet_heading(sheet, "Table 4: S1 on the plate over S1 of geometry 1");
	sheet_say(sheet,
	          "What the mounts are worth: 1 is no help; the softer, smaller cubes of 2A help more.");
	sheet_table(sheet, columns, sizeof(columns) / sizeof(columns[0]));
	for (size_t a = 0; a < STUDY_ANGLES; a++) {
		char cells[256] = "", t[16];
		size_t at = 0;

		for (size_t g = 1; g < STUDY_GEOMETRIES; g++)
			for (size_t q = 0; q <= STUDY_R; q++)
				at += (size_t)snprintf(cells + at, sizeof(cells) - at, "|%.2f|%s",
				                       study->series[g][a].published_ratio[q],
				                       tables_shown(t, 2,
				                                    ratio_here(study, a, g, 0, 0, 0,
				                                               (enum study_quantity)q)));
		if (study->series[0][a].cell.drops + study->series[1][a].cell.drops +
		            study->series[2][a].cell.drops >
		    0)
			sheet_row(sheet, "%.0f%s", study_angle_deg[a], cells);
	}
	sheet_table_end(sheet);
}

static void tell_sensors(const struct study *study, struct sheet *sheet)
{
	static const struct sheet_column columns[] = {
	        {"", "deg", 3},
	        {"S1/S2 in 1", "study", 9},
	        {"S1/S2 in 1", "here", 7},
	        {"S1/S2 in 2A", "study", 9},
	        {"S1/S2 in 2A", "here", 7},
	        {"S1/S2 in 2B", "study", 9},
	        {"S1/S2 in 2B", "here", 7},
	        {"S2 of 1/2A", "study", 9},
	        {"S2 of 1/2A", "here", 7},
	        {"S2 of 1/2B", "study", 9},
	        {"S2 of 1/2B", "here", 7},
	};

	sheet_heading(sheet, "Plate against box, and box against box, by resultants");
	sheet_say(sheet,
	          "S1 over S2 within a box, and S2 of geometry 1 over S2 of the others. The last differ from "
	          "1 in the study by more than a plate of 14 g explains: no two boxes are alike.");
	sheet_table(sheet, columns, sizeof(columns) / sizeof(columns[0]));
	for (size_t a = 0; a < STUDY_ANGLES; a++) {
		char cells[256] = "", t[16];
		size_t at = 0;

		for (size_t k = 0; k < 5; k++) {
			size_t g = k < 3 ? k : 0, s = k < 3 ? 0 : 1, of = k < 3 ? k : k - 2;

			at += (size_t)snprintf(
			        cells + at, sizeof(cells) - at, "|%.2f|%s",
			        ratio_published(study, a, g, s, of, 1),
			        tables_shown(t, 2, ratio_here(study, a, g, s, of, 1, STUDY_R)));
		}
		if (study->series[0][a].cell.drops + study->series[1][a].cell.drops +
		            study->series[2][a].cell.drops >
		    0)
			sheet_row(sheet, "%.0f%s", study_angle_deg[a], cells);
	}
	sheet_table_end(sheet);
}

/* 25 deg when it was dropped, else the first that was. */
size_t study_reference(const struct study *study, size_t g)
{
	for (size_t k = 0; k < STUDY_ANGLES; k++) {
		size_t a = (STUDY_ANGLES / 2 + k) % STUDY_ANGLES;

		if (study->series[g][a].cell.drops > 0)
			return a;
	}
	return STUDY_ANGLES / 2;
}

static double tables_predicted(const struct model_prediction *p, enum study_feature feature)
{
	const double value[STUDY_FEATURES] = {
	        [STUDY_LAG] = p->lag_s,
	        [STUDY_FREQUENCY] = p->plate_frequency_hz,
	        [STUDY_DAMPING] = p->plate_damping_ratio,
	        [STUDY_CONTACT] = p->contact_time_s,
	        [STUDY_REBOUND] = p->restitution,
	};

	return value[feature];
}

static void tell_features(const struct study *study, struct sheet *sheet)
{
	static const struct sheet_column columns[] = {
	        {"", "", -52},   {"", "geometry", 9}, {"", "deg", 5},    {"", "study", 8},
	        {"", "here", 9}, {"", "SD", 8},       {"", "planar", 9}, {"", "here - study", 14},
	};

	sheet_heading(sheet, "Contact, rebound, ringing, lag");
	sheet_say(sheet,
	          "The contact time here is how long X of geometry 1 stands above 1 %% of its peak, the "
	          "rebound by its change of velocity; planar is the model's own, without sensors.");
	sheet_table(sheet, columns, sizeof(columns) / sizeof(columns[0]));
	for (size_t i = 0; i < FEATURE_ROWS; i++) {
		size_t g = features[i].geometry, a = study_reference(study, g);
		const struct study_series *series = &study->series[g][a];
		struct study_value here = study_mean(series, features[i].feature);
		double scale = features[i].scale, off = 100 * (here.mean * scale / features[i].published - 1);
		char t[5][16];

		sheet_row(sheet, "%s|%s|%.0f|%s|%s|%s|%s|%s", features[i].what, study_geometry[g],
		          study_angle_deg[a], tables_shown(t[0], features[i].decimals, features[i].published),
		          tables_shown(t[1], features[i].decimals, here.mean * scale),
		          tables_shown(t[2], features[i].decimals, here.sd * scale),
		          tables_shown(t[3], features[i].decimals,
		                       tables_predicted(&series->planar, features[i].feature) * scale),
		          isfinite(off) ? (snprintf(t[4], 16, "%+.1f %%", off), t[4]) : "-");
	}
	sheet_table_end(sheet);
}

static void tell_directions(const struct study *study, struct sheet *sheet)
{
	static const struct sheet_column columns[] = {
	        {"", "deg", 3},     {"1", "study", 9},   {"1", "here", 7},    {"1", "planar", 8},
	        {"2A", "study", 9}, {"2A", "here", 7},   {"2A", "planar", 8}, {"2B", "study", 9},
	        {"2B", "here", 7},  {"2B", "planar", 8},
	};

	sheet_heading(sheet, "Direction of S2's peak, degrees from X towards Y");
	sheet_say(sheet,
	          "A box that only fell and did not turn would show the contact angle itself: the turning "
	          "holds the direction near 25 deg.");
	sheet_table(sheet, columns, sizeof(columns) / sizeof(columns[0]));
	for (size_t a = 0; a < STUDY_ANGLES; a++) {
		char cells[256] = "", t[16];
		size_t at = 0, drops = 0;

		for (size_t g = 0; g < STUDY_GEOMETRIES; g++) {
			const struct study_series *series = &study->series[g][a];
			double here = atan2(study_peak(series, 1, STUDY_Y).mean,
			                    study_peak(series, 1, STUDY_X).mean);

			drops += series->cell.drops;
			at += (size_t)snprintf(cells + at, sizeof(cells) - at, "|%.1f|%s|%.1f",
			                       atan2(series->published[1][STUDY_Y].mean,
			                             series->published[1][STUDY_X].mean) /
			                               M_PI * 180,
			                       tables_shown(t, 1, here / M_PI * 180),
			                       series->planar.direction_deg[1]);
		}
		if (drops > 0)
			sheet_row(sheet, "%.0f%s", study_angle_deg[a], cells);
	}
	sheet_table_end(sheet);
}

/* Geometric mean of the SDs over all series, as a share of the resultant. */
static double scatter(const struct study *study, bool plate, enum study_quantity q, bool published)
{
	double sum = 0.0;
	size_t count = 0;

	for (size_t i = 0; i < STUDY_GEOMETRIES * STUDY_ANGLES * STUDY_SENSORS; i++) {
		size_t g = i / (STUDY_ANGLES * STUDY_SENSORS), s = i % STUDY_SENSORS;
		const struct study_series *series = &study->series[g][i / STUDY_SENSORS % STUDY_ANGLES];
		struct study_value v = published ? series->published[s][q] : study_peak(series, s, q);

		if ((g > 0 && s == 0) != plate || !isfinite(study_peak(series, s, q).sd))
			continue;
		sum += log(v.sd / series->published[s][STUDY_R].mean);
		count++;
	}
	return count > 0 ? 100.0 * exp(sum / (double)count) : (double)NAN;
}

static void tell_scatter(const struct study *study, struct sheet *sheet)
{
	static const struct sheet_column columns[] = {{"", "", -40}, {"", "study", 8}, {"", "here", 8}};

	sheet_heading(sheet, "Scatter between repeats, percent of the resultant");
	sheet_say(sheet,
	          "Typical SD of five drops (geometric mean over the series). The study's own spread is "
	          "uneven: a few series scatter three times as much as their neighbours.");
	sheet_table(sheet, columns, sizeof(columns) / sizeof(columns[0]));
	for (size_t i = 0; i < 4; i++) {
		enum study_quantity q = i % 2 == 0 ? STUDY_X : STUDY_Y;
		char t[2][16];

		sheet_row(sheet, "%s, %c|%s|%s", i < 2 ? "sensors on the box" : "sensor on the plate",
		          "XY"[i % 2], tables_shown(t[0], 2, scatter(study, i >= 2, q, true)),
		          tables_shown(t[1], 2, scatter(study, i >= 2, q, false)));
	}
	sheet_table_end(sheet);
}

void study_tables(const struct study *study, struct sheet *sheet)
{
	sheet_say(sheet,
	          "study: as printed; here: mean of the drops on the simulated tower; %%: here against "
	          "study, * outside %.0f %% (XY) or %.0f %% (X, Y); -: nothing stands out of the noise, or "
	          "one drop has no SD. XY is the resultant's peak. Peaks count positive away from the mat; "
	          "the study prints them with the other sign.",
	          STUDY_LIMIT_R, STUDY_LIMIT_XY);
	for (size_t g = 0; g < STUDY_GEOMETRIES; g++)
		tell_geometry(study, sheet, g);
	tell_ratios(study, sheet);
	tell_sensors(study, sheet);
	tell_features(study, sheet);
	tell_directions(study, sheet);
	tell_scatter(study, sheet);
}
