/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * droptower-mat read|write: a MAT file on standard input, which has to be a file, as a tree
 * (host/record/tree.h) on standard output; our CSV as a MAT file (put.h). Started by droptower
 * (host/record/read_mat.c).
 *
 * libmatio ends silently where a file ends or is damaged: what stands between its marks is counted here
 * first, and what is compressed is unpacked to its checksum.
 */
#include <fcntl.h>
#include <matio.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <zlib.h>

#include "common/base/process.h"
#include "common/base/text.h"
#include "common/link/temporary.h"
#include "host/mat/put.h"
#include "host/record/helper.h"
#include "host/record/mat.h"
#include "host/record/tree.h"

enum { HEAD = 128, MATRIX = 14, COMPRESSED = 15, DEEPEST = 16, ELEMENTS_MOST = 4096, DEFLATE_MOST = 1032 };

/* As many numbers as the file can hold, which are a byte each at least: a dimension that is damaged may be
 * any. */
static size_t numbers_most;

static int refuse(const char *what)
{
	fprintf(stderr, "MAT file %s\n", what);
	return -1;
}

/* ---- whether all of it is there ---- */

static bool unpacks(const char *bytes, size_t size)
{
	static unsigned char out[1 << 16];
	z_stream stream = {.next_in = (unsigned char *)(uintptr_t)bytes, .avail_in = (unsigned)size};
	int state = inflateInit(&stream);

	while (state == Z_OK) {
		stream.next_out = out;
		stream.avail_out = sizeof(out);
		state = inflate(&stream, Z_NO_FLUSH);
	}
	inflateEnd(&stream);
	return state == Z_STREAM_END && stream.avail_in == 0;
}

/* Elements of version 5; -1 where they do not come out even. */
static long count_5(const struct source *source)
{
	bool big = source->size > HEAD && source->bytes[126] == 'M';
	long count = 0;

	for (size_t at = HEAD; at < source->size; count++) {
		uint64_t type, size;

		if (source->size - at < 8)
			return -1;
		type = bytes_whole(source->bytes + at, 4, big);
		size = bytes_whole(source->bytes + at + 4, 4, big);
		at += 8;
		if ((type != MATRIX && type != COMPRESSED) || size > source->size - at ||
		    (type == COMPRESSED && !unpacks(source->bytes + at, (size_t)size)))
			return -1;
		at += (size_t)size;
	}
	return count;
}

/* ---- a variable ---- */

static int put_variable(const char *path, const matvar_t *variable, unsigned deep);

static int put_other(const char *path, const char *what)
{
	return tree_put_text(stdout, path, TREE_OTHER, what);
}

static size_t elements_of(const matvar_t *variable)
{
	size_t count = 1;

	for (int i = 0; i < variable->rank; i++)
		if (__builtin_mul_overflow(count, variable->dims[i], &count))
			return SIZE_MAX;
	return count;
}

static bool kind_of(enum matio_types type, enum bytes_kind *kind)
{
	static const struct {
		enum matio_types type;
		enum bytes_kind kind;
	} kinds[] = {{MAT_T_DOUBLE, BYTES_F64}, {MAT_T_SINGLE, BYTES_F32}, {MAT_T_INT8, BYTES_I8},
	             {MAT_T_UINT8, BYTES_U8},   {MAT_T_INT16, BYTES_I16},  {MAT_T_UINT16, BYTES_U16},
	             {MAT_T_INT32, BYTES_I32},  {MAT_T_UINT32, BYTES_U32}, {MAT_T_INT64, BYTES_I64},
	             {MAT_T_UINT64, BYTES_U64}};

	for (size_t i = 0; i < sizeof(kinds) / sizeof(kinds[0]); i++)
		if (kinds[i].type == type) {
			*kind = kinds[i].kind;
			return true;
		}
	return false;
}

static int put_numbers(const char *path, const matvar_t *variable)
{
	size_t count = elements_of(variable);
	enum bytes_kind kind;
	double *value;
	int result;

	if (variable->isComplex)
		return put_other(path, "complex numbers");
	if (variable->rank != 2)
		return put_other(path, "of more than two dimensions");
	if (count == 0)
		return 0;
	if (count > numbers_most || variable->data == NULL || !kind_of(variable->data_type, &kind) ||
	    count > UINT32_MAX || variable->nbytes != count * bytes_size(kind))
		return refuse("is damaged: a matrix without its numbers");
	value = malloc(count * sizeof(*value));
	if (value == NULL)
		return refuse("is too large for the memory");
	for (size_t k = 0; k < count; k++)
		value[k] = bytes_value((const char *)variable->data + k * bytes_size(kind), kind, false);
	result = tree_put(stdout, path,
	                  (struct tree_entry){.rows = variable->dims[0],
	                                      .columns = variable->dims[1],
	                                      .bytes = count * sizeof(*value),
	                                      .kind = TREE_NUMBERS,
	                                      .single = kind == BYTES_F32},
	                  value);
	free(value);
	return result;
}

/* A character of 8, 16 or 32 bits as UTF-8; bytes beyond ASCII are UTF-8 already. */
static void put_character(FILE *out, const matvar_t *text, size_t k)
{
	size_t width = (size_t)text->data_size;
	uint64_t c = bytes_whole((const char *)text->data + k * width, width, false);

	if (c < 0x80 || width == 1) {
		fputc((int)c, out);
	} else if (c < 0x800) {
		fputc((int)(0xC0 | c >> 6), out);
		fputc((int)(0x80 | (c & 0x3F)), out);
	} else {
		fputc((int)(0xE0 | (c >> 12 & 0xF)), out);
		fputc((int)(0x80 | (c >> 6 & 0x3F)), out);
		fputc((int)(0x80 | (c & 0x3F)), out);
	}
}

/* A line for each row of characters; -1 where it is no text. */
static int text_lines(FILE *out, const matvar_t *text)
{
	size_t rows, columns, held;

	if (text->class_type != MAT_C_CHAR || text->rank != 2 || elements_of(text) > INT32_MAX)
		return -1;
	rows = text->dims[0];
	columns = text->dims[1];
	held = text->data != NULL && text->data_size > 0 ? text->nbytes / (size_t)text->data_size : 0;
	if (text->data_size > 4)
		return -1;
	if (rows <= 1)
		columns = held; /* of UTF-8 there are more bytes than characters */
	else if (held < rows * columns)
		return -1;
	for (size_t r = 0; r < rows; r++) {
		if (r > 0)
			fputc('\n', out);
		for (size_t c = 0; c < columns; c++)
			put_character(out, text, r + c * rows);
	}
	return 0;
}

static int put_text(const char *path, const matvar_t *const *cell, size_t count)
{
	struct text text;
	int result = 0;

	if (text_open(&text) != 0)
		return refuse("is too large for the memory");
	for (size_t i = 0; i < count && result == 0; i++) {
		if (i > 0)
			fputc('\n', text.out);
		result = cell[i] != NULL ? text_lines(text.out, cell[i]) : -1;
	}
	if (text_close(&text, result) != 0)
		return put_other(path, "a text that is none");
	result = tree_put(stdout, path, (struct tree_entry){.bytes = text.size, .kind = TREE_TEXT},
	                  text.bytes);
	free(text.bytes);
	return result;
}

static int put_element(const char *path, const char *name, size_t k, size_t count, const matvar_t *element,
                       unsigned deep)
{
	char below[1024];
	int length = count > 1 ? snprintf(below, sizeof(below), "%s(%zu)%s%s", path, k + 1,
	                                  name[0] ? "/" : "", name)
	                       : snprintf(below, sizeof(below), "%s%s%s", path, name[0] ? "/" : "", name);

	if (length >= (int)sizeof(below))
		return refuse("has names that are too long");
	return element != NULL ? put_variable(below, element, deep + 1) : 0;
}

static int put_struct(const char *path, matvar_t *variable, unsigned deep)
{
	size_t count = elements_of(variable);
	unsigned fields = Mat_VarGetNumberOfFields(variable);
	char *const *names = Mat_VarGetStructFieldnames(variable);
	int result = 0;

	if (count > ELEMENTS_MOST || (fields > 0 && names == NULL))
		return put_other(path, "too many elements");
	for (size_t k = 0; k < count; k++)
		for (unsigned f = 0; f < fields && result == 0; f++)
			result = put_element(path, names[f], k, count,
			                     Mat_VarGetStructFieldByIndex(variable, f, k), deep);
	return result;
}

/* A cell array of texts is a text of so many lines. */
static int put_cells(const char *path, matvar_t *variable, unsigned deep)
{
	size_t count = elements_of(variable), texts = 0;
	matvar_t **cells = variable->data;
	int result = 0;

	if (cells == NULL || count == 0)
		return 0;
	if (count > ELEMENTS_MOST || variable->nbytes / sizeof(*cells) < count)
		return put_other(path, "too many elements");
	for (size_t k = 0; k < count; k++)
		texts += cells[k] != NULL && cells[k]->class_type == MAT_C_CHAR && cells[k]->rank == 2 &&
		         cells[k]->dims[0] <= 1;
	if (texts == count)
		return put_text(path, (const matvar_t *const *)cells, count);
	for (size_t k = 0; k < count && result == 0; k++)
		result = put_element(path, "", k, count, cells[k], deep);
	return result;
}

static int put_variable(const char *path, const matvar_t *is, unsigned deep)
{
	matvar_t *variable = (matvar_t *)(uintptr_t)is; /* the library takes none that is const */

	if (deep > DEEPEST)
		return put_other(path, "too deep in others");
	switch (variable->class_type) {
	case MAT_C_STRUCT:
		return put_struct(path, variable, deep);
	case MAT_C_CELL:
		return put_cells(path, variable, deep);
	case MAT_C_CHAR:
		return put_text(path, &is, 1);
	case MAT_C_EMPTY:
		return put_other(path, "empty, or of no known class");
	case MAT_C_SPARSE:
		return put_other(path, "a sparse matrix");
	case MAT_C_OBJECT:
	case MAT_C_OPAQUE:
		return put_other(path, "an object, as a timetable: save its parts as arrays");
	case MAT_C_FUNCTION:
		return put_other(path, "a function");
	default:
		return put_numbers(path, variable);
	}
}

/* ---- the file ---- */

static unsigned complaints;
static char complaint[100];

static void on_complaint(int level, char *text)
{
	if (complaints == 0)
		snprintf(complaint, sizeof(complaint), "%.*s", (int)strcspn(text, "\n"), text);
	complaints += (level & (MATIO_LOG_LEVEL_ERROR | MATIO_LOG_LEVEL_CRITICAL)) != 0;
}

static int put_all(mat_t *mat, long expected)
{
	matvar_t *variable;
	long count = 0;
	int result = fwrite(TREE_HEAD, strlen(TREE_HEAD), 1, stdout) == 1 ? 0 : -1;

	while (result == 0 && (variable = Mat_VarReadNext(mat)) != NULL) {
		/* without a name it is what objects keep */
		result = variable->name != NULL && variable->name[0] != '\0'
		                 ? put_variable(variable->name, variable, 0)
		                 : 0;
		Mat_VarFree(variable);
		count++;
	}
	if (result == 0 && (complaints > 0 || count != expected)) {
		fprintf(stderr, "MAT file is cut or damaged: %ld variables of %ld read%s%s\n", count,
		        expected, complaints > 0 ? ", " : "", complaints > 0 ? complaint : "");
		result = -1;
	}
	return result == 0 && fflush(stdout) == 0 ? 0 : -1;
}

/* HDF5 opens no link to a file without a name, as our input may be: it gets one until it is open. */
static mat_t *open_7_3(const struct source *source)
{
	struct temporary folder;
	char path[TEMPORARY_PATH_MAX + 8];
	mat_t *mat = NULL;
	int fd;

	if (temporary_make(&folder, "mat") != 0)
		return NULL;
	snprintf(path, sizeof(path), "%s/in.mat", folder.path);
	fd = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
	if (fd >= 0 && process_write(fd, source->bytes, source->size) == 0)
		mat = Mat_Open(path, MAT_ACC_RDONLY);
	if (fd >= 0)
		close(fd);
	temporary_remove(&folder);
	return mat;
}

static int mat_to_tree(const struct source *source)
{
	bool is_7 = source->size > HEAD && memcmp(source->bytes, "MATLAB 7.3 ", 11) == 0,
	     is_5 = source->size > HEAD && memcmp(source->bytes, "MATLAB 5.0 ", 11) == 0;
	long expected = is_5 ? count_5(source) : is_7 ? 0 : mat4_count(source->bytes, source->size);
	size_t count = 0;
	mat_t *mat;
	int result;

	if (expected < 0)
		return refuse(
		        "is cut or damaged: its elements do not come out even, or a checksum does not agree");
	numbers_most = is_7 ? SIZE_MAX : is_5 ? DEFLATE_MOST * source->size : source->size;
	Mat_LogInitFunc("droptower-mat", on_complaint);
	mat = is_7 ? open_7_3(source) : Mat_Open("/dev/stdin", MAT_ACC_RDONLY);
	if (mat == NULL)
		return refuse("is cut or damaged: it does not open");
	if (is_7)
		expected = Mat_GetDir(mat, &count) != NULL ? (long)count : -1;
	result = put_all(mat, expected);
	Mat_Close(mat);
	return result;
}

int main(int argc, char **argv)
{
	return helper_serve(argc, argv, "droptower-mat", mat_to_tree, put_record);
}
