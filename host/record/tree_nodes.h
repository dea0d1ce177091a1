/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_TREE_NODES_H
#define DT_HOST_RECORD_TREE_NODES_H
/*
 * The entries of a helper's bytes (tree.h) in memory, for those who make columns of them. Nothing is copied.
 */
#include "host/record/cells.h"
#include "host/record/tree.h"

enum { TREE_ENTRIES = 4096 };

struct tree_node {
	struct tree_entry is;
	const char *path, *key; /* key: the last of the path */
	size_t parent;          /* length of the path above */
	const char *data;       /* at any address */
};

struct tree {
	const struct source *source;
	char *message;
	struct table_data *table;
	struct tree_node *node; /* [TREE_ENTRIES] */
	size_t nodes;
};

/* False where the bytes are none of a helper's. */
bool tree_take(struct tree *tree, const char *bytes, size_t size);

double tree_number(const struct tree_node *node, size_t k);
size_t tree_numbers(const struct tree_node *node); /* how many; 0 of what is none */
bool tree_is_vector(const struct tree_node *node);
bool tree_is_time(const struct tree_node *node);
struct piece tree_key(const struct tree_node *node);
struct piece tree_text(const struct tree_node *node);

/* A time of so many rows stands beside it, or above. */
bool tree_has_time(const struct tree *tree, const struct tree_node *of, size_t count);

/* ---- what is said of an array ---- */

typedef bool tree_says(const struct tree_node *node, struct piece key);
tree_says tree_says_name, tree_says_names;

enum tree_where { TREE_NOWHERE, TREE_OWN, TREE_SHARED };

/* The nearest entry that says it of this one: below it, named with it, beside it, above it. *folder: length
 * of the path that a shared one stands in. */
const struct tree_node *tree_nearest(const struct tree *tree, const struct tree_node *of, tree_says *test,
                                     enum tree_where *where, size_t *folder);

/* Whether it is the only array within the folder, but for times. */
bool tree_is_only(const struct tree *tree, const struct tree_node *of, size_t folder);

/* Lines of a text, from 0. */
struct piece tree_line(const struct tree_node *node, size_t wanted);
size_t tree_lines(const struct tree_node *node);

/* Without blanks around it. */
void tree_copy(char *to, size_t size, struct piece text);

int tree_refuse(const struct tree *tree, const struct tree_node *node, const char *why);

/* i: which of the columns of a matrix, whose name is found already. */
void tree_give_unit(const struct tree *tree, const struct tree_node *node, size_t i, size_t columns,
                    struct table_column *column);
void tree_give_start(const struct tree *tree, const struct tree_node *node, struct table_column *column);
DT_MUST_USE int tree_give_rate(const struct tree *tree, const struct tree_node *node,
                               struct table_column *column);
void tree_give_doubts(const struct tree *tree, const struct tree_node *node, bool is_named,
                      struct table_column *column);

#endif
