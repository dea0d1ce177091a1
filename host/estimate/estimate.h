/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_ESTIMATE_H
#define DT_HOST_ESTIMATE_ESTIMATE_H
/*
 * What the analyzer says of a record. Every quantity is a value with its standard uncertainty, the method
 * that gave it and a status; a value whose status is not ok may be NAN and must not be shown without it.
 * Accelerations in g, times in s after the record's first instant, frequencies in Hz.
 */
#include <stdbool.h>

#include "host/record/record.h"

enum estimate_status {
	ESTIMATE_OK,
	ESTIMATE_CLIPPED,       /* the true value lies beyond what the sensor shows */
	ESTIMATE_SHORT,         /* the record does not hold enough samples */
	ESTIMATE_NO_PEAK,       /* nothing stands out of the noise */
	ESTIMATE_AMBIGUOUS,     /* more than one answer fits; the value is the likeliest */
	ESTIMATE_NOT_CONVERGED, /* the fit failed */
};

/* "ok" "clipped" "short" "no_peak" "ambiguous" "not_converged" */
const char *estimate_status_name(enum estimate_status status);

struct estimate_baseline {
	double offset_g; /* mean before the pulse; 0 when the record starts inside it (samples 0) */
	double noise_g;  /* standard deviation per sample as read, from the median absolute deviation */
	size_t samples;  /* used for the offset */
};

struct estimate_peak {
	double value_g; /* signed; the extreme of largest magnitude (of a drop: within 100 ms of its trigger)
	                 */
	double sigma_g;
	double time_s;
	double sigma_time_s;
	const char *method; /* "poly4/poly6", "parabola", "sample" */
	enum estimate_status status;
};

struct estimate_pulse {
	double duration_s; /* width at 10 % of the peak */
	double sigma_duration_s;
	double velocity_change_m_s; /* integral over the pulse, signed */
	double sigma_velocity_m_s;
	double start_s, end_s; /* where the pulse leaves and meets 10 % */
	enum estimate_status status;
};

struct estimate_ringdown {
	double frequency_hz; /* damped */
	double sigma_hz;
	double natural_frequency_hz; /* undamped */
	double damping_ratio;
	double sigma_damping;
	double three_cycle_frequency_hz; /* mean over the first three oscillations, as the study has it */
	const char *method;
	enum estimate_status status;
};

struct estimate_channel {
	struct estimate_baseline baseline;
	struct estimate_peak peak;
	struct estimate_pulse pulse;
	struct estimate_ringdown ringdown;
	unsigned flags; /* RECORD_FLAG_* of the channel as analysed */
};

struct estimate_resultant {
	char sensor[8]; /* "S1" */
	double peak_g;  /* maximum of hypot(X(t), Y(t)) on one continuous time */
	double sigma_g;
	double time_s;
	bool axes_coincide;  /* X and Y have their own maxima within the coincidence limit of each other */
	double axes_apart_s; /* Y's time minus X's */
	enum estimate_status status;
};

/* The time from S2's peak to S1's, positive when S1 is later. A lag without its definition says little:
 * three of them, and their spread. */
struct estimate_lag {
	double first_peak_s;
	double largest_peak_s;
	double cross_correlation_s;
	double spread_s; /* largest minus smallest of the three */
	double sigma_s;  /* statistical, of largest_peak_s */
	enum estimate_status status;
};

enum { ESTIMATE_SENSORS_MAX = 2 };

struct analysis {
	struct estimate_channel *channels; /* [record->channel_count], same order */
	size_t channel_count;
	struct estimate_resultant resultants[ESTIMATE_SENSORS_MAX];
	size_t resultant_count; /* sensors that have both X and Y */
	bool has_lag;           /* S1 and S2 are both there */
	struct estimate_lag lag;
	bool has_plate;                 /* S1 rings on its own: it and S2 differ */
	struct estimate_ringdown plate; /* X and Y of S1 combined by their weights */
};

struct estimate_options {
	double lowpass_hz; /* zero-phase low-pass with this corner before everything else; 0 = raw */
};

/* Analyses a record; the record is only read. 0; DT_E_EMPTY if no channel has a single good sample;
 * DT_E_ARGUMENT for a low-pass that is negative or not finite; DT_E_MEMORY. Uncertain results are not errors:
 * they carry a status. On success free with estimate_free. */
DT_MUST_USE int estimate_record(const struct record *record, const struct estimate_options *options,
                                struct analysis *analysis);
void estimate_free(struct analysis *analysis);

#endif
