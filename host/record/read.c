/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/read.h"

#include <string.h>

#include "host/record/hdf5.h"
#include "host/record/lcm_log.h"
#include "host/record/source.h"
#include "host/record/uff58.h"

static bool is_csv(const struct source *source)
{
	static const char head[] = "# droptower csv";

	return source->size >= sizeof(head) - 1 && memcmp(source->bytes, head, sizeof(head) - 1) == 0;
}

/* The first line that says something begins with '('. */
static bool is_candump(const struct source *source)
{
	struct source_line line = {0};

	while (source_next_line(source, &line))
		if (line.length > 0 && line.text[0] != '#')
			return line.text[0] == '(';
	return false;
}

static int dispatch(struct record *record, const struct source *source, const char *columns,
                    char message[READ_MESSAGE_MAX])
{
	int (*reader)(struct record *, const struct source *, char *) = NULL;

	if (lcm_log_is(source))
		reader = read_lcm;
	else if (hdf5_is(source))
		reader = read_hdf5;
	else if (is_csv(source))
		reader = read_csv;
	else if (uff58_is(source))
		reader = read_uff58;
	else if (is_candump(source))
		reader = read_candump;
	if (!reader)
		return read_delimited(record, source, columns, message);
	if (columns)
		return source_refuse(message, DT_E_ARGUMENT, source->file, 0,
		                     "this format names its channels itself, expected no --columns");
	return reader(record, source, message);
}

int read_record(struct record *record, const char *file, const char *columns, char message[READ_MESSAGE_MAX])
{
	struct source source;
	int error;

	if (strlen(file) >= sizeof(record->file))
		return source_refuse(message, DT_E_ARGUMENT, file, 0,
		                     "name of %zu bytes, expected less than %zu", strlen(file),
		                     sizeof(record->file));
	error = source_load(&source, file, "a recording", message);
	if (error)
		return error;
	error = dispatch(record, &source, columns, message);
	if (!error)
		strcpy(record->file, file);
	source_free(&source);
	return error;
}
