/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The JSON of an analysis, back to what pictures and remarks need of it. What it does not say is NAN.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "host/report/series_private.h"

static const cJSON *at(const cJSON *object, const char *key)
{
	return cJSON_GetObjectItemCaseSensitive(object, key);
}

/* NAN when it is no number. */
static double number(const cJSON *object, const char *key)
{
	return cJSON_GetNumberValue(at(object, key));
}

static const char *text(const cJSON *object, const char *key)
{
	const char *string = cJSON_GetStringValue(at(object, key));

	return string ? string : "";
}

/* A count of milliseconds or the like; 0 when it is none. */
static uint32_t whole(const cJSON *object, const char *key)
{
	double value = number(object, key);

	return value >= 0.0 && value <= UINT32_MAX ? (uint32_t)value : 0;
}

static unsigned flags(const cJSON *object, const char *(*name)(unsigned flags))
{
	const cJSON *item;
	unsigned all = 0;

	cJSON_ArrayForEach(item, at(object, "flags"))
	{
		for (unsigned bit = 1; bit && cJSON_IsString(item) && name(bit)[0]; bit <<= 1)
			if (!strcmp(name(bit), item->valuestring))
				all |= bit;
	}
	return all;
}

static enum estimate_status status(const cJSON *object)
{
	for (enum estimate_status s = ESTIMATE_OK; s <= ESTIMATE_NOT_CONVERGED; s++)
		if (!strcmp(estimate_status_name(s), text(object, "status")))
			return s;
	return ESTIMATE_NO_PEAK;
}

static struct estimate_how how(const cJSON *object)
{
	return (struct estimate_how){.method = "",
	                             .chi_square = number(object, "chi_square"),
	                             .flags = flags(object, estimate_flag_name),
	                             .status = status(object)};
}

static struct estimate_channel channel(const cJSON *item)
{
	const cJSON *baseline = at(item, "baseline"), *peak = at(item, "peak"), *pulse = at(item, "pulse");
	const cJSON *contact = at(pulse, "contact");

	return (struct estimate_channel){
	        .baseline = {.offset_g = number(baseline, "offset_g"),
	                     .noise_g = number(baseline, "noise_g")},
	        .peak = {.value_g = number(peak, "value_g"),
	                 .sigma_g = number(peak, "sigma_g"),
	                 .time_s = number(peak, "time_s"),
	                 .sigma_time_s = number(peak, "sigma_time_s"),
	                 .how = how(peak)},
	        .pulse = {.duration_s = number(pulse, "duration_s"),
	                  .start_s = number(pulse, "start_s"),
	                  .status = status(pulse),
	                  .contact_time_s = number(contact, "duration_s"),
	                  .contact = how(contact)},
	        .flags = flags(item, record_flag_name),
	};
}

/* The result's channel of that name; all NAN when there is none. */
static struct estimate_channel channel_of(const cJSON *root, const char *name)
{
	const cJSON *item;

	cJSON_ArrayForEach(item, at(root, "channels"))
	{
		if (!strcmp(text(item, "name"), name))
			return channel(item);
	}
	return channel(NULL);
}

static void take_resultants(struct analysis *a, const cJSON *root)
{
	const cJSON *item;

	cJSON_ArrayForEach(item, at(root, "resultants"))
	{
		struct estimate_resultant *r = &a->resultants[a->resultant_count];

		if (a->resultant_count == ESTIMATE_SENSORS_MAX)
			return;
		snprintf(r->sensor, sizeof(r->sensor), "%s", text(item, "sensor"));
		r->peak_g = number(item, "peak_g");
		r->sigma_g = number(item, "sigma_g");
		r->time_s = number(item, "time_s");
		r->how = how(item);
		a->resultant_count++;
	}
}

static void take_joint(struct analysis *a, const cJSON *root)
{
	const cJSON *lag = at(root, "lag"), *driven = at(lag, "driven"), *plate = at(root, "plate");

	a->has_lag = cJSON_IsObject(lag);
	a->lag.status = status(lag);
	a->lag.driven_s = number(driven, "lag_s");
	a->lag.driven = how(driven);
	a->has_plate = cJSON_IsObject(plate);
	a->plate.frequency_hz = number(plate, "frequency_hz");
	a->plate.how = how(plate);
}

/* What a log would have told. */
static int take_record(struct record *record, const cJSON *root)
{
	const cJSON *item, *drop = at(root, "drop");

	cJSON_ArrayForEach(item, at(root, "channels"))
	{
		double rate_hz = number(item, "rate_hz");

		if (!(rate_hz > 0.0) || !record_add_channel(record, text(item, "name"), rate_hz, 0))
			return rate_hz > 0.0 ? DT_E_MEMORY : DT_E_FORMAT;
	}
	record->is_drop = cJSON_IsObject(drop);
	record->first_tick_ms = whole(drop, "first_tick_ms");
	record->last_tick_ms = whole(drop, "last_tick_ms");
	record->trigger_s = number(drop, "trigger_s");
	record->frame_speed_m_s = number(drop, "frame_speed_m_s");
	record->crc_known = isfinite(number(drop, "crc32"));
	record->crc_agrees = cJSON_IsTrue(at(drop, "crc_agrees"));
	record->lost_samples = whole(root, "lost_samples");
	return 0;
}

static int take(struct series_drop *drop, const cJSON *root)
{
	struct record *record = &drop->record;
	struct analysis *a = &drop->analysis;
	int result = record->channel_count ? 0 : take_record(record, root);

	if (result)
		return result;
	a->channels = calloc(record->channel_count, sizeof(*a->channels));
	if (!a->channels)
		return DT_E_MEMORY;
	a->channel_count = record->channel_count;
	for (size_t i = 0; i < a->channel_count; i++)
		a->channels[i] = channel_of(root, record->channels[i].name);
	record->flags = flags(root, record_flag_name);
	drop->highpass_undone_s = number(at(root, "processing"), "highpass_undone_s");
	take_resultants(a, root);
	take_joint(a, root);
	return 0;
}

int series_result_read(struct series_drop *drop, const char *json)
{
	cJSON *root;
	int result = archive_json_parse(json, &root);

	if (result)
		return result;
	result = cJSON_GetArraySize(at(root, "channels")) > 0 ? take(drop, root) : DT_E_FORMAT;
	cJSON_Delete(root);
	return result;
}
