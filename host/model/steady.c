/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/model/steady.h"

#include <math.h>

int steady_response(double r, double damping_ratio, double *transmissibility, double *phase_rad)
{
	double damper = 2.0 * damping_ratio * r, below = hypot((1.0 - r) * (1.0 + r), damper);

	if (!(r > 0.0) || !isfinite(r) || !(damping_ratio >= 0.0) || !isfinite(damping_ratio))
		return DT_E_ARGUMENT;
	if (!(below > 0.0))
		return DT_E_NUMERIC;
	*transmissibility = hypot(1.0, damper) / below;
	*phase_rad = atan2(damper, (1.0 - r) * (1.0 + r)) - atan(damper);
	return 0;
}
