/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <stdlib.h>

#include "host/chart/chart.h"
#include "host/chart/model_maps.h"
#include "host/chart/plot.h"

enum { COLUMNS = 60, ROWS = 40, DECAY_COLUMNS = 26, DECAY_ROWS = 16, PANELS = 2, CURVES = 4, CURVE = 120 };

#define KIND "model-stability"

/* Cells and curves of the picture being made. */
struct canvas {
	double cell[PANELS][ROWS * COLUMNS];
	double x[PANELS][CURVES][CURVE], y[PANELS][CURVES][CURVE]; /* of each panel */
	struct plot_panel panel[PANELS];
	struct plot plot;
	const struct chart_options *options;
};

static void model_stability_fill(struct canvas *canvas, size_t panel, size_t columns, size_t rows,
                                 double (*value)(const struct canvas *canvas, double x, double y,
                                                 size_t index))
{
	struct plot_panel *p = &canvas->panel[panel];

	p->cell = canvas->cell[panel];
	p->columns = columns;
	p->rows = rows;
	for (size_t r = 0; r < rows; r++)
		for (size_t c = 0; c < columns; c++)
			canvas->cell[panel][r * columns + c] =
			        value(canvas, plot_centre(&p->x, c, columns), plot_centre(&p->y, r, rows),
			              r * columns + c);
}

/* A curve over the panel's whole width. */
static void trace_curve(struct canvas *canvas, size_t panel, size_t curve,
                        double (*value)(double x, double other), double other, const char *name, int colour)
{
	double *x = canvas->x[panel][curve], *y = canvas->y[panel][curve];

	for (size_t i = 0; i < CURVE; i++) {
		x[i] = plot_centre(&canvas->panel[panel].x, i, CURVE);
		y[i] = value(x[i], other);
	}
	canvas->panel[panel].series[curve] = (struct plot_series){
	        .name = name, .x = x, .y = y, .count = CURVE, .judged = true, .colour = colour};
}

static int model_stability_finish(struct canvas *canvas, FILE *out, char *message)
{
	canvas->plot.panel = canvas->panel;
	canvas->plot.panels = PANELS;
	fprintf(out, "%s\n  %s\n", canvas->plot.title, canvas->plot.note[1]);
	return plot_write(&canvas->plot, canvas->options->folder, KIND, message);
}

/* No error at all has no place on a logarithmic axis. */
static double model_stability_shown(double error, double least)
{
	return isnan(error) ? error : fmax(error, least);
}

/* ---- resonance --------------------------------------------------------------------------------------------
 */

static double steady_error(const struct canvas *canvas, double pulse, double zeta, size_t index)
{
	(void)canvas, (void)index;
	return fabs(maps_steady_ratio(pulse, zeta) - 1);
}

static double plain_transient(double apart, double zeta)
{
	return model_stability_shown(maps_plain_transient(apart, zeta), 1e-16);
}

static int resonance(struct canvas *canvas, FILE *out, char *message)
{
	static const double damping[] = {0, 1e-12, 1e-8, 1e-4};
	static const char *const names[] = {"no damping", "damping ratio 1e-12", "damping ratio 1e-8",
	                                    "damping ratio 1e-4"};

	canvas->plot = (struct plot){
	        .name = "resonance",
	        .title = "Through resonance: the steady state, and the usual formula of the transient",
	        .note = {"Left: peak of the plate by the steady state against the exact one. Right: the "
	                 "plate's place by the usual quotient over (1 - r^2)^2 + (2 zeta r)^2 against sdof's "
	                 "divided difference.",
	                 "A drop is over before a steady state begins: 2A agrees by accident, on a crossing, "
	                 "2B not at all; use sdof, whose form has no resonance to fail at."},
	        .value = "error of the peak",
	        .shade = {0.01, 0.1, 0.3, 1},
	        .shade_text = {"to 1 %", "to 10 %", "to 30 %", "to 100 %", "more"},
	};
	canvas->panel[0] = (struct plot_panel){
	        .title = "steady against sdof",
	        .x = {"contact time in cycles of the plate, f_p T  (resonance: 0.5)", "cycles", 0.1, 3, false,
	              NULL},
	        .y = {"damping ratio of the mounts", "damping_ratio", 0.003, 1, true, NULL},
	        .fails = 0.1,
	        .label = {{"steady fails: up to 30 times too large", 0.95, 0.012, false, false},
	                  {"2A", 0.3648, 0.1, true, true},
	                  {"2B", 0.471, 0.1, true, false}},
	};
	model_stability_fill(canvas, 0, COLUMNS, ROWS, steady_error);
	canvas->panel[1] = (struct plot_panel){
	        .title = "the usual transient near resonance",
	        .x = {"distance from resonance, 1 - r", "one_minus_r", 1e-16, 0.1, true, "1e%T"},
	        .y = {"relative error", "error", 1e-16, 1, true, "1e%T"},
	        .region = {{1e-16, 0.1, 1e-6, 1}},
	        .label = {{"usual transient fails: over half of its digits lost", 1e-7, 1e-3, false, false}},
	        .key = "bottom left",
	};
	for (size_t i = 0; i < CURVES; i++)
		trace_curve(canvas, 1, i, plain_transient, damping[i], names[i], (int)i + 1);
	return model_stability_finish(canvas, out, message);
}

/* ---- steps ------------------------------------------------------------------------------------------------
 */

static double step_error(const struct canvas *canvas, double contact_ms, double step_us, size_t index)
{
	const double e = 0.5;

	(void)canvas, (void)index;
	return fabs(maps_rk4_restitution(e, step_us * 1e-3 / contact_ms) - e);
}

static double share_error(const struct canvas *canvas, double e, double share, size_t index)
{
	(void)canvas, (void)index;
	return fabs(maps_rk4_restitution(e, share) - e);
}

/* The shortest step, as a share of the contact, by which something bounces faster than it came. */
static double gains_from(double e, double other)
{
	(void)other;
	for (double share = 0.05; share < 0.8; share *= 1.02)
		if (maps_rk4_restitution(e, share) > 1.01)
			return share;
	return NAN;
}

static int model_stability_step(struct canvas *canvas, FILE *out, char *message)
{
	canvas->plot = (struct plot){
	        .name = "step",
	        .title = "Fixed steps through a contact: when RK4 gets the rebound wrong",
	        .note = {"Hunt and Crossley's contact by classical Runge-Kutta steps, worst of 40 places of "
	                 "the touch within a step. It fails where the restitution comes out wrong by more "
	                 "than 0.01.",
	                 "Six steps a contact do from 0.2 up, thirty are needed at 0.03; one step a sample "
	                 "of 7 kHz is fine on the mat and fails on steel. droptower's steps follow the "
	                 "contact."},
	        .value = "error of the restitution",
	        .shade = {1e-4, 1e-3, 1e-2, 0.1},
	        .shade_text = {"to 0.0001", "to 0.001", "to 0.01", "to 0.1", "more"},
	};
	canvas->panel[0] = (struct plot_panel){
	        .title = "contact stiffness, as contact time; restitution 0.5",
	        .x = {"contact time, ms  (stiff to the left)", "contact_ms", 0.2, 10, true, NULL},
	        .y = {"step, us", "step_us", 3, 3000, true, NULL},
	        .fails = 0.01,
	        .label = {{"RK4 fails", 0.5, 900, false, false},
	                  {"mat, a step per sample", 3, 1e6 / 7000, true, false},
	                  {"steel, the same step", 0.537, 1e6 / 7000, true, false}},
	};
	model_stability_fill(canvas, 0, COLUMNS, ROWS, step_error);
	canvas->panel[1] = (struct plot_panel){
	        .title = "restitution",
	        .x = {"restitution", "restitution", 0.03, 1, false, NULL},
	        .y = {"step over contact time", "step_share", 0.01, 0.8, true, NULL},
	        .fails = 0.01,
	        .label = {{"RK4 fails", 0.42, 0.42, false, false}},
	        .key = "bottom right",
	};
	model_stability_fill(canvas, 1, COLUMNS, ROWS, share_error);
	trace_curve(canvas, 1, 0, gains_from, 0, "above it leaves faster than it came (RK4)", 0);
	return model_stability_finish(canvas, out, message);
}

/* ---- restitution ------------------------------------------------------------------------------------------
 */

static double small_error(double e, double way)
{
	return model_stability_shown(maps_damping_of_small((enum maps_way)way, e), 1e-17);
}

static double near_one_error(double u, double way)
{
	return model_stability_shown(maps_damping_near_one((enum maps_way)way, u), 1e-17);
}

static void damping_panel(struct canvas *canvas, size_t panel, double (*error)(double x, double way))
{
	static const char *const names[] = {"plain equation, Brent", "first order, 1.5 (1 - e)", "droptower"};
	static const int colours[] = {2, 5, 1};
	struct plot_panel *p = &canvas->panel[panel];

	for (size_t way = 0; way <= MAPS_OURS; way++)
		trace_curve(canvas, panel, way, error, (double)way, names[way], colours[way]);
	p->region[0] = (struct plot_region){p->x.from, p->x.from, p->y.from, p->y.to};
	p->series[MAPS_LINEAR].judged = p->series[MAPS_OURS].judged = false;
	for (size_t i = 0; i < CURVE; i++)
		if (!(canvas->y[panel][MAPS_PLAIN][i] < 1e-6))
			p->region[0].to = plot_edge(&p->x, i + 1, CURVE);
}

static int restitution(struct canvas *canvas, FILE *out, char *message)
{
	canvas->plot = (struct plot){
	        .name = "restitution",
	        .title = "Restitution near 0 and near 1: finding the contact's damping D",
	        .note = {"D of Hunt and Crossley's law from ln((1 + D)/(1 - e D)) = D (1 + e): relative "
	                 "error against two forms that do not cancel, a fixed point (left), a power series "
	                 "in long double (right).",
	                 "As it stands the equation has no bracket below 0.03 and loses its digits towards "
	                 "1; a root in another variable, as droptower takes it, serves from 1e-6 to 1."},
	};
	canvas->panel[0] = (struct plot_panel){
	        .title = "near 0: hardly any rebound",
	        .x = {"restitution e", "restitution", 1e-6, 0.1, true, "1e%T"},
	        .y = {"relative error of D", "error", 1e-17, 10, true, "1e%T"},
	        .label = {{"plain equation fails: no root is bracketed", 3e-4, 1e-6, false, false}},
	        .key = "center right",
	};
	damping_panel(canvas, 0, small_error);
	canvas->panel[1] = (struct plot_panel){
	        .title = "near 1: hardly any loss",
	        .x = {"1 - e", "one_minus_e", 1e-12, 0.1, true, "1e%T"},
	        .y = {"relative error of D", "error", 1e-17, 10, true, "1e%T"},
	        .label = {{"plain equation fails: its digits cancel", 1e-9, 1e-10, false, false}},
	};
	damping_panel(canvas, 1, near_one_error);
	return model_stability_finish(canvas, out, message);
}

/* ---- angle ------------------------------------------------------------------------------------------------
 */

static double second_ms(double angle_deg, double other)
{
	double second = maps_corners(angle_deg).second_s;

	(void)other;
	return isfinite(second) ? second * 1e3 : (double)NAN;
}

static double release_ms(double angle_deg, double other)
{
	(void)other;
	return maps_corners(angle_deg).release_s * 1e3;
}

static double record_ms(double angle_deg, double other)
{
	(void)angle_deg, (void)other;
	return 12;
}

static double lever_mm(double angle_deg, double balance_deg)
{
	return maps_lever(angle_deg, balance_deg) * 1e3;
}

/* The angles next to 0 and to 90 between which the second corner waits for the first to leave. */
static void flat_limits(const struct canvas *canvas, double *low, double *high)
{
	const double *at = canvas->x[0][0], *second = canvas->y[0][0], *release = canvas->y[0][1];

	*low = 0, *high = 90;
	for (size_t i = 0; i < CURVE; i++) {
		if (second[i] >= release[i] || isnan(second[i]))
			continue;
		if (at[i] < 45)
			*low = plot_edge(&canvas->panel[0].x, i + 1, CURVE);
		else
			*high = fmin(*high, plot_edge(&canvas->panel[0].x, i, CURVE));
	}
}

static int angle(struct canvas *canvas, FILE *out, char *message)
{
	double own = maps_own_balance_deg(), low, high;

	canvas->plot = (struct plot){
	        .name = "angle",
	        .title = "Towards flat, and over the tip: one corner, or two",
	        .note = {"Geometry 1 (289 x 101 mm) with its own square corners, planar motion without "
	                 "friction, gravity on, followed for 60 ms. Right: lever of a vertical contact force "
	                 "about the centre of gravity.",
	                 "planar's one corner is enough from 4 to 87 deg. Over the tip only a sign changes: "
	                 "with the lever of the box's own corner it turns the wrong way from 19.3 to 25 "
	                 "deg."},
	};
	canvas->panel[0] = (struct plot_panel){
	        .title = "when a second corner comes down",
	        .x = {"angle from the vertical to X, deg", "angle_deg", 0, 90, false, NULL},
	        .y = {"ms after the first touch", "ms", 0.3, 100, true, NULL},
	        .label =
	                {
	                        {"none in 60 ms", 20, 60, false, false},
	                        {"hatched: planar fails, two corners carry at once", 42, 5.2, false, false},
	                },
	        .key = "bottom center",
	};
	trace_curve(canvas, 0, 0, second_ms, 0, "second corner touches", 2);
	trace_curve(canvas, 0, 1, release_ms, 0, "first corner has left", 1);
	trace_curve(canvas, 0, 2, record_ms, 0, "end of a record of 12 ms", 7);
	canvas->panel[0].series[2].judged = false;
	flat_limits(canvas, &low, &high);
	canvas->panel[0].region[0] = (struct plot_region){0, low, 0.3, 100};
	canvas->panel[0].region[1] = (struct plot_region){high, 90, 0.3, 100};
	canvas->panel[1] = (struct plot_panel){
	        .title = "which way it turns",
	        .x = {"angle from the vertical to X, deg", "angle_deg", 0, 60, false, NULL},
	        .y = {"lever, mm  (positive: X turns away from the vertical)", "lever_mm", -60, 110, false,
	              NULL},
	        .region = {{own, 25, -60, 110}},
	        .label = {{"own corner fails:", 30, -35, false, false},
	                  {"wrong way round", 30, -45, false, false}},
	        .key = "top left",
	};
	trace_curve(canvas, 1, 0, lever_mm, 25, "balance angle 25 deg, as observed", 1);
	canvas->panel[1].series[0].judged = false;
	trace_curve(canvas, 1, 1, lever_mm, own, "the box's own corner, 19.3 deg", 2);
	return model_stability_finish(canvas, out, message);
}

/* ---- dent -------------------------------------------------------------------------------------------------
 */

static double dent_share(const struct canvas *canvas, double modulus_mpa, double height_m, size_t index)
{
	(void)canvas, (void)index;
	return maps_hertz(modulus_mpa * 1e6, height_m).dent_share;
}

static double hertz_ms(double modulus_mpa, double height_m)
{
	return maps_hertz(modulus_mpa * 1e6, height_m).duration_s * 1e3;
}

static double measured_ms(double modulus_mpa, double other)
{
	(void)modulus_mpa, (void)other;
	return 3.0;
}

static int dent(struct canvas *canvas, FILE *out, char *message)
{
	double through = 0;

	canvas->plot = (struct plot){
	        .name = "dent",
	        .title = "Contact deeper than the mat: where Hertz's prediction has no meaning",
	        .note = {"Geometry 1 (173 g, corner radius 15 mm) on a mat of 10 mm. The half space of the "
	                 "theory has no floor: it fails where the dent is over 0.3 of the mat and begins to "
	                 "feel one.",
	                 "At the mat's own modulus Hertz wants a dent through the mat and a contact of 7 ms; "
	                 "3 ms were measured. So the contact is identified from its time, not predicted."},
	        .value = "dent over thickness",
	        .shade = {0.1, 0.3, 0.6, 1},
	        .shade_text = {"to 0.1", "to 0.3", "to 0.6", "to 1", "more"},
	};
	canvas->panel[0] = (struct plot_panel){
	        .title = "predicted dent",
	        .x = {"Young's modulus of the mat, MPa", "modulus_mpa", 0.3, 3000, true, NULL},
	        .y = {"drop height, m", "height_m", 0.05, 5, true, NULL},
	        .fails = 0.3,
	        .label = {{"Hertz fails", 1.6, 0.11, false, false},
	                  {"the mat's", 1.69, 0.894, true, true},
	                  {"dent through the mat", 0.9, 3, false, false},
	                  {"would give 3 ms", 14.86, 0.894, true, false},
	                  {"sound", 400, 0.4, false, false}},
	};
	model_stability_fill(canvas, 0, COLUMNS, ROWS, dent_share);
	canvas->panel[1] = (struct plot_panel){
	        .title = "predicted contact time, 0.894 m",
	        .x = {"Young's modulus of the mat, MPa", "modulus_mpa", 0.3, 3000, true, NULL},
	        .y = {"contact time, ms", "contact_ms", 0, 12, false, NULL},
	        .key = "top right",
	};
	trace_curve(canvas, 1, 0, hertz_ms, 0.894, "Hertz", 2);
	trace_curve(canvas, 1, 1, measured_ms, 0, "measured", 0);
	canvas->panel[1].series[1].judged = false;
	for (size_t i = 0; i < CURVE; i++)
		if (maps_hertz(canvas->x[1][0][i] * 1e6, 0.894).dent_share > canvas->panel[0].fails)
			through = plot_edge(&canvas->panel[1].x, i + 1, CURVE);
	canvas->panel[1].region[0] = (struct plot_region){0.3, through, 0, 12};
	canvas->panel[1].label[0] = (struct plot_label){"Hertz fails", 3, 9.5, false, false};
	canvas->panel[1].label[1] =
	        (struct plot_label){"the mat's modulus", 1.69, hertz_ms(1.69, 0.894), true, false};
	return model_stability_finish(canvas, out, message);
}

/* ---- decrement --------------------------------------------------------------------------------------------
 */

static double decrement_error(const struct canvas *canvas, double zeta, double noise_g, size_t index)
{
	return maps_decay_error(false, zeta, noise_g, canvas->options->drops, canvas->options->seed + index);
}

static double ringdown_error(const struct canvas *canvas, double zeta, double noise_g, size_t index)
{
	return maps_decay_error(true, zeta, noise_g, canvas->options->drops, canvas->options->seed + index);
}

static int model_stability_decrement(struct canvas *canvas, FILE *out, char *message)
{
	static double (*const error[])(const struct canvas *, double, double, size_t) = {decrement_error,
	                                                                                 ringdown_error};

	canvas->plot = (struct plot){
	        .name = "decrement",
	        .title = "Damping from a decay: the logarithmic decrement where damping or noise is high",
	        .note = {"Free decays of 300 g, 129 Hz, 7 kHz, any phase; root mean square error of the "
	                 "damping ratio over the ratio itself. Fails: over 10 %. No value counts as wrong by "
	                 "its whole.",
	                 "The decrement reads a few samples: it fails from 3 to 10 g of noise on, and from "
	                 "any above a ratio of 0.4; the fit of the whole decay bears ten times the noise at "
	                 "any ratio."},
	        .value = "error of the damping ratio",
	        .shade = {0.01, 0.03, 0.1, 0.3},
	        .shade_text = {"to 1 %", "to 3 %", "to 10 %", "to 30 %", "more"},
	};
	for (size_t i = 0; i < PANELS; i++) {
		canvas->panel[i] = (struct plot_panel){
		        .title = i ? "droptower: fit of the decay" : "logarithmic decrement, one whole cycle",
		        .x = {"damping ratio", "damping_ratio", 0.01, 0.6, true, NULL},
		        .y = {"noise of a sample, g", "noise_g", 0.1, 100, true, NULL},
		        .fails = 0.1,
		        .label = {{i ? "the fit fails" : "log decrement fails", 0.25, 40, false, false},
		                  {"the study's plate", 0.1, 1, true, false}},
		};
		model_stability_fill(canvas, i, DECAY_COLUMNS, DECAY_ROWS, error[i]);
	}
	return model_stability_finish(canvas, out, message);
}

int chart_model_stability(const struct chart_options *options, FILE *out, char *message)
{
	static int (*const pictures[])(struct canvas *, FILE *, char *) = {
	        resonance, model_stability_step, restitution, angle, dent, model_stability_decrement};
	struct canvas *canvas = calloc(1, sizeof(*canvas));
	int status = 0;

	if (!canvas) {
		snprintf(message, CHART_MESSAGE_MAX, "%s", error_text(DT_E_MEMORY));
		return DT_E_MEMORY;
	}
	canvas->options = options;
	for (size_t i = 0; i < sizeof(pictures) / sizeof(pictures[0]) && !status; i++)
		status = pictures[i](canvas, out, message);
	free(canvas);
	return status;
}
