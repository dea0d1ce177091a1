/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_UNIT_ADVERSARIAL_H
#define DT_TESTS_UNIT_ADVERSARIAL_H
/*
 * Drops on five channels with known truth, of pulses, plates, disturbances and chain errors that no estimator
 * is fitted to. Shares nothing with host/estimate, host/model or hil.
 */
#include <stdbool.h>

#include "host/record/record.h"
#include "tests/unit/synth.h"

enum { S1X, S1Y, S2X, S2Y, S2Z, CHANNELS };

enum form {
	HALF_SINE,
	HAVERSINE,
	HERTZ,
	GAMMA,
	TRAPEZOID,
	HUMPS,
	RING,
	BELL,
	FINAL,
	INITIAL,
	EXPONENTIALS,
	EDGE
};
enum plate { PLAIN, HARDLY_DAMPED, MUCH_DAMPED, FAST, RIGID, TWO_MODES, SOFT };
enum spoil {
	NOTHING,
	SHORT,
	LONG,
	WEAK,
	SECOND,
	OFFSET,
	HUM,
	LAPLACE,
	COARSE,
	COARSER,
	COARSER_TWICE,
	LOUD,
	SPIKES,
	LOST,
	CLEAN, /* the above show nothing, or what is flagged and cured */
	CUT_FINE,
	CUT,
	CUT_NOISY,
	CUT_BOTH,
	CABLE,
	RAIL,
	STUCK,
	SHIFT,
	SHIFT_AT_ONCE,
	TAIL,
	SLAP,
	SLAP_NEAR,
	REVERSED,
	EXCHANGED,
	S1_LOOSE,
	S2_LOOSE,
	COLOURED,
	RED,
	BURST,
	INSIDE,
	GAIN_STEP,
	GAIN_BACK,
	LIMITED,
	S1_GAIN_STEP,
	LATE,
	S2_LATE,
	S1_LESS,
	S1_LIMITED,
	DULL,
	HELD,
	FROZEN,
	TWICE,
	RECTIFIED,
	SLEW,
	DEAD,
	SAG,
	BLOCK_TWICE,
	S1_DEAD,
	BEGIN_HELD,
	S2_LOOSE_LESS,
	SPOILS
};

struct adversarial_class {
	const char *name;
	enum form form;
	enum plate plate;
	enum spoil spoil;
	bool open; /* known to be silently wrong */
};

extern const struct adversarial_class adversarial_classes[];
extern const unsigned adversarial_count;

struct adversarial_drop {
	const struct adversarial_class *class;
	double base_s, noise_g, onset_s, part[CHANNELS], hz, damping, at, much, again_s;
	struct channel channel[CHANNELS];
	struct record record;
};

/* Of a pulse of height 1: the largest within 40 ms, the area in s, the width at 10 %. */
struct adversarial_truth {
	double peak, time_s, area, width_s;
};

/* The next drop of a class; told: with its trigger. Free it with adversarial_free. */
void adversarial_make(const struct adversarial_class *class, bool told, struct synth_random *random,
                      struct adversarial_drop *drop);
void adversarial_free(struct adversarial_drop *drop);

/* Of S1 or S2, sensor 1 or 2, of the drop that was made last. */
struct adversarial_truth adversarial_truth(unsigned sensor);

#endif
