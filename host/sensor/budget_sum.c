/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/sensor/budget_sum.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define NOT_NORMAL 0.3 /* of the variance: from there on the linear rule does not do */

const char *budget_part_name(enum budget_part part)
{
	static const char *const name[BUDGET_PARTS] = {"noise",     "definition", "sensitivity", "transverse",
	                                               "linearity", "response",   "zero",        "filter",
	                                               "clock",     "mounting"};

	return name[part];
}

void budget_collect(struct budget_sum *sum, enum budget_part part, enum coverage_law law, double u)
{
	u = fabs(u);
	sum->unknown |= !isfinite(u);
	if (!(u > 0.0) || !isfinite(u))
		return;
	sum->part[part] = hypot(sum->part[part], u);
	coverage_add(&sum->coverage, law, u);
}

void budget_within(struct budget_sum *sum, enum budget_part part, double half)
{
	budget_collect(sum, part, COVERAGE_RECTANGULAR, half / sqrt(3.0));
}

static void largest_of(struct budget_item *item, const char *noise)
{
	bool taken[BUDGET_PARTS] = {false};
	size_t used = 0;

	for (int n = 0; n < 3; n++) {
		int most = -1;

		for (int p = 0; p < BUDGET_PARTS; p++)
			if (!taken[p] && item->part[p] > 0.0 &&
			    (most < 0 || item->part[p] > item->part[most]))
				most = p;
		if (most < 0)
			break;
		taken[most] = true;
		used += (size_t)snprintf(item->largest + used, sizeof(item->largest) - used, "%s%s %.0f %%",
		                         used > 0 ? ", " : "",
		                         most == BUDGET_NOISE ? noise
		                                              : budget_part_name((enum budget_part)most),
		                         100.0 * pow(item->part[most] / item->u, 2));
	}
}

void budget_settle(struct budget_item *item, const struct budget_sum *sum, const char *noise_name,
                   double student)
{
	struct budget_sum c = *sum;
	double noise = c.part[BUDGET_NOISE], rest = sqrt(c.coverage.normal + c.coverage.other);
	const double u[2] = {noise, rest}, degrees[2] = {c.degrees, (double)INFINITY};

	memcpy(item->part, c.part, sizeof(item->part));
	item->u = hypot(noise, rest);
	item->degrees = coverage_degrees(u, degrees, 2);
	item->k = coverage_factor(item->degrees);
	item->expanded = item->k * item->u;
	item->method = "linear";
	if (c.coverage.other > NOT_NORMAL * item->u * item->u) {
		coverage_add(&c.coverage, COVERAGE_NORMAL, noise * student);
		item->expanded = coverage_expanded(&c.coverage);
		item->k = item->expanded / item->u;
		item->method = "distribution";
	}
	largest_of(item, noise_name);
}

/* ---- of several drops ---- */

void budget_mean_add(struct budget_mean *mean, const struct budget_item *item)
{
	mean->count++;
	for (int p = 0; p < BUDGET_PARTS; p++)
		mean->part[p] += item->part[p];
	mean->noise = item->part[BUDGET_NOISE];
	mean->expanded += item->expanded;
	mean->distribution |= strcmp(item->method, "distribution") == 0;
}

/* The parts that all drops have, by the law that most of each is of. transverse: of a direction that nobody
 * knows, or by the matrix. */
static struct budget_sum common_parts(const struct budget_mean *mean, enum coverage_law transverse)
{
	struct budget_sum c = {.degrees = (double)INFINITY};

	for (int p = 0; p < BUDGET_PARTS; p++)
		if (p != BUDGET_NOISE)
			budget_collect(&c, (enum budget_part)p,
			               p == BUDGET_TRANSVERSE                          ? transverse
			               : p == BUDGET_SENSITIVITY || p == BUDGET_FILTER ? COVERAGE_NORMAL
			                                                               : COVERAGE_RECTANGULAR,
			               mean->part[p] / (double)mean->count);
	return c;
}

/* By which of the two laws U is as far from what it is of the drops themselves. */
static double missed(const struct budget_mean *mean, const struct budget_sum *c)
{
	struct coverage coverage = c->coverage;

	coverage_add(&coverage, COVERAGE_NORMAL, mean->part[BUDGET_NOISE] / (double)mean->count);
	return fabs(coverage_expanded(&coverage) - mean->expanded / (double)mean->count);
}

void budget_mean_item(const struct budget_mean *mean, double value, double sd, struct budget_item *item)
{
	struct budget_sum c = common_parts(mean, COVERAGE_ARCSINE),
	                  normal = common_parts(mean, COVERAGE_NORMAL);
	double n = (double)mean->count;

	if (!mean->distribution || missed(mean, &normal) < missed(mean, &c))
		c = normal;
	c.degrees = mean->count > 1 ? n - 1.0 : (double)INFINITY;
	c.part[BUDGET_NOISE] = mean->count > 1 ? sd / sqrt(n) : mean->noise;
	*item = (struct budget_item){.unit = "", .value = value};
	/* alone it covers what it has to */
	budget_settle(item, &c, mean->count > 1 ? "scatter" : budget_part_name(BUDGET_NOISE),
	              coverage_factor(c.degrees) / coverage_factor((double)INFINITY));
}
