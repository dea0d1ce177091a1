/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * What is said of an array by what stands below it, is named with it, stands beside or above it: name, unit,
 * rate, beginning, and what makes it doubtful.
 */
#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "host/record/cells.h"
#include "host/record/sniff.h"
#include "host/record/tree_nodes.h"

enum { TREE_LINES = COLUMNS_MAX + 1, RAMP_LEAST = 8 };

/* ---- what is said of an array ---- */

static bool key_is(struct piece key, const char *const *words)
{
	for (; *words != NULL; words++)
		if (key.length == strlen(*words) && strncasecmp(key.text, *words, key.length) == 0)
			return true;
	return false;
}

static bool says_unit(const struct tree_node *node, struct piece key)
{
	static const char *const words[] = {"unit", "units", "unit_string", "y_unit", "yunit", "uom", NULL};

	return node->is.kind == TREE_TEXT && key_is(key, words);
}

bool tree_says_name(const struct tree_node *node, struct piece key)
{
	static const char *const words[] = {"name",        "label",     "channel", "channel_name",
	                                    "channelname", "long_name", NULL};

	return node->is.kind == TREE_TEXT && key_is(key, words);
}

bool tree_says_names(const struct tree_node *node, struct piece key)
{
	static const char *const words[] = {"names",        "labels",        "channels",     "columns",
	                                    "headers",      "channel_names", "channelnames", "column_names",
	                                    "sensor_names", "header",        "fields",       NULL};

	return node->is.kind == TREE_TEXT && key_is(key, words);
}

/* What behind the words of a rate or a step is not its unit: all of it is other words. */
static bool key_tells(struct piece key, enum sniff_key wanted, struct piece *rest)
{
	static const char *const rates[] = {"rate", "rate_hz", "rate_khz", NULL}, *const steps[] = {
	                                                                                  "wf_increment",
	                                                                                  "x_increment",
	                                                                                  "xincrement", NULL};
	size_t length;
	enum sniff_key found = sniff_key(key, &length);

	if (found == SNIFF_NO_KEY && key_is(key, wanted == SNIFF_RATE ? rates : steps)) {
		found = wanted;
		length = wanted == SNIFF_RATE ? 4 : key.length;
	}
	if (found != wanted)
		return false;
	while (length < key.length && strchr("_- ([", key.text[length]))
		length++;
	*rest = (struct piece){key.text + length, key.length - length};
	return rest->length == 0 || unit_find(rest->text, rest->length) != NULL;
}

static bool says_rate(const struct tree_node *node, struct piece key)
{
	struct piece rest;

	return tree_numbers(node) == 1 && key_tells(key, SNIFF_RATE, &rest);
}

static bool says_step(const struct tree_node *node, struct piece key)
{
	struct piece rest;

	return tree_numbers(node) == 1 && key_tells(key, SNIFF_STEP, &rest);
}

static bool says_start(const struct tree_node *node, struct piece key)
{
	static const char *const words[] = {"start_s", "t0_s", "wf_start_offset", NULL};

	return tree_numbers(node) == 1 && isfinite(tree_number(node, 0)) && key_is(key, words);
}

static bool says_scale(const struct tree_node *node, struct piece key)
{
	static const char *const offsets[] = {"offset", "add_offset", NULL};
	double value = tree_numbers(node) == 1 ? tree_number(node, 0) : 0;

	return tree_numbers(node) == 1 &&
	       (sniff_is_scale(key) ? fabs(value - 1) > 1e-12 : key_is(key, offsets) && fabs(value) > 1e-12);
}

/* "acc_units" and "units_acc" beside "acc". */
static struct piece named_with(struct piece key, struct piece name)
{
	size_t length = name.length;

	if (key.length <= length + 1)
		return (struct piece){0};
	if (memcmp(key.text, name.text, length) == 0 && key.text[length] == '_')
		return (struct piece){key.text + length + 1, key.length - length - 1};
	if (memcmp(key.text + key.length - length, name.text, length) == 0 &&
	    key.text[key.length - length - 1] == '_')
		return (struct piece){key.text, key.length - length - 1};
	return (struct piece){0};
}

static bool stands_in(const struct tree_node *node, const char *path, size_t length)
{
	return node->parent == length && memcmp(node->path, path, length) == 0 &&
	       (length > 0 || node->key == node->path);
}

/* The tree_nearest entry that says it of this one: below it, named with it, beside it, above it. *folder:
 * length of the path that a shared one stands in. */
const struct tree_node *tree_nearest(const struct tree *tree, const struct tree_node *of, tree_says *test,
                                     enum tree_where *where, size_t *folder)
{
	size_t own = strlen(of->path);

	*where = TREE_OWN;
	for (size_t i = 0; i < tree->nodes; i++) {
		const struct tree_node *node = &tree->node[i];

		if (node != of && stands_in(node, of->path, own) && test(node, tree_key(node)))
			return node;
	}
	for (size_t i = 0; i < tree->nodes; i++) {
		const struct tree_node *node = &tree->node[i];
		struct piece key = named_with(tree_key(node), tree_key(of));

		if (node != of && key.length > 0 && stands_in(node, of->path, of->parent) && test(node, key))
			return node;
	}
	*where = TREE_SHARED;
	for (size_t length = of->parent;;) {
		for (size_t i = 0; i < tree->nodes; i++) {
			const struct tree_node *node = &tree->node[i];

			if (node != of && stands_in(node, of->path, length) && test(node, tree_key(node))) {
				*folder = length;
				return node;
			}
		}
		if (length == 0)
			break;
		while (length > 0 && of->path[--length] != '/')
			;
	}
	*where = TREE_NOWHERE;
	return NULL;
}

/* Whether it is the only array within the folder, but for times. */
bool tree_is_only(const struct tree *tree, const struct tree_node *of, size_t folder)
{
	for (size_t i = 0; i < tree->nodes; i++) {
		const struct tree_node *node = &tree->node[i];

		if (node != of && tree_numbers(node) > 1 && !tree_is_time(node) &&
		    strncmp(node->path, of->path, folder) == 0 && (folder == 0 || node->path[folder] == '/'))
			return false;
	}
	return true;
}

struct piece tree_line(const struct tree_node *node, size_t wanted)
{
	const char *from = node->data, *end = node->data + node->is.bytes;

	for (size_t i = 0;; i++) {
		const char *stop = from < end ? memchr(from, '\n', (size_t)(end - from)) : NULL;

		if (i == wanted)
			return (struct piece){from, (size_t)((stop != NULL ? stop : end) - from)};
		if (stop == NULL)
			return (struct piece){0};
		from = stop + 1;
	}
}

size_t tree_lines(const struct tree_node *node)
{
	size_t lines = 1;

	for (size_t i = 0; i < node->is.bytes && lines < TREE_LINES; i++)
		lines += node->data[i] == '\n';
	return lines;
}

void tree_copy(char *to, size_t size, struct piece text)
{
	while (text.length > 0 && isspace((unsigned char)text.text[0])) {
		text.text++;
		text.length--;
	}
	while (text.length > 0 && strchr(" \t\r", text.text[text.length - 1]))
		text.length--;
	snprintf(to, size, "%.*s", (int)(text.length < size ? text.length : size - 1),
	         text.length > 0 ? text.text : "");
}

/* ---- the attributes of a column ---- */

int tree_refuse(const struct tree *tree, const struct tree_node *node, const char *why)
{
	return source_refuse(tree->message, DT_E_FORMAT, tree->source->file, 0, "%.80s: %s", node->path, why);
}

/* The unit of a number that stands beside: in its key, or in what is said of it alone. */
static const struct unit *unit_beside(const struct tree *tree, const struct tree_node *node,
                                      enum sniff_key key, bool *unknown)
{
	struct piece rest = {0}, text;
	enum tree_where where;
	size_t folder;
	const struct tree_node *told = tree_nearest(tree, node, says_unit, &where, &folder);

	for (size_t at = 0; at < strlen(node->key) && rest.length == 0; at++)
		if (at == 0 || node->key[at - 1] == '_')
			(void)key_tells((struct piece){node->key + at, strlen(node->key) - at}, key, &rest);
	if (rest.length > 0)
		return unit_find(rest.text, rest.length);
	if (where != TREE_OWN)
		return NULL;
	text = tree_text(told);
	*unknown = unit_find(text.text, text.length) == NULL;
	return unit_find(text.text, text.length);
}

/* A rate of what is told, as if in Hz or s where it tells no unit. */
static int take_rate(const struct tree *tree, const struct tree_node *node, enum sniff_key key,
                     double *rate_hz, bool *open)
{
	bool unknown = false;
	const struct unit *unit = unit_beside(tree, node, key, &unknown);
	double value = tree_number(node, 0), factor = 1;

	if (unit != NULL)
		factor = key == SNIFF_RATE ? unit_hertz(unit) : unit->kind == UNIT_TIME ? unit->divisor : 0;
	if (unknown || !(factor > 0))
		return tree_refuse(tree, node, "its unit is none of a rate or a time");
	*rate_hz = key == SNIFF_RATE ? value * factor : factor / value;
	*open = unit == NULL;
	if (!(value > 0) || !isfinite(value) || !isfinite(*rate_hz))
		return tree_refuse(tree, node, "no rate and no time step, expected a positive number");
	return 0;
}

/* When the first sample is; 0 where it is not told. */
void tree_give_start(const struct tree *tree, const struct tree_node *node, struct table_column *column)
{
	enum tree_where where;
	size_t folder;
	const struct tree_node *told = tree_nearest(tree, node, says_start, &where, &folder);

	column->start_s = told != NULL ? tree_number(told, 0) : 0;
}

int tree_give_rate(const struct tree *tree, const struct tree_node *node, struct table_column *column)
{
	enum tree_where near_rate, near_step;
	size_t rate_in = 0, step_in = 0;
	const struct tree_node *rate = tree_nearest(tree, node, says_rate, &near_rate, &rate_in),
	                       *step = tree_nearest(tree, node, says_step, &near_step, &step_in);
	double by_step;
	bool open;
	int error = 0;

	if (rate != NULL)
		error = take_rate(tree, rate, SNIFF_RATE, &column->rate_hz, &column->rate_open);
	if (error || step == NULL)
		return error;
	error = take_rate(tree, step, SNIFF_STEP, &by_step, &open);
	if (!error && rate != NULL && !(fabs(by_step / column->rate_hz - 1) < 1e-3))
		return source_refuse(tree->message, DT_E_FORMAT, tree->source->file, 0,
		                     "%.60s tells %.9g Hz, but %.60s %.9g Hz, expected one", rate->path,
		                     column->rate_hz, step->path, by_step);
	if (!error && (rate == NULL || !open)) {
		column->rate_hz = by_step;
		column->rate_open = open;
	}
	return error;
}

/* "seconds since 1970-01-01" is in seconds. */
static struct piece without_epoch(struct piece text)
{
	const char *since = text.length > 0 ? memmem(text.text, text.length, " since ", 7) : NULL;

	return since != NULL ? (struct piece){text.text, (size_t)(since - text.text)} : text;
}

void tree_give_unit(const struct tree *tree, const struct tree_node *node, size_t i, size_t columns,
                    struct table_column *column)
{
	struct piece name = {column->name, strlen(column->name)}, text;
	enum tree_where where;
	size_t folder = 0;
	const struct tree_node *told = tree_nearest(tree, node, says_unit, &where, &folder);
	const struct unit *unit;

	if (told ==
	    NULL) { /* a name of its own, or that of a matrix, hides the unit in the path; no masses */
		unit = unit_of_name(node->key, strlen(node->key), UNIT_ACCELERATION);
		if (unit != NULL && unit->kind == UNIT_ACCELERATION &&
		    (unit->name[1] == '\0' || strchr(unit->name, '/') != NULL) && !sniff_is_time(name))
			tree_copy(column->unit, sizeof(column->unit),
			          (struct piece){unit->name, strlen(unit->name)});
		return;
	}
	text = without_epoch(columns > 1 && tree_lines(told) == columns ? tree_line(told, i)
	                                                                : tree_text(told));
	unit = unit_find(text.text, text.length);
	if (columns == 1 || tree_lines(told) != columns) {
		if (tree_lines(told) > 1 || (unit != NULL && unit->kind != UNIT_TIME && sniff_is_time(name)))
			return;
		if (where == TREE_SHARED && !tree_is_only(tree, node, folder) && !sniff_is_acceleration(name))
			return;
	}
	tree_copy(column->unit, sizeof(column->unit), text);
}

/* How many numbers from the first on only increase. */
static size_t ramp_length(const struct table_column *column)
{
	double before, now;
	size_t k = 1;

	table_column_take(column, 0, 1, &before);
	for (; k < column->count; k++, before = now) {
		table_column_take(column, k, 1, &now);
		if (!(now > before))
			break;
	}
	return k;
}

void tree_give_doubts(const struct tree *tree, const struct tree_node *node, bool is_named,
                      struct table_column *column)
{
	enum tree_where where;
	size_t folder, k = 0;
	const struct tree_node *scale = tree_nearest(tree, node, says_scale, &where, &folder);

	if (scale != NULL)
		snprintf(column->doubt, sizeof(column->doubt), "%.40s %.9g may be in the numbers or not",
		         scale->key, tree_number(scale, 0));
	if (is_named)
		return;
	if (memchr(node->path, '(', strlen(node->path)) != NULL)
		snprintf(column->doubt, sizeof(column->doubt),
		         "element of an array: a channel of one recording, or a recording of several");
	if (node->is.rows > 1 && node->is.columns > 1)
		k = ramp_length(column);
	if (k == column->count && k >= RAMP_LEAST)
		snprintf(column->doubt, sizeof(column->doubt), "only increases: the time, or a channel");
}
