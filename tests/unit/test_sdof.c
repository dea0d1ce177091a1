/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The half-sine response against numbers of a 60-digit computation, against a Runge-Kutta integration of
 * the equation of motion made here, and against limits known in closed form.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <math.h>

#include "host/model/sdof.h"

#define PI 3.14159265358979323846

static void check_close(const char *what, double value, double expected, double relative)
{
	if (!(fabs(value - expected) <= relative * fabs(expected)))
		fail_msg("%s: %.15g, expected %.15g within %g of it", what, value, expected, relative);
}

static struct sdof make(double frequency_hz, double zeta, double amplitude, double pulse_s)
{
	struct sdof sdof;

	assert_int_equal(sdof_init(&sdof, frequency_hz, zeta, amplitude, pulse_s), 0);
	return sdof;
}

static void check_peak(double frequency_hz, double zeta, double value, double time_ms, double tolerance)
{
	struct sdof sdof = make(frequency_hz, zeta, 1.0, 0.003);
	double v, t;

	assert_int_equal(sdof_peak(&sdof, &v, &t), 0);
	check_close("peak", v, value, tolerance);
	if (time_ms > 0.0)
		check_close("peak time", t * 1e3, time_ms, tolerance);
}

static void test_reference_motion(void **state)
{
	static const struct {
		double time_s, z, v, acceleration;
	} reference[] = {
	        {0.5e-3, -2.09158881489e-8, -1.22808409293e-4, .0336489113594},
	        {1.5e-3, -4.52559405610e-7, -7.60483060777e-4, .420592588949},
	        {3.0e-3, -1.68664944659e-6, -4.22491449534e-4, 1.17655028165},
	        {4.5e-3, -1.10208965129e-6, 1.04121335734e-3, .555242079241},
	        {10e-3, -5.34144207420e-7, -6.70728409313e-4, .459640784916},
	};
	struct sdof sdof = make(129.0, 0.1, 1.0, 0.003);

	(void)state;
	for (size_t i = 0; i < sizeof(reference) / sizeof(reference[0]); i++) {
		struct sdof_motion m = sdof_motion(&sdof, reference[i].time_s);

		check_close("z", m.z, reference[i].z, 1e-11);
		check_close("z'", m.v, reference[i].v, 1e-11);
		check_close("u\"", m.acceleration, reference[i].acceleration, 1e-11);
	}
}

static void test_reference_peaks(void **state)
{
	(void)state;
	check_peak(121.0, 0.1, 1.12757877870, 3.21278447741, 1e-11);
	check_peak(129.0, 0.1, 1.18135966265, 3.11103015269, 1e-11);
	check_peak(154.0, 0.1, 1.32374538069, 2.87725254545, 1e-11);
	check_peak(177.0, 0.1, 1.41787975130, 2.70598705831, 1e-11);
	check_peak(1.0 / 0.006, 0.1, 1.37960363108, 2.78039773767, 1e-11);
	check_peak(116.877143715989, 0.1, 1.09847437243, 3.27080406287, 1e-11);
	check_peak(150.887743721439, 0.1, 1.30839423536, 2.90205350089, 1e-11);
	check_peak(121.0, 0.01, 1.26142688566, 0.0, 1e-11);
	check_peak(129.0, 0.01, 1.32155483425, 0.0, 1e-11);
	check_peak(154.0, 0.01, 1.48215593382, 0.0, 1e-11);
	check_peak(177.0, 0.01, 1.59092666519, 0.0, 1e-11);
	check_peak(1.0 / 0.006, 0.01, 1.54677985853, 0.0, 1e-11);
	check_peak(1.0 / 0.006, 0.0, PI / 2.0, 3.0, 1e-8); /* flat top: at the pulse's very end */
}

/* The equation of motion, z'' = -w'' - 2 zeta omega z' - omega^2 z, by fixed-step Runge-Kutta. */
static double rate(double omega, double zeta, double pulse_s, double t, double z, double v)
{
	double base = t < pulse_s ? sin(PI * t / pulse_s) : 0.0;

	return -base - 2.0 * zeta * omega * v - omega * omega * z;
}

static void integrate(double omega, double zeta, double pulse_s, double end_s, int steps, double *z,
                      double *v)
{
	double h = end_s / steps;

	*z = 0.0;
	*v = 0.0;
	for (int k = 0; k < steps; k++) {
		double t = end_s * k / steps;
		double a1 = rate(omega, zeta, pulse_s, t, *z, *v), v1 = *v;
		double v2 = *v + h / 2 * a1, a2 = rate(omega, zeta, pulse_s, t + h / 2, *z + h / 2 * v1, v2);
		double v3 = *v + h / 2 * a2, a3 = rate(omega, zeta, pulse_s, t + h / 2, *z + h / 2 * v2, v3);
		double v4 = *v + h * a3, a4 = rate(omega, zeta, pulse_s, t + h, *z + h * v3, v4);

		*z += h / 6 * (v1 + 2 * v2 + 2 * v3 + v4);
		*v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
	}
}

/* Times within and after the pulse that the steps meet exactly, so that no step straddles its end. */
static void check_against_integration(double cycles, double zeta)
{
	const double pulse_s = 0.003, times[] = {0.25, 0.5, 1.0, 1.5, 3.0};
	struct sdof sdof = make(cycles / pulse_s, zeta, 1.0, pulse_s);
	double omega = 2.0 * PI * cycles / pulse_s;

	for (size_t i = 0; i < sizeof(times) / sizeof(times[0]); i++) {
		struct sdof_motion m = sdof_motion(&sdof, times[i] * pulse_s);
		double z, v, scale = 1.0 / (omega * omega);

		integrate(omega, zeta, pulse_s, times[i] * pulse_s, 12000, &z, &v);
		if (!(fabs(m.z - z) <= 1e-10 * scale) || !(fabs(m.v - v) <= 1e-10 * scale * omega) ||
		    !(fabs(m.acceleration + 2 * zeta * omega * v + omega * omega * z) <= 1e-9))
			fail_msg("f T %.17g, zeta %g, t/T %g: z %.15g and %.15g, z' %.15g and %.15g", cycles,
			         zeta, times[i], m.z, z, m.v, v);
	}
}

static void test_against_integration(void **state)
{
	const double cycles[] = {0.1, 0.363, 0.5, 0.531, 1.0, 2.7},
	             zetas[] = {0.0, 1e-8, 0.01, 0.1, 0.4, 0.99};

	(void)state;
	for (size_t c = 0; c < sizeof(cycles) / sizeof(cycles[0]); c++)
		for (size_t z = 0; z < sizeof(zetas) / sizeof(zetas[0]); z++)
			check_against_integration(cycles[c], zetas[z]);
}

/* Around f T = 1/2 the usual form divides zero by zero. */
static void test_through_resonance(void **state)
{
	const double off[] = {0.0, 1e-15, 1e-14, 1e-10, 1e-8, 1e-4, 1e-2}, zetas[] = {0.0, 1e-12, 1e-8, 0.1};

	(void)state;
	for (size_t d = 0; d < sizeof(off) / sizeof(off[0]); d++)
		for (size_t z = 0; z < sizeof(zetas) / sizeof(zetas[0]); z++) {
			check_against_integration(0.5 * (1.0 + off[d]), zetas[z]);
			check_against_integration(0.5 * (1.0 - off[d]), zetas[z]);
		}
}

/* Undamped at resonance: u'' = (sin x - x cos x)/2, x = omega t. */
static void test_undamped_resonance(void **state)
{
	struct sdof sdof = make(1.0 / 0.006, 0.0, 1.0, 0.003);

	(void)state;
	for (int k = 1; k <= 20; k++) {
		double t = 0.003 * k / 20, x = PI * t / 0.003;

		if (k > 2) /* where sin x - x cos x itself does not cancel */
			check_close("u\"", sdof_motion(&sdof, t).acceleration, (sin(x) - x * cos(x)) / 2,
			            1e-13);
	}
}

/* For an undamped oscillator slower than the pulse the peak is a quarter period after the pulse's middle. */
static void test_undamped_peak_time(void **state)
{
	const double frequencies[] = {1.0, 20.0, 80.0, 121.0, 154.0, 166.0};

	(void)state;
	for (size_t i = 0; i < sizeof(frequencies) / sizeof(frequencies[0]); i++) {
		struct sdof sdof = make(frequencies[i], 0.0, 1.0, 0.003);
		double value, time_s;

		assert_int_equal(sdof_peak(&sdof, &value, &time_s), 0);
		check_close("time", time_s, 0.0015 + 0.25 / frequencies[i], 1e-12);
	}
}

static void test_continuous_at_the_end_of_the_pulse(void **state)
{
	struct sdof sdof = make(129.0, 0.1, 1.0, 0.003);
	double before = nextafter(0.003, 0.0), after = nextafter(0.003, 1.0);

	(void)state;
	check_close("z", sdof_motion(&sdof, after).z, sdof_motion(&sdof, before).z, 1e-13);
	check_close("z'", sdof_motion(&sdof, after).v, sdof_motion(&sdof, before).v, 1e-12);
	check_close("u\"", sdof_motion(&sdof, after).acceleration, sdof_motion(&sdof, before).acceleration,
	            1e-13);
}

/* A very stiff mount carries the base's acceleration, a very soft one passes the momentum on: in the limit
 * u'' = 2 zeta omega dv at once or, undamped, omega dv a quarter period later, dv = 2 a0 T/pi. */
static void test_limits(void **state)
{
	double value, time_s, dv = 2.0 * 0.003 / PI;
	struct sdof sdof = make(1e6, 0.1, 1.0, 0.003);

	(void)state;
	assert_int_equal(sdof_peak(&sdof, &value, &time_s), 0);
	check_close("stiff", value, 1.0, 1e-3);
	check_close("stiff, time", time_s, 0.0015, 0.05);
	sdof = make(0.01, 0.0, 1.0, 0.003);
	assert_int_equal(sdof_peak(&sdof, &value, &time_s), 0);
	check_close("soft", value, 2.0 * PI * 0.01 * dv, 1e-6);
	sdof = make(0.01, 0.9, 1.0, 0.003);
	assert_int_equal(sdof_peak(&sdof, &value, &time_s), 0);
	check_close("soft and damped", value, 2.0 * 0.9 * 2.0 * PI * 0.01 * dv, 1e-3);
	assert_true(time_s <= 0.0031);
}

/* The peak is never below a sample of a fine scan, and is reached by it. */
static void test_peak_against_scan(void **state)
{
	const double cycles[] = {0.05, 0.2, 0.4, 0.7, 1.3, 2.5, 10.0, 40.0},
	             zetas[] = {0.0, 0.03, 0.3, 0.7, 0.99};

	(void)state;
	for (size_t c = 0; c < sizeof(cycles) / sizeof(cycles[0]); c++)
		for (size_t z = 0; z < sizeof(zetas) / sizeof(zetas[0]); z++) {
			struct sdof sdof = make(cycles[c] / 0.003, zetas[z], -1.0, 0.003);
			double span = 0.003 * (1.0 + 1.0 / cycles[c]), value, time_s, largest = 0.0;

			assert_int_equal(sdof_peak(&sdof, &value, &time_s), 0);
			for (int k = 0; k < 20000; k++)
				largest = fmax(largest,
				               fabs(sdof_motion(&sdof, span * k / 20000).acceleration));
			if (!(fabs(value) >= largest * (1 - 1e-14)) || !(fabs(value) <= largest * (1 + 1e-4)))
				fail_msg("f T %g, zeta %g: peak %.15g, scan %.15g", cycles[c], zetas[z],
				         value, largest);
			assert_true(value < 0.0);
		}
}

static void test_refusals(void **state)
{
	struct sdof sdof = make(129.0, 0.1, 1.0, 0.003), before = sdof;
	double value = -1.0, time_s = -1.0;

	(void)state;
	assert_int_equal(sdof_init(&sdof, 129.0, 1.0, 1.0, 0.003), DT_E_ARGUMENT);
	assert_int_equal(sdof_init(&sdof, 129.0, -0.1, 1.0, 0.003), DT_E_ARGUMENT);
	assert_int_equal(sdof_init(&sdof, 0.0, 0.1, 1.0, 0.003), DT_E_ARGUMENT);
	assert_int_equal(sdof_init(&sdof, 129.0, 0.1, 1.0, 0.0), DT_E_ARGUMENT);
	assert_int_equal(sdof_init(&sdof, 129.0, 0.1, (double)NAN, 0.003), DT_E_ARGUMENT);
	assert_int_equal(sdof_init(&sdof, (double)INFINITY, 0.1, 1.0, 0.003), DT_E_ARGUMENT);
	assert_int_equal(sdof_init(&sdof, (double)NAN, 0.1, 1.0, 0.003), DT_E_ARGUMENT);
	assert_memory_equal(&sdof, &before, sizeof(sdof));
	sdof = make(1e9, 0.1, 1.0, 0.003);
	assert_int_equal(sdof_peak(&sdof, &value, &time_s), DT_E_NUMERIC);
	assert_true(value == -1.0 && time_s == -1.0);
	assert_true(sdof_motion(&before, -1.0).acceleration == 0.0);
	assert_true(sdof_motion(&before, (double)NAN).acceleration == 0.0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(test_reference_motion),
	        cmocka_unit_test(test_reference_peaks),
	        cmocka_unit_test(test_against_integration),
	        cmocka_unit_test(test_through_resonance),
	        cmocka_unit_test(test_undamped_resonance),
	        cmocka_unit_test(test_undamped_peak_time),
	        cmocka_unit_test(test_continuous_at_the_end_of_the_pulse),
	        cmocka_unit_test(test_limits),
	        cmocka_unit_test(test_peak_against_scan),
	        cmocka_unit_test(test_refusals),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
