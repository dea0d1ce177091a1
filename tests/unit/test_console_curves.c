/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * What the page draws of a drop: trace, model and spectra.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "common/units.h"
#include "host/console/work.h"
#include "host/model/model.h"
#include "tests/unit/desk.h"
#include "tests/unit/near.h"

static size_t largest(const struct desk_curve *c)
{
	size_t best = 0;

	for (size_t k = 1; k < c->count; k++)
		if (c->value[k] > c->value[best])
			best = k;
	return best;
}

static double time_of(const struct desk_curve *c, size_t k)
{
	return c->start_s + (double)k / c->rate_hz;
}

/* Samples come exactly; 0 is where a half-sine crosses a tenth of itself. */
static void test_a_trace_is_the_log(void **state)
{
	const double tenth_s = DESK_PULSE_S * asin(0.1) / M_PI;
	struct desk_curves c;
	struct desk_curve x, r;

	(void)state;
	desk_start_with_drops();
	c = desk_ask_curves(work_trace, "one/1");
	assert_string_equal(desk_text(c.head, "zero"), "S2X leaves 10 % of its peak");
	assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(c.head, "channels")), 8);
	for (unsigned sensor = 1; sensor <= 2; sensor++)
		for (int axis = 0; axis < 3; axis++)
			desk_check_samples(&c, sensor, axis, DESK_TICKS);
	x = desk_curve(&c, "S2X");
	assert_near(x.start_s, -DESK_TRIGGER_S - tenth_s, 5e-5);
	r = desk_curve(&c, "S2R");
	assert_near(r.rate_hz, 10000, 0);
	assert_near((double)r.value[largest(&r)], hypot(DESK_S2X_G, DESK_S2Y_G), 2.5);
	assert_near(time_of(&r, largest(&r)), DESK_PULSE_S / 2 - tenth_s, 2e-4);
	assert_true(isnan(r.value[r.count - 1])); /* X ends before Y */
	free(x.value);
	free(r.value);
	desk_free_curves(&c);
	c = desk_ask_curves(work_trace, "one/2");
	desk_check_samples(&c, 1, 0, DESK_TICKS);
	desk_check_samples(&c, 2, 0, 200);
	desk_check_samples(&c, 2, 1, 200);
	desk_free_curves(&c);
}

static void test_the_model_lies_on_the_trace(void **state)
{
	static const char *const names[] = {"S1X", "S1Y", "S2X", "S2Y", "S1R", "S2R"};
	struct model_prediction prediction;
	struct scene scene;
	struct desk_curves c, t;
	struct desk_curve model, trace;

	(void)state;
	desk_start_with_drops();
	assert_int_equal(scene_read(&scene, DESK_SCENE, desk_message), 0);
	scene.drop_angle_deg = 27;
	assert_int_equal(model_solve(&scene, MODEL_AUTO, NULL, &prediction, NULL), 0);
	c = desk_ask_curves(work_model, "one/1");
	t = desk_ask_curves(work_trace, "one/1");
	assert_string_equal(desk_text(c.head, "zero"), desk_text(t.head, "zero"));
	assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(c.head, "channels")), 6);
	trace = desk_curve(&t, "S2R");
	for (size_t i = 0; i < 6; i++) {
		model = desk_curve(&c, names[i]);
		assert_int_equal(model.count, trace.count);
		assert_near(model.start_s, trace.start_s, 1e-9);
		assert_near(model.rate_hz, trace.rate_hz, 0);
		assert_true(model.value[0] == 0.0f); /* falls freely */
		free(model.value);
	}
	model = desk_curve(&c, "S2R");
	assert_near(time_of(&model, largest(&model)), time_of(&trace, largest(&trace)), 2.5e-4);
	assert_near((double)model.value[largest(&model)], prediction.resultant[1].value_g,
	            0.005 * prediction.resultant[1].value_g);
	free(model.value);
	model = desk_curve(&c, "S1R");
	assert_near((double)model.value[largest(&model)], prediction.resultant[0].value_g,
	            0.005 * prediction.resultant[0].value_g);
	free(model.value);
	free(trace.value);
	desk_free_curves(&c);
	desk_free_curves(&t);
}

static double spectrum_at(const cJSON *tree, const char *channel, int i)
{
	const cJSON *item;

	cJSON_ArrayForEach(
	        item,
	        cJSON_GetObjectItem(
	                tree,
	                "channels")) if (strcmp(desk_text(item, "name"), channel) ==
	                                 0) return cJSON_GetArrayItem(cJSON_GetObjectItem(item, "value"), i)
	        ->valuedouble;
	fail_msg("no channel %s", channel);
	return 0;
}

static void test_spectra(void **state)
{
	static const char *const kinds[] = {"kind=absolute-acceleration", "kind=pseudo-velocity",
	                                    "kind=relative-displacement"};
	static const char *const units[] = {"g", "m/s", "m"};
	cJSON *tree[3], *frequency;
	int count;

	(void)state;
	desk_start_with_drops();
	for (int i = 0; i < 3; i++) {
		tree[i] = desk_ask_json(work_spectrum, "one/1", kinds[i], NULL);
		assert_string_equal(desk_text(tree[i], "kind"), kinds[i] + 5);
		assert_string_equal(desk_text(tree[i], "unit"), units[i]);
		assert_near(desk_number(tree[i], "q"), 10, 1e-12);
		assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(tree[i], "channels")), 6);
	}
	frequency = cJSON_GetObjectItem(tree[0], "frequency_hz");
	count = cJSON_GetArraySize(frequency);
	for (int i = 0; i + 1 < count; i++) {
		double f = cJSON_GetArrayItem(frequency, i)->valuedouble, w = 2 * M_PI * f;
		double g = spectrum_at(tree[0], "S2X", i), v = spectrum_at(tree[1], "S2X", i);

		assert_near(cJSON_GetArrayItem(frequency, i + 1)->valuedouble / f, pow(2, 1.0 / 12), 1e-9);
		assert_near(w * spectrum_at(tree[2], "S2X", i), v, 1e-9 * v);
		assert_near(w * v / UNITS_G_M_S2, g, 0.03 * g); /* but for the damper's force */
	}
	/* slow: the velocity change, 2 A T/pi; of a half-sine 1.65 A at most with this damping */
	assert_near(spectrum_at(tree[1], "S2X", 0), 2 * DESK_S2X_G * UNITS_G_M_S2 * DESK_PULSE_S / M_PI, 0.7);
	assert_in_range(spectrum_at(tree[0], "S2X", count - 20), DESK_S2X_G, 1.7 * DESK_S2X_G);
	for (int i = 0; i < 3; i++)
		cJSON_Delete(tree[i]);
	desk_expect(400, work_spectrum, "one/1", "kind=loudness", NULL);
}

static void test_names_that_are_none(void **state)
{
	static void (*const runs[])(struct job *) = {work_trace, work_model, work_spectrum, work_result};
	static const struct {
		const char *name;
		int status;
	} wrong[] = {{"one/4", 404},    {"two/1", 404},    {"one", 400},
	             {"one/x", 400},    {"", 400},         {"../../etc/1", 404},
	             {"one/-1", 400},   {"one/1/..", 400}, {"one/99999999999", 400},
	             {"one/1%2f", 400}, {"/1", 404}};

	(void)state;
	desk_start_with_drops();
	for (size_t i = 0; i < 4; i++)
		for (size_t k = 0; k < sizeof(wrong) / sizeof(wrong[0]); k++)
			desk_expect(wrong[k].status, runs[i], wrong[k].name, NULL, NULL);
	for (size_t i = 0; i < 3; i++)
		desk_expect(409, runs[i], "one/3", NULL, NULL);
	desk_expect(404, work_result, "one/1", NULL, NULL); /* nobody analysed it */
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        AT_THE_DESK(test_a_trace_is_the_log),
	        AT_THE_DESK(test_the_model_lies_on_the_trace),
	        AT_THE_DESK(test_spectra),
	        AT_THE_DESK(test_names_that_are_none),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
