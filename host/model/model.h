/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_MODEL_MODEL_H
#define DT_HOST_MODEL_MODEL_H
/*
 * What a drop should look like: models behind one call. Three rungs of rising fidelity, of which MODEL_AUTO
 * takes the least that serves:
 *
 *   sdof     half-sine contact, the plate's transient and free decay exact
 *   coupled  box and plate as two masses, skewed contact with restitution (Hunt and Crossley), gravity
 *   planar   rigid box in its plane that strikes with a corner and turns; refinements by name
 *
 * and the study's, for comparison, by name only:
 *
 *   paper    its equations as printed
 *   steady   equation (17) put right: the steady state of the plate under a half-sine of the box
 *
 * Time 0 is the first touch. Readings as an accelerometer gives them: 0 in free fall, positive along the body
 * axis away from the mat. X and Y of S1 and S2. What a rung cannot say is NAN.
 *
 * Pure functions, any thread; no memory kept. README.md has the evidence for each rung and refinement.
 */
#include <stdbool.h>
#include <stddef.h>

#include "common/error.h"
#include "common/scenes/scene.h"
#include "host/model/contact.h"

enum model_fidelity {
	MODEL_AUTO, /* the least for what is asked, see auto.h; planar when everything is */
	MODEL_PAPER,
	MODEL_STEADY,
	MODEL_SDOF,
	MODEL_COUPLED,
	MODEL_PLANAR,
	MODEL_FIDELITIES
};

/* "auto", "paper", ...; DT_E_UNKNOWN for another name. */
DT_MUST_USE int model_fidelity_parse(const char *name, enum model_fidelity *fidelity);
const char *model_fidelity_name(enum model_fidelity fidelity);

enum model_axis { MODEL_S1X, MODEL_S1Y, MODEL_S2X, MODEL_S2Y, MODEL_AXES };

/* What may be added to a frictionless corner of the stiffness that the contact time tells, on linear mounts.
 * Each takes its numbers from the scene; README.md has the evidence. `planar` knows all, `coupled` the first
 * two. */
enum model_refinement {
	MODEL_STIFFNESS = 1 << 0, /* stiffness_n_m15, instead of the one that gives duration_s */
	MODEL_WEDGE = 1 << 1,     /* stiffness times sin 50/sin 2 angle: the imprint of an edge */
	MODEL_GRIP = 1 << 2,      /* tangential_ratio and friction: the mat holds the corner sideways */
	MODEL_MOUNTS = 1 << 3,    /* softening and damping_n_s_m: stiffer at small strain, Kelvin damping that
	                           * turns with the box */
	MODEL_REFINEMENTS = MODEL_STIFFNESS | MODEL_WEDGE | MODEL_GRIP | MODEL_MOUNTS,
	MODEL_OF_RUNG = 1 << 4 /* planar: all; coupled: none, which explains the plate best */
};

/* "stiffness", "wedge", "grip", "mounts"; DT_E_UNKNOWN for another name. */
DT_MUST_USE int model_refinement_parse(const char *name, enum model_refinement *refinement);

/* What may be asked of a rung: who asks for less gets it for less. */
enum model_question {
	MODEL_ASK_PLATE = 1 << 0,     /* S1's resultant, its time */
	MODEL_ASK_AXES = 1 << 1,      /* S1 in X and Y */
	MODEL_ASK_BOX = 1 << 2,       /* resultant at the box's centre of gravity */
	MODEL_ASK_LAG = 1 << 3,       /* S1's resultant peak after S2's */
	MODEL_ASK_S2 = 1 << 4,        /* S2 in X and Y, its resultant */
	MODEL_ASK_DIRECTION = 1 << 5, /* of S1 and S2 */
	MODEL_ASK_ALL = (1 << 6) - 1
};

/* "plate", "axes", "box", "lag", "s2", "direction"; DT_E_UNKNOWN for another name. */
DT_MUST_USE int model_question_parse(const char *name, enum model_question *question);

struct model_options {
	double tolerance; /* numerical, of peaks: MODEL_TOLERANCE_MIN to 0.01 of them; 0: MODEL_TOLERANCE */
	unsigned refinements;     /* MODEL_OF_RUNG, or MODEL_WEDGE | ... */
	bool ring;                /* planar with MODEL_MOUNTS: count the plate's frequency and damping */
	bool paper_measured_time; /* paper: the scene's contact time instead of (7) and (9) */
	bool paper_signed_speed;  /* paper: (10) and (13) with the sign of v put right */
	unsigned asked; /* MODEL_ASK_PLATE | ...: peaks that no bit asks for may come as NAN; 0: everything */
	double accuracy; /* auto: how far the answer may be from planar's, as a share of it; 0: MODEL_ACCURACY
	                  */
	double lag_accuracy_us; /* the same of a lag; 0: MODEL_LAG_ACCURACY_US */
};
#define MODEL_TOLERANCE 1e-5
#define MODEL_TOLERANCE_MIN 1e-10
#define MODEL_ACCURACY 0.05
#define MODEL_LAG_ACCURACY_US 50.0

/* MODEL_OF_RUNG, ring counted, MODEL_TOLERANCE. */
extern const struct model_options model_defaults;

struct model_peak {
	double value_g;
	double time_s;
};

enum model_note {
	MODEL_NOTE_DEEP = 1 << 0,   /* the dent is deeper than 0.3 of the mat: its floor begins to be felt */
	MODEL_NOTE_STUCK = 1 << 1,  /* the box does not leave the mat: no contact time, no restitution */
	MODEL_NOTE_STRUCK = 1 << 2, /* a corner strikes, or strikes again, before all peaks are over: they
	                             * take it in */
};

struct model_prediction {
	const char *fidelity; /* the rung taken */
	char reason[160];     /* why that one, what it explains */
	enum model_fidelity rung;
	unsigned refinements; /* that were taken */
	unsigned notes;       /* enum model_note */
	bool has_plate;
	double impact_speed_m_s;
	double velocity_change_m_s; /* of the centre of gravity of all */
	double contact_time_s;
	double restitution;         /* corner's speed of leaving over its speed of impact, as it comes out */
	double stiffness_n_m15;     /* of the contact */
	double dent_m;              /* deepest */
	double dent_share;          /* of the mat's thickness */
	double plate_travel_m;      /* largest, against the box */
	double plate_frequency_hz;  /* damped, box and plate both free; 0 without a plate */
	double plate_damping_ratio; /* of that; the mean of three oscillations with MODEL_MOUNTS */
	double spin_rad_s;          /* after the contact, positive turns X away from the vertical */
	struct model_peak peak[MODEL_AXES];
	struct model_peak resultant[2]; /* S1, S2 */
	struct model_peak box;          /* resultant at the box's centre of gravity */
	double direction_deg[2];        /* S1, S2: from X towards Y when the resultant peaks */
	double second_touch_s;          /* MODEL_NOTE_STRUCK: when */
	int second_corner;              /* and which: 0 the one that struck first, 1 that beyond X, 3 that
	                                 * beyond Y, 2 the opposite one */
	double until_s;                 /* what the peaks are of ends here; NAN: nothing can come later */
	double lag_s;                   /* S1's resultant peak after S2's */
	unsigned evaluations;           /* of the equations of motion: its cost; 0 where the form is closed */
	/* of auto only, else NAN and none: */
	double difference; /* from planar as a share, numbers' error included, of the worst of what is asked
	                    */
	enum model_fidelity next; /* the rung above the one taken; MODEL_AUTO: none */
	double next_change;       /* what it would change */
};

enum { MODEL_MESSAGE_MAX = 256 };

/* Predicts a drop. options NULL: model_defaults; message NULL: not wanted. 0, or with the prediction
 * unchanged and one line in message: DT_E_ARGUMENT (the scene or an option makes no drop; names the key),
 * DT_E_RANGE (the corner would go through the mat) or DT_E_NUMERIC. */
DT_MUST_USE int model_solve(const struct scene *scene, enum model_fidelity fidelity,
                            const struct model_options *options, struct model_prediction *prediction,
                            char message[MODEL_MESSAGE_MAX]);

/* What Hertz would predict of the scene's contact from its materials, for comparison: no rung uses it. Look
 * at hertz->validity first. 0 or DT_E_ARGUMENT. */
DT_MUST_USE int model_hertz(const struct scene *scene, struct contact_hertz *hertz,
                            char message[MODEL_MESSAGE_MAX]);

/* The same drop by the rung below, for how much the two differ: coupled, with the scene's stiffness and the
 * wedge, below planar; sdof below coupled. DT_E_UNKNOWN below these. */
DT_MUST_USE int model_below(const struct scene *scene, const struct model_prediction *prediction,
                            struct model_prediction *below);

/* Fills value_g[count] with all axes at times start_s + k step_s after first touch (negative times: 0). */
DT_MUST_USE int model_histories(const struct scene *scene, enum model_fidelity fidelity,
                                const struct model_options *options, double start_s, double step_s,
                                double (*value_g)[MODEL_AXES], size_t count, char message[MODEL_MESSAGE_MAX]);

/* One of them, with the defaults. */
DT_MUST_USE int model_history(const struct scene *scene, enum model_fidelity fidelity, enum model_axis axis,
                              double start_s, double step_s, double *value_g, size_t count);

#endif
