/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/model/root.h"

#include <float.h>
#include <math.h>

#include <gsl/gsl_errno.h>
#include <gsl/gsl_roots.h>

enum { STEPS_MAX = 200 };

static int iterate(gsl_root_fsolver *solver, double *root)
{
	int status = GSL_CONTINUE;

	for (int i = 0; i < STEPS_MAX && status == GSL_CONTINUE; i++) {
		status = gsl_root_fsolver_iterate(solver);
		if (status == GSL_SUCCESS)
			status = gsl_root_test_interval(gsl_root_fsolver_x_lower(solver),
			                                gsl_root_fsolver_x_upper(solver), 0.0,
			                                4.0 * DBL_EPSILON);
	}
	if (status != GSL_SUCCESS)
		return DT_E_NUMERIC;
	*root = gsl_root_fsolver_root(solver);
	return 0;
}

int root_find(double (*function)(double, void *), void *context, double low, double high, double *root)
{
	gsl_function f = {.function = function, .params = context};
	double at_low = function(low, context), at_high = function(high, context);
	gsl_root_fsolver *solver;
	int error;

	if (at_low == 0.0 || at_high == 0.0) {
		*root = at_low == 0.0 ? low : high;
		return 0;
	}
	if (!(at_low < 0.0 && at_high > 0.0) && !(at_low > 0.0 && at_high < 0.0))
		return DT_E_NUMERIC;
	solver = gsl_root_fsolver_alloc(gsl_root_fsolver_brent);
	if (!solver)
		return DT_E_MEMORY;
	error = gsl_root_fsolver_set(solver, &f, low, high) == GSL_SUCCESS ? iterate(solver, root)
	                                                                   : DT_E_NUMERIC;
	gsl_root_fsolver_free(solver);
	return error;
}
