/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/hdf5.h"

#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "host/record/helper.h"
#include "host/record/seal.h"
#include "host/record/tree.h"

static const struct helper helper = {"droptower-hdf5", "HDF5", "libhdf5-dev and pkg-config"};

bool hdf5_is(const struct source *source)
{
	static const char signature[] = "\x89HDF\r\n\x1a\n";

	for (size_t at = 0; at + sizeof(signature) <= source->size; at = at == 0 ? 512 : 2 * at)
		if (memcmp(source->bytes + at, signature, sizeof(signature) - 1) == 0)
			return true;
	return false;
}

/* What the helper made of it, as a source of its own that goes by the name of the file. */
static int read_csv_of(struct record *record, int fd, const char *file, char *message)
{
	struct source csv;
	char path[32];
	int error, sealed;

	snprintf(path, sizeof(path), "/proc/self/fd/%d", fd);
	error = source_load(&csv, path, "a recording", message);
	if (error)
		return error;
	csv.file = file;
	sealed = seal_check(&csv, message);
	error = sealed < 0 ? sealed : read_csv(record, &csv, message);
	if (!error)
		record->file_sealed = sealed > 0;
	source_free(&csv);
	return error;
}

static int read_foreign_of(struct record *record, int fd, const struct source *source, const char *columns,
                           char *message)
{
	struct table_data table = {.format = NULL};
	int error = read_tree_of(&table, "hdf5", fd, source, message);

	if (!error)
		error = table_data_record(&table, record, source, columns, message);
	table_data_free(&table);
	return error;
}

int read_hdf5(struct record *record, const struct source *source, const char *columns,
              char message[READ_MESSAGE_MAX])
{
	struct process_streams streams;
	int error = helper_read(&helper, source, &streams, message);
	char head[sizeof(TREE_HEAD)];
	ssize_t size;

	if (error != 0)
		return error;
	size = pread(streams.fd[1], head, sizeof(head), 0);
	if (size > 0 && tree_is(head, (size_t)size))
		error = read_foreign_of(record, streams.fd[1], source, columns, message);
	else if (columns != NULL)
		error = read_refuse_columns(source->file, message);
	else
		error = read_csv_of(record, streams.fd[1], source->file, message);
	if (error == 0)
		strcpy(record->format, "hdf5");
	process_streams_close(&streams);
	return error;
}

int write_hdf5(const struct record *record, FILE *out, const char *file, char message[READ_MESSAGE_MAX])
{
	return helper_write(&helper, record, out, file, message);
}
