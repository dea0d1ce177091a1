/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/hdf5/foreign.h"

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/base/text.h"
#include "host/base/mapped.h"
#include "host/record/tree.h"

enum { PATH_BYTES = 512, PART = 1 << 16 /* numbers at once */, TEXTS_MOST = 1 << 20, MEMBERS_MOST = 256 };

static const hssize_t NUMBERS_MOST = UINT32_MAX - 1;

/* Whole numbers beyond this are told after the first one: they are instants in ns. */
static const double WHOLE_MOST = 9007199254740992.0;

static int refuse_foreign(const char *what, const char *why)
{
	fprintf(stderr, "HDF5: %.200s: %s\n", what, why);
	return -1;
}

static int put_other(const char *path, const char *what)
{
	return tree_put_text(stdout, path, TREE_OTHER, what);
}

/* An array or an attribute, read alike. */
struct values {
	const char *path;
	hid_t id, type, space;
	bool is_attribute;
	size_t rank, count, rows, columns;
};

static int refuse_values(const struct values *of)
{
	return refuse_foreign(of->path,
	                      "cannot be read: cut or damaged, or packed in a way that is not known");
}

static int read_values(const struct values *of, hid_t type, void *to)
{
	herr_t error = of->is_attribute ? H5Aread(of->id, type, to)
	                                : H5Dread(of->id, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, to);

	return error >= 0 ? 0 : refuse_values(of);
}

/* ---- numbers ---- */

/* From the first on, to the last digit: a double holds 53 bits. */
static int take_instants(const struct values *of, double *value)
{
	int64_t *whole = malloc(of->count * sizeof(*whole));
	int result = whole != NULL ? read_values(of, H5T_NATIVE_INT64, whole)
	                           : refuse_foreign(of->path, "no memory");

	for (size_t k = 0; k < of->count && result == 0; k++)
		value[k] = (double)(int64_t)((uint64_t)whole[k] - (uint64_t)whole[0]);
	free(whole);
	return result;
}

/* What the array says it fills gaps with is no number. */
static void leave_fills(const struct values *of, double *value)
{
	static const char *const names[] = {"_FillValue", "missing_value"};

	for (size_t i = 0; i < 2 && !of->is_attribute; i++) {
		hid_t attribute =
		        H5Aexists(of->id, names[i]) > 0 ? H5Aopen(of->id, names[i], H5P_DEFAULT) : -1;
		hid_t space = attribute >= 0 ? H5Aget_space(attribute) : -1;
		double fill;

		if (space >= 0 && H5Sget_simple_extent_npoints(space) == 1 &&
		    H5Aread(attribute, H5T_NATIVE_DOUBLE, &fill) >= 0)
			for (size_t k = 0; k < of->count; k++) {
				if (!(value[k] < fill || value[k] > fill))
					value[k] = NAN;
				if (k % PART == 0)
					mapped_seen(PART * sizeof(*value));
			}
		if (space >= 0)
			H5Sclose(space);
		if (attribute >= 0)
			H5Aclose(attribute);
	}
}

/* The same, some rows at a time, as doubles. */
static int read_parts(const struct values *of, hid_t type, double *value)
{
	size_t part = of->columns < PART ? PART / of->columns : 1, rank = of->rank;
	hid_t space = H5Scopy(of->space);
	int result = 0;

	for (size_t row = 0; row < of->rows && result == 0; row += part) {
		size_t rows = of->rows - row < part ? of->rows - row : part;
		const hsize_t from[2] = {row, 0}, size[2] = {rows, of->columns}, count = rows * of->columns;
		hid_t memory = H5Screate_simple(1, &count, NULL);

		if (rank > 0 && H5Sselect_hyperslab(space, H5S_SELECT_SET, from, NULL, size, NULL) < 0)
			result = -1;
		else if (H5Dread(of->id, type, memory, space, H5P_DEFAULT, value + row * of->columns) < 0)
			result = -1;
		H5Sclose(memory);
		mapped_seen(2 * (size_t)count * sizeof(*value));
	}
	H5Sclose(space);
	return result == 0 ? 0 : refuse_values(of);
}

static int put_numbers(const struct values *of, hid_t type, hid_t read_as, const char *path)
{
	double *value = mapped_array(of->count, sizeof(*value)), largest = 0;
	int result = value == NULL      ? refuse_foreign(path, "no memory")
	             : of->is_attribute ? read_values(of, read_as, value)
	                                : read_parts(of, read_as, value);

	for (size_t k = 0; k < of->count && result == 0; k++) {
		largest = fmax(largest, fabs(value[k]));
		if (k % PART == 0)
			mapped_seen(PART * sizeof(*value));
	}
	if (result == 0 && largest > WHOLE_MOST && of->count > 1 && H5Tget_class(type) == H5T_INTEGER &&
	    read_as == H5T_NATIVE_DOUBLE)
		result = take_instants(of, value);
	if (result == 0) {
		leave_fills(of, value);
		result = tree_put(stdout, path,
		                  (struct tree_entry){.rows = of->rows,
		                                      .columns = of->columns,
		                                      .bytes = of->count * sizeof(*value),
		                                      .kind = TREE_NUMBERS,
		                                      .single = H5Tget_class(type) == H5T_FLOAT &&
		                                                H5Tget_size(type) < 8,
		                                      .by_rows = 1},
		                  value);
	}
	mapped_free(value);
	return result;
}

/* A table of rows: each member that is a number is an array. */
static int put_members(const struct values *of)
{
	int members = H5Tget_nmembers(of->type), result = 0;

	if (members > MEMBERS_MOST || of->columns != 1)
		return put_other(of->path, "a table of too many columns or dimensions");
	for (int i = 0; i < members && result == 0; i++) {
		hid_t type = H5Tget_member_type(of->type, (unsigned)i),
		      one = H5Tcreate(H5T_COMPOUND, sizeof(double));
		char *name = H5Tget_member_name(of->type, (unsigned)i), path[PATH_BYTES];

		if (name == NULL ||
		    snprintf(path, sizeof(path), "%s/%s", of->path, name) >= (int)sizeof(path))
			result = refuse_foreign(of->path, "names that are too long");
		else if (H5Tget_class(type) != H5T_INTEGER && H5Tget_class(type) != H5T_FLOAT)
			result = put_other(path, "neither numbers nor text");
		else if (H5Tinsert(one, name, 0, H5T_NATIVE_DOUBLE) < 0)
			result = refuse_foreign(path, "cannot be read");
		else
			result = put_numbers(of, type, one, path);
		H5free_memory(name);
		H5Tclose(one);
		H5Tclose(type);
	}
	return result;
}

/* ---- texts ---- */

static void put_line(FILE *out, const char *line, size_t size, bool first)
{
	size_t length = line != NULL ? strnlen(line, size) : 0;

	if (!first)
		fputc('\n', out);
	for (size_t i = 0; i < length; i++)
		fputc(line[i] == '\n' || line[i] == '\r' ? ' ' : line[i], out);
}

static int take_variable_text(const struct values *of, FILE *out)
{
	hid_t type = H5Tcopy(of->type);
	char **line = calloc(of->count, sizeof(*line));
	int result = line != NULL ? read_values(of, type, line) : -1;

	for (size_t i = 0; i < of->count && result == 0; i++)
		put_line(out, line[i], TEXTS_MOST, i == 0);
	if (result == 0)
		H5Dvlen_reclaim(type, of->space, H5P_DEFAULT, line);
	free(line);
	H5Tclose(type);
	return result;
}

static int take_fixed_text(const struct values *of, FILE *out)
{
	size_t size = H5Tget_size(of->type);
	char *line = size > 0 && size <= TEXTS_MOST / of->count ? calloc(of->count, size) : NULL;
	int result = line != NULL ? read_values(of, of->type, line) : -1;

	for (size_t i = 0; i < of->count && result == 0; i++)
		put_line(out, line + i * size, size, i == 0);
	free(line);
	return result;
}

static int put_texts(const struct values *of)
{
	struct text text;
	int result;

	if (of->count > TEXTS_MOST)
		return put_other(of->path, "too many texts");
	if (text_open(&text) != 0)
		return refuse_foreign(of->path, "no memory");
	result = H5Tis_variable_str(of->type) > 0 ? take_variable_text(of, text.out)
	                                          : take_fixed_text(of, text.out);
	if (text_close(&text, result) != 0)
		return -1;
	result = tree_put(stdout, of->path, (struct tree_entry){.bytes = text.size, .kind = TREE_TEXT},
	                  text.bytes);
	free(text.bytes);
	return result;
}

/* ---- an array or an attribute ---- */

/* Vectors and matrices; false for more dimensions, none, or too many. */
static bool take_extent(struct values *of)
{
	hsize_t size[2] = {1, 1};
	int ranks = H5Sget_simple_extent_ndims(of->space);
	hssize_t count = H5Sget_simple_extent_npoints(of->space);

	if (ranks < 0 || ranks > 2 || count < 1 || count > NUMBERS_MOST ||
	    H5Sget_simple_extent_dims(of->space, size, NULL) < 0)
		return false;
	of->rank = (size_t)ranks;
	of->count = (size_t)count;
	of->rows = (size_t)size[0];
	of->columns = (size_t)size[1];
	return true;
}

/* Of a packed array the size of what is stored tells nothing. */
static bool has_all_chunks(hid_t array, hid_t plan, const struct values *of)
{
	hsize_t chunk[2] = {1, 1}, stored = 0;
	size_t size[2] = {of->rows, of->columns}, wanted = 1;
	int ranks = H5Pget_chunk(plan, 2, chunk);

	for (int i = 0; i < ranks && i < 2; i++)
		wanted *= chunk[i] > 0 ? (size[i] + (size_t)chunk[i] - 1) / (size_t)chunk[i] : 1;
	return ranks >= 1 && ranks <= 2 && H5Dget_num_chunks(array, of->space, &stored) >= 0 &&
	       stored == wanted;
}

/* Samples that were never written, or stand in another file, would read as zeros. NULL: all are there. */
static const char *what_lacks(const struct values *of)
{
	hid_t plan = H5Dget_create_plist(of->id);
	const char *what = NULL;

	if (plan < 0)
		what = "damaged";
	else if (H5Pget_layout(plan) == H5D_VIRTUAL || H5Pget_external_count(plan) > 0)
		what = "samples in another file, expected them in this one";
	else if (H5Pget_layout(plan) == H5D_CHUNKED ? !has_all_chunks(of->id, plan, of)
	                                            : H5Dget_storage_size(of->id) == 0)
		what = "not all of its samples were written";
	if (plan >= 0)
		H5Pclose(plan);
	return what;
}

static int put_values(struct values *of)
{
	H5T_class_t class = H5Tget_class(of->type);
	const char *lacks;

	if (H5Sget_simple_extent_type(of->space) == H5S_NULL || H5Sget_simple_extent_npoints(of->space) == 0)
		return 0;
	if (!take_extent(of))
		return of->is_attribute ? 0
		                        : put_other(of->path, "of more than two dimensions, or too large");
	lacks = of->is_attribute ? NULL : what_lacks(of);
	if (lacks != NULL)
		return put_other(of->path, lacks);
	if (class == H5T_INTEGER || class == H5T_FLOAT || class == H5T_ENUM)
		return class == H5T_ENUM ? put_other(of->path, "names of states")
		                         : put_numbers(of, of->type, H5T_NATIVE_DOUBLE, of->path);
	if (class == H5T_STRING)
		return put_texts(of);
	if (of->is_attribute)
		return 0; /* references to axes, and the like */
	return class == H5T_COMPOUND ? put_members(of) : put_other(of->path, "neither numbers nor text");
}

static int put_one(hid_t id, const char *path, bool is_attribute)
{
	struct values of = {.path = path, .id = id, .is_attribute = is_attribute};
	int result;

	of.type = is_attribute ? H5Aget_type(id) : H5Dget_type(id);
	of.space = is_attribute ? H5Aget_space(id) : H5Dget_space(id);
	if (of.type < 0 || of.space < 0)
		result = refuse_foreign(path, "damaged");
	else
		result = put_values(&of);
	if (of.space >= 0)
		H5Sclose(of.space);
	if (of.type >= 0)
		H5Tclose(of.type);
	return result;
}

/* ---- all objects, each once ---- */

static herr_t on_attribute(hid_t object, const char *name, const H5A_info_t *info, void *context)
{
	const char *of = context;
	hid_t attribute = H5Aopen(object, name, H5P_DEFAULT);
	char path[PATH_BYTES];
	int result = -1;

	(void)info;
	if (attribute < 0 ||
	    snprintf(path, sizeof(path), "%s%s%s", of, of[0] != '\0' ? "/" : "", name) >= (int)sizeof(path))
		refuse_foreign(name, "damaged, or a name that is too long");
	else
		result = put_one(attribute, path, true);
	if (attribute >= 0)
		H5Aclose(attribute);
	return result;
}

static herr_t on_object(hid_t file, const char *name, const H5O_info_t *info, void *context)
{
	char path[PATH_BYTES];
	hid_t object = H5Oopen(file, name, H5P_DEFAULT);
	int result = 0;

	(void)context;
	if (object < 0 ||
	    snprintf(path, sizeof(path), "%s", strcmp(name, ".") == 0 ? "" : name) >= (int)sizeof(path))
		result = refuse_foreign(name, "damaged, or a name that is too long");
	if (result == 0 && info->type == H5O_TYPE_DATASET)
		result = put_one(object, path, false);
	if (result == 0 && H5Aiterate2(object, H5_INDEX_NAME, H5_ITER_INC, NULL, on_attribute, path) < 0)
		result = -1;
	if (object >= 0)
		H5Oclose(object);
	return result;
}

int foreign_put(hid_t file)
{
	if (fwrite(TREE_HEAD, strlen(TREE_HEAD), 1, stdout) != 1)
		return refuse_foreign("standard output", "no room");
	if (H5Ovisit2(file, H5_INDEX_NAME, H5_ITER_NATIVE, on_object, NULL, H5O_INFO_BASIC) < 0) {
		fprintf(stderr, "HDF5: cut or damaged\n"); /* the first line tells, if there is one */
		return -1;
	}
	return fflush(stdout) == 0 ? 0 : -1;
}
