/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_COMPLEX_PRODUCT_H
#define DT_HOST_ESTIMATE_COMPLEX_PRODUCT_H
/*
 * Products of finite complex numbers, for loops: the language's own looks after infinities as well, which
 * takes longer than the product. Not every library has CMPLX for every compiler.
 */
#include <complex.h>

static inline double complex product(double complex a, double complex b)
{
	const union {
		double part[2];
		double complex whole;
	} made = {{creal(a) * creal(b) - cimag(a) * cimag(b), creal(a) * cimag(b) + cimag(a) * creal(b)}};

	return made.whole;
}

/* The real part alone. */
static inline double product_real(double complex a, double complex b)
{
	return creal(a) * creal(b) - cimag(a) * cimag(b);
}

#endif
