/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/model/contact.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>

#include <gsl/gsl_integration.h>
#include <gsl/gsl_sf_log.h>

#include "common/units.h"
#include "host/model/root.h"

enum { SERIES_TERMS = 20, NODES = 32 };

/* Below this spread the series are exact to the last digit, above it the closed forms. */
#define SPREAD_SERIES 1.0

/* Below this one D and the deviation from the elastic law are a rounding error. */
#define SPREAD_ELASTIC 1e-14

/* Panels of the contact integral are at most this long; beyond REACH from the touch-down's end of it the
 * exponential in it has left no digit. */
#define PANEL 2.0
#define REACH 40.0

/* How far the restitution of this spread lies below the wanted one. Close to e = 1 what counts is 1 - e,
 * close to e = 0 it is e. */
static double shortfall(double x, void *context)
{
	const double *wanted = context;
	double over = 0.0, under = 0.0, factorial = 2.0, power = 1.0;

	if (x >= SPREAD_SERIES)
		return *wanted - (1.0 - (1.0 + x) * exp(-x)) / (x + expm1(-x));
	for (int k = 0; k < SERIES_TERMS; k++) { /* factorial: (k + 2)! */
		over += power * (k + 1) / (factorial * (k + 3));
		under += power * (k + 1) / factorial;
		power *= x;
		factorial *= k + 3;
	}
	return x * over / under - (1.0 - *wanted);
}

/* (1 - exp(-x))/x */
static double fade(double x)
{
	return x == 0.0 ? 1.0 : -expm1(-x) / x;
}

/* D = x/(1 - exp(-x)) - 1 */
static double contact_damping(double x)
{
	double sum = 0.0, term = 0.5;

	if (x >= SPREAD_SERIES)
		return (x + expm1(-x)) / -expm1(-x);
	for (int k = 0; k < SERIES_TERMS; k++) {
		sum += term;
		term *= -x / (k + 3);
	}
	return x * sum / fade(x);
}

/* (fade(h) - fade(x))/(x - h) */
static double fade_slope(double h, double x)
{
	double sum = 0.0, homogeneous = 1.0, power = 1.0, factorial = 2.0;

	for (int n = 1; n <= SERIES_TERMS; n++) {
		sum += (n % 2 ? homogeneous : -homogeneous) / factorial;
		power *= h;
		homogeneous = homogeneous * x + power;
		factorial *= n + 2;
	}
	return sum;
}

/* d*^2.5 D^2/2.5 as a function of h. The other side counts h from the release: rest = x - h. */
static double depth_power(double x, double h, double rest)
{
	if (x < SPREAD_SERIES)
		return h * rest * fade_slope(h, x) / fade(x);
	if (h < rest)
		return h * (fade(h) / fade(x) - 1.0);
	return rest - x / expm1(x) * expm1(rest);
}

/* Nodes and weights of Gauss and Jacobi's rule from 0 to 1 for x^-0.6 times a smooth function. */
static const double jacobi[][2] = {
        {0.0023564000055709668688, 0.4128232697801082894}, {0.025369604115236793468, 0.31614087925320273528},
        {0.071521965860360666128, 0.2777382876577521126},  {0.13855187417448951704, 0.25029263722784691841},
        {0.22319086121990933092, 0.22656680458752453371},  {0.32131281025232566375, 0.20417204669207478456},
        {0.4281344839870606092, 0.18209665376164552553},   {0.53844860011894066416, 0.15986986678334594911},
        {0.64687765486786106162, 0.13727701246087906653},  {0.74813607032203410498, 0.11424060111599977256},
        {0.83728789651396806149, 0.090763250603581544475}, {0.90998759881594211988, 0.066897308878069025544},
        {0.96269281154838818535, 0.042728533115333838806}, {0.99284669666506553983, 0.01839284808263590123},
};

/* The panel that begins at the touch or at the release, where the integrand has a pole of order 0.6. */
static double first_panel(double x, double to, bool release)
{
	double sum = 0.0;

	for (size_t i = 0; i < sizeof(jacobi) / sizeof(jacobi[0]); i++) {
		double y = to * jacobi[i][0];

		sum += jacobi[i][1] *
		       pow((release ? depth_power(x, x - y, y) : depth_power(x, y, x - y)) / y, -0.6);
	}
	return pow(to, 0.4) * sum;
}

/* A later panel of the contact integral, counted from the touch (release = false) or from the release. */
static double panel(double x, double from, double to, bool release,
                    const gsl_integration_glfixed_table *table)
{
	double sum = 0.0;

	for (size_t i = 0; i < NODES; i++) {
		double s, weight, y;

		gsl_integration_glfixed_point(0.0, 1.0, i, &s, &weight, table);
		weight *= to - from;
		y = from + (to - from) * s;
		sum += weight * pow(release ? depth_power(x, x - y, y) : depth_power(x, y, x - y), -0.6);
	}
	return sum;
}

/* Panels from `from` on to `to`. */
static double panels(double x, double from, double to, bool release,
                     const gsl_integration_glfixed_table *table)
{
	int count = (int)ceil((to - from) / PANEL);
	double sum = 0.0;

	for (int i = 0; i < count; i++)
		sum += from == 0.0 && i == 0 ? first_panel(x, to / count, release)
		                             : panel(x, from + (to - from) * i / count,
		                                     from + (to - from) * (i + 1) / count, release, table);
	return sum;
}

/* The integral of depth_power^-0.6 over h from 0 to x. */
static int contact_integral(double x, double *value)
{
	gsl_integration_glfixed_table *table = gsl_integration_glfixed_table_alloc(NODES);
	double turn = log1p(contact_damping(x)); /* h at the largest depth */
	double after = x - turn, slow = 0.0;

	if (!table)
		return DT_E_MEMORY;
	*value = panels(x, 0.0, turn, false, table);
	if (after > REACH) { /* the slow way out: depth_power is a straight line */
		double q = x / expm1(x);

		slow = after - REACH;
		*value += (pow(slow + q, 0.4) - pow(q, 0.4)) / 0.4;
	}
	*value += panels(x, slow, after, true, table);
	gsl_integration_glfixed_table_free(table);
	return 0;
}

int contact_law_begin(struct contact_law *law, double restitution)
{
	struct contact_law l = {.restitution = restitution};
	int error;

	if (!(restitution >= CONTACT_RESTITUTION_MIN && restitution <= 1.0))
		return DT_E_ARGUMENT;
	error = root_find(shortfall, &restitution, 0.0, 2.0 + 1.0 / restitution, &l.spread);
	if (error)
		return error;
	if (l.spread < SPREAD_ELASTIC)
		l.spread = SPREAD_ELASTIC;
	l.damping = contact_damping(l.spread);
	l.duration = 3.218 + 0.386 * (1.0 / restitution - 1.0);
	l.depth = pow(-2.5 * gsl_sf_log_1plusx_mx(l.damping) / (l.damping * l.damping), 0.4);
	*law = l;
	return 0;
}

int contact_law_init(struct contact_law *law, double restitution)
{
	struct contact_law l;
	double integral;
	int error = contact_law_begin(&l, restitution);

	if (!error)
		error = contact_integral(l.spread, &integral);
	if (error)
		return error;
	l.duration = pow(l.damping, 0.2) * pow(2.5, -0.6) * integral;
	*law = l;
	return 0;
}

double contact_stiffness(const struct contact_law *law, double mass_kg, double speed_m_s, double duration_s)
{
	return mass_kg / sqrt(speed_m_s) * pow(law->duration / duration_s, 2.5);
}

double contact_duration(const struct contact_law *law, double mass_kg, double speed_m_s,
                        double stiffness_n_m15)
{
	return law->duration * pow(mass_kg / stiffness_n_m15 * (mass_kg / stiffness_n_m15) / speed_m_s, 0.2);
}

double contact_depth(const struct contact_law *law, double mass_kg, double speed_m_s, double stiffness_n_m15)
{
	return law->depth * pow(mass_kg * speed_m_s * speed_m_s / stiffness_n_m15, 0.4);
}

enum contact_validity contact_validity(double depth_m, double thickness_m)
{
	if (!(depth_m < thickness_m))
		return CONTACT_THROUGH;
	return depth_m > CONTACT_DEEP_SHARE * thickness_m ? CONTACT_DEEP : CONTACT_SOUND;
}

static bool is_material(double modulus_pa, double poisson)
{
	return modulus_pa > 0.0 && isfinite(modulus_pa) && poisson >= 0.0 && poisson <= 0.5;
}

int contact_hertz(const struct contact_hertz_input *in, struct contact_hertz *hertz)
{
	/* T v/depth of an elastic contact: (4 sqrt(pi)/5) G(2/5)/G(9/10), equation (9)'s 2.943 */
	const double shape = 0.8 * sqrt(UNITS_PI) * tgamma(0.4) / tgamma(0.9);
	struct contact_hertz h;

	if (!is_material(in->case_modulus_pa, in->case_poisson) ||
	    !is_material(in->mat_modulus_pa, in->mat_poisson) || !(in->mass_kg > 0.0) ||
	    !(in->speed_m_s > 0.0) || !(in->radius_m > 0.0) || !(in->mat_thickness_m > 0.0))
		return DT_E_ARGUMENT;
	h.modulus_pa = 4.0 / 3.0 /
	               ((1.0 - in->case_poisson * in->case_poisson) / in->case_modulus_pa +
	                (1.0 - in->mat_poisson * in->mat_poisson) / in->mat_modulus_pa);
	h.stiffness_n_m15 = h.modulus_pa * sqrt(in->radius_m);
	h.depth_m = pow(1.25 * in->mass_kg * in->speed_m_s * in->speed_m_s / h.stiffness_n_m15, 0.4);
	h.duration_s = shape * h.depth_m / in->speed_m_s;
	h.depth_share = h.depth_m / in->mat_thickness_m;
	h.validity = contact_validity(h.depth_m, in->mat_thickness_m);
	if (!isfinite(h.duration_s))
		return DT_E_ARGUMENT;
	*hertz = h;
	return 0;
}
