/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/model/auto.h"

#include <math.h>
#include <stdio.h>

#include "common/units.h"
#include "host/model/rung.h"

/* Numbers of a scene that its rungs differ by. */
enum number {
	ONE,
	LEVER, /* how much lighter the corner feels because the box turns: log of mass over effective mass */
	OBLIQUE,  /* log of the contact force over its normal part */
	STIFFER,  /* log of the contact's stiffness over the one that the contact time gives */
	REBOUND,  /* restitution */
	REBOUND2, /* its square */
	PLATE,    /* plate over box */
	CYCLES,   /* log of the plate's undamped cycles in the contact time */
	CYCLES2,
	CYCLES_REBOUND,
	CYCLES_LEVER,
	MOUNT, /* log of the mounts' stiffness at their strain over the static one */
	CYCLES_MOUNT,
	DAMPERS, /* damping ratio of the identified dampers less the given one */
	DAMPING,
	NUMBERS
};

/* Of these, by their size, and of the angle of the contact force, the doubt is made. */
enum doubt { D_ONE, D_LEVER, D_OBLIQUE, D_SLANT, D_PLATE, D_MOUNT, D_DAMPERS, D_CYCLES, D_STIFFER, DOUBTS };

enum answer {
	SDOF_PLATE,
	COUPLED_PLATE_R,
	COUPLED_X,
	COUPLED_Y,
	COUPLED_BOX_R,
	COUPLED_S2X,
	COUPLED_S2Y,
	DIRECTION_S1,
	DIRECTION_S2,
	ANSWERS
};

/* Log of planar over the rung, beyond what the closed forms tell (directions: difference, rad), and how far
 * it may be off. */
static const struct {
	double change[NUMBERS], doubt[DOUBTS];
} fitted[ANSWERS] = {
        [SDOF_PLATE] = {{0.467, -0.537, 1.07, 0.088, -0.587, 0.16, -0.446, 0.355, 0.0563, -0.237, 0.136,
                         0.0399, -0.274, -0.102, 0.0815},
                        {0.0463, 0.318, 0.208, 0.0683, 0.0828, 0.0678, 0.34, 0.0134, 0.112}},
        [COUPLED_PLATE_R] = {{0.00875, -0.63, 1.58, 0, -0.0168, 0, -0.000896, 0.00398, 0, 0, 0.0379, 0,
                              -0.204, -0.156, 0.0344},
                             {0.0115, 0.616, 0, 0, 0.00493, 0.141, 0.416, 0.00644, 0.000914}},
        [COUPLED_X] = {{-0.00211, -0.462, 1.53, 0, -0.00262, 0, 0.00963, 0.00171, 0, 0, 0.0645, 0, -0.163,
                        -0.107, 0.0213},
                       {0.0334, 0.827, 0, 0, 0.00277, 0.14, 0.431, 0.00344, 0.00271}},
        [COUPLED_Y] = {{0.0115, -0.568, 0.919, 0, -0.0119, 0, -0.00368, 0.00374, 0, 0, 0.0109, 0, -0.152,
                        -0.112, 0.023},
                       {0.0552, 1.11, 0, 0.0774, 0.00762, 0.171, 0.3, 0, 0.0309}},
        [COUPLED_BOX_R] = {{-0.0188, -0.741, 2.11, 0, 0.027, 0, -0.00431, 0, 0, 0, 0, 0, 0, 0, 0},
                           {0.00795, 0.556, 0, 0, 0.0199, 0.0158, 0.0402, 0, 0}},
        [COUPLED_S2X] = {{-0.0206, -0.543, 1.79, 0, 0.0291, 0, -0.00364, 0, 0, 0, 0, 0, 0, 0, 0},
                         {0.031, 0.771, 0, 0.0529, 0.0206, 0.0155, 0.00902, 0, 0.0195}},
        [COUPLED_S2Y] = {{0.00666, -0.472, 1.3, 0, -0.0088, 0, -0.0045, 0, 0, 0, 0, 0, 0, 0, 0},
                         {0.0586, 1.47, 0, 0.329, 0.0411, 0.0694, 0.0155, 0.000836, 0.032}},
        [DIRECTION_S1] = {{0.00041, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0},
                          {0.0465, 0.115, 0, 0.319, 0.0118, 0.0256, 0.0226, 0, 0.00426}},
        [DIRECTION_S2] = {{0.00239, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0},
                          {0.06, 0, 0, 0.583, 0.0565, 0, 0.0729, 0, 0}},
};

/* The sample's limits. */
#define LEVER_MAX 0.5
#define ANGLE_MIN_DEG 10.0
#define ANGLE_MAX_DEG 80.0
#define REBOUND_MIN 0.2
#define REBOUND_MAX 0.95
#define PLATE_MAX 0.5
#define CYCLES_MIN 0.15
#define CYCLES_MAX 2.0
#define DAMPING_MAX 0.5
#define SOFTENING_MAX 1.0
#define STIFFER_MAX 1.0 /* log */

/* sdof is held against coupled where its predicted difference takes more than this share of the tolerance. */
#define CHECK_SHARE 0.5

/* Numerical tolerance over the one asked for, and the loosest. */
#define NUMERICAL_SHARE 0.2
#define NUMERICAL_MAX 0.01
#define NUMERICAL_MAX_INSTANT 0.002 /* for what hangs on the instant of a peak: lag, direction */

/* Components along an axis below this share of the whole are not told as ratios. */
#define SMALL_SHARE 0.02

struct numbers {
	double value[NUMBERS];
	double slant;            /* of the contact force from the vertical, rad */
	double x, y;             /* logs of what the slant does to S1's and */
	double s2x, s2y;         /* with the turning, to S2's shares */
	double s1_rad, s2_rad;   /* directions without it, */
	double s1_more, s2_more; /* what it adds */
};

/* What a corner that a mat of this grip and friction holds feels: the force across over the one along the
 * fall, and the effective mass. */
static double slope_of(const struct drop *d, double across, double up, double per_inertia)
{
	const struct scene *s = d->scene;
	double held = 1.0 + up * up * per_inertia, grip = s->contact_tangential_ratio * held;
	double slope = up * across * per_inertia / held * grip / (1.0 + grip);

	return fmax(-s->contact_friction, fmin(s->contact_friction, slope));
}

static double floored(double value)
{
	return fmax(fabs(value), SMALL_SHARE);
}

static void fill_contact(const struct drop *d, struct numbers *n)
{
	const struct scene *s = d->scene;
	double across = d->lever_y_m * d->cosine - d->lever_x_m * d->sine;
	double up = -(d->lever_x_m * d->cosine + d->lever_y_m * d->sine);
	double per_inertia = s->product_case_mass_kg / d->inertia_kg_m2;
	double slope = slope_of(d, across, up, per_inertia);
	double x = d->cosine + slope * d->sine, y = d->sine - slope * d->cosine;
	double s2y = y - (up * slope - across) * per_inertia * s->sensor_s2_offset_m,
	       s2y_plain = d->sine - d->turning;

	n->value[LEVER] = log1p(per_inertia * across * (across - up * slope));
	n->value[OBLIQUE] = 0.5 * log1p(slope * slope);
	n->slant = atan(slope);
	n->s1_rad = d->angle + UNITS_RAD(s->sensor_s1_yaw_deg);
	n->s1_more = -n->slant;
	n->s2_rad = atan2(s2y_plain, d->cosine);
	n->s2_more = atan2(s2y, x) - n->s2_rad;
	n->x = log(floored(cos(n->s1_rad - n->slant)) / floored(cos(n->s1_rad)));
	n->y = log(floored(sin(n->s1_rad - n->slant)) / floored(sin(n->s1_rad)));
	n->s2x = log(floored(x) / d->cosine);
	n->s2y = log(floored(s2y) / floored(s2y_plain));
}

/* Log of the given stiffness, wedge included, over that which the contact time gives; the contact's
 * dimensionless duration within a few percent. */
static double stiffer(const struct drop *d)
{
	const struct scene *s = d->scene;
	double mass = s->contact_mass_kg > 0.0 ? s->contact_mass_kg : s->product_case_mass_kg;
	double duration = 3.218 + 0.386 * (1.0 / s->contact_restitution - 1.0);
	double by_time = mass * pow(duration / s->contact_duration_s, 2.5) / sqrt(d->speed_m_s);

	return log(s->contact_stiffness_n_m15 / by_time * sin(2.0 * UNITS_RAD(25.0)) /
	           (2.0 * d->sine * d->cosine));
}

static void auto_fill_plate(const struct drop *d, struct numbers *n)
{
	const struct scene *s = d->scene;
	double cycles = d->plate_omega * s->contact_duration_s / (2.0 * UNITS_PI),
	       rebound = s->contact_restitution;
	double jump = d->speed_m_s * (1.0 + rebound), swing, strain, own;

	/* the swing is that of a blow or of a push, whichever is less */
	swing = fmin(jump / d->plate_omega * exp(-d->plate_zeta),
	             1.6 * jump * UNITS_PI / (2.0 * s->contact_duration_s * d->plate_omega * d->plate_omega));
	strain = swing / (s->mount_softening_strain * s->mount_cube_m);
	own = s->mount_damping_n_s_m / (2.0 * sqrt(s->mount_stiffness_n_m * s->mount_plate_mass_kg));
	n->value[PLATE] = s->mount_plate_mass_kg / s->product_case_mass_kg;
	n->value[CYCLES] = log(cycles);
	n->value[CYCLES2] = n->value[CYCLES] * n->value[CYCLES];
	n->value[CYCLES_REBOUND] = n->value[CYCLES] * rebound;
	n->value[CYCLES_LEVER] = n->value[CYCLES] * n->value[LEVER];
	n->value[MOUNT] =
	        s->mount_softening > 0.0 ? log1p(s->mount_softening / (1.0 + strain * strain)) : 0.0;
	n->value[CYCLES_MOUNT] = n->value[CYCLES] * n->value[MOUNT];
	n->value[DAMPERS] = s->mount_damping_n_s_m > 0.0 ? own - d->plate_zeta : 0.0;
	n->value[DAMPING] = d->plate_zeta;
}

static bool auto_between(double value, double low, double high)
{
	return value >= low && value <= high;
}

/* False outside the sample's limits. */
static bool numbers_of(const struct drop *d, struct numbers *n)
{
	const struct scene *s = d->scene;

	*n = (struct numbers){.value = {[ONE] = 1.0,
	                                [REBOUND] = s->contact_restitution,
	                                [REBOUND2] = s->contact_restitution * s->contact_restitution}};
	if (!auto_between(s->drop_angle_deg, ANGLE_MIN_DEG, ANGLE_MAX_DEG) ||
	    !auto_between(s->contact_restitution, REBOUND_MIN, REBOUND_MAX) ||
	    !(s->contact_stiffness_n_m15 > 0.0))
		return false;
	fill_contact(d, n);
	n->value[STIFFER] = stiffer(d);
	if (!auto_between(n->value[LEVER], 0.0, LEVER_MAX) ||
	    !auto_between(n->value[STIFFER], -STIFFER_MAX, STIFFER_MAX))
		return false;
	if (!d->has_plate)
		return true;
	auto_fill_plate(d, n);
	return auto_between(n->value[PLATE], 0.0, PLATE_MAX) &&
	       auto_between(n->value[CYCLES], log(CYCLES_MIN), log(CYCLES_MAX)) &&
	       auto_between(d->plate_zeta, 0.0, DAMPING_MAX) && s->mount_softening <= SOFTENING_MAX;
}

static double doubt_of(const struct numbers *n, enum answer answer)
{
	const double size[DOUBTS] = {
	        [D_ONE] = 1.0,
	        [D_LEVER] = n->value[LEVER],
	        [D_OBLIQUE] = n->value[OBLIQUE],
	        [D_SLANT] = fabs(n->slant),
	        [D_PLATE] = n->value[PLATE],
	        [D_MOUNT] = n->value[MOUNT],
	        [D_DAMPERS] = fabs(n->value[DAMPERS]),
	        [D_CYCLES] = fabs(n->value[CYCLES]),
	        [D_STIFFER] = fabs(n->value[STIFFER]),
	};
	double sum = 0.0;

	for (int i = 0; i < DOUBTS; i++)
		sum += fitted[answer].doubt[i] * size[i];
	return sum;
}

static double change_of(const struct numbers *n, enum answer answer, double closed_form)
{
	for (int i = 0; i < NUMBERS; i++)
		closed_form += fitted[answer].change[i] * n->value[i];
	return closed_form;
}

/* As a share of planar's answer. */
static double value_off(const struct numbers *n, enum answer answer, double closed_form)
{
	return expm1(fabs(change_of(n, answer, closed_form))) + doubt_of(n, answer);
}

static double direction_off(const struct numbers *n, enum answer answer, double direction, double more)
{
	double off = fabs(change_of(n, answer, more)) + doubt_of(n, answer);

	return off / fmax(fabs(direction) - off, SMALL_SHARE);
}

static double sdof_off(const struct drop *drop, const struct numbers *n, unsigned asked)
{
	double worst = 0.0;

	if ((asked & (MODEL_ASK_BOX | MODEL_ASK_S2)) ||
	    (!drop->has_plate && (asked & (MODEL_ASK_PLATE | MODEL_ASK_AXES))))
		return INFINITY; /* a half-sine */
	if (asked & MODEL_ASK_PLATE)
		worst = value_off(n, SDOF_PLATE, 0.0);
	if (asked & MODEL_ASK_AXES)
		worst = fmax(value_off(n, SDOF_PLATE, n->x), value_off(n, SDOF_PLATE, n->y)) +
		        doubt_of(n, COUPLED_Y);
	return worst;
}

static double coupled_off(const struct drop *drop, const struct numbers *n, unsigned asked)
{
	double worst = 0.0;

	if (asked & MODEL_ASK_PLATE)
		worst = value_off(n, drop->has_plate ? COUPLED_PLATE_R : COUPLED_BOX_R, 0.0);
	if (asked & MODEL_ASK_AXES)
		worst = fmax(worst, fmax(value_off(n, COUPLED_X, n->x), value_off(n, COUPLED_Y, n->y)));
	if (asked & MODEL_ASK_BOX)
		worst = fmax(worst, value_off(n, COUPLED_BOX_R, 0.0));
	if (asked & MODEL_ASK_S2)
		worst = fmax(worst,
		             fmax(value_off(n, COUPLED_S2X, n->s2x), value_off(n, COUPLED_S2Y, n->s2y)));
	return worst;
}

double auto_difference(const struct drop *drop, enum model_fidelity rung, unsigned asked)
{
	struct numbers n;
	double worst;

	if (!asked || (asked & MODEL_ASK_LAG) || !numbers_of(drop, &n))
		return INFINITY;
	worst = rung == MODEL_SDOF ? sdof_off(drop, &n, asked) : coupled_off(drop, &n, asked);
	if (asked & MODEL_ASK_DIRECTION) {
		worst = fmax(worst, direction_off(&n, DIRECTION_S1, n.s1_rad, n.s1_more));
		worst = fmax(worst, direction_off(&n, DIRECTION_S2, n.s2_rad, n.s2_more));
	}
	return worst;
}

double auto_apart(const struct model_prediction *p, const struct model_prediction *to, unsigned asked)
{
	const struct {
		unsigned asked;
		double value, to;
	} all[] = {
	        {MODEL_ASK_PLATE, p->resultant[0].value_g, to->resultant[0].value_g},
	        {MODEL_ASK_AXES, p->peak[MODEL_S1X].value_g, to->peak[MODEL_S1X].value_g},
	        {MODEL_ASK_AXES, p->peak[MODEL_S1Y].value_g, to->peak[MODEL_S1Y].value_g},
	        {MODEL_ASK_BOX, p->box.value_g, to->box.value_g},
	        {MODEL_ASK_LAG, p->lag_s, to->lag_s},
	        {MODEL_ASK_S2, p->peak[MODEL_S2X].value_g, to->peak[MODEL_S2X].value_g},
	        {MODEL_ASK_S2, p->peak[MODEL_S2Y].value_g, to->peak[MODEL_S2Y].value_g},
	        {MODEL_ASK_S2, p->resultant[1].value_g, to->resultant[1].value_g},
	        {MODEL_ASK_DIRECTION, p->direction_deg[0], to->direction_deg[0]},
	        {MODEL_ASK_DIRECTION, p->direction_deg[1], to->direction_deg[1]},
	};
	double worst = 0.0;

	for (size_t i = 0; i < sizeof(all) / sizeof(all[0]); i++) {
		double apart = fabs(all[i].value - all[i].to) / fabs(all[i].to);

		if ((all[i].asked & asked) && !(apart <= worst)) /* a NaN stays */
			worst = apart;
	}
	return worst;
}

/* ---- the choice ---- */

/* What each rung is asked with: no more digits than are wanted. */
static struct model_options options_of(const struct model_options *options, enum model_fidelity rung)
{
	double most = options->asked & (MODEL_ASK_LAG | MODEL_ASK_DIRECTION) ? NUMERICAL_MAX_INSTANT
	                                                                     : NUMERICAL_MAX;
	struct model_options o = *options;

	if (rung == MODEL_COUPLED)
		o.refinements = MODEL_STIFFNESS | MODEL_WEDGE;
	if (o.asked) {
		o.ring = false;
		o.tolerance = fmax(fmin(NUMERICAL_SHARE * o.accuracy, most), MODEL_TOLERANCE_MIN);
	}
	return o;
}

static int model_auto_solve(const struct drop *drop, enum model_fidelity rung,
                            const struct model_options *options, const char *why, struct model_prediction *p,
                            char *message)
{
	struct model_options o = options_of(options, rung);

	return rung_solve(drop, rung, &o, why, p, message);
}

/* What no rung above can mend: the answer must not depend on it. */
static bool ends(int error)
{
	return error == DT_E_MEMORY;
}

/* sdof when its predicted difference is small enough and coupled does not contradict it: 1, 0, DT_E_MEMORY.
 */
static int sdof_serves(const struct drop *drop, const struct model_options *options, const char *why,
                       struct model_prediction *p)
{
	double off = auto_difference(drop, MODEL_SDOF, options->asked), apart;
	struct model_prediction above;
	int error;

	if (!(off <= options->accuracy))
		return 0;
	error = model_auto_solve(drop, MODEL_SDOF, options, why, p, NULL);
	if (error)
		return ends(error) ? error : 0;
	p->difference = p->next_change = off;
	p->next = MODEL_COUPLED;
	if (off <= CHECK_SHARE * options->accuracy)
		return 1;
	error = model_auto_solve(drop, MODEL_COUPLED, options, why, &above, NULL);
	if (error)
		return ends(error) ? error : 0;
	apart = auto_apart(p, &above, options->asked);
	p->evaluations += above.evaluations;
	p->next_change = apart;
	return apart <= options->accuracy;
}

static int coupled_serves(const struct drop *drop, const struct model_options *options, const char *why,
                          struct model_prediction *p)
{
	double off = auto_difference(drop, MODEL_COUPLED, options->asked);
	int error;

	if (!(off <= options->accuracy))
		return 0;
	error = model_auto_solve(drop, MODEL_COUPLED, options, why, p, NULL);
	if (error)
		return ends(error) ? error : 0;
	p->difference = p->next_change = off;
	p->next = MODEL_PLANAR;
	return 1;
}

/* planar; sdof, which says what it can, where planar has no answer. */
static int planar_or_sdof(const struct drop *drop, const struct model_options *options, const char *why,
                          struct model_prediction *p, char *message)
{
	int error = model_auto_solve(drop, MODEL_PLANAR, options, why, p, message);

	if (ends(error))
		return error;
	if (error)
		return model_auto_solve(drop, MODEL_SDOF, options, "planar has no answer here", p, message);
	p->difference = 0.0;
	return 0;
}

int auto_solve(const struct drop *drop, const struct model_options *options,
               struct model_prediction *prediction, char message[MODEL_MESSAGE_MAX])
{
	struct model_options o = *options;
	struct model_prediction p;
	char why[64];
	int error = 0, serves;

	if (!(o.accuracy > 0.0))
		o.accuracy = MODEL_ACCURACY;
	if (!o.asked || !(o.refinements & MODEL_OF_RUNG))
		return planar_or_sdof(drop, &o, "answers every question asked", prediction, message);
	snprintf(why, sizeof(why), "the least that answers within %.4g %%", 100.0 * o.accuracy);
	serves = sdof_serves(drop, &o, why, &p);
	if (serves == 0)
		serves = coupled_serves(drop, &o, why, &p);
	if (serves == 0)
		error = planar_or_sdof(drop, &o, why, &p, message);
	if (serves < 0)
		error = drop_refuse(message, serves, "%s", error_text(serves));
	if (!error)
		*prediction = p;
	return error;
}
