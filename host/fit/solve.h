/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_FIT_SOLVE_H
#define DT_HOST_FIT_SOLVE_H
/* One minimum of the sum of squares, from one start. Used within host/fit. */
#include "host/fit/fit.h"

/* The samples of one drop that are used, around its touch. */
struct solve_sample {
	uint8_t axis;
	double t_s; /* after the touch as it was guessed */
	double value_g, envelope_g;
};

struct solve_drop {
	struct solve_sample *sample;
	size_t count;
	double touch_s;                /* as guessed, in the record's time */
	double noise_g[MOTION_AXES];   /* white */
	double colour[MOTION_AXES];    /* variance of a mean over that of white noise, 1 or more */
	double quarter_s[MOTION_AXES]; /* when a quarter of its peak is reached, after the record's begin */
	double own[FIT_OWN];
	double centre[FIT_OWN], prior_sd[FIT_OWN];                          /* of priors; 0: free */
	double c[FIT_OWN][FIT_OWN], b[FIT_COMMON][FIT_OWN], right[FIT_OWN]; /* normal equations */
	double covariance[FIT_OWN][FIT_OWN], cross[FIT_COMMON][FIT_OWN];
};

struct solve {
	const struct scene *scene;
	struct solve_drop *drop;
	unsigned drops;
	bool held;                                                           /* the common ones are known */
	size_t nodes;                                                        /* of the histories */
	double common[FIT_COMMON], centre[FIT_COMMON], prior_sd[FIT_COMMON]; /* prior_sd 0: held */
	double known[FIT_COMMON][FIT_COMMON]; /* information of the priors; 1 of one that is held */
	double share;                         /* of the envelope in the weights */
	double a[FIT_COMMON][FIT_COMMON], right[FIT_COMMON];
	double covariance[FIT_COMMON][FIT_COMMON];
	double squares;        /* with priors */
	size_t used;           /* samples in it */
	struct motion *motion; /* [1 + MOTION_PARAMETERS], and, if `derives`, what is derived of each */
	bool derives;
	bool tried; /* motion[0] is the history where the unknowns are now, of the only drop */
	double derived[2 + MOTION_PARAMETERS][MOTION_DERIVED]; /* the last: of the latest without slopes */
};

/* Minimises from what common and own are, which it leaves at the minimum. False: nowhere to go. */
bool solve_run(struct solve *s, unsigned iterations, double enough);

/* The sum alone, where common and own are. INFINITY: no history. */
double solve_squares(struct solve *s);

/* Covariances, for noise as the weights have it. False: the data leave something open. */
bool solve_covariance(struct solve *s);

/* The same where the last iteration began, which costs no histories. */
bool solve_covariance_there(struct solve *s);

/* The history of a drop into motion[0], and, with slopes, those with one parameter a step further, where it
 * moves. */
bool solve_histories(struct solve *s, const struct solve_drop *d, bool slopes);
bool solve_moves(const struct solve *s, size_t parameter);

/* How far the common ones are from their priors. */
double solve_known(const struct solve *s);

/* Adds the information on the common ones of one drop, its own eliminated. */
bool solve_information(struct solve *s, struct solve_drop *d, double information[FIT_COMMON][FIT_COMMON]);

/* Normalised residuals of a drop, in the order of its samples, by the white noise alone; NAN: not used. */
bool solve_residuals(struct solve *s, struct solve_drop *d, double *residual);

/* The parameters of a drop's history. */
void solve_parameters(const struct solve *s, const struct solve_drop *d, double p[MOTION_PARAMETERS]);

/* In place: a = L L^T of the first n; false unless positive definite. */
bool solve_factor(size_t n, size_t stride, double *a);
void solve_back(size_t n, size_t stride, const double *factor, double *x);
void solve_invert(size_t n, const double *factor, double *inverse);
double solve_step_of(size_t parameter);

#endif
