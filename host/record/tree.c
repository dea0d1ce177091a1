/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/tree_nodes.h"

#include <string.h>

#include "host/base/mapped.h"
#include "host/record/sniff.h"

enum { PART = 1 << 20 /* bytes at once */ };

int tree_put(FILE *out, const char *path, struct tree_entry entry, const void *data)
{
	bool right;

	entry.path_bytes = (uint32_t)strlen(path) + 1;
	right = fwrite(&entry, sizeof(entry), 1, out) == 1 && fwrite(path, entry.path_bytes, 1, out) == 1;
	for (uint64_t at = 0; at < entry.bytes && right; at += PART) {
		size_t part = entry.bytes - at < PART ? (size_t)(entry.bytes - at) : PART;

		right = fwrite((const char *)data + at, part, 1, out) == 1;
		mapped_seen(part);
	}
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
bool tree_take(struct tree *tree, const char *bytes, size_t size)
{
	for (size_t at = strlen(TREE_HEAD); at < size; tree->nodes++) {
		struct tree_node *node = &tree->node[tree->nodes];

		if (tree->nodes == TREE_ENTRIES || size - at < sizeof(node->is))
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

double tree_number(const struct tree_node *node, size_t k)
{
	double value;

	memcpy(&value, node->data + k * sizeof(value), sizeof(value));
	return value;
}

size_t tree_numbers(const struct tree_node *node)
{
	return node->is.kind == TREE_NUMBERS ? node->is.rows * node->is.columns : 0;
}

bool tree_is_vector(const struct tree_node *node)
{
	return tree_numbers(node) > 1 && (node->is.rows == 1 || node->is.columns == 1);
}

struct piece tree_key(const struct tree_node *node)
{
	return (struct piece){node->key, strlen(node->key)};
}

bool tree_is_time(const struct tree_node *node)
{
	return tree_is_vector(node) && sniff_is_time(tree_key(node));
}

struct piece tree_text(const struct tree_node *node)
{
	return (struct piece){node->data, node->is.bytes};
}

bool tree_has_time(const struct tree *tree, const struct tree_node *of, size_t count)
{
	for (size_t i = 0; i < tree->nodes; i++) {
		const struct tree_node *node = &tree->node[i];

		if (node != of && tree_is_time(node) && tree_numbers(node) == count &&
		    strncmp(node->path, of->path, node->parent) == 0 &&
		    (node->parent == 0 || of->path[node->parent] == '/'))
			return true;
	}
	return false;
}
