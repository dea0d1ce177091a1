/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/shock/axes.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static bool axes_usable(const struct channel *channel)
{
	return channel->count > 0 && isfinite(channel->rate_hz) && channel->rate_hz > 0 &&
	       isfinite(channel->start_s);
}

/* 'x' 'y' 'z' for the last letter of an axis' name, else 0. */
static char letter(const char *name)
{
	size_t length = strlen(name);
	char last = length > 0 ? name[length - 1] : '\0';

	return last != '\0' && strchr("xyzXYZ", last) ? last : '\0';
}

static bool same_sensor(const char *a, const char *b)
{
	size_t length = strlen(a);
	char one = letter(a), other = letter(b);

	return one && other && one != other && (one < 'a') == (other < 'a') && strlen(b) == length &&
	       memcmp(a, b, length - 1) == 0;
}

static void set_name(struct axes *axes)
{
	char *name = axes->name;
	size_t length;

	snprintf(name, sizeof(axes->name), "%s", axes->axis[0]->name);
	if (axes->count == 1)
		return;
	length = strlen(name) - 1;
	while (length > 0 && strchr(" _-.", name[length - 1]))
		length--;
	name[length] = '\0';
	if (length == 0)
		strcpy(name, "xyz");
}

/* Adds the axes of the sensor that channel first belongs to. */
static void axes_gather(const struct record *record, size_t first, struct axes *axes)
{
	*axes = (struct axes){.count = 1, .axis = {&record->channels[first]}};
	for (size_t i = first + 1; i < record->channel_count && axes->count < AXES_MAX; i++) {
		const struct channel *c = &record->channels[i];

		if (!axes_usable(c) || !same_sensor(axes->axis[0]->name, c->name))
			continue;
		axes->axis[axes->count++] = c;
		if (c->rate_hz > axes->axis[0]->rate_hz) {
			axes->axis[axes->count - 1] = axes->axis[0];
			axes->axis[0] = c;
		}
	}
	set_name(axes);
}

static bool axes_taken(const struct axes *axes, size_t count, const struct channel *channel)
{
	for (size_t i = 0; i < count; i++)
		for (size_t a = 0; a < axes[i].count; a++)
			if (axes[i].axis[a] == channel)
				return true;
	return false;
}

size_t axes_find(const struct record *record, struct axes *axes)
{
	size_t count = 0;

	for (size_t i = 0; i < record->channel_count; i++)
		if (axes_usable(&record->channels[i]) && !axes_taken(axes, count, &record->channels[i]))
			axes_gather(record, i, &axes[count++]);
	return count;
}

double axes_time(const struct axes *axes, size_t k)
{
	return axes->axis[0]->start_s + (double)k / axes->axis[0]->rate_hz;
}

/* Straight between two samples; NAN beside one that is not there. */
static double axes_between(const struct channel *channel, double time_s)
{
	double place = (time_s - channel->start_s) * channel->rate_hz, whole = floor(place + 1e-9);
	double part = fmax(place - whole, 0);
	size_t k;

	if (!(whole >= 0) || whole >= (double)channel->count)
		return NAN;
	k = (size_t)whole;
	if (part < 1e-9)
		return channel->value_g[k];
	if (k + 1 == channel->count)
		return NAN;
	return channel->value_g[k] + part * (channel->value_g[k + 1] - channel->value_g[k]);
}

bool axes_read(const struct axes *axes, size_t k, const double offset_g[AXES_MAX], double value_g[AXES_MAX])
{
	value_g[0] = axes->axis[0]->value_g[k] - offset_g[0];
	for (size_t i = 1; i < axes->count; i++)
		value_g[i] = axes_between(axes->axis[i], axes_time(axes, k)) - offset_g[i];
	for (size_t i = 0; i < axes->count; i++)
		if (!isfinite(value_g[i]))
			return false;
	return true;
}

double axes_value(const struct axes *axes, const double value_g[AXES_MAX])
{
	double squares = 0;

	if (axes->count == 1)
		return value_g[0];
	for (size_t i = 0; i < axes->count; i++)
		squares += value_g[i] * value_g[i];
	return sqrt(squares);
}
