/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/median.h"

#include <stdbool.h>

enum { SORT_MAX = 24 };

static void median_sort(double *v, size_t n)
{
	for (size_t i = 1; i < n; i++) {
		double here = v[i];
		size_t j = i;

		for (; j > 0 && here < v[j - 1]; j--)
			v[j] = v[j - 1];
		v[j] = here;
	}
}

static double middle_of_three(double a, double b, double c)
{
	if ((a < b) == (b < c))
		return b;
	return (b < a) == (a < c) ? a : c;
}

/* Moves what is below (or, with equal, at) the pivot to the front and counts it. No branch hangs on a value:
 * half of them would be guessed wrong. */
static size_t part(double *v, size_t n, double pivot, bool equal)
{
	size_t front = 0;

	for (size_t i = 0; i < n; i++) {
		double here = v[i];

		v[i] = v[front];
		v[front] = here;
		front += equal ? here <= pivot : here < pivot;
	}
	return front;
}

/* Puts number rank into place, none larger before it, none smaller after it. */
static void select(double *v, size_t n, size_t rank)
{
	while (n > SORT_MAX) {
		double pivot = middle_of_three(v[0], v[n / 2], v[n - 1]);
		size_t below = part(v, n, pivot, false);
		size_t equal;

		if (rank < below) {
			n = below;
			continue;
		}
		equal = part(v + below, n - below, pivot, true);
		if (rank < below + equal)
			return;
		v += below + equal;
		n -= below + equal;
		rank -= below + equal;
	}
	median_sort(v, n);
}

double median_find(double *value, size_t n)
{
	size_t rank = n / 2;
	double most;

	select(value, n, rank);
	if (n % 2 == 1)
		return value[rank];
	most = value[0];
	for (size_t i = 1; i < rank; i++)
		most = value[i] > most ? value[i] : most;
	return most + (value[rank] - most) / 2;
}
