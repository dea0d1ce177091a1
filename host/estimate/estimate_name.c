/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/estimate/estimate.h"

#include <string.h>

#include "common/error.h"

const char *estimate_status_name(enum estimate_status status)
{
	static const char *const names[] = {
	        [ESTIMATE_OK] = "ok",
	        [ESTIMATE_CLIPPED] = "clipped",
	        [ESTIMATE_SHORT] = "short",
	        [ESTIMATE_NO_PEAK] = "no_peak",
	        [ESTIMATE_AMBIGUOUS] = "ambiguous",
	        [ESTIMATE_NOT_CONVERGED] = "not_converged",
	};

	return (unsigned)status < sizeof(names) / sizeof(names[0]) ? names[status] : "unknown";
}

const char *estimate_flag_name(unsigned flags)
{
	static const char *const names[] = {"extrapolated",
	                                    "gaps",
	                                    "spike",
	                                    "hum",
	                                    "two_modes",
	                                    "amplitude_dependent",
	                                    "tolerance_not_met",
	                                    "model_refused",
	                                    "weak_axis",
	                                    "not_separable",
	                                    "zero_unsure",
	                                    "rival",
	                                    "step",
	                                    "tail",
	                                    "axes_disagree",
	                                    "flat_top",
	                                    "rough",
	                                    "larger_follows"};

	for (unsigned i = 0; i < sizeof(names) / sizeof(names[0]); i++)
		if (flags & 1u << i)
			return names[i];
	return "";
}

static const char *const family_names[ESTIMATE_FAMILIES] = {
        [ESTIMATE_FAMILY_AUTO] = "auto",
        [ESTIMATE_FAMILY_HALF_SINE] = "half-sine",
        [ESTIMATE_FAMILY_HAVERSINE] = "haversine",
        [ESTIMATE_FAMILY_SINE_POWER] = "sine-power",
};

const char *estimate_family_name(enum estimate_family family)
{
	return (unsigned)family < ESTIMATE_FAMILIES ? family_names[family] : "unknown";
}

int estimate_family_parse(const char *name, enum estimate_family *family)
{
	for (unsigned i = 0; i < ESTIMATE_FAMILIES; i++) {
		if (strcmp(name, family_names[i]) == 0) {
			*family = (enum estimate_family)i;
			return 0;
		}
	}
	return DT_E_UNKNOWN;
}
