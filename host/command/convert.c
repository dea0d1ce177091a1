/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <errno.h>
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/command/archived.h"
#include "host/command/command.h"
#include "host/record/log_capture.h"
#include "host/record/dbc.h"
#include "host/record/read.h"
#include "common/base/text.h"
#include "host/record/write.h"

enum { CONVERT_TOLD = 1 }; /* what was wrong was printed */

static int write_dbc(const char *file)
{
	struct text text;
	int code, result = text_open(&text);

	if (result == 0)
		result = text_close(&text, dbc_write(text.out));
	if (result != 0) {
		command_error("%s: %s", file, error_text(result));
		return COMMAND_INPUT;
	}
	code = command_write(file, text.bytes, text.size);
	free(text.bytes);
	return code;
}

/* A log into blocks, all of it as it is. */
static int convert_log(struct log_file *log, const char *in, const char *out)
{
	char message[READ_MESSAGE_MAX], damage[BLOCKS_MESSAGE_MAX];

	if (write_blocks(log, out, message) != 0) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	if (log_file_damage(log, 0, log->size, damage) == 0)
		return COMMAND_DONE;
	command_error("%s: %s: what stood in it is not in %s", in, damage, out);
	return COMMAND_INPUT;
}

static int convert(const char *in, const char *out, const char *columns, unsigned number)
{
	char message[READ_MESSAGE_MAX];
	struct record record;
	struct log_file log;
	int result;

	if (number == 0 && columns == NULL && write_packs(out) &&
	    log_file_open(&log, in, "a recording", message) == 0) {
		bool is_log = write_blocks_is(&log, out);
		int code = is_log ? convert_log(&log, in, out) : COMMAND_DONE;

		log_file_close(&log);
		if (is_log)
			return code;
	}
	result = read_nth(&record, in, columns, number, message);

	if (result == 0) {
		archived_origin(in, &record);
		result = write_record(&record, out, message);
		record_free(&record);
	}
	if (result == 0)
		return COMMAND_DONE;
	command_error("%s", message);
	return COMMAND_INPUT;
}

struct converting {
	const char *in, *out;
	unsigned number;
	int code;
};

/* OUT with the drop's number in front of its ending; false without memory. */
static bool convert_name_of(const struct converting *converting, char **name)
{
	const char *out = converting->out, *slash = strrchr(out, '/'), *dot = strrchr(out, '.');
	size_t stem = dot != NULL && (slash == NULL || dot > slash) ? (size_t)(dot - out) : strlen(out);

	return asprintf(name, "%.*s-%04u%s", (int)stem, out, converting->number, out + stem) >= 0;
}

static int convert_drop(void *context, const struct log_capture *capture, struct record *record)
{
	struct converting *converting = context;
	char message[READ_MESSAGE_MAX], *name = NULL;
	int result = 0;

	converting->number++;
	if (record == NULL) {
		command_error("%s: drop %u of the log: no block of it", converting->in, capture->number);
		converting->code = COMMAND_INPUT;
		return 0;
	}
	if (!convert_name_of(converting, &name)) {
		result = DT_E_MEMORY;
		command_error("%s: %s", converting->out, error_text(result));
	} else if (command_is_input("convert", name, converting->in)) {
		result = DT_E_ARGUMENT;
	} else {
		result = write_record(record, name, message);
		if (result != 0)
			command_error("%s", message);
		else
			printf("%s\n", name);
	}
	free(name);
	record_free(record);
	converting->code = result != 0 ? COMMAND_INPUT : converting->code;
	return result != 0 ? CONVERT_TOLD : 0;
}

static int convert_each(const char *in, const char *out, const char *columns)
{
	struct converting converting = {.in = in, .out = out, .code = COMMAND_DONE};
	char message[READ_MESSAGE_MAX];
	int result = read_each(in, columns, convert_drop, &converting, message);

	if (result == 0 || result == CONVERT_TOLD)
		return converting.code;
	command_error("%s", message);
	return COMMAND_INPUT;
}

struct arguments {
	const char *columns, *dbc;
	unsigned drop; /* of a log of several; 0: the only one */
	bool each;
};

static const struct option_row rows[] = {
        OPTION_UNSIGNED("drop", "N", struct arguments, drop, 1, 1e9,
                        "the N-th drop of a log of several, counted from 1 ('analyze --list' shows them)"),
        OPTION_FLAG("each", struct arguments, each,
                    "every drop of IN into a file of its own: OUT.csv becomes OUT-0001.csv ..."),
        OPTION_TEXT("columns", "SPEC", struct arguments, columns,
                    "what the columns of foreign text are, where the file does not tell it, e.g. "
                    "\"time:ms,fixture:g,board:-g,-\""),
        OPTION_TEXT("dbc", "OUT", struct arguments, dbc,
                    "the wire as a DBC file for other CAN tools; - is standard output"),
};

static const struct option_table known_options = {
        .program = "droptower",
        .command = "convert",
        .head = "usage: droptower convert IN OUT [--drop N | --each] [--columns SPEC]\n"
                "       droptower convert --dbc OUT\n"
                "\n"
                "Writes a logged drop in another format, chosen by OUT's ending: .log candump text, .lcm LCM "
                "event "
                "log,\n"
                ".csv, .unv or .uff universal file (dataset 58), .h5 or .hdf5 HDF5, .pcapng frames for "
                "Wireshark,\n"
                ".mat MATLAB version 5, .mme a test of ISO 13499 with its folder Channel. .log.zst and "
                ".lcm.zst are\n"
                "a log in blocks with an index: all of IN, however many drops, read at any place; 'zstd -d' "
                "undoes it.\n"
                "IN is recognised by its content.\n"
                "Foreign recordings become CSV, universal files, HDF5, MAT or ISO 13499.\n"
                "\n",
        OPTION_ROWS(rows),
        .words = true,
};

int command_convert(int argc, char **argv)
{
	struct arguments a = {0};
	int code = option_read(&known_options, &a, argc, argv);

	if (code != OPTIONS_READ)
		return code;
	if (a.dbc != NULL)
		return optind == argc ? write_dbc(a.dbc) : command_usage("convert", "--dbc takes no IN");
	if (optind + 2 != argc)
		return command_usage("convert", "expected IN OUT, %d given", argc - optind);
	if (a.each && a.drop != 0)
		return command_usage("convert", "--drop and --each exclude each other");
	if (a.each)
		return convert_each(argv[optind], argv[optind + 1], a.columns);
	if (command_is_input("convert", argv[optind + 1], argv[optind]))
		return COMMAND_USAGE;
	return convert(argv[optind], argv[optind + 1], a.columns, a.drop);
}
