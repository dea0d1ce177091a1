/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <ctype.h>
#include <math.h>
#include <string.h>

#include "host/chart/chart.h"
#include "host/model/model.h"

/* The record after the impact holds at least so many cycles of the plate, or so long. */
#define CYCLES 6
#define AFTER_S 50e-3

static int drop_of_scene_refuse(const struct scene *scene, char *message, const char *why)
{
	snprintf(message, CHART_MESSAGE_MAX, "%s: %s", scene->name, why);
	return DT_E_ARGUMENT;
}

/* The name is not ours, and titles become part of a gnuplot script: what might mean something there is _. */
static void clean_name(const struct scene *scene, char name[sizeof(scene->name)])
{
	size_t i = 0;

	for (; scene->name[i]; i++) {
		bool plain = isalnum((unsigned char)scene->name[i]) || strchr("-_. ", scene->name[i]);

		name[i] = (char)(plain ? scene->name[i] : '_');
	}
	name[i] = '\0';
}

static bool drop_of_scene_predicted(const struct model_prediction *p)
{
	double sum = p->contact_time_s;

	for (int i = 0; i < MODEL_AXES; i++)
		sum += p->peak[i].value_g;
	return isfinite(p->has_plate ? sum + p->lag_s + p->plate_frequency_hz + p->plate_damping_ratio : sum);
}

static void drop_of_scene_take(const struct scene *scene, const struct model_prediction *p,
                               struct synthetic_scene *drop)
{
	for (int i = 0; i < 2; i++) {
		drop->peak_g[i] = fabs(p->peak[MODEL_S2X + i].value_g);
		drop->plate_g[i] = fabs(p->peak[MODEL_S1X + i].value_g);
	}
	drop->contact_s = p->contact_time_s;
	drop->noise_g = scene->sensor_noise_g;
	drop->clip_g = scene->sensor_range_g;
	drop->z_part = scene->sensor_s2_z_ratio;
	if (p->has_plate) {
		drop->interval_s = p->lag_s;
		drop->damped_hz = p->plate_frequency_hz;
		drop->damping = p->plate_damping_ratio;
	}
	drop->post_s = fmax(drop->post_s,
	                    drop->contact_s + drop->interval_s + fmax(AFTER_S, CYCLES / drop->damped_hz));
}

int chart_drop(const struct scene *scene, struct chart_options *options, char *message)
{
	struct synthetic_scene *drop = &options->drop;
	struct model_prediction p;
	char plate[40] = "no plate", name[sizeof(scene->name)] = "";
	int status;

	*drop = synthetic_scene();
	options->no_plate = false;
	if (scene) {
		status = model_solve(scene, MODEL_AUTO, NULL, &p, message);
		if (status)
			return status;
		if (!drop_of_scene_predicted(&p) || (p.has_plate && !(p.plate_damping_ratio < 1)))
			return drop_of_scene_refuse(scene, message,
			                            "its peaks, lag or ring-down cannot be predicted");
		if (!(scene->sensor_noise_g > 0))
			return drop_of_scene_refuse(scene, message,
			                            "noise_g is 0: there is no bound without noise");
		options->no_plate = !p.has_plate;
		drop_of_scene_take(scene, &p, drop);
		clean_name(scene, name);
	}
	if (!options->no_plate)
		snprintf(plate, sizeof(plate), "plate of %.0f Hz", drop->damped_hz);
	snprintf(options->about, sizeof(options->about), "%s%shalf-sine of %.0f g, %.3g ms, %g kHz, %s", name,
	         scene ? ": " : "", drop->peak_g[0], 1e3 * drop->contact_s, 1e-3 * drop->rate_hz[0], plate);
	return 0;
}
