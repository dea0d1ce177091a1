/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * knockout [--drops N] [--only TEXT] [--figures] [FILE[=COLUMNS]]...: what every special mechanism of
 * host/estimate is worth. Each is switched off, one at a time, by the linker (--wrap, knockout_wrap.c), so
 * that the product holds no switch; then files are estimated once more, and the cells of make accuracy, the
 * same drops.
 *
 * A figure is a number with a standard uncertainty. Moved: it differs at all; far: by more than that
 * uncertainty; lost: it is no number any more, or has become one. Of the cells: those whose error grew by
 * more than a twentieth, or shrank so, that lost values, and that are out of their limits though they were
 * not.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <gsl/gsl_errno.h>

#include "host/record/drop.h"
#include "host/record/read.h"
#include "tests/accuracy/cells.h"
#include "tests/accuracy/knockout.h"

#define IEPE_S 0.3 /* of the tower's sensors: common/scenes */
#define WORSE 1.05
#define SLACK 3.0

enum { FIGURES_MAX = 256, FILES_MAX = 64 };

struct figure {
	char name[64];
	double value, sigma;
};

struct figures {
	struct figure figure[FIGURES_MAX];
	unsigned count;
};

/* ---- all figures of a record ---- */

static void add(struct figures *all, const char *of, const char *what, double value, double sigma)
{
	struct figure *figure = &all->figure[all->count];

	if (all->count == FIGURES_MAX)
		return;
	snprintf(figure->name, sizeof(figure->name), "%s %s", of, what);
	figure->value = value;
	figure->sigma = sigma;
	all->count++;
}

static void add_ringdown(struct figures *all, const char *of, const struct estimate_ringdown *r)
{
	add(all, of, "frequency", r->frequency_hz, r->sigma_hz);
	add(all, of, "natural frequency", r->natural_frequency_hz, r->sigma_natural_hz);
	add(all, of, "damping", r->damping_ratio, r->sigma_damping);
}

static void add_channel(struct figures *all, const char *of, const struct estimate_channel *channel)
{
	const struct estimate_peak *peak = &channel->peak;
	const struct estimate_pulse *pulse = &channel->pulse;

	add(all, of, "peak", peak->value_g, peak->sigma_g);
	add(all, of, "peak time", peak->time_s, peak->sigma_time_s);
	add(all, of, "width", pulse->duration_s, pulse->sigma_duration_s);
	add(all, of, "velocity change", pulse->velocity_change_m_s, pulse->sigma_velocity_m_s);
	add(all, of, "contact time", pulse->contact_time_s, pulse->sigma_contact_s);
	add(all, of, "fitted velocity change", pulse->fitted_velocity_m_s, pulse->sigma_fitted_velocity_m_s);
	add_ringdown(all, of, &channel->ringdown);
}

static void take_figures(const struct record *record, const struct analysis *a, struct figures *all)
{
	all->count = 0;
	for (size_t i = 0; i < a->channel_count; i++)
		add_channel(all, record->channels[i].name, &a->channels[i]);
	for (size_t i = 0; i < a->resultant_count; i++) {
		const struct estimate_resultant *r = &a->resultants[i];

		add(all, r->sensor, "resultant", r->peak_g, r->sigma_g);
		add(all, r->sensor, "resultant's time", r->time_s, r->sigma_time_s);
	}
	if (a->has_lag) {
		add(all, "lag", "of largest peaks", a->lag.largest_peak_s, a->lag.sigma_s);
		add(all, "lag", "driven", a->lag.driven_s, a->lag.sigma_driven_s);
	}
	if (a->has_plate)
		add_ringdown(all, "plate", &a->plate);
	if (a->has_rebound) {
		add(all, "rebound", "by velocity", a->rebound.velocity_ratio,
		    a->rebound.sigma_velocity_ratio);
		add(all, "rebound", "by flight", a->rebound.flight_ratio, a->rebound.sigma_flight_ratio);
	}
}

/* ---- recordings ---- */

struct file {
	char name[200];
	bool of_tower;
	struct record record;
	struct figures figures; /* by the whole estimator */
};

static void estimate(const struct file *file, struct figures *figures)
{
	const struct estimate_options options = {.iepe_time_constant_s = file->of_tower ? IEPE_S : 0};
	struct analysis analysis;

	figures->count = 0;
	if (estimate_record(&file->record, &options, &analysis) != 0)
		return;
	take_figures(&file->record, &analysis, figures);
	estimate_free(&analysis);
}

/* FILE or FILE=COLUMNS. */
static void open_file(struct file *file, const char *argument)
{
	const char *columns = strchr(argument, '=');
	char message[READ_MESSAGE_MAX];

	snprintf(file->name, sizeof(file->name), "%.*s",
	         (int)(columns ? columns - argument : (ptrdiff_t)strlen(argument)), argument);
	if (read_record(&file->record, file->name, columns ? columns + 1 : NULL, message) != 0) {
		fprintf(stderr, "knockout: %s\n", message);
		exit(2);
	}
	file->of_tower = drop_has_channel(&file->record);
	estimate(file, &file->figures);
}

struct moved {
	unsigned figures, any, far, lost;
	double most; /* in its sigma */
	char where[256];
};

static void compare(const struct file *file, struct moved *moved)
{
	struct figures without;

	estimate(file, &without);
	for (unsigned i = 0; i < file->figures.count && i < without.count; i++) {
		const struct figure *a = &file->figures.figure[i], *b = &without.figure[i];
		double by = fabs(b->value - a->value) / a->sigma;

		if (!isfinite(a->value) && !isfinite(b->value))
			continue;
		moved->figures++;
		if (!isfinite(a->value) || !isfinite(b->value)) {
			moved->lost++;
			continue;
		}
		moved->any += by > 0;
		moved->far += by > 1;
		if (by > moved->most) {
			const char *slash = strrchr(file->name, '/');

			moved->most = by;
			snprintf(moved->where, sizeof(moved->where), "%s: %s", slash ? slash + 1 : file->name,
			         b->name);
		}
	}
}

/* ---- cells ---- */

struct held {
	unsigned worse, better, lost;
	int out;
	double most; /* error without it over the error with it */
	const char *where;
	double noise_g;
};

static unsigned out_of(const struct cells *cells)
{
	unsigned judged, failed = 0;

	for (int group = 0; group < GROUPS; group++)
		failed += cells_judge(cells, (enum group)group, SLACK, CELLS_NOTHING, &judged);
	return failed;
}

static void compare_cells(const struct cells *with, const struct cells *without, struct held *held)
{
	for (unsigned i = 0; i < with->count; i++)
		for (int q = 0; q < QUANTITIES; q++) {
			const struct tally *a = &with->scene[i].tally[q], *b = &without->scene[i].tally[q];
			double ratio;

			held->lost += b->values < a->values;
			if (a->values == 0 || b->values == 0)
				continue;
			ratio = sqrt(b->square / b->values / (a->square / a->values));
			held->worse += ratio > WORSE;
			held->better += ratio < 1 / WORSE;
			if (ratio > held->most) {
				held->most = ratio;
				held->where = with->scene[i].name;
				held->noise_g = with->scene[i].scene.noise_g;
			}
		}
}

/* ---- lines ---- */

/* Of a file, or of one function of it: from its first line to the brace that ends it. */
static unsigned lines_of(const char *file, const char *function)
{
	char path[128], line[512], call[64];
	unsigned count = 0;
	bool inside = *function == '\0';
	FILE *in;

	snprintf(path, sizeof(path), "host/estimate/%s", file);
	snprintf(call, sizeof(call), "%s(", function);
	in = fopen(path, "r");
	if (!in)
		return 0;
	while (fgets(line, sizeof(line), in)) {
		inside |= strchr("\t /", line[0]) == NULL && strstr(line, call) != NULL;
		count += inside;
		inside &= *function == '\0' || line[0] != '}';
	}
	fclose(in);
	return count;
}

static unsigned count_lines(const char *where)
{
	char list[256], *save = NULL;
	unsigned count = 0;

	snprintf(list, sizeof(list), "%s", where);
	for (char *word = strtok_r(list, " ", &save); word; word = strtok_r(NULL, " ", &save)) {
		char *colon = strchr(word, ':');

		if (colon)
			*colon++ = '\0';
		count += lines_of(word, colon ? colon : "");
	}
	return count;
}

/* ---- the table ---- */

static void print_row(const struct knockout *off, const struct moved moved[2], const struct held *held)
{
	printf("%-26s %5u | %4u %4u %4u %8.2g | %4u %4u %4u %8.2g | %4u %4u %4u %4d %8.3g\n", off->name,
	       count_lines(off->lines), moved[0].any, moved[0].far, moved[0].lost, moved[0].most,
	       moved[1].any, moved[1].far, moved[1].lost, moved[1].most, held->worse, held->better,
	       held->lost, held->out, held->most);
	for (int i = 0; i < 2; i++)
		if (moved[i].far > 0)
			printf("%32s | most: %s\n", "", moved[i].where);
	if (held->worse > 0)
		printf("%32s | worst cell: %s, %.1f g\n", "", held->where, held->noise_g);
	fflush(stdout);
}

static void knock_out(const struct knockout *off, const struct file *files, unsigned count,
                      const struct cells_options *options, const struct cells *with)
{
	struct cells_options same = *options;
	struct moved moved[2] = {{0}};
	struct held held = {0};
	struct cells without;

	knocked_out = off;
	for (unsigned i = 0; i < count; i++)
		compare(&files[i], &moved[!files[i].of_tower]);
	same.bounds = with;
	cells_run(&same, &without);
	compare_cells(with, &without, &held);
	held.out = (int)out_of(&without) - (int)out_of(with);
	knocked_out = NULL;
	print_row(off, moved, &held);
	cells_free(&without);
}

/* Everything a mechanism or a number may move, for tests/accuracy/thresholds: what, value, uncertainty, and
 * of a cell the number of values, its value the error. */
static void print_figures(const struct file *files, unsigned count, const struct cells *cells)
{
	for (unsigned i = 0; i < count; i++)
		for (unsigned k = 0; k < files[i].figures.count; k++) {
			const struct figure *f = &files[i].figures.figure[k];

			printf("%s\t%s\t%.17g\t%.17g\t0\n", files[i].name, f->name, f->value, f->sigma);
		}
	for (unsigned i = 0; i < cells->count; i++)
		for (int q = 0; q < QUANTITIES; q++) {
			const struct tally *t = &cells->scene[i].tally[q];

			if (t->values > 0)
				printf("%u\t%d\t%.17g\t0\t%u\n", i, q, sqrt(t->square / t->values),
				       t->values);
		}
}

static void print_head(const struct file *files, unsigned count, const struct cells_options *options)
{
	unsigned with_sigma[2] = {0};

	for (unsigned i = 0; i < count; i++)
		for (unsigned k = 0; k < files[i].figures.count; k++)
			with_sigma[!files[i].of_tower] += isfinite(files[i].figures.figure[k].value);
	printf("%u figures of tower drops, %u of other recordings, cells of %u drops\n", with_sigma[0],
	       with_sigma[1], options->drops);
	printf("%-26s %5s | %4s %4s %4s %8s | %4s %4s %4s %8s | %4s %4s %4s %4s %8s\n", "without", "lines",
	       "any", "far", "lost", "most", "any", "far", "lost", "most", "wors", "bett", "lost", "out",
	       "most");
	fflush(stdout);
}

int main(int argc, char **argv)
{
	static struct file files[FILES_MAX];
	struct cells_options options = {.drops = 20, .all = true};
	const char *only = "";
	bool figures = false;
	struct cells cells;
	unsigned count = 0;

	gsl_set_error_handler_off();
	for (int i = 1; i < argc; i++) {
		if (strcmp(argv[i], "--drops") == 0 && i + 1 < argc)
			options.drops = (unsigned)strtoul(argv[++i], NULL, 10);
		else if (strcmp(argv[i], "--only") == 0 && i + 1 < argc)
			only = argv[++i];
		else if (strcmp(argv[i], "--figures") == 0)
			figures = true;
		else if (argv[i][0] != '-' && count < FILES_MAX)
			open_file(&files[count++], argv[i]);
		else
			return fprintf(stderr, "knockout [--drops N] [--only TEXT] [--figures] "
			                       "[FILE[=COLUMNS]]...\n"),
			       2;
	}
	if (figures) {
		options.bounds = &cells; /* none are asked for */
		cells_run(&options, &cells);
		print_figures(files, count, &cells);
		cells_free(&cells);
		return 0;
	}
	cells_run(&options, &cells);
	print_head(files, count, &options);
	for (size_t i = 0; i < knockout_count; i++)
		if (strstr(knockouts[i].name, only))
			knock_out(&knockouts[i], files, count, &options, &cells);
	cells_free(&cells);
	return 0;
}
