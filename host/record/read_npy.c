/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * A NumPy array (.npy, versions 1 to 3): a vector, or a matrix with a column for each channel. Names, units
 * and rate are not in it.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/record/table_data.h"

struct npy {
	const char *data;
	enum bytes_kind kind;
	bool big, fortran;
	size_t rows, columns;
};

static int npy_refuse(const struct source *source, const char *why, char *message)
{
	return source_refuse(message, DT_E_FORMAT, source->file, 0, "NumPy array %s", why);
}

static bool npy_kind(const char *text, struct npy *npy)
{
	static const struct {
		const char *code;
		enum bytes_kind kind;
	} kinds[] = {{"f4", BYTES_F32}, {"f8", BYTES_F64}, {"i1", BYTES_I8},
	             {"u1", BYTES_U8},  {"i2", BYTES_I16}, {"u2", BYTES_U16},
	             {"i4", BYTES_I32}, {"u4", BYTES_U32}, {"i8", BYTES_I64}};

	for (size_t i = 0; i < sizeof(kinds) / sizeof(kinds[0]); i++)
		if (strncmp(text + 1, kinds[i].code, 2) == 0 && text[3] == '\'') {
			npy->kind = kinds[i].kind;
			npy->big = text[0] == '>';
			return strchr("<>|=", text[0]) != NULL;
		}
	return false;
}

/* "{'descr': '<f8', 'fortran_order': False, 'shape': (1000, 3), }" */
static int npy_head(const char *head, const struct source *source, struct npy *npy, char *message)
{
	const char *descr = strstr(head, "'descr':"), *order = strstr(head, "'fortran_order':"),
	           *shape = strstr(head, "'shape':");
	unsigned long long rows = 0, columns = 1;
	int found;

	if (descr == NULL || order == NULL || shape == NULL)
		return npy_refuse(source, "without descr, fortran_order and shape", message);
	descr += 8 + strspn(descr + 8, " ");
	order += 16 + strspn(order + 16, " ");
	if (descr[0] != '\'' || !npy_kind(descr + 1, npy))
		return npy_refuse(source, "of another type than real numbers, expected one of those",
		                  message);
	npy->fortran = strncmp(order, "True", 4) == 0;
	shape += 8 + strspn(shape + 8, " ");
	found = sscanf(shape, "(%llu,%llu", &rows, &columns);
	if (found < 1 || strchr(shape, ')') == NULL || rows < 2 || columns < 1 || columns > COLUMNS_MAX ||
	    rows > source->size)
		return npy_refuse(source, "of no shape (rows,) or (rows, columns) with two rows and more",
		                  message);
	for (const char *at = shape, *end = strchr(shape, ')'), *comma = NULL; at < end; at++) {
		if (*at == ',' && comma != NULL && at + 1 < end)
			return npy_refuse(source, "of more than two dimensions, expected rows and columns",
			                  message);
		comma = *at == ',' && found == 2 ? at : comma;
	}
	npy->rows = (size_t)rows;
	npy->columns = (size_t)columns;
	return 0;
}

static int npy_open(const struct source *source, struct npy *npy, char *message)
{
	char head[2048];
	size_t wide = source->size > 12 && source->bytes[6] > 1 ? 4 : 2, length, need;
	int error;

	if (source->size < 12 || source->bytes[6] < 1 || source->bytes[6] > 3)
		return npy_refuse(source, "of another version than 1 to 3", message);
	length = (size_t)bytes_whole(source->bytes + 8, wide, false);
	if (length >= sizeof(head) || 8 + wide + length > source->size)
		return npy_refuse(source, "whose header is not all there, or no header of one array",
		                  message);
	memcpy(head, source->bytes + 8 + wide, length);
	head[length] = '\0';
	error = npy_head(head, source, npy, message);
	if (error)
		return error;
	npy->data = source->bytes + 8 + wide + length;
	need = npy->rows * npy->columns * bytes_size(npy->kind);
	if (need != source->size - (8 + wide + length))
		return source_refuse(
		        message, DT_E_FORMAT, source->file, 0,
		        "NumPy array of %zu bytes of numbers, expected %zu as its shape says: cut or damaged",
		        source->size - (8 + wide + length), need);
	return 0;
}

int read_npy(struct table_data *table, const struct source *source, char message[READ_MESSAGE_MAX])
{
	struct npy npy = {.rows = 0};
	int error = npy_open(source, &npy, message);

	table->format = "npy";
	for (size_t c = 0; c < npy.columns && !error; c++) {
		size_t size = bytes_size(npy.kind), from = npy.fortran ? c * npy.rows : c;
		const struct bytes_view view = {.data = npy.data + from * size,
		                                .stride = npy.fortran ? size : npy.columns * size,
		                                .kind = npy.kind,
		                                .big = npy.big};

		if (table_data_view(table, npy.rows, view) == NULL)
			return source_no_memory(message, source->file);
	}
	return error;
}
