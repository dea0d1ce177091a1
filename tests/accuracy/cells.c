/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/accuracy/cells.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define GROSS 0.15
#define DECAY_S 45e-3 /* that the limits were set with */

enum { SCENES_MAX = 200 };

/* ---- scenes: rows, spread over noises and geometries ----------------------------------------------------
 */

enum { N03 = 1, N1 = 2, N3 = 4, N10 = 8, N30 = 16, N100 = 32, NALL = N03 | N1 | N3 | N10, NOISES = 6 };
enum { A = 1, B = 2, AB = A | B };

static const double noises[NOISES] = {0.3, 1, 3, 10, 30, 100};

/* Of the scene, what it has beyond a geometry's drop. */
struct row {
	enum group group;
	unsigned noise, geometry; /* N*, A and B */
	const char *name;
	enum synthetic_family shape;
	enum estimate_family family;
	struct synthetic_scene scene;
	double x_peak_g; /* of S2; 0: the geometry's */
};

#define HALF .shape = SYNTHETIC_HALF_SINE
#define HAVER .shape = SYNTHETIC_HAVERSINE
#define HERTZ .shape = SYNTHETIC_HERTZ
#define SKEWED .shape = SYNTHETIC_HUNT_CROSSLEY
#define TOLD_HALF .family = ESTIMATE_FAMILY_HALF_SINE
#define TOLD_HAVER .family = ESTIMATE_FAMILY_HAVERSINE
#define WITH(...) .scene = {__VA_ARGS__}

static const struct row rows[] = {
        {GROUP_KNOWN, NALL, AB, "half-sine", HALF, TOLD_HALF},
        {GROUP_KNOWN, NALL, AB, "haversine", HAVER, TOLD_HAVER},
        {GROUP_UNKNOWN, NALL, AB, "half-sine", HALF},
        {GROUP_UNKNOWN, NALL, AB, "haversine", HAVER},
        {GROUP_UNKNOWN, NALL, AB, "hertz", HERTZ},
        {GROUP_SKEWED, NALL, AB, "hunt-crossley", SKEWED},
        {GROUP_APART_KNOWN, NALL, A, "half-sine, 0.2 ms", HALF, TOLD_HALF, WITH(.skew_s = 0.2e-3)},
        {GROUP_APART_KNOWN, NALL, A, "half-sine, 0.5 ms", HALF, TOLD_HALF, WITH(.skew_s = 0.5e-3)},
        {GROUP_APART, NALL, A, "half-sine, 0.2 ms", HALF, WITH(.skew_s = 0.2e-3)},
        {GROUP_APART, NALL, A, "half-sine, 0.5 ms", HALF, WITH(.skew_s = 0.5e-3)},
        {GROUP_DISTURBED, NALL, AB, "offset 10 g", HALF, WITH(.offset_g = 10)},
        {GROUP_DISTURBED, NALL, AB, "hum 5 g", HALF, WITH(.hum_g = 5)},
        {GROUP_DISTURBED, NALL, AB, "3 spikes of 300 g", HALF, WITH(.spikes = 3)},
        {GROUP_DISTURBED, NALL, AB, "20 % missing", HALF, WITH(.missing = 0.2)},
        {GROUP_DISTURBED, NALL, AB, "20 samples missing", HALF, WITH(.gap = 20)},
        {GROUP_TWO_MODES, N03 | N1, AB, "+20 Hz at 10 %", HALF,
         WITH(.second_part = 0.1, .second_apart_hz = 20)},
        {GROUP_LOUD, N30 | N100, AB, "half-sine", HALF},
        {GROUP_CLIPPED, N03 | N1 | N3, A, "520 g", HALF, TOLD_HALF, WITH(.clip_g = 500), .x_peak_g = 520},
        {GROUP_CLIPPED, N03 | N1 | N3, A, "560 g", HALF, TOLD_HALF, WITH(.clip_g = 500), .x_peak_g = 560},
        {GROUP_CLIPPED, N03 | N1 | N3, A, "627 g", HALF, TOLD_HALF, WITH(.clip_g = 500), .x_peak_g = 627},
        {GROUP_CLIPPED, N03 | N1 | N3, A, "696 g", HALF, TOLD_HALF, WITH(.clip_g = 500), .x_peak_g = 696},
        {GROUP_HOLE, N03 | N1, A, "half-sine, told", HALF, TOLD_HALF, WITH(.lost_at_peak = 4)},
        {GROUP_HOLE, N03 | N1, A, "half-sine", HALF, WITH(.lost_at_peak = 4)},
        {GROUP_WRONG, NALL, A, "half-sine on haversine", HAVER, TOLD_HALF},
        {GROUP_WRONG, N03 | N1 | N3, A, "half-sine on hertz", HERTZ, TOLD_HALF},
        {GROUP_WRONG, NALL, A, "half-sine on hunt-crossley", SKEWED, TOLD_HALF},
        {GROUP_WRONG, NALL, A, "haversine on half-sine", HALF, TOLD_HAVER},
        {GROUP_FAULT, N1, A, "nan", HALF, WITH(.nan_at_peak = 1)},
        {GROUP_FAULT, N1, A, "offset", HALF, WITH(.offset_g = 20)},
        {GROUP_FAULT, N1, A, "drift", HALF, WITH(.drift_g_s = 100)},
        {GROUP_FAULT, N1, A, "spike", HALF, WITH(.spikes = 1)},
        {GROUP_FAULT, N1, A, "clipped", HALF, WITH(.clip_g = 400)},
        {GROUP_FAULT, N1, A, "zeroed", HALF, WITH(.zeroed_at_peak = 6)},
        {GROUP_FAULT, N1, A, "missing", HALF, WITH(.lost_at_peak = 6)},
        {GROUP_FAULT, N1, A, "too short", HALF, WITH(.cut = true)},
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
	static const enum synthetic_channel channel[3] = {SYNTHETIC_S2X, SYNTHETIC_S2Y, SYNTHETIC_S2Z};
	const struct estimate_pulse *pulse = &analysis->channels[SYNTHETIC_S2X].pulse;

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
		        &analysis->channels[i == 0 ? SYNTHETIC_S1X : SYNTHETIC_S1Y].ringdown;

		reading[QUANTITY_FREQUENCY_X + i] = in_order(r->frequency_hz, r->sigma_hz);
		reading[QUANTITY_DAMPING_X + i] = in_order(r->damping_ratio, r->sigma_damping);
	}
	for (int i = 0; i < 2; i++) {
		const struct estimate_peak *peak =
		        &analysis->channels[i == 0 ? SYNTHETIC_S1X : SYNTHETIC_S1Y].peak;

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

static void find_truth(const struct synthetic *synthetic, double *out)
{
	const struct synthetic_truth truth = synthetic_truth(synthetic);

	for (int i = 0; i < 2; i++) {
		out[QUANTITY_PEAK_X + i] = truth.peak_g[i];
		out[QUANTITY_PEAK_TIME_X + i] = truth.peak_s[i];
		out[QUANTITY_LAG_X + i] = truth.lag_s[i];
		out[QUANTITY_PLATE_PEAK_X + i] = truth.plate_g[i];
		out[QUANTITY_PLATE_TIME_X + i] = truth.plate_s[i];
	}
	out[QUANTITY_LAG] = truth.lag_s[0];
	out[QUANTITY_PEAK_Z] = truth.z_peak_g;
	out[QUANTITY_WIDTH_X] = truth.width_s;
	out[QUANTITY_VELOCITY_X] = out[QUANTITY_FITTED_VELOCITY_X] = truth.velocity_m_s;
	out[QUANTITY_CONTACT_X] = truth.contact_s;
	out[QUANTITY_RESULTANT] = truth.resultant_g;
	out[QUANTITY_RESULTANT_TIME] = truth.resultant_s;
	for (int i = QUANTITY_FREQUENCY_X; i <= QUANTITY_FREQUENCY; i++)
		out[i] = truth.damped_hz;
	out[QUANTITY_NATURAL] = truth.natural_hz;
	for (int i = QUANTITY_DAMPING_X; i <= QUANTITY_DAMPING; i++)
		out[i] = truth.damping;
	out[QUANTITY_PLATE_RESULTANT] = truth.plate_resultant_g;
	out[QUANTITY_PLATE_RESULTANT_TIME] = truth.plate_resultant_s;
}

/* ---- what a scene must be flagged as ------------------------------------------------------------------- */

static bool doubtful(const struct estimate_how *how)
{
	return how->status != ESTIMATE_OK || (how->flags & ESTIMATE_FLAG_MODEL);
}

static bool marked(const struct cell_scene *cell, const struct analysis *analysis)
{
	const struct synthetic_scene *scene = &cell->scene;
	const struct estimate_channel *x = &analysis->channels[SYNTHETIC_S2X];
	const struct estimate_channel *plate = &analysis->channels[SYNTHETIC_S1X];

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
	return isfinite(analysis->channels[SYNTHETIC_S1X].ringdown.second_frequency_hz) ||
	       isfinite(analysis->channels[SYNTHETIC_S1Y].ringdown.second_frequency_hz) ||
	       (analysis->has_plate && isfinite(analysis->plate.second_frequency_hz));
}

/* Of a campaign: its context. */
struct run {
	struct cells *cells;
	const struct cells *bounds;
};

static int run_drop(void *context, size_t i, const struct synthetic *synthetic, unsigned drop)
{
	const struct run *run = context;
	struct cell_scene *cell = &run->cells->scene[i];
	struct estimate_options options = {.family = cell->family};
	struct reading reading[QUANTITIES];
	struct analysis analysis;
	double truth[QUANTITIES];

	(void)drop;
	cell->drops++;
	if (estimate_record(&synthetic->record, &options, &analysis)) {
		cell->refused++;
		return 0;
	}
	for (int q = 0; q < QUANTITIES; q++)
		reading[q] = in_order(NAN, NAN);
	read_sensor(&analysis, reading);
	read_plate(&analysis, reading);
	find_truth(synthetic, truth);
	for (int q = 0; q < QUANTITIES; q++)
		tally_add(&cell->tally[q], reading[q].value, truth[q], reading[q].sigma,
		          GROSS * fabs(truth[q]));
	cell->marked += marked(cell, &analysis);
	cell->second += second_mode(&analysis);
	estimate_free(&analysis);
	return 0;
}

static int find_bounds(struct cell_scene *cell, struct synthetic *synthetic)
{
	bool lags = cell->group == GROUP_KNOWN || cell->group == GROUP_UNKNOWN;
	double missing = synthetic->scene.missing;
	struct tally *t = cell->tally;
	struct bound b;
	int status;

	synthetic->scene.missing = 0; /* what is lost by chance is not taken out of these bounds */
	status = bound_find(synthetic, lags, &b);
	synthetic->scene.missing = missing;
	for (int i = 0; i < 2; i++) {
		t[QUANTITY_PEAK_X + i].bound = b.peak_g[i];
		t[QUANTITY_PEAK_TIME_X + i].bound = b.peak_s[i];
		t[QUANTITY_FREQUENCY_X + i].bound = b.damped_hz[i];
		t[QUANTITY_DAMPING_X + i].bound = b.damping[i];
		t[QUANTITY_LAG_X + i].bound = lags ? b.lag_s[i] : (double)NAN;
		t[QUANTITY_PLATE_PEAK_X + i].bound = lags ? b.plate_g[i] : (double)NAN;
		t[QUANTITY_PLATE_TIME_X + i].bound = lags ? b.plate_s[i] : (double)NAN;
	}
	t[QUANTITY_CONTACT_X].bound = b.contact_s[0];
	t[QUANTITY_FITTED_VELOCITY_X].bound = t[QUANTITY_VELOCITY_X].bound = b.velocity_m_s[0];
	t[QUANTITY_RESULTANT].bound = b.resultant_g;
	t[QUANTITY_RESULTANT_TIME].bound = b.resultant_s;
	t[QUANTITY_FREQUENCY].bound = b.pair_hz;
	t[QUANTITY_NATURAL].bound = b.pair_natural_hz;
	t[QUANTITY_DAMPING].bound = b.pair_damping;
	t[QUANTITY_LAG].bound = lags ? b.pair_lag_s : (double)NAN;
	return status;
}

static int begin(void *context, size_t i, struct synthetic *synthetic)
{
	const struct run *run = context;
	struct cell_scene *cell = &run->cells->scene[i];

	for (int q = 0; q < QUANTITIES; q++)
		cell->tally[q].bound = run->bounds ? run->bounds->scene[i].tally[q].bound : (double)NAN;
	return run->bounds || cell->group == GROUP_FAULT ? 0 : find_bounds(cell, synthetic);
}

/* ---- all of them --------------------------------------------------------------------------------------- */

static bool wanted(const struct row *row, unsigned noise, const struct cells_options *options)
{
	if (!(row->noise & 1u << noise))
		return false;
	if (options->only && !strstr(row->name, options->only) &&
	    !strstr(group_name(row->group), options->only))
		return false;
	return options->all || noises[noise] == 1 || row->group == GROUP_LOUD; /* exact: from the table */
}

/* Scenes that differ in what they are, not in what the estimators are told, get chances of their own. */
static struct synthetic_scene drop_of(const struct row *row, enum geometry geometry, double noise_g)
{
	static const struct {
		double damped_hz, interval_s, plate_g[2], sign;
	} geometries[] = {
	        [GEOMETRY_2A] = {129, 2.0e-3, {310.1, 133.0}, 1},
	        [GEOMETRY_2B] = {177, 1.2e-3, {401.0, 225.9}, -1},
	};
	const struct synthetic_scene usual = synthetic_scene();
	struct synthetic_scene scene = row->scene;

	scene.family = row->shape;
	scene.seed = 131ul * (2 * (unsigned long)row->shape + (unsigned long)geometry) +
	             1009ul * (unsigned long)(10 * noise_g);
	for (int i = 0; i < 2; i++) {
		double peak_g = i == 0 && row->x_peak_g > 0 ? row->x_peak_g : usual.peak_g[i];

		scene.peak_g[i] = geometries[geometry].sign * peak_g;
		scene.plate_g[i] = geometries[geometry].sign * geometries[geometry].plate_g[i];
		scene.rate_hz[i] = usual.rate_hz[i];
	}
	scene.damped_hz = geometries[geometry].damped_hz;
	scene.interval_s = geometries[geometry].interval_s;
	scene.z_part = usual.z_part;
	scene.contact_s = usual.contact_s;
	scene.damping = usual.damping;
	scene.pre_s = usual.pre_s;
	scene.post_s = usual.post_s;
	scene.decay_s = DECAY_S;
	scene.noise_g = noise_g;
	scene.step_g = usual.step_g;
	scene.hum_hz = usual.hum_hz;
	scene.spike_g = usual.spike_g;
	return scene;
}

static unsigned spread(const struct cells_options *options, struct cell_scene *cell)
{
	unsigned n = 0;

	for (unsigned r = 0; r < ROWS; r++)
		for (unsigned g = 0; g < 2; g++)
			for (unsigned i = 0; i < NOISES; i++) {
				if (!(rows[r].geometry & 1u << g) || !wanted(&rows[r], i, options) ||
				    n == SCENES_MAX)
					continue;
				cell[n].name = rows[r].name;
				cell[n].family = rows[r].family;
				cell[n].group = rows[r].group;
				cell[n].geometry = (enum geometry)g;
				cell[n++].scene = drop_of(&rows[r], (enum geometry)g, noises[i]);
			}
	return n;
}

static const struct synthetic_scene *scene_of(void *context, size_t i)
{
	const struct run *run = context;

	return &run->cells->scene[i].scene;
}

void cells_run(const struct cells_options *options, struct cells *cells)
{
	struct run run = {.cells = cells, .bounds = options->bounds};
	struct campaign campaign = {.drops = options->drops,
	                            .context = &run,
	                            .scene = scene_of,
	                            .begin = begin,
	                            .drop = run_drop};

	cells->scene = campaign_memory(SCENES_MAX * sizeof(*cells->scene));
	if (!cells->scene)
		abort();
	campaign.count = cells->count = spread(options, cells->scene);
	if (campaign_run(&campaign)) {
		fputs("a process of the Monte Carlo died\n", stderr);
		exit(1);
	}
}

void cells_free(struct cells *cells)
{
	campaign_free(cells->scene, SCENES_MAX * sizeof(*cells->scene));
}
