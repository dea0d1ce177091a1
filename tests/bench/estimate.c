/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * make bench: what the analysis costs on one core, as us, as a multiple of a loop measured in the same run,
 * and beside what was asked for. Another thing to measure is one more row.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include <gsl/gsl_blas.h>
#include <gsl/gsl_errno.h>
#include <gsl/gsl_multifit_nlinear.h>

#include "common/units.h"
#include "host/estimate/baseline.h"
#include "host/estimate/dropout.h"
#include "host/estimate/estimate.h"
#include "host/estimate/modes.h"
#include "host/estimate/ringdown.h"
#include "host/estimate/spike.h"
#include "host/shock/events.h"
#include "host/shock/free_fall.h"
#include "host/shock/srs.h"
#include "tests/bench/archive.h"
#include "tests/bench/material.h"
#include "tests/bench/stopwatch.h"

/* Five cycles of the plate. */
#define DECAY_S 0.04

enum { UNKNOWNS = 5 };

static struct material clean, worst;
static struct trace plate; /* S1X of the clean drop, baseline removed */
static struct series series;
static double scratch[20000];

static void must(bool done, const char *what)
{
	if (done)
		return;
	fprintf(stderr, "bench: %s failed\n", what);
	exit(1);
}

static void whole_drop(void *context)
{
	const struct material *material = context;
	struct estimate_options options = {0};
	struct analysis analysis;

	must(estimate_record(&material->record, &options, &analysis) == 0, "the analysis");
	estimate_free(&analysis);
}

/* Six traces opened, looked through and set to zero. */
static void prepare(void *context)
{
	const struct material *material = context;
	struct estimate_baseline baseline;
	struct trace trace;

	for (int i = 0; i < MATERIAL_CHANNELS; i++) {
		must(trace_open(&trace, &material->channel[i], -INFINITY, INFINITY) == 0, "a trace");
		baseline_find(&trace, scratch, &baseline);
		spike_mark(&trace, baseline.noise_g);
		dropout_mark(&trace, baseline.noise_g);
		baseline_remove(&trace, &baseline);
		trace_close(&trace);
	}
}

static void ring(void *context)
{
	struct ringdown_span span = {.from_s = clean.contact_end_s, .until_s = INFINITY, .peak_g = 400};
	struct ringdown ringdown;

	(void)context;
	ringdown_find(&plate, &span, &ringdown);
	must(ringdown.result.how.status == ESTIMATE_OK, "the ring-down");
}

/* Offset, decay, angular frequency, cosine, sine: both solvers start here. */
static const double start[UNKNOWNS] = {0, 75, 2 * M_PI * 131, 250, 100};

static void own_fit(void *context)
{
	struct modes modes = {.count = 1};
	double *solution = context;

	for (int i = 0; i < UNKNOWNS; i++)
		modes.p[i] = start[i];
	must(modes_fit(&modes, &series), "our fit");
	for (int i = 0; i < UNKNOWNS; i++)
		solution[i] = modes.p[i];
}

static double time_of(size_t k)
{
	return series.first_s + (double)k * series.step_s;
}

static int residual(const gsl_vector *p, void *context, gsl_vector *f)
{
	(void)context;
	for (size_t k = 0; k < series.count; k++) {
		double t = time_of(k), w = gsl_vector_get(p, 2) * t;
		double value = exp(-gsl_vector_get(p, 1) * t) *
		               (gsl_vector_get(p, 3) * cos(w) + gsl_vector_get(p, 4) * sin(w));

		gsl_vector_set(f, k, gsl_vector_get(p, 0) + value - series.value_g[k]);
	}
	return GSL_SUCCESS;
}

static int jacobian(const gsl_vector *p, void *context, gsl_matrix *j)
{
	(void)context;
	for (size_t k = 0; k < series.count; k++) {
		double t = time_of(k), w = gsl_vector_get(p, 2) * t, e = exp(-gsl_vector_get(p, 1) * t);
		double c = e * cos(w), s = e * sin(w), a = gsl_vector_get(p, 3), b = gsl_vector_get(p, 4);

		gsl_matrix_set(j, k, 0, 1);
		gsl_matrix_set(j, k, 1, -t * (a * c + b * s));
		gsl_matrix_set(j, k, 2, t * (b * c - a * s));
		gsl_matrix_set(j, k, 3, c);
		gsl_matrix_set(j, k, 4, s);
	}
	return GSL_SUCCESS;
}

static void gsl_fit(void *context)
{
	gsl_multifit_nlinear_parameters parameters = gsl_multifit_nlinear_default_parameters();
	gsl_multifit_nlinear_workspace *work =
	        gsl_multifit_nlinear_alloc(gsl_multifit_nlinear_trust, &parameters, series.count, UNKNOWNS);
	gsl_multifit_nlinear_fdf fdf = {.f = residual, .df = jacobian, .n = series.count, .p = UNKNOWNS};
	gsl_vector_const_view from = gsl_vector_const_view_array(start, UNKNOWNS);
	double *solution = context;
	int info;

	must(work && gsl_multifit_nlinear_init(&from.vector, &fdf, work) == GSL_SUCCESS &&
	             gsl_multifit_nlinear_driver(50, 1e-8, 1e-8, 0, NULL, NULL, &info, work) == GSL_SUCCESS,
	     "GSL's fit");
	for (size_t i = 0; i < UNKNOWNS; i++)
		solution[i] = gsl_vector_get(work->x, i);
	gsl_multifit_nlinear_free(work);
}

/* Six channels of 1 s at 10 kHz; 104 frequencies, 5 to 1 918 Hz, Q 10. */
enum { SPECTRA = 6, SPECTRUM_SAMPLES = 10000, SPECTRUM_FREQUENCIES = 104 };

static double shocks[SPECTRA][SPECTRUM_SAMPLES], natural_hz[SPECTRUM_FREQUENCIES];
static struct srs_options as_sampled = {.damping = 0.05, .keep_rate = true};
static struct srs_options upsampled = {.damping = 0.05};

static void prepare_shocks(void)
{
	for (int c = 0; c < SPECTRA; c++)
		for (int k = 0; k < SPECTRUM_SAMPLES; k++)
			shocks[c][k] = sin(0.7 * k + c) +
			               (k > 2000 && k < 2030 ? 485 * sin(M_PI * (k - 2000) / 30.0) : 0);
	for (int i = 0; i < SPECTRUM_FREQUENCIES; i++)
		natural_hz[i] = 5 * exp2(i / 12.0);
}

static void spectra(void *context)
{
	struct srs_value value[SPECTRUM_FREQUENCIES];

	for (int c = 0; c < SPECTRA; c++)
		must(srs_compute(shocks[c], SPECTRUM_SAMPLES, 10000, natural_hz, SPECTRUM_FREQUENCIES,
		                 context, value) == 0,
		     "a spectrum");
}

static void list_shocks(void *context)
{
	const struct material *material = context;
	struct events_options options = {0};
	struct free_falls falls;
	struct events events;

	must(events_find(&material->record, &options, &events) == 0, "the shocks");
	must(free_fall_find(&material->record, UNITS_G_M_S2, &falls) == 0, "the falls");
}

static double own_solution[UNKNOWNS], gsl_solution[UNKNOWNS];

static const struct row {
	const char *name;
	void (*work)(void *);
	void *context;
	double target_us; /* 0: none */
} rows[] = {
        {"whole clean drop, 6 channels x 0.5 s", whole_drop, &clean, 150},
        {"  of it opening, baseline, spikes", prepare, &clean, 0},
        {"worst drop: spikes, hum, modes, clip, lost", whole_drop, &worst, 2000},
        {"frequency and damping of an axis", ring, NULL, 10},
        {"shocks and free falls of the clean drop", list_shocks, &clean, 0},
        {"spectra, 6 x 1 s x 104, as sampled", spectra, &as_sampled, 8000},
        {"spectra, 6 x 1 s x 104, up-sampled", spectra, &upsampled, 30000},
        {"archive of 10 000 drops: series listed", bench_archive_list, NULL, 100e3},
        {"  its drops at one angle on three days", bench_archive_filter, NULL, 100e3},
        {"  the 2 000 drops with two words", bench_archive_text, NULL, 100e3},
        {"  the newest 100 series with a word", bench_archive_newest, NULL, 100e3},
        {"  means and SDs of all", bench_archive_tables, NULL, 100e3},
        {"decay of 5 unknowns, our solver", own_fit, own_solution, 0},
        {"decay of 5 unknowns, GSL's", gsl_fit, gsl_solution, 0},
};

enum { ROWS = sizeof(rows) / sizeof(rows[0]), OWN = ROWS - 2, GSL = ROWS - 1 };

static void prepare_series(void)
{
	struct estimate_baseline baseline;

	must(trace_open(&plate, &clean.channel[MATERIAL_S1X], -INFINITY, INFINITY) == 0, "a trace");
	baseline_find(&plate, scratch, &baseline);
	baseline_remove(&plate, &baseline);
	series_take(&series, &plate, trace_index(&plate, clean.contact_end_s),
	            trace_index(&plate, clean.contact_end_s + DECAY_S), clean.contact_end_s, 1);
}

static void print_row(const char *name, double median_us, double best_us, double reference_us,
                      double target_us)
{
	printf("%-44s %10.2f %10.2f %9.1f", name, median_us, best_us, median_us / reference_us);
	if (target_us > 0)
		printf(" %10.0f  %s", target_us, median_us <= target_us ? "met" : "NOT MET");
	printf("\n");
}

static void print_solvers(const struct stopwatch *time)
{
	double apart = 0;

	for (int i = 1; i < UNKNOWNS; i++)
		apart = fmax(apart, fabs(own_solution[i] / gsl_solution[i] - 1));
	printf("solvers: GSL takes %.1f times as long (asked: 5), answers agree to %.1e (asked: 1e-6)\n",
	       time[GSL].median_us / time[OWN].median_us, apart);
}

static void print_program(char **argv, double reference_us)
{
	char verb[] = "analyze", json[] = "--json";
	char *const arguments[] = {argv[1], verb, json, argv[2], NULL};
	double peak_mb;
	struct stopwatch time = stopwatch_program(arguments, &peak_mb);

	must(time.median_us > 0, "droptower analyze");
	print_row("droptower analyze --json, from a cold start", time.median_us, time.best_us, reference_us,
	          30e3);
	printf("%-44s %10.1f MB %29.0f  %s\n", "  its largest resident size", peak_mb, 20.0,
	       peak_mb <= 20 ? "met" : "NOT MET");
}

int main(int argc, char **argv)
{
	struct stopwatch reference = stopwatch_reference(), time[ROWS];

	gsl_set_error_handler_off();
	material_make(&clean, MATERIAL_CLEAN);
	material_make(&worst, MATERIAL_WORST);
	prepare_series();
	prepare_shocks();
	must(bench_archive_make(), "the archive");
	printf("%-44s %10s %10s %9s %10s\n", "us on one core", "median", "best", "x ref.", "asked for");
	print_row("reference: 4096 products summed", reference.median_us, reference.best_us,
	          reference.median_us, 0);
	for (int i = 0; i < ROWS; i++) {
		time[i] = stopwatch_time(rows[i].work, rows[i].context);
		print_row(rows[i].name, time[i].median_us, time[i].best_us, reference.median_us,
		          rows[i].target_us);
	}
	print_solvers(time);
	if (argc == 3)
		print_program(argv, reference.median_us);
	bench_archive_remove();
	trace_close(&plate);
	material_free(&clean);
	material_free(&worst);
	return 0;
}
