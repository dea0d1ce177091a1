/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_ESTIMATE_H
#define DT_HOST_ESTIMATE_ESTIMATE_H
/*
 * What the analyzer says of a record. Every quantity is a value with its standard uncertainty, the method
 * that gave it and a status; a value whose status is not ok may be NAN and must not be shown without it.
 * Where the record has no quiet part the noise is not known, and an uncertainty that hangs on it is NAN.
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

/* What is remarkable about one value. Bits; names by estimate_flag_name. */
enum {
	ESTIMATE_FLAG_EXTRAPOLATED =
	        1u << 0,               /* "extrapolated": clipped, the true value follows from the family */
	ESTIMATE_FLAG_GAPS = 1u << 1,  /* "gaps": samples it would have used are missing */
	ESTIMATE_FLAG_SPIKE = 1u << 2, /* "spike": outliers were left out */
	ESTIMATE_FLAG_HUM = 1u << 3,   /* "hum": mains terms were fitted along */
	ESTIMATE_FLAG_TWO_MODES = 1u << 4, /* "two_modes": the value is the stronger mode's */
	ESTIMATE_FLAG_AMPLITUDE =
	        1u
	        << 5, /* "amplitude_dependent": frequency follows the swing; value the mean of three cycles */
	ESTIMATE_FLAG_TOLERANCE = 1u << 6, /* "tolerance_not_met" */
	ESTIMATE_FLAG_MODEL = 1u << 7,     /* "model_refused": the residual is no noise; sigma is widened, or
	                                      another value stands */
	ESTIMATE_FLAG_WEAK = 1u << 8,      /* "weak_axis": by the strong axis' shape */
	ESTIMATE_FLAG_NOT_SEPARABLE = 1u << 9, /* "not_separable": two modes nearer than their width */
	ESTIMATE_FLAG_ZERO = 1u << 10,         /* "zero_unsure": the baseline is doubtful */
	ESTIMATE_FLAG_RIVAL = 1u << 11, /* "rival": another extreme is as high, as far as noise lets tell */
	ESTIMATE_FLAG_STEP = 1u << 12,  /* "step": within one sample, as no sensor makes */
	ESTIMATE_FLAG_TAIL = 1u << 13,  /* "tail": more than noise follows the pulse; sigma is widened */
	ESTIMATE_FLAG_AXES = 1u << 14,  /* "axes_disagree": S1 and S2, or X and Y, do not see one shock */
	ESTIMATE_FLAG_FLAT = 1u << 15,  /* "flat_top": as a cut one; how high it went is not known then */
	ESTIMATE_FLAG_ROUGH = 1u << 16, /* "rough": rings on faster than a plate: a loose sensor */
	ESTIMATE_FLAG_FIRST = 1u << 17, /* "larger_follows": of the first contact; a later one is larger */
};

/* Name of the lowest flag bit in flags; "" for 0. */
const char *estimate_flag_name(unsigned flags);

enum { ESTIMATE_PATH_MAX = 6 };

/* How a value was got: cheapest method first, the next one only while the residual refuses it or its
 * uncertainty exceeds the tolerance. */
struct estimate_how {
	const char *method;                  /* the one that gave the value; "" when none did */
	const char *path[ESTIMATE_PATH_MAX]; /* tried, in this order; NULL after the last */
	double chi_square; /* reduced, of method against the noise; NAN without a residual test */
	unsigned flags;    /* ESTIMATE_FLAG_* */
	enum estimate_status status;
};

#define ESTIMATE_TOLERANCE 0.005

/* Whether a standard uncertainty is within a tolerance (0: ESTIMATE_TOLERANCE) of a value, or of the whole
 * that an instant is part of. One that is not known is not. */
bool estimate_meets(double sigma, double whole, double tolerance);

/* Pulse families. AUTO: family-free unless precision asks for more. */
enum estimate_family {
	ESTIMATE_FAMILY_AUTO,
	ESTIMATE_FAMILY_HALF_SINE,  /* "half-sine": A sin(pi s), s in 0..1 */
	ESTIMATE_FAMILY_HAVERSINE,  /* "haversine": A sin^2(pi s) */
	ESTIMATE_FAMILY_SINE_POWER, /* "sine-power": A sin^p(pi s), p fitted */
	ESTIMATE_FAMILIES
};

/* "auto" "half-sine" "haversine" "sine-power"; parse: DT_E_UNKNOWN for another name. */
const char *estimate_family_name(enum estimate_family family);
DT_MUST_USE int estimate_family_parse(const char *name, enum estimate_family *family);

enum { ESTIMATE_TONES_MAX = 2 };

/* amplitude_g cos(2 pi hz u + phase) */
struct estimate_tone {
	double amplitude_g, hz, phase;
};

/* offset_g + drift_g_s u + hum_g cos(2 pi hum_hz u + hum_phase) + tones, u from the middle of
 * from_s..until_s, is what the quiet part before the pulse says of zero; all of it is taken off. */
struct estimate_baseline {
	double offset_g;    /* 0 when the record starts inside its pulse (samples 0) */
	double noise_g;     /* standard deviation per sample as read, without what the median deviation calls
	                       an outlier; drift and hum taken off */
	double deviation_g; /* plain standard deviation: larger with spikes, drift or hum */
	double drift_g_s;   /* slope, 0 unless significant */
	double hum_g;       /* amplitude of the strongest hum, 0 unless significant */
	double hum_hz;      /* 50 or 60 where that explains it, else fitted; NAN when there is none */
	double hum_phase;
	unsigned tones; /* weaker ones: harmonics */
	struct estimate_tone tone[ESTIMATE_TONES_MAX];
	double from_s, until_s; /* the quiet part; NAN when there is none */
	size_t samples;         /* of it that were used */
	bool doubtful;          /* there is none, or it holds more than noise, hum and a slope */
	bool unsettled;         /* it decays to its end, by no exponential, or the record begins in motion */
};

struct estimate_peak {
	double value_g; /* signed; the extreme of largest magnitude (of a drop: within 100 ms of its trigger)
	                 */
	double sigma_g;
	double time_s;
	double sigma_time_s;
	struct estimate_how how; /* "poly4/poly6" "sine-power" "half-sine" "haversine" "strong-axis"
	                            "parabola" "sample"; of S1 "driven-oscillator" (driven.h) */
};

struct estimate_pulse {
	double duration_s; /* width at 10 % of the peak: family-free */
	double sigma_duration_s;
	double velocity_change_m_s; /* integral over the pulse, signed */
	double sigma_velocity_m_s;
	double start_s, end_s; /* where the pulse leaves and meets 10 % */
	unsigned flags;        /* ESTIMATE_FLAG_* of the above */
	enum estimate_status status;
	/* the fitted pulse of a named family: foot to foot, and its area; NAN unless one fits */
	enum estimate_family family;
	double contact_time_s;
	double sigma_contact_s;
	double contact_start_s;
	double fitted_velocity_m_s;
	double sigma_fitted_velocity_m_s;
	struct estimate_how contact;
};

struct estimate_ringdown {
	double frequency_hz; /* damped */
	double sigma_hz;
	double natural_frequency_hz; /* undamped */
	double sigma_natural_hz;
	double damping_ratio;
	double sigma_damping;
	double small_swing_hz;      /* damped, as the swing vanishes: "amplitude" only, else NAN */
	double amplitude_g;         /* envelope at the start of the free decay */
	double second_frequency_hz; /* of a second mode; NAN when there is none */
	double second_damping_ratio;
	double three_cycle_frequency_hz; /* mean over the first three oscillations, as the study has it */
	struct estimate_how how;         /* "block" "full" "full+hum" "amplitude" "two-modes" */
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
	double sigma_time_s;
	bool axes_coincide;  /* X and Y have their own maxima within the coincidence limit of each other */
	double axes_apart_s; /* Y's time minus X's */
	struct estimate_how how;
};

/* The time from S2's peak to S1's, positive when S1 is later. A lag without its definition says little:
 * all of them, and the spread of the first three. */
struct estimate_lag {
	double first_peak_s;
	double largest_peak_s;
	double cross_correlation_s;
	double spread_s; /* largest minus smallest of the three */
	double sigma_s;  /* statistical, of largest_peak_s */
	double driven_s; /* S1 as a damped oscillator on S2: X and Y combined */
	double sigma_driven_s;
	double driven_axis_s[2]; /* X, Y; NAN when that axis does not follow the oscillator */
	double sigma_driven_axis_s[2];
	struct estimate_how driven; /* "driven-oscillator" */
	enum estimate_status status;
};

/* Rebound speed over impact speed. */
struct estimate_rebound {
	double velocity_ratio; /* from the resultant velocity change of the case */
	double sigma_velocity_ratio;
	double flight_ratio; /* from the time of flight to the second impact */
	double sigma_flight_ratio;
	double second_impact_s; /* NAN when the record ends before it */
	enum estimate_status status;
};

/* The true motion of box and plate: the body of a scene that was fitted to earlier drops (host/fit), laid
 * over this one. All NAN unless ok. */
struct estimate_motion {
	double contact_time_s, sigma_contact_time_s;
	double restitution, sigma_restitution; /* of the centre of gravity */
	double spin_rad_s, sigma_spin_rad_s;   /* at the release; positive turns X away from the vertical */
	double lag_s, sigma_lag_s;             /* S1's largest resultant after S2's */
	double lag_x_s, sigma_lag_x_s;         /* the same of X */
	double angle_deg, sigma_angle_deg;     /* at the touch */
	double speed_m_s, sigma_speed_m_s;     /* of impact */
	double chi_square;                     /* reduced, of the residual against the noise */
	const char *refused;                   /* why not; "": it is ok */
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
	bool has_rebound;               /* the impact speed was given, and S2 has a velocity change */
	struct estimate_rebound rebound;
	bool has_motion; /* a fitted scene was given, and the tower's sensors are there */
	struct estimate_motion motion;
};

struct estimate_options {
	double lowpass_hz; /* zero-phase low-pass with this corner before everything else; 0 = raw */
	unsigned cfc;      /* channel frequency class (cfc.h) before everything else; 0 = none */
	double iepe_time_constant_s; /* the sensor supply's high-pass is undone; 0 = left as it is */
	enum estimate_family family; /* of the contact pulse, when it is known */
	double tolerance; /* standard uncertainty asked for: part of the value, for instants part of the
	                     pulse's width; 0 = ESTIMATE_TOLERANCE */
	double impact_speed_m_s; /* for the rebound; 0 = not known */
	double gravity_m_s2;     /* that it fell with; 0 = standard gravity */
};

/* Analyses a record; the record is only read. 0; DT_E_EMPTY if no channel has a single good sample;
 * DT_E_ARGUMENT for an option that is negative or not finite; DT_E_UNKNOWN or DT_E_RANGE for a class that
 * does not exist or that a channel is sampled too slowly for; DT_E_MEMORY. Uncertain results are not errors:
 * they carry a status. On success free with estimate_free. */
DT_MUST_USE int estimate_record(const struct record *record, const struct estimate_options *options,
                                struct analysis *analysis);
void estimate_free(struct analysis *analysis);

#endif
