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
	             zetas[] = {0.0, 1e-8, 0.01, 0.1, 0.4, 0.99, 1.0, 1.5, 4.0};

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

/* z, z' and u" at t = 2/3 T of a pulse of 3 ms, r = omega T/pi: 50-digit divided differences. */
static const struct {
	double zeta, r, z, v, acceleration;
} corner[] = {
        {0, 1, -8.7232506466666374e-7, -0.00086602540378443865, 0.9566114774905182},
        {0, 1.00000000000001, -8.7232506466665931e-7, -0.00086602540378442909, 0.95661147749053247},
        {1e-12, 1, -8.7232506466575024e-7, -0.000866025403783075, 0.95661147749133023},
        {1e-12, 1.00000000000001, -8.7232506466574582e-7, -0.00086602540378306544, 0.9566114774913445},
        {0.1, 1.00000000000001, -7.8829518703762141e-7, -0.00074421058525354553, 1.0203295057508907},
        {0.9, 1, -4.2601003138417295e-7, -0.0003132111711640998, 1.0575614242394402},
        {1 - 1e-6, 1, -4.0171468534413526e-7, -0.00029035217299235807, 1.0486410083561035},
        {1 - 1e-6, 1.3, -3.0729845712518055e-7, -0.00018213761446822256, 1.0654219596914293},
        {1 - 1e-8, 1, -4.0171445786972776e-7, -0.0002903519626211709, 1.0486409203331697},
        {1 - 1e-8, 1.3, -3.0729827658182222e-7, -0.00018213749691727068, 1.065421795983703},
        {1 - 1e-12, 1, -4.0171445557223748e-7, -0.00029035196049642339, 1.0486409194441381},
        {1 - 1e-12, 1.00000000000001, -4.0171445557223377e-7, -0.00029035196049641887, 1.0486409194441395},
        {1 - 1e-12, 1.3, -3.0729827475833537e-7, -0.00018213749573000692, 1.0654217943302561},
        {1, 1, -4.0171445557200771e-7, -0.0002903519604962109, 1.0486409194440492},
        {1, 1.3, -3.07298274758153e-7, -0.00018213749572988819, 1.0654217943300907},
        {1 + 1e-12, 1, -4.0171445557177792e-7, -0.00029035196049599839, 1.0486409194439603},
        {1 + 1e-12, 1.3, -3.0729827475797062e-7, -0.00018213749572976944, 1.0654217943299253},
        {1 + 1e-8, 1, -4.0171445327428771e-7, -0.00029035195837125096, 1.0486409185549288},
        {1.1, 1, -3.7992767142944469e-7, -0.00027051461358089846, 1.0398582431056592},
        {3, 1, -1.8531295135314792e-7, -0.00011819038912851721, 0.94583050756145801},
        {3, 1.3, -1.4092657692695988e-7, -8.2535103935080667e-5, 0.93533650952045289},
};

/* Resonance, no damping, critical damping and all of them at once: no digit is lost. */
static void test_where_the_rates_meet(void **state)
{
	(void)state;
	for (size_t i = 0; i < sizeof(corner) / sizeof(corner[0]); i++) {
		struct sdof sdof = make(corner[i].r / 0.006, corner[i].zeta, 1.0, 0.003);
		struct sdof_motion m = sdof_motion(&sdof, 0.002);

		check_close("z", m.z, corner[i].z, 2e-15);
		check_close("z'", m.v, corner[i].v, 5e-15);
		check_close("u\"", m.acceleration, corner[i].acceleration, 2e-15);
	}
}

/* The peak goes smoothly through critical damping: its slope over zeta, -0.0642, is that of a wider step. */
static void test_peak_through_critical_damping(void **state)
{
	double value, time_s, base, at_base;
	struct sdof sdof = make(1.0 / 0.006, 1.0, 1.0, 0.003);

	(void)state;
	assert_int_equal(sdof_peak(&sdof, &base, &at_base), 0);
	for (double off = 1e-14; off < 1e-3; off *= 10.0)
		for (int side = -1; side <= 1; side += 2) {
			sdof = make(1.0 / 0.006, 1.0 + side * off, 1.0, 0.003);
			assert_int_equal(sdof_peak(&sdof, &value, &time_s), 0);
			if (!(fabs(value - (base - 0.0651 * side * off)) < 2e-3 * off + 1e-15) ||
			    !(fabs(time_s / at_base - 1.0) < 0.3 * off + 1e-13))
				fail_msg("zeta 1 %+g: %.16g at %.16g, at 1: %.16g at %.16g", side * off,
				         value, time_s, base, at_base);
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
	             zetas[] = {0.0, 0.03, 0.3, 0.7, 0.99, 1.0, 1.01, 3.0};

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

/* Two extremes of the same height: whichever is larger by a hair is the peak. */
static void test_rivals(void **state)
{
	double low = 0.0, high = 0.0, value, time_s, before = 0.0;

	(void)state;
	for (double cycles = 1.2; cycles < 4.0 && high == 0.0; cycles += 0.01) {
		struct sdof sdof = make(cycles / 0.003, 0.01, 1.0, 0.003);

		assert_int_equal(sdof_peak(&sdof, &value, &time_s), 0);
		if (before > 0.0 && fabs(time_s - before) > 0.0003) {
			low = cycles - 0.01;
			high = cycles;
		}
		before = time_s;
	}
	assert_true(high > 0.0);
	for (int k = 0; k <= 2000; k++) {
		double cycles = low + (high - low) * k / 2000;
		struct sdof sdof = make(cycles / 0.003, 0.01, 1.0, 0.003);
		double left = 0.0;

		assert_int_equal(sdof_peak(&sdof, &value, &time_s), 0);
		for (int i = 1; i < 600; i++)
			left = fmax(left, fabs(sdof_motion(&sdof, 0.003 * i / 600).acceleration));
		assert_true(fabs(value) >= left && fabs(value) < left * (1 + 2e-4));
		if (k > 0 && !(fabs(value - before) < 3e-6))
			fail_msg("peak %.12g after %.12g at %.9g cycles", value, before, cycles);
		before = value;
	}
}

/* Left to itself the mass turns round where its speed is zero, and nowhere further out. */
static void test_turning_round(void **state)
{
	const double zetas[] = {0.0, 0.3, 0.99, 1 - 1e-9, 1.0, 1 + 1e-9, 1.01, 2.0, 20.0};

	(void)state;
	for (size_t i = 0; i < sizeof(zetas) / sizeof(zetas[0]); i++)
		for (double v0 = -300.0; v0 < 310.0; v0 += 50.0) {
			struct oscillator o;
			double z = 0.7, v = v0, far = 0.7, at;

			assert_int_equal(oscillator_init(&o, 200.0, zetas[i]), 0);
			at = oscillator_turn(&o, z, v);
			for (int k = 0; k < 2000; k++) {
				double z1 = 0.7, v1 = v0;

				oscillator_move(&o, 0.06 * k / 2000, &z1, &v1);
				far = fmax(far, fabs(z1));
			}
			oscillator_move(&o, at, &z, &v);
			assert_true(at >= 0.0);
			if (at > 0.0 && !(fabs(v) < 1e-9))
				fail_msg("zeta %.12g from %g: speed %g at %g", zetas[i], v0, v, at);
			if (v0 > 0.0 && !(at > 0.0 && z >= far * (1 - 1e-12) && z < far * (1 + 1e-3)))
				fail_msg("zeta %.12g from %g: turns at %.12g, reaches %.12g", zetas[i], v0, z,
				         far);
		}
}

static void test_refusals(void **state)
{
	struct sdof sdof = make(129.0, 0.1, 1.0, 0.003), before = sdof;
	double value = -1.0, time_s = -1.0;

	(void)state;
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
	        cmocka_unit_test(test_where_the_rates_meet),
	        cmocka_unit_test(test_peak_through_critical_damping),
	        cmocka_unit_test(test_undamped_peak_time),
	        cmocka_unit_test(test_continuous_at_the_end_of_the_pulse),
	        cmocka_unit_test(test_limits),
	        cmocka_unit_test(test_peak_against_scan),
	        cmocka_unit_test(test_rivals),
	        cmocka_unit_test(test_turning_round),
	        cmocka_unit_test(test_refusals),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
