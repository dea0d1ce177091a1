/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/tree.h"

#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "common/base/process.h"
#include "host/record/cells.h"
#include "host/record/sniff.h"

enum { ENTRIES_MAX = 4096, LINES_MAX = COLUMNS_MAX + 1, RAMP_LEAST = 8 };

struct node {
	struct tree_entry is;
	const char *path, *key; /* key: the last of the path */
	size_t parent;          /* length of the path above */
	const char *data;       /* at any address */
};

struct tree {
	const struct source *source;
	char *message;
	struct table_data *table;
	struct node *node;
	size_t nodes;
};

/* ---- a helper's bytes ---- */

int tree_put(FILE *out, const char *path, struct tree_entry entry, const void *data)
{
	bool right;

	entry.path_bytes = (uint32_t)strlen(path) + 1;
	right = fwrite(&entry, sizeof(entry), 1, out) == 1 && fwrite(path, entry.path_bytes, 1, out) == 1 &&
	        (entry.bytes == 0 || fwrite(data, entry.bytes, 1, out) == 1);
	return right ? 0 : DT_E_SYSTEM;
}

int tree_put_text(FILE *out, const char *path, enum tree_kind kind, const char *text)
{
	return tree_put(out, path, (struct tree_entry){.bytes = strlen(text), .kind = kind}, text);
}

bool tree_is(const char *bytes, size_t size)
{
	return size >= strlen(TREE_HEAD) && memcmp(bytes, TREE_HEAD, strlen(TREE_HEAD)) == 0;
}

static bool entry_fits(const struct tree_entry *entry)
{
	return entry->kind <= TREE_OTHER && (entry->kind != TREE_NUMBERS ||
	                                     (entry->rows < UINT32_MAX && entry->columns < UINT32_MAX &&
	                                      entry->bytes / sizeof(double) == entry->rows * entry->columns &&
	                                      entry->bytes % sizeof(double) == 0));
}

/* False where the bytes are none of a helper's. */
static bool take_nodes(struct tree *tree, const char *bytes, size_t size)
{
	for (size_t at = strlen(TREE_HEAD); at < size; tree->nodes++) {
		struct node *node = &tree->node[tree->nodes];

		if (tree->nodes == ENTRIES_MAX || size - at < sizeof(node->is))
			return false;
		memcpy(&node->is, bytes + at, sizeof(node->is));
		at += sizeof(node->is);
		if (!entry_fits(&node->is) || node->is.path_bytes == 0 || node->is.path_bytes > size - at ||
		    node->is.bytes > size - at - node->is.path_bytes ||
		    bytes[at + node->is.path_bytes - 1] != '\0')
			return false;
		node->path = bytes + at;
		node->key = strrchr(node->path, '/');
		node->parent = node->key != NULL ? (size_t)(node->key - node->path) : 0;
		node->key = node->key != NULL ? node->key + 1 : node->path;
		node->data = bytes + at + node->is.path_bytes;
		at += node->is.path_bytes + node->is.bytes;
	}
	return true;
}

static double number_at(const struct node *node, size_t k)
{
	double value;

	memcpy(&value, node->data + k * sizeof(value), sizeof(value));
	return value;
}

static size_t numbers_of(const struct node *node)
{
	return node->is.kind == TREE_NUMBERS ? node->is.rows * node->is.columns : 0;
}

static bool is_vector(const struct node *node)
{
	return numbers_of(node) > 1 && (node->is.rows == 1 || node->is.columns == 1);
}

static struct piece key_of(const struct node *node)
{
	return (struct piece){node->key, strlen(node->key)};
}

static bool is_time(const struct node *node)
{
	return is_vector(node) && sniff_is_time(key_of(node));
}

static struct piece text_of(const struct node *node)
{
	return (struct piece){node->data, node->is.bytes};
}

/* ---- what is said of an array ---- */

typedef bool says(const struct node *node, struct piece key);

static bool key_is(struct piece key, const char *const *words)
{
	for (; *words != NULL; words++)
		if (key.length == strlen(*words) && strncasecmp(key.text, *words, key.length) == 0)
			return true;
	return false;
}

static bool says_unit(const struct node *node, struct piece key)
{
	static const char *const words[] = {"unit", "units", "unit_string", "y_unit", "yunit", "uom", NULL};

	return node->is.kind == TREE_TEXT && key_is(key, words);
}

static bool says_name(const struct node *node, struct piece key)
{
	static const char *const words[] = {"name",        "label",     "channel", "channel_name",
	                                    "channelname", "long_name", NULL};

	return node->is.kind == TREE_TEXT && key_is(key, words);
}

static bool says_names(const struct node *node, struct piece key)
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

static bool says_rate(const struct node *node, struct piece key)
{
	struct piece rest;

	return numbers_of(node) == 1 && key_tells(key, SNIFF_RATE, &rest);
}

static bool says_step(const struct node *node, struct piece key)
{
	struct piece rest;

	return numbers_of(node) == 1 && key_tells(key, SNIFF_STEP, &rest);
}

static bool says_scale(const struct node *node, struct piece key)
{
	static const char *const offsets[] = {"offset", "add_offset", NULL}, *const gains[] = {"gain", NULL};
	double value = numbers_of(node) == 1 ? number_at(node, 0) : 0;

	return numbers_of(node) == 1 &&
	       ((sniff_is_scale(key) || key_is(key, gains)) ? fabs(value - 1) > 1e-12
	                                                    : key_is(key, offsets) && fabs(value) > 1e-12);
}

enum where { NOWHERE, OWN, SHARED };

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

static bool stands_in(const struct node *node, const char *path, size_t length)
{
	return node->parent == length && memcmp(node->path, path, length) == 0 &&
	       (length > 0 || node->key == node->path);
}

/* The nearest entry that says it of this one: below it, named with it, beside it, above it. *folder: length
 * of the path that a shared one stands in. */
static const struct node *nearest(const struct tree *tree, const struct node *of, says *test,
                                  enum where *where, size_t *folder)
{
	size_t own = strlen(of->path);

	*where = OWN;
	for (size_t i = 0; i < tree->nodes; i++) {
		const struct node *node = &tree->node[i];

		if (node != of && stands_in(node, of->path, own) && test(node, key_of(node)))
			return node;
	}
	for (size_t i = 0; i < tree->nodes; i++) {
		const struct node *node = &tree->node[i];
		struct piece key = named_with(key_of(node), key_of(of));

		if (node != of && key.length > 0 && stands_in(node, of->path, of->parent) && test(node, key))
			return node;
	}
	*where = SHARED;
	for (size_t length = of->parent;;) {
		for (size_t i = 0; i < tree->nodes; i++) {
			const struct node *node = &tree->node[i];

			if (node != of && stands_in(node, of->path, length) && test(node, key_of(node))) {
				*folder = length;
				return node;
			}
		}
		if (length == 0)
			break;
		while (length > 0 && of->path[--length] != '/')
			;
	}
	*where = NOWHERE;
	return NULL;
}

/* Whether it is the only array within the folder, but for times. */
static bool is_only(const struct tree *tree, const struct node *of, size_t folder)
{
	for (size_t i = 0; i < tree->nodes; i++) {
		const struct node *node = &tree->node[i];

		if (node != of && numbers_of(node) > 1 && !is_time(node) &&
		    strncmp(node->path, of->path, folder) == 0 && (folder == 0 || node->path[folder] == '/'))
			return false;
	}
	return true;
}

static struct piece line_of(const struct node *node, size_t wanted)
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

static size_t lines_of(const struct node *node)
{
	size_t lines = 1;

	for (size_t i = 0; i < node->is.bytes && lines < LINES_MAX; i++)
		lines += node->data[i] == '\n';
	return lines;
}

static void copy_piece(char *to, size_t size, struct piece text)
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

static int tree_refuse(const struct tree *tree, const struct node *node, const char *why)
{
	return source_refuse(tree->message, DT_E_FORMAT, tree->source->file, 0, "%.80s: %s", node->path, why);
}

/* The unit of a number that stands beside: in its key, or in what is said of it alone. */
static const struct unit *unit_beside(const struct tree *tree, const struct node *node, enum sniff_key key,
                                      bool *unknown)
{
	struct piece rest = {0}, text;
	enum where where;
	size_t folder;
	const struct node *told = nearest(tree, node, says_unit, &where, &folder);

	for (size_t at = 0; at < strlen(node->key) && rest.length == 0; at++)
		if (at == 0 || node->key[at - 1] == '_')
			(void)key_tells((struct piece){node->key + at, strlen(node->key) - at}, key, &rest);
	if (rest.length > 0)
		return unit_find(rest.text, rest.length);
	if (where != OWN)
		return NULL;
	text = text_of(told);
	*unknown = unit_find(text.text, text.length) == NULL;
	return unit_find(text.text, text.length);
}

/* A rate of what is told, as if in Hz or s where it tells no unit. */
static int take_rate(const struct tree *tree, const struct node *node, enum sniff_key key, double *rate_hz,
                     bool *open)
{
	bool unknown = false;
	const struct unit *unit = unit_beside(tree, node, key, &unknown);
	double value = number_at(node, 0), factor = 1;

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

static int give_rate(const struct tree *tree, const struct node *node, struct table_column *column)
{
	enum where near_rate, near_step;
	size_t rate_in = 0, step_in = 0;
	const struct node *rate = nearest(tree, node, says_rate, &near_rate, &rate_in),
	                  *step = nearest(tree, node, says_step, &near_step, &step_in);
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

static void give_unit(const struct tree *tree, const struct node *node, size_t i, size_t columns,
                      struct table_column *column)
{
	struct piece name = {column->name, strlen(column->name)}, text;
	enum where where;
	size_t folder = 0;
	const struct node *told = nearest(tree, node, says_unit, &where, &folder);
	const struct unit *unit;

	if (told ==
	    NULL) { /* a name of its own, or that of a matrix, hides the unit in the path; no masses */
		unit = unit_of_name(node->key, strlen(node->key), UNIT_ACCELERATION);
		if (unit != NULL && unit->kind == UNIT_ACCELERATION &&
		    (unit->name[1] == '\0' || strchr(unit->name, '/') != NULL) && !sniff_is_time(name))
			copy_piece(column->unit, sizeof(column->unit),
			           (struct piece){unit->name, strlen(unit->name)});
		return;
	}
	text = without_epoch(columns > 1 && lines_of(told) == columns ? line_of(told, i) : text_of(told));
	unit = unit_find(text.text, text.length);
	if (columns == 1 || lines_of(told) != columns) {
		if (lines_of(told) > 1 || (unit != NULL && unit->kind != UNIT_TIME && sniff_is_time(name)))
			return;
		if (where == SHARED && !is_only(tree, node, folder) && !sniff_is_acceleration(name))
			return;
	}
	copy_piece(column->unit, sizeof(column->unit), text);
}

static void give_doubts(const struct tree *tree, const struct node *node, bool is_named,
                        struct table_column *column)
{
	enum where where;
	size_t folder, k = 1;
	const struct node *scale = nearest(tree, node, says_scale, &where, &folder);

	if (scale != NULL)
		snprintf(column->doubt, sizeof(column->doubt), "%.40s %.9g may be in the numbers or not",
		         scale->key, number_at(scale, 0));
	if (is_named)
		return;
	if (memchr(node->path, '(', strlen(node->path)) != NULL)
		snprintf(column->doubt, sizeof(column->doubt),
		         "element of an array: a channel of one recording, or a recording of several");
	while (k < column->count && column->value[k] > column->value[k - 1])
		k++;
	if (node->is.rows > 1 && node->is.columns > 1 && k == column->count && k >= RAMP_LEAST)
		snprintf(column->doubt, sizeof(column->doubt), "only increases: the time, or a channel");
}

static bool has_time(const struct tree *tree, const struct node *of, size_t count)
{
	for (size_t i = 0; i < tree->nodes; i++) {
		const struct node *node = &tree->node[i];

		if (node != of && is_time(node) && numbers_of(node) == count &&
		    strncmp(node->path, of->path, node->parent) == 0 &&
		    (node->parent == 0 || of->path[node->parent] == '/'))
			return true;
	}
	return false;
}

/* ---- columns ---- */

struct shape {
	size_t columns, count;
	bool across; /* samples go along the second dimension */
};

static bool ends_with(const char *path, const char *tail)
{
	size_t length = strlen(path), most = strlen(tail);

	return length >= most && strcmp(path + length - most, tail) == 0 &&
	       (length == most || path[length - most - 1] == '/');
}

/* As much of the end of its path as no other array has. */
static void name_by_path(const struct tree *tree, const struct node *of, char *name, size_t size)
{
	const char *text = of->key;

	for (size_t i = 0; i < tree->nodes && !is_time(of); i++)
		while (&tree->node[i] != of && numbers_of(&tree->node[i]) > 1 && text > of->path &&
		       ends_with(tree->node[i].path, text))
			for (text--; text > of->path && text[-1] != '/';)
				text--;
	snprintf(name, size, "%.50s", text);
	for (char *at = name; *at != '\0'; at++)
		*at = *at == '/' ? '.' : *at;
}

static void give_name(const struct tree *tree, const struct node *node, size_t i, const struct shape *shape,
                      struct table_column *column, bool *is_named)
{
	enum where where;
	size_t folder = 0;
	const struct node *told =
	        nearest(tree, node, shape->columns > 1 ? says_names : says_name, &where, &folder);
	struct piece text = {0};

	if (told != NULL && shape->columns > 1 && lines_of(told) == shape->columns)
		text = line_of(told, i);
	else if (told != NULL && shape->columns == 1 && lines_of(told) == 1 &&
	         (where == OWN || (folder > 0 && folder == node->parent && is_only(tree, node, folder))))
		text = text_of(told);
	copy_piece(column->name, sizeof(column->name), text);
	*is_named = column->name[0] != '\0';
	if (*is_named)
		return;
	name_by_path(tree, node, column->name, sizeof(column->name));
	if (shape->columns > 1)
		snprintf(column->name + strlen(column->name), 8, "(%zu)", (i + 1) % 1000);
}

static int add_column(const struct tree *tree, const struct node *node, size_t i, const struct shape *shape)
{
	struct table_column *column = table_data_add(tree->table, shape->count);
	size_t columns = shape->across ? node->is.rows : node->is.columns, step, from;
	bool is_named;
	int error;

	if (column == NULL)
		return source_no_memory(tree->message, tree->source->file);
	if (shape->columns == 1)
		columns = 1;
	step = node->is.by_rows != shape->across ? columns : 1;
	from = step == 1 ? i * shape->count : i;
	for (size_t k = 0; k < shape->count; k++)
		column->value[k] = number_at(node, from + k * step);
	column->exact = !node->is.single;
	column->timed = !is_time(node) && has_time(tree, node, shape->count);
	give_name(tree, node, i, shape, column, &is_named);
	give_unit(tree, node, i, shape->columns, column);
	error = give_rate(tree, node, column);
	give_doubts(tree, node, is_named, column);
	return error;
}

/* Which dimension the samples go along; false where both could be it. */
static bool take_shape(const struct tree *tree, const struct node *node, struct shape *shape)
{
	size_t rows = node->is.rows, columns = node->is.columns;
	bool down = has_time(tree, node, rows), across = has_time(tree, node, columns);

	if (down == across) {
		down = rows > COLUMNS_MAX;
		across = columns > COLUMNS_MAX;
	}
	*shape = across ? (struct shape){rows, columns, true} : (struct shape){columns, rows, false};
	if (is_vector(node))
		*shape = (struct shape){1, numbers_of(node), false};
	return is_vector(node) || down != across;
}

/* The same time told once more. */
static bool is_told_again(const struct tree *tree, const struct node *of)
{
	for (const struct node *node = tree->node; node < of; node++)
		if (is_time(node) && is_time(of) && node->is.bytes == of->is.bytes &&
		    memcmp(node->data, of->data, of->is.bytes) == 0)
			return true;
	return false;
}

static void leave_out(struct table_data *table, const struct node *node)
{
	size_t used = strlen(table->left_out);
	char why[40];

	if (node->is.kind == TREE_OTHER)
		snprintf(why, sizeof(why), "%.*s", (int)(node->is.bytes < 40 ? node->is.bytes : 39),
		         node->data);
	else
		snprintf(why, sizeof(why), "%u by %u: samples down or across?", (unsigned)node->is.rows,
		         (unsigned)node->is.columns);
	snprintf(table->left_out + used, sizeof(table->left_out) - used, "%s%.30s (%s)", used > 0 ? ", " : "",
	         node->path, why);
}

static int add_array(const struct tree *tree, const struct node *node)
{
	struct shape shape;
	int error = 0;

	if (is_told_again(tree, node))
		return 0;
	if (!take_shape(tree, node, &shape)) {
		leave_out(tree->table, node);
		return 0;
	}
	if (tree->table->count + shape.columns > COLUMNS_MAX)
		return tree_refuse(tree, node, "more than 256 columns");
	for (size_t k = 0; k < shape.columns && !error; k++)
		error = add_column(tree, node, k, &shape);
	return error;
}

static int add_columns(const struct tree *tree)
{
	int error = 0;

	for (size_t i = 0; i < tree->nodes && !error; i++) {
		if (tree->node[i].is.kind == TREE_OTHER)
			leave_out(tree->table, &tree->node[i]);
		else if (numbers_of(&tree->node[i]) > 1)
			error = add_array(tree, &tree->node[i]);
	}
	return error;
}

int read_tree(struct table_data *table, const char *format, const char *bytes, size_t size,
              const struct source *source, char message[READ_MESSAGE_MAX])
{
	struct tree tree = {.source = source, .message = message, .table = table};
	int error;

	tree.node = calloc(ENTRIES_MAX, sizeof(*tree.node));
	if (tree.node == NULL)
		return source_no_memory(message, source->file);
	table->format = format;
	error = tree_is(bytes, size) && take_nodes(&tree, bytes, size)
	                ? add_columns(&tree)
	                : source_refuse(message, DT_E_FORMAT, source->file, 0, "more than %d entries",
	                                ENTRIES_MAX);
	if (!error && table->count == 0)
		error = source_refuse(message, DT_E_EMPTY, source->file, 0,
		                      "no array of numbers whose samples go one way%s%s",
		                      table->left_out[0] != '\0' ? ", but " : "", table->left_out);
	free(tree.node);
	return error;
}

int read_tree_of(struct table_data *table, const char *format, int fd, const struct source *source,
                 char message[READ_MESSAGE_MAX])
{
	size_t size;
	char *bytes = process_read(fd, &size);
	int error = bytes != NULL ? read_tree(table, format, bytes, size, source, message)
	                          : source_no_memory(message, source->file);

	free(bytes);
	return error;
}
