/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The arrays of a helper's bytes as columns.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/base/process.h"
#include "host/record/tree_nodes.h"

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
static void name_by_path(const struct tree *tree, const struct tree_node *of, char *name, size_t size)
{
	const char *text = of->key;

	for (size_t i = 0; i < tree->nodes && !tree_is_time(of); i++)
		while (&tree->node[i] != of && tree_numbers(&tree->node[i]) > 1 && text > of->path &&
		       ends_with(tree->node[i].path, text))
			for (text--; text > of->path && text[-1] != '/';)
				text--;
	snprintf(name, size, "%.50s", text);
	for (char *at = name; *at != '\0'; at++)
		*at = *at == '/' ? '.' : *at;
}

static void give_name(const struct tree *tree, const struct tree_node *node, size_t i,
                      const struct shape *shape, struct table_column *column, bool *is_named)
{
	enum tree_where where;
	size_t folder = 0;
	const struct tree_node *told = tree_nearest(
	        tree, node, shape->columns > 1 ? tree_says_names : tree_says_name, &where, &folder);
	struct piece text = {0};

	if (told != NULL && shape->columns > 1 && tree_lines(told) == shape->columns)
		text = tree_line(told, i);
	else if (told != NULL && shape->columns == 1 && tree_lines(told) == 1 &&
	         (where == TREE_OWN ||
	          (folder > 0 && folder == node->parent && tree_is_only(tree, node, folder))))
		text = tree_text(told);
	tree_copy(column->name, sizeof(column->name), text);
	*is_named = column->name[0] != '\0';
	if (*is_named)
		return;
	name_by_path(tree, node, column->name, sizeof(column->name));
	if (shape->columns > 1)
		snprintf(column->name + strlen(column->name), 8, "(%zu)", (i + 1) % 1000);
}

static int add_column(const struct tree *tree, const struct tree_node *node, size_t i,
                      const struct shape *shape)
{
	size_t columns = shape->across ? node->is.rows : node->is.columns, step, from;
	struct table_column *column;
	bool is_named;
	int error;

	if (shape->columns == 1)
		columns = 1;
	step = node->is.by_rows != shape->across ? columns : 1;
	from = step == 1 ? i * shape->count : i;
	column =
	        table_data_view(tree->table, shape->count,
	                        (struct bytes_view){node->data + from * sizeof(double), step * sizeof(double),
	                                            BYTES_F64, __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__, 0, 0});
	if (column == NULL)
		return source_no_memory(tree->message, tree->source->file);
	column->exact = !node->is.single;
	column->timed = !tree_is_time(node) && tree_has_time(tree, node, shape->count);
	give_name(tree, node, i, shape, column, &is_named);
	tree_give_unit(tree, node, i, shape->columns, column);
	tree_give_start(tree, node, column);
	error = tree_give_rate(tree, node, column);
	tree_give_doubts(tree, node, is_named, column);
	return error;
}

/* Which dimension the samples go along; false where both could be it. */
static bool take_shape(const struct tree *tree, const struct tree_node *node, struct shape *shape)
{
	size_t rows = node->is.rows, columns = node->is.columns;
	bool down = tree_has_time(tree, node, rows), across = tree_has_time(tree, node, columns);

	if (down == across) {
		down = rows > COLUMNS_MAX;
		across = columns > COLUMNS_MAX;
	}
	*shape = across ? (struct shape){rows, columns, true} : (struct shape){columns, rows, false};
	if (tree_is_vector(node))
		*shape = (struct shape){1, tree_numbers(node), false};
	return tree_is_vector(node) || down != across;
}

/* The same time told once more. */
static bool is_told_again(const struct tree *tree, const struct tree_node *of)
{
	for (const struct tree_node *node = tree->node; node < of; node++)
		if (tree_is_time(node) && tree_is_time(of) && node->is.bytes == of->is.bytes &&
		    memcmp(node->data, of->data, of->is.bytes) == 0)
			return true;
	return false;
}

static void leave_out(struct table_data *table, const struct tree_node *node)
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

static int add_array(const struct tree *tree, const struct tree_node *node)
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
		else if (tree_numbers(&tree->node[i]) > 1)
			error = add_array(tree, &tree->node[i]);
	}
	return error;
}

int read_tree(struct table_data *table, const char *format, const char *bytes, size_t size,
              const struct source *source, char message[READ_MESSAGE_MAX])
{
	struct tree tree = {.source = source, .message = message, .table = table};
	int error;

	tree.node = calloc(TREE_ENTRIES, sizeof(*tree.node));
	if (tree.node == NULL)
		return source_no_memory(message, source->file);
	table->format = format;
	error = tree_is(bytes, size) && tree_take(&tree, bytes, size)
	                ? add_columns(&tree)
	                : source_refuse(message, DT_E_FORMAT, source->file, 0, "more than %d entries",
	                                TREE_ENTRIES);
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
	char path[32];
	int error;

	snprintf(path, sizeof(path), "/proc/self/fd/%d", fd);
	error = source_load(&table->made, path, "a recording", message);
	table->made.file = source->file;
	return error ? error : read_tree(table, format, table->made.bytes, table->made.size, source, message);
}
