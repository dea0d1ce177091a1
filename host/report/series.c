/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A series gathered from its archive, and the order of its page.
 */
#include "host/report/series.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "host/base/progress.h"
#include "host/record/read.h"
#include "host/report/series_private.h"

/* ---- what the archive has ---- */

/* Texts of the archive are valid during a call: each is copied, and its pointer set to the copy. */
static void series_keep(char to[ARCHIVE_TEXT_MAX + 1], const char **text)
{
	if (!*text)
		return;
	snprintf(to, ARCHIVE_TEXT_MAX + 1, "%s", *text);
	*text = to;
}

static int series_take_series(void *context, const struct archive_series *series)
{
	struct series_page *page = context;
	struct archive_series *s = &page->series;
	const char **texts[] = {&s->name, &s->campaign, &s->scene_name, &s->created, &s->last};

	*s = *series;
	s->scene = "";
	for (size_t i = 0; i < sizeof(texts) / sizeof(texts[0]); i++)
		series_keep(page->text[i], texts[i]);
	return 0;
}

static int series_take_drop(void *context, const struct archive_drop *drop)
{
	struct series_page *page = context;
	struct series_drop *d = calloc(1, sizeof(*d)), **more = page->drop;
	struct archive_drop *a;

	if (d && page->count == page->room) {
		page->room = 2 * page->room + 8;
		more = realloc(page->drop, page->room * sizeof(struct series_drop *));
	}
	if (!d || !more) {
		free(d);
		return DT_E_MEMORY;
	}
	page->drop = more;
	page->drop[page->count++] = d;
	record_init(&d->record);
	a = &d->a;
	*a = *drop;
	a->series = page->series;
	const char **texts[SERIES_TEXTS] = {&a->state,   &a->decision, &a->reason,     &a->operator_name,
	                                    &a->note,    &a->raw,      &a->sha256,     &a->time,
	                                    &a->version, &a->flags,    &a->quantities, &a->verdict};
	for (size_t i = 0; i < SERIES_TEXTS; i++)
		series_keep(d->text[i], texts[i]);
	return 0;
}

/* The log, if it and all that is kept with it are what was recorded. */
static int read_log(struct series_page *page, struct series_drop *drop, const char *name)
{
	struct archive *archive = page->request->archive;
	char message[READ_MESSAGE_MAX];
	struct archive_log log;
	int result;

	if (!drop->a.sha256[0]) {
		snprintf(drop->no_log, sizeof(drop->no_log), "recording was not finished");
		return 0;
	}
	result = archive_open_log(archive, name, &log);
	drop->a.state = "recorded";
	if (result == DT_E_CORRUPT) {
		drop->a.state = "altered"; /* or missing: it counts nowhere */
		snprintf(drop->no_log, sizeof(drop->no_log), "%.300s", archive_message(archive));
		drop->quoted = true;
		return 0;
	}
	if (result)
		return result;
	if (log.fault[0]) {
		drop->a.state = "altered";
		snprintf(drop->no_log, sizeof(drop->no_log), "%.300s", log.fault);
		drop->quoted = true;
	} else if (read_record(&drop->record, log.file, NULL, message) != 0) {
		snprintf(drop->no_log, sizeof(drop->no_log), "%.100s: the raw log cannot be read", log.raw);
		record_init(&drop->record);
	}
	archive_close_log(&log);
	return 0;
}

/* The files that the result was made with, by their digests. */
struct applied {
	size_t count;
	char sha256[SENSORS_MAX][DIGEST_CHARS];
};

static int note_applied(void *context, const struct sensor_used *used)
{
	struct applied *applied = context;

	if (applied->count < SENSORS_MAX)
		snprintf(applied->sha256[applied->count], DIGEST_CHARS, "%s", used->file_sha256);
	applied->count++;
	return 0;
}

static bool still_there(const struct sensors *sensors, const struct applied *applied)
{
	size_t same = 0;

	for (size_t i = 0; i < sensors->count; i++)
		for (size_t k = 0; k < applied->count && k < SENSORS_MAX; k++)
			same += !strcmp(sensors->used[i].file_sha256, applied->sha256[k]);
	return same == applied->count && sensors->count == applied->count;
}

/* The readings as the sensors' files put them right for the result, if the scene's are those. */
static int correct_readings(struct series_page *page, struct series_drop *drop, const char *name)
{
	char message[SETTINGS_MESSAGE_MAX];
	struct applied applied = {0};
	struct sensors sensors;
	struct record corrected;
	int result =
	        archive_each_sensor(page->request->archive, name, drop->a.version, note_applied, &applied);

	if (result != 0 || applied.count == 0 || drop->record.channel_count == 0)
		return result;
	result = sensors_read(&sensors, page->scene.chain, (double)drop->record.time_s / 86400.0, message);
	if (result == 0 && still_there(&sensors, &applied))
		result = sensors_correct(&sensors, &drop->record, &corrected, message);
	else if (result == 0)
		result = DT_E_UNKNOWN;
	if (result == DT_E_MEMORY)
		return result;
	if (result != 0) {
		drop->as_read = true;
		return 0;
	}
	record_free(&drop->record);
	drop->record = corrected;
	return 0;
}

/* What was decided when it was analysed, with the sensors' files of then. */
static int read_verdict(struct series_page *page, struct series_drop *drop, const char *name)
{
	char *json;
	int result;

	if (!page->scene.limits[0] || !series_is_whole(drop))
		return 0;
	result = archive_json(page->request->archive, name, drop->a.version, &json);
	if (result)
		return result;
	drop->said = cJSON_Parse(json);
	free(json);
	drop->judged = verdict_read(&drop->verdict, drop->said);
	return 0;
}

static int read_drop(struct series_page *page, struct series_drop *drop)
{
	struct result said = result_of(&drop->record, &drop->analysis, &drop->options);
	char name[ARCHIVE_NAME_MAX + 16];
	int result;

	snprintf(name, sizeof(name), "%.60s/%u", page->series.name, drop->a.number);
	drop->model_s = (double)NAN;
	result = read_log(page, drop, name);
	drop->counts = archive_counts(&drop->a, page->request->undecided);
	if (drop->counts)
		archive_cell_add(&page->cell, &drop->a);
	if (result || !drop->a.version)
		return result;
	if (drop->counts)
		result = archive_each_sensor(page->request->archive, name, drop->a.version,
		                             series_take_sensor, &(struct series_drop_of_page){page, drop});
	if (result)
		return result;
	result = archive_analysis(page->request->archive, name, drop->a.version, &said);
	if (result == DT_E_FORMAT && !drop->no_log[0])
		snprintf(drop->no_log, sizeof(drop->no_log), "the result by %s is no analysis",
		         drop->a.version);
	if (result)
		return result == DT_E_FORMAT ? 0 : result;
	drop->has_result = true;
	result = read_verdict(page, drop, name);
	if (result == 0)
		result = correct_readings(page, drop, name);
	if (result)
		return result;
	drop->report = (struct report){.record = &drop->record, .analysis = &drop->analysis};
	drop->zero = report_zero(&drop->report);
	for (size_t i = 0; i < drop->analysis.resultant_count && page->has_model; i++)
		if (!strcmp(drop->analysis.resultants[i].sensor, "S2"))
			drop->model_s = drop->analysis.resultants[i].time_s - drop->zero.time_s -
			                page->prediction.resultant[1].time_s;
	return 0;
}

/* ---- what all pictures share ---- */

static void set_window(struct series_page *page)
{
	double width_s = 0.0, before_s = 0.0, after_s = 0.0;

	for (size_t i = 0; i < page->count; i++) {
		const struct series_drop *d = page->drop[i];
		struct script_window whole = script_whole(&d->record);

		if (!series_is_drawn(d))
			continue;
		width_s = fmax(width_s, d->zero.width_s);
		before_s = fmax(before_s, d->zero.time_s - whole.from_s);
		after_s = fmax(after_s, whole.to_s - d->zero.time_s);
	}
	if (!(width_s > 0.0))
		width_s = 0.003;
	page->window.from_s = -fmin(before_s, 1.5 * width_s);
	page->window.to_s = fmin(after_s, 6.5 * width_s);
}

/* A drop's first touch is where its S2 says, some tenths of a ms before zero: the curve begins earlier. */
static int solve_model(struct series_page *page)
{
	struct script_window *w = &page->curve;
	int result = model_solve(&page->scene, MODEL_AUTO, NULL, &page->prediction, NULL);

	page->has_model = result == 0;
	if (page->has_model)
		result = model_below(&page->scene, &page->prediction, &page->below);
	page->has_below = page->has_model && result == 0;
	*w = (struct script_window){-0.005, 0.025};
	return result == DT_E_MEMORY ? result : 0; /* else there is none for this scene */
}

static int draw_model(struct series_page *page)
{
	struct script_window *w = &page->curve;
	double first_s = 0.0, last_s = 0.0;
	int result = 0;

	for (size_t i = 0; i < page->count; i++) {
		first_s = fmax(first_s, page->drop[i]->model_s);
		last_s = fmin(last_s, page->drop[i]->model_s);
	}
	w->from_s = page->window.from_s - first_s;
	w->to_s = page->window.to_s - last_s;
	if (page->has_model)
		result = model_histories(&page->scene, page->prediction.rung, NULL, w->from_s,
		                         (w->to_s - w->from_s) / (SCRIPT_CURVE_POINTS - 1), page->curve_g,
		                         SCRIPT_CURVE_POINTS, NULL);
	page->has_model = page->has_model && result == 0;
	return result == DT_E_MEMORY ? result : 0;
}

/* A trace that a reader of the page will miss. */
static bool tell_lacking(const struct series_page *page, const struct series_drop *drop)
{
	const struct series_report *request = page->request;
	char text[420], name[ARCHIVE_NAME_MAX + 16];

	if (series_is_whole(drop) || !drop->a.sha256[0] || (!drop->no_log[0] && !drop->counts))
		return false;
	snprintf(name, sizeof(name), "%.60s/%u", page->series.name, drop->a.number);
	if (drop->no_log[0] && !strncmp(drop->no_log, name, strlen(name)))
		snprintf(text, sizeof(text), "%s", drop->no_log);
	else
		snprintf(text, sizeof(text), "%s: %s", name,
		         drop->no_log[0] ? drop->no_log : "no result, so no trace");
	if (request->lacking)
		request->lacking(request->context, text);
	return true;
}

static int tell_all_lacking(struct series_page *page)
{
	const struct series_report *request = page->request;
	int rest =
	        archive_verify_series(request->archive, request->series, request->lacking, request->context);
	size_t count = 0;

	if (rest < 0)
		return rest;
	for (size_t i = 0; i < page->count; i++)
		count += tell_lacking(page, page->drop[i]);
	if ((!count && !rest) || request->partial)
		return 0;
	if (!count)
		snprintf(page->page.message, page->page.size,
		         "%s: its sidecar is not what was recorded; --partial makes it all the same",
		         page->series.name);
	else
		snprintf(page->page.message, page->page.size,
		         "%s: %zu of %zu drops lack what a report rests on; --partial makes it all the same",
		         page->series.name, count, page->count);
	return DT_E_CORRUPT;
}

static int series_gather(struct series_page *page)
{
	struct archive *archive = page->request->archive;
	struct archive_filter filter = archive_filter_none();
	struct progress progress;
	int result = archive_scene(archive, page->request->series, &page->scene);

	filter.series = page->request->series;
	if (result == 0)
		result = archive_each_series(archive, &filter, series_take_series, page);
	if (result == 0)
		result = archive_each_drop(archive, &filter, series_take_drop, page);
	if (result == 0)
		result = archive_seal(archive, &page->seal);
	if (result == 0)
		result = solve_model(page);
	progress_begin(&progress, 2.0);
	for (size_t i = 0; i < page->count && result == 0; i++) {
		progress_tell(&progress, (double)i / (double)page->count, "%zu of %zu drops read", i,
		              page->count);
		result = read_drop(page, page->drop[i]);
	}
	progress_end(&progress);
	if (result == 0)
		result = series_check_sensors(page);
	archive_cell_close(&page->cell);
	if (result != 0)
		snprintf(page->page.message, page->page.size, "%s",
		         result == DT_E_MEMORY || !archive_message(archive)[0] ? error_text(result)
		                                                               : archive_message(archive));
	if (result == 0)
		result = tell_all_lacking(page);
	if (result == 0 && page->request->strict && (series_is_overdue(page) || series_is_suspect(page))) {
		snprintf(page->page.message, page->page.size,
		         "%s: a sensor's calibration was overdue at a drop%s, and --strict was asked for",
		         page->series.name,
		         series_is_suspect(page) ? ", or it failed its check before or after" : "");
		result = DT_E_STATE;
	}
	if (result != 0)
		return result;
	set_window(page);
	result = draw_model(page);
	if (result != 0)
		snprintf(page->page.message, page->page.size, "%s", error_text(result));
	return result;
}

static void series_release(struct series_page *page)
{
	for (size_t i = 0; i < page->count; i++) {
		free(page->drop[i]->analysis.channels);
		cJSON_Delete(page->drop[i]->said);
		record_free(&page->drop[i]->record);
		free(page->drop[i]);
	}
	free(page->drop);
	free(page);
}

bool series_is_whole(const struct series_drop *drop)
{
	return drop->has_result && !drop->no_log[0];
}

bool series_is_drawn(const struct series_drop *drop)
{
	return series_is_whole(drop) && !drop->as_read;
}

size_t series_counted(const struct series_page *page)
{
	size_t counted = 0;

	for (size_t i = 0; i < page->count; i++)
		counted += page->drop[i]->counts;
	return counted;
}

static void series_write_page(struct series_page *page)
{
	series_head(page);
	series_laboratory(page);
	series_limits(page);
	series_subject(page);
	series_results(page);
	series_remarks(page);
	series_pictures(page);
	series_excluded(page);
	series_model(page);
	series_records(page);
	if (page->request->laboratory)
		fputs("<p><b>End of the report.</b></p>\n", page->page.out);
	page_end(page->page.out, page->request->version);
	series_evidence(page);
}

static int series_make_page(struct series_page *page, FILE *out)
{
	int result = page_open(&page->page, out);

	if (result != 0)
		return result;
	series_write_page(page);
	result = page_close(&page->page);
	if (result != 0)
		return result;
	if (fflush(out) == 0 && !ferror(out))
		return 0;
	snprintf(page->page.message, page->page.size, "the report cannot be written");
	return DT_E_SYSTEM;
}

int series_report_html(const struct series_report *request, FILE *out, char *message, size_t size)
{
	struct series_page *page = calloc(1, sizeof(*page));
	int result;

	snprintf(message, size, "%s", error_text(DT_E_MEMORY));
	if (!page)
		return DT_E_MEMORY;
	page->request = request;
	page->page = (struct page){.translation = request->translation, .message = message, .size = size};
	result = series_gather(page);
	if (result == 0)
		result = series_make_page(page, out);
	series_release(page);
	return result;
}
