/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Setting up: which scenes there are, which series were made of them, a new one, and the scene of a series on
 * its way to the tower.
 */
#include <cjson/cJSON.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/result/plan.h"
#include "host/console/work_private.h"
#include "host/base/put.h"

enum { PRESETS_MAX = 20, PLANNED_MAX = 1000 };

/* ---- at the start ---- */

int work_open_scenes(struct work *work, char message[ARCHIVE_MESSAGE_MAX])
{
	size_t count = 0;

	while (work->options.scenes[count] != NULL)
		count++;
	work->scene = calloc(count + 1, sizeof(*work->scene));
	if (work->scene == NULL) {
		snprintf(message, ARCHIVE_MESSAGE_MAX, "%s", error_text(DT_E_MEMORY));
		return DT_E_MEMORY;
	}
	for (; work->scenes < count; work->scenes++) {
		struct work_scene_file *s = &work->scene[work->scenes];
		struct plan plan;
		int result;

		s->file = work->options.scenes[work->scenes];
		result = scene_read(&s->scene, s->file, message);
		if (result == 0)
			result = plan_read(&plan, s->scene.limits, s->file, message);
		if (result != 0)
			return result;
	}
	return 0;
}

/* ---- what can be chosen ---- */

static const struct work_scene_file *find_scene(const struct work *work, const char *name)
{
	for (size_t i = 0; i < work->scenes; i++)
		if (strcmp(work->scene[i].scene.name, name) == 0)
			return &work->scene[i];
	return NULL;
}

struct preset {
	char series[ARCHIVE_NAME_MAX + 1], campaign[ARCHIVE_NAME_MAX + 1], scene[64], created[32];
	double angle_deg, height_m;
	unsigned planned;
};

/* The newest, each combination once, newest first. */
struct presets {
	const struct work *work;
	struct preset preset[PRESETS_MAX];
	size_t count;
};

static bool same_choice(const struct preset *p, const struct archive_series *s)
{
	return p->planned == s->planned && fabs(p->angle_deg - s->angle_deg) < 1e-9 &&
	       fabs(p->height_m - s->height_m) < 1e-9 && strcmp(p->campaign, s->campaign) == 0 &&
	       strcmp(p->scene, s->scene_name) == 0;
}

static int add_preset(void *context, const struct archive_series *series)
{
	struct presets *all = context;
	struct preset *p = all->preset;
	size_t same = 0, place = 0;

	if (find_scene(all->work, series->scene_name) == NULL)
		return 0;
	while (same < all->count && !same_choice(&p[same], series))
		same++;
	if (same < all->count && strcmp(p[same].created, series->created) > 0)
		return 0;
	while (place < all->count && strcmp(p[place].created, series->created) > 0)
		place++;
	if (place == PRESETS_MAX)
		return 0;
	if (same == PRESETS_MAX)
		same = PRESETS_MAX - 1; /* the oldest goes */
	else if (same == all->count)
		all->count++;
	memmove(&p[place + 1], &p[place], (same - place) * sizeof(*p));
	p[place] = (struct preset){
	        .angle_deg = series->angle_deg, .height_m = series->height_m, .planned = series->planned};
	snprintf(p[place].series, sizeof(p->series), "%s", series->name);
	snprintf(p[place].campaign, sizeof(p->campaign), "%s", series->campaign);
	snprintf(p[place].scene, sizeof(p->scene), "%s", series->scene_name);
	snprintf(p[place].created, sizeof(p->created), "%s", series->created);
	return 0;
}

static void put_scenes(struct builder *b, cJSON *array, const struct work *work)
{
	for (size_t i = 0; i < work->scenes; i++) {
		const struct scene *s = &work->scene[i].scene;
		cJSON *item = put_append(b, array);

		put_text(b, item, "name", s->name);
		put_text(b, item, "title", s->title);
		put_number(b, item, "angle_deg", s->drop_angle_deg);
		put_number(b, item, "height_m", s->drop_height_m);
		put_number(b, item, "plate_mass_kg", s->mount_plate_mass_kg);
	}
}

static void put_presets(struct builder *b, cJSON *array, const struct presets *presets)
{
	for (size_t i = 0; i < presets->count; i++) {
		const struct preset *p = &presets->preset[i];
		cJSON *item = put_append(b, array);

		put_text(b, item, "series", p->series);
		put_text(b, item, "scene", p->scene);
		put_text(b, item, "campaign", p->campaign);
		put_number(b, item, "angle_deg", p->angle_deg);
		put_number(b, item, "height_m", p->height_m);
		put_number(b, item, "planned", p->planned);
	}
}

void work_setup(struct job *job)
{
	struct archive_filter filter = archive_filter_none();
	const struct work *work = job->console->work;
	struct presets presets = {.work = work};
	struct builder b = {false};
	cJSON *root;
	int result = archive_each_series(work->archive, &filter, add_preset, &presets);

	if (result != 0) {
		work_refuse(job, result);
		return;
	}
	root = cJSON_CreateObject();
	put_scenes(&b, put_array(&b, root, "scenes"), work);
	put_presets(&b, put_array(&b, root, "presets"), &presets);
	put_text(&b, root, "operator", work->options.operator_name);
	job_answer_json(job, root);
	job_done(job);
}

/* ---- a new series ---- */

struct wanted {
	const char *name, *campaign, *scene;
	double angle_deg, height_m, planned;
};

/* A number that may be left out: then it is NAN. */
static bool optional_number(struct job *job, const char *key, double min, double max, double *value)
{
	*value = NAN;
	return cJSON_GetObjectItemCaseSensitive(job->body, key) == NULL ||
	       job_number(job, key, min, max, NAN, value);
}

static bool read_wanted(struct job *job, struct wanted *w)
{
	w->name = job_text(job, "name", NULL);
	w->campaign = w->name != NULL ? job_text(job, "campaign", "default") : NULL;
	w->scene = w->campaign != NULL ? job_text(job, "scene", NULL) : NULL;
	if (w->scene == NULL || !optional_number(job, "angle_deg", 0, 90, &w->angle_deg) ||
	    !optional_number(job, "height_m", 0, 100, &w->height_m) ||
	    !job_number(job, "planned", 1, PLANNED_MAX, 5, &w->planned))
		return false;
	if (!(fabs(w->planned - floor(w->planned)) > 0))
		return true;
	job_refuse(job, 400, "\"planned\": expected a whole number");
	return false;
}

void work_new_series(struct job *job)
{
	struct work *work = job->console->work;
	const struct work_scene_file *scene;
	struct wanted wanted;
	cJSON *root;
	int result;

	if (!read_wanted(job, &wanted)) {
		job_done(job);
		return;
	}
	scene = find_scene(work, wanted.scene);
	if (scene == NULL) {
		job_refuse(job, 400, "no scene '%.60s'", wanted.scene);
		job_done(job);
		return;
	}
	result = archive_new_series(work->archive, wanted.name, wanted.campaign, scene->file,
	                            wanted.angle_deg, wanted.height_m, NULL, (unsigned)wanted.planned);
	if (result != 0) {
		work_refuse(job, result);
		return;
	}
	work_changed(work);
	root = cJSON_CreateObject();
	cJSON_AddStringToObject(root, "series", wanted.name);
	job_answer_json(job, root);
	job_done(job);
}

/* ---- the scene of a series ---- */

static int copy_text(void *context, const struct archive_series *series)
{
	char **text = context;

	*text = strdup(series->scene);
	return *text != NULL ? 0 : DT_E_MEMORY;
}

void work_setup_scene(struct job *job)
{
	struct work *work = job->console->work;
	struct archive_filter filter = archive_filter_none();
	struct handover_scene *wanted = job->payload;
	int result = archive_scene(work->archive, wanted->series, &wanted->scene);

	wanted->text = NULL;
	filter.series = wanted->series;
	if (result == 0)
		result = archive_each_series(work->archive, &filter, copy_text, &wanted->text);
	job->message = JOB_RUN;
	if (result == 0 && job_put(&job->console->tower_queue, job) == 0)
		return;
	free(wanted->text);
	free(wanted);
	if (result != 0) {
		work_refuse(job, result);
		return;
	}
	job_refuse(job, 503, "the tower's thread takes nothing more");
	job_done(job);
}
