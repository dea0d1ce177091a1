/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/accuracy/cells.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#define G_M_S2 9.80665
#define GROSS 0.15

enum { SCENES_MAX = 200 };

/* ---- scenes: rows, spread over noises and geometries ----------------------------------------------------
 */

enum { N03 = 1, N1 = 2, N3 = 4, N10 = 8, N30 = 16, N100 = 32, NALL = N03 | N1 | N3 | N10, NOISES = 6 };
enum { A = 1, B = 2, AB = A | B };

static const double noises[NOISES] = {0.3, 1, 3, 10, 30, 100};

struct row {
	enum group group;
	unsigned noise, geometry; /* N*, A and B */
	struct scene scene;
};

#define HALF .shape = SYNTH_HALF_SINE
#define HAVER .shape = SYNTH_HAVERSINE
#define HERTZ .shape = SYNTH_HERTZ
#define SKEWED .shape = SYNTH_HUNT_CROSSLEY
#define TOLD_HALF .family = ESTIMATE_FAMILY_HALF_SINE
#define TOLD_HAVER .family = ESTIMATE_FAMILY_HAVERSINE

static const struct row rows[] = {
        {GROUP_KNOWN, NALL, AB, {"half-sine", HALF, TOLD_HALF}},
        {GROUP_KNOWN, NALL, AB, {"haversine", HAVER, TOLD_HAVER}},
        {GROUP_UNKNOWN, NALL, AB, {"half-sine", HALF}},
        {GROUP_UNKNOWN, NALL, AB, {"haversine", HAVER}},
        {GROUP_UNKNOWN, NALL, AB, {"hertz", HERTZ}},
        {GROUP_SKEWED, NALL, AB, {"hunt-crossley", SKEWED}},
        {GROUP_APART_KNOWN, NALL, A, {"half-sine, 0.2 ms", HALF, TOLD_HALF, .skew_s = 0.2e-3}},
        {GROUP_APART_KNOWN, NALL, A, {"half-sine, 0.5 ms", HALF, TOLD_HALF, .skew_s = 0.5e-3}},
        {GROUP_APART, NALL, A, {"half-sine, 0.2 ms", HALF, .skew_s = 0.2e-3}},
        {GROUP_APART, NALL, A, {"half-sine, 0.5 ms", HALF, .skew_s = 0.5e-3}},
        {GROUP_DISTURBED, NALL, AB, {"offset 10 g", HALF, .offset_g = 10}},
        {GROUP_DISTURBED, NALL, AB, {"hum 5 g", HALF, .hum_g = 5}},
        {GROUP_DISTURBED, NALL, AB, {"3 spikes of 300 g", HALF, .spikes = 3}},
        {GROUP_DISTURBED, NALL, AB, {"20 % missing", HALF, .missing = 0.2}},
        {GROUP_DISTURBED, NALL, AB, {"20 samples missing", HALF, .gap = 20}},
        {GROUP_TWO_MODES, N03 | N1, AB, {"+20 Hz at 10 %", HALF, .second_part = 0.1, .second_hz = 20}},
        {GROUP_LOUD, N30 | N100, AB, {"half-sine", HALF}},
        {GROUP_CLIPPED, N03 | N1 | N3, A, {"520 g", HALF, TOLD_HALF, .x_peak_g = 520, .clip_g = 500}},
        {GROUP_CLIPPED, N03 | N1 | N3, A, {"560 g", HALF, TOLD_HALF, .x_peak_g = 560, .clip_g = 500}},
        {GROUP_CLIPPED, N03 | N1 | N3, A, {"627 g", HALF, TOLD_HALF, .x_peak_g = 627, .clip_g = 500}},
        {GROUP_CLIPPED, N03 | N1 | N3, A, {"696 g", HALF, TOLD_HALF, .x_peak_g = 696, .clip_g = 500}},
        {GROUP_HOLE, N03 | N1, A, {"half-sine, told", HALF, TOLD_HALF, .lost_at_peak = 4}},
        {GROUP_HOLE, N03 | N1, A, {"half-sine", HALF, .lost_at_peak = 4}},
        {GROUP_WRONG, NALL, A, {"half-sine on haversine", HAVER, TOLD_HALF}},
        {GROUP_WRONG, N03 | N1 | N3, A, {"half-sine on hertz", HERTZ, TOLD_HALF}},
        {GROUP_WRONG, NALL, A, {"half-sine on hunt-crossley", SKEWED, TOLD_HALF}},
        {GROUP_WRONG, NALL, A, {"haversine on half-sine", HALF, TOLD_HAVER}},
        {GROUP_FAULT, N1, A, {"nan", HALF, .nan_at_peak = 1}},
        {GROUP_FAULT, N1, A, {"offset", HALF, .offset_g = 20}},
        {GROUP_FAULT, N1, A, {"drift", HALF, .drift_g_s = 100}},
        {GROUP_FAULT, N1, A, {"spike", HALF, .spikes = 1}},
        {GROUP_FAULT, N1, A, {"clipped", HALF, .clip_g = 400}},
        {GROUP_FAULT, N1, A, {"zeroed", HALF, .zeroed_at_peak = 6}},
        {GROUP_FAULT, N1, A, {"missing", HALF, .lost_at_peak = 6}},
        {GROUP_FAULT, N1, A, {"too short", HALF, .cut = true}},
};

enum { ROWS = sizeof(rows) / sizeof(rows[0]) };

const char *group_name(enum group group)
{
	static const char *const names[GROUPS] = {
	        [GROUP_KNOWN] = "family known",       [GROUP_UNKNOWN] = "family unknown",
	        [GROUP_SKEWED] = "skewed pulse",      [GROUP_APART_KNOWN] = "axes apart, known",
	        [GROUP_APART] = "axes apart",         [GROUP_DISTURBED] = "disturbed decay",
	        [GROUP_TWO_MODES] = "two modes",      [GROUP_LOUD] = "loud noise",
	        [GROUP_CLIPPED] = "clipped at 500 g", [GROUP_HOLE] = "hole at the peak",
	        [GROUP_WRONG] = "wrong family",       [GROUP_FAULT] = "faults",
	};

	return names[group];
}

/* ---- one drop ------------------------------------------------------------------------------------------ */

struct reading {
	double value, sigma;
};

static struct reading in_order(double value, double sigma)
{
	return (struct reading){value, sigma};
}

static void read_sensor(const struct analysis *analysis, struct reading *reading)
{
	static const enum stage_channel channel[3] = {STAGE_S2X, STAGE_S2Y, STAGE_S2Z};
	const struct estimate_pulse *pulse = &analysis->channels[STAGE_S2X].pulse;

	for (int i = 0; i < 3; i++) {
		const struct estimate_peak *peak = &analysis->channels[channel[i]].peak;

		reading[QUANTITY_PEAK_X + i] = in_order(peak->value_g, peak->sigma_g);
		if (i < 2)
			reading[QUANTITY_PEAK_TIME_X + i] = in_order(peak->time_s, peak->sigma_time_s);
	}
	reading[QUANTITY_WIDTH_X] = in_order(pulse->duration_s, pulse->sigma_duration_s);
	reading[QUANTITY_VELOCITY_X] = in_order(pulse->velocity_change_m_s, pulse->sigma_velocity_m_s);
	reading[QUANTITY_CONTACT_X] = in_order(pulse->contact_time_s, pulse->sigma_contact_s);
	reading[QUANTITY_FITTED_VELOCITY_X] =
	        in_order(pulse->fitted_velocity_m_s, pulse->sigma_fitted_velocity_m_s);
	if (analysis->resultant_count == 2) {
		const struct estimate_resultant *r = &analysis->resultants[1];

		reading[QUANTITY_RESULTANT] = in_order(r->peak_g, r->sigma_g);
		reading[QUANTITY_RESULTANT_TIME] = in_order(r->time_s, r->sigma_time_s);
	}
}

static void read_plate(const struct analysis *analysis, struct reading *reading)
{
	for (int i = 0; i < 2; i++) {
		const struct estimate_ringdown *r =
		        &analysis->channels[i == 0 ? STAGE_S1X : STAGE_S1Y].ringdown;

		reading[QUANTITY_FREQUENCY_X + i] = in_order(r->frequency_hz, r->sigma_hz);
		reading[QUANTITY_DAMPING_X + i] = in_order(r->damping_ratio, r->sigma_damping);
	}
	for (int i = 0; i < 2; i++) {
		const struct estimate_peak *peak = &analysis->channels[i == 0 ? STAGE_S1X : STAGE_S1Y].peak;

		reading[QUANTITY_PLATE_PEAK_X + i] = in_order(peak->value_g, peak->sigma_g);
		reading[QUANTITY_PLATE_TIME_X + i] = in_order(peak->time_s, peak->sigma_time_s);
	}
	if (analysis->resultant_count == 2) {
		const struct estimate_resultant *r = &analysis->resultants[0];

		reading[QUANTITY_PLATE_RESULTANT] = in_order(r->peak_g, r->sigma_g);
		reading[QUANTITY_PLATE_RESULTANT_TIME] = in_order(r->time_s, r->sigma_time_s);
	}
	if (analysis->has_plate) {
		const struct estimate_ringdown *r = &analysis->plate;

		reading[QUANTITY_FREQUENCY] = in_order(r->frequency_hz, r->sigma_hz);
		reading[QUANTITY_NATURAL] = in_order(r->natural_frequency_hz, r->sigma_natural_hz);
		reading[QUANTITY_DAMPING] = in_order(r->damping_ratio, r->sigma_damping);
	}
	if (analysis->has_lag) {
		const struct estimate_lag *lag = &analysis->lag;

		for (int i = 0; i < 2; i++)
			reading[QUANTITY_LAG_X + i] =
			        in_order(lag->driven_axis_s[i], lag->sigma_driven_axis_s[i]);
		reading[QUANTITY_LAG] = in_order(lag->driven_s, lag->sigma_driven_s);
	}
}

static void find_truth(const struct stage *stage, double *truth)
{
	const struct stage_axis *axis = stage->axis;
	double area = synth_pulse_area(stage->scene.shape) * STAGE_CONTACT_S * axis[0].s2_g * G_M_S2;
	double natural = stage->damped_hz / sqrt(1 - STAGE_DAMPING * STAGE_DAMPING), height;

	for (int i = 0; i < 2; i++) {
		truth[QUANTITY_PEAK_X + i] = axis[i].s2_g;
		truth[QUANTITY_PEAK_TIME_X + i] = stage->onset_s + axis[i].skew_s +
		                                  synth_pulse_summit(stage->scene.shape) * STAGE_CONTACT_S;
	}
	truth[QUANTITY_PEAK_Z] = stage_signal(stage, STAGE_S2Z, truth[QUANTITY_PEAK_TIME_X]);
	truth[QUANTITY_WIDTH_X] = NAN; /* the scene's, not the drop's */
	truth[QUANTITY_VELOCITY_X] = truth[QUANTITY_FITTED_VELOCITY_X] = area;
	truth[QUANTITY_CONTACT_X] = STAGE_CONTACT_S;
	truth[QUANTITY_RESULTANT] = stage_resultant(stage, &truth[QUANTITY_RESULTANT_TIME]);
	for (int i = QUANTITY_FREQUENCY_X; i <= QUANTITY_FREQUENCY; i++)
		truth[i] = stage->damped_hz;
	truth[QUANTITY_NATURAL] = natural;
	for (int i = QUANTITY_DAMPING_X; i <= QUANTITY_DAMPING; i++)
		truth[i] = STAGE_DAMPING;
	for (int i = QUANTITY_LAG_X; i <= QUANTITY_LAG; i++)
		truth[i] = stage->interval_s;
	synth_plate_peak(stage->plate, STAGE_TABLE, &height);
	for (int i = 0; i < 2; i++) {
		truth[QUANTITY_PLATE_PEAK_X + i] = axis[i].gain * height;
		truth[QUANTITY_PLATE_TIME_X + i] = stage->onset_s + axis[i].skew_s + axis[i].s1_peak_s;
	}
	truth[QUANTITY_PLATE_RESULTANT] = stage_plate_resultant(stage, &truth[QUANTITY_PLATE_RESULTANT_TIME]);
}

/* Base of the pulse at 10 % of its height. */
static double true_width(const struct stage *stage)
{
	double edge[2];

	for (int side = 0; side < 2; side++) {
		double inside = synth_pulse_summit(stage->scene.shape), outside = side;

		for (int i = 0; i < 60; i++) {
			double middle = (inside + outside) / 2;

			if (synth_pulse(stage->scene.shape, middle) > 0.1)
				inside = middle;
			else
				outside = middle;
		}
		edge[side] = inside;
	}
	return (edge[1] - edge[0]) * STAGE_CONTACT_S;
}

static void count(struct tally *tally, struct reading reading, double truth)
{
	double error = reading.value - truth;

	if (!isfinite(reading.value))
		return;
	tally->gross += fabs(error) > GROSS * fabs(truth);
	tally->values++;
	tally->error += error;
	tally->square += error * error;
	if (isfinite(reading.sigma))
		tally->covered += fabs(error) <= 2 * reading.sigma;
}

/* ---- what a scene must be flagged as ------------------------------------------------------------------- */

static bool doubtful(const struct estimate_how *how)
{
	return how->status != ESTIMATE_OK || (how->flags & ESTIMATE_FLAG_MODEL);
}

static bool marked(const struct cell_scene *cell, const struct analysis *analysis)
{
	const struct scene *scene = &cell->scene;
	const struct estimate_channel *x = &analysis->channels[STAGE_S2X];
	const struct estimate_channel *plate = &analysis->channels[STAGE_S1X];

	if (cell->group == GROUP_CLIPPED)
		return (x->flags & RECORD_FLAG_CLIPPED) && (x->peak.how.flags & ESTIMATE_FLAG_EXTRAPOLATED);
	if (cell->group == GROUP_WRONG)
		return doubtful(&x->peak.how) && doubtful(&x->pulse.contact);
	if (scene->nan_at_peak)
		return x->flags & RECORD_FLAG_BAD;
	if (scene->offset_g > 0)
		return (x->flags & RECORD_FLAG_OFFSET) && fabs(x->baseline.offset_g - scene->offset_g) < 1;
	if (scene->drift_g_s > 0)
		return (x->flags & RECORD_FLAG_DRIFT) && fabs(x->baseline.drift_g_s - scene->drift_g_s) < 20;
	if (scene->hum_g > 0)
		return (x->flags & RECORD_FLAG_HUM) &&
		       fabs(x->baseline.hum_g - scene->hum_g) < 0.1 * scene->hum_g + scene->noise_g / 5;
	if (scene->spikes > 0)
		return (plate->flags & RECORD_FLAG_SPIKE) ||
		       (plate->ringdown.how.flags & ESTIMATE_FLAG_SPIKE);
	if (scene->clip_g > 0)
		return x->flags & RECORD_FLAG_CLIPPED;
	if (scene->lost_at_peak > 0)
		return (x->flags & RECORD_FLAG_LOST) &&
		       ((x->peak.how.flags & ESTIMATE_FLAG_GAPS) || x->peak.how.status != ESTIMATE_OK);
	if (scene->zeroed_at_peak > 0)
		return x->flags & RECORD_FLAG_ZEROED;
	if (scene->cut)
		return (x->flags & RECORD_FLAG_SHORT) && x->peak.how.status != ESTIMATE_OK;
	return false;
}

static bool second_mode(const struct analysis *analysis)
{
	return isfinite(analysis->channels[STAGE_S1X].ringdown.second_frequency_hz) ||
	       isfinite(analysis->channels[STAGE_S1Y].ringdown.second_frequency_hz) ||
	       (analysis->has_plate && isfinite(analysis->plate.second_frequency_hz));
}

static void run_drop(struct cell_scene *cell, struct stage *stage, unsigned drop, double width_s)
{
	struct estimate_options options = {.family = cell->scene.family};
	struct reading reading[QUANTITIES];
	struct analysis analysis;
	double truth[QUANTITIES];

	stage_drop(stage, drop);
	cell->drops++;
	if (estimate_record(&stage->record, &options, &analysis)) {
		cell->refused++;
		return;
	}
	for (int i = 0; i < QUANTITIES; i++)
		reading[i] = in_order(NAN, NAN);
	read_sensor(&analysis, reading);
	read_plate(&analysis, reading);
	find_truth(stage, truth);
	truth[QUANTITY_WIDTH_X] = width_s;
	for (int i = 0; i < QUANTITIES; i++)
		count(&cell->tally[i], reading[i], truth[i]);
	cell->marked += marked(cell, &analysis);
	cell->second += second_mode(&analysis);
	estimate_free(&analysis);
}

/* The bounds grow as the noise, with what the converter's steps add, and know nothing else of it, nor of
 * what the estimators are told. */
static bool same_signal(const struct scene *a, const struct scene *b)
{
	struct scene like = *a;

	like.name = b->name;
	like.noise_g = b->noise_g;
	like.family = b->family;
	return memcmp(&like, b, sizeof(like)) == 0;
}

static void find_bounds(const struct cell_scene *cell, double *bound)
{
	bool lags = cell->group == GROUP_KNOWN || cell->group == GROUP_UNKNOWN;
	struct stage stage;
	struct bounds b;

	stage_open(&stage, &cell->scene);
	bounds_find(&stage, lags, &b);
	stage_close(&stage);
	for (int i = 0; i < QUANTITIES; i++)
		bound[i] = NAN;
	for (int i = 0; i < 2; i++) {
		bound[QUANTITY_PEAK_X + i] = b.peak_g[i];
		bound[QUANTITY_PEAK_TIME_X + i] = b.peak_s[i];
		bound[QUANTITY_FREQUENCY_X + i] = b.frequency_hz[i];
		bound[QUANTITY_DAMPING_X + i] = b.damping[i];
		bound[QUANTITY_LAG_X + i] = lags ? b.lag_s[i] : (double)NAN;
		bound[QUANTITY_PLATE_PEAK_X + i] = lags ? b.plate_g[i] : (double)NAN;
		bound[QUANTITY_PLATE_TIME_X + i] = lags ? b.plate_s[i] : (double)NAN;
	}
	bound[QUANTITY_CONTACT_X] = b.contact_s[0];
	bound[QUANTITY_FITTED_VELOCITY_X] = bound[QUANTITY_VELOCITY_X] = b.velocity_m_s[0];
	bound[QUANTITY_RESULTANT] = b.resultant_g;
	bound[QUANTITY_RESULTANT_TIME] = b.resultant_s;
	bound[QUANTITY_FREQUENCY] = b.joint_hz;
	bound[QUANTITY_NATURAL] = b.joint_natural_hz;
	bound[QUANTITY_DAMPING] = b.joint_damping;
	bound[QUANTITY_LAG] = lags ? b.joint_lag_s : (double)NAN;
}

/* Of every scene, each signal once. */
static void compute_bounds(struct cells *cells)
{
	for (unsigned i = 0; i < cells->count; i++) {
		struct cell_scene *cell = &cells->scene[i];
		double noise = stage_noise(&cell->scene), bound[QUANTITIES];
		unsigned like = 0;

		while (like < i && !(same_signal(&cells->scene[like].scene, &cell->scene)))
			like++;
		if (like == i && cell->group != GROUP_FAULT)
			find_bounds(cell, bound);
		for (int q = 0; q < QUANTITIES; q++) {
			double as = cells->scene[like].tally[q].bound;

			cell->tally[q].bound = cell->group == GROUP_FAULT ? (double)NAN
			                       : like == i
			                               ? bound[q]
			                               : as * noise / stage_noise(&cells->scene[like].scene);
		}
	}
}

static void take_bounds(struct cells *cells, const struct cells *from)
{
	for (unsigned i = 0; from && i < cells->count; i++)
		for (int q = 0; q < QUANTITIES; q++)
			cells->scene[i].tally[q].bound = from->scene[i].tally[q].bound;
	if (!from)
		compute_bounds(cells);
}

static void run_scene(struct cell_scene *cell, unsigned drops)
{
	struct stage stage;
	double width_s;

	stage_open(&stage, &cell->scene);
	width_s = true_width(&stage);
	for (unsigned drop = 0; drop < drops; drop++)
		run_drop(cell, &stage, drop, width_s);
	stage_close(&stage);
}

/* ---- all of them, a share for each process --------------------------------------------------------------
 */

static bool wanted(const struct row *row, unsigned noise, const struct cells_options *options)
{
	if (!(row->noise & 1u << noise))
		return false;
	if (options->only && !strstr(row->scene.name, options->only) &&
	    !strstr(group_name(row->group), options->only))
		return false;
	return options->all || noises[noise] == 1 || row->group == GROUP_LOUD; /* exact: from the table */
}

static unsigned spread(const struct cells_options *options, struct cell_scene *scene)
{
	unsigned n = 0;

	for (unsigned r = 0; r < ROWS; r++)
		for (unsigned g = 0; g < 2; g++)
			for (unsigned i = 0; i < NOISES; i++) {
				if (!(rows[r].geometry & 1u << g) || !wanted(&rows[r], i, options) ||
				    n == SCENES_MAX)
					continue;
				scene[n].scene = rows[r].scene;
				scene[n].scene.noise_g = noises[i];
				scene[n].scene.geometry = g == 0 ? STAGE_2A : STAGE_2B;
				scene[n++].group = rows[r].group;
			}
	return n;
}

void cells_run(const struct cells_options *options, struct cells *cells)
{
	size_t bytes = SCENES_MAX * sizeof(*cells->scene);
	bool failed = false;

	cells->scene = mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
	if (cells->scene == MAP_FAILED)
		abort();
	cells->count = spread(options, cells->scene);
	take_bounds(cells, options->bounds);
	for (unsigned job = 0; job < options->jobs; job++) {
		pid_t child = fork();

		if (child < 0)
			abort();
		if (child > 0)
			continue;
		for (unsigned i = job; i < cells->count; i += options->jobs)
			run_scene(&cells->scene[i], options->drops);
		_exit(0);
	}
	for (unsigned job = 0; job < options->jobs; job++) {
		int status = 1;

		failed |= wait(&status) < 0 || status != 0;
	}
	if (failed) {
		fputs("a process of the Monte Carlo died\n", stderr);
		exit(1);
	}
}

void cells_free(struct cells *cells)
{
	munmap(cells->scene, SCENES_MAX * sizeof(*cells->scene));
}
