/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <errno.h>
#include <getopt.h>
#include <stdio.h>
#include <string.h>

#include "host/command/command.h"
#include "host/record/dbc.h"
#include "host/record/read.h"
#include "host/record/whole.h"
#include "host/record/write.h"

static const char help[] =
        "usage: droptower convert IN OUT [--columns SPEC]\n"
        "       droptower convert --dbc OUT\n"
        "\n"
        "Writes a logged drop in another format, chosen by OUT's ending: .log candump text, .lcm LCM event "
        "log,\n"
        ".csv, .unv or .uff universal file (dataset 58), .h5 or .hdf5 HDF5. IN is recognised by its "
        "content.\n"
        "Foreign recordings become CSV, universal files or HDF5; foreign text needs --columns.\n"
        "\n"
        "  --columns SPEC  for foreign text, e.g. \"time:ms,fixture:g,board:-g,-\"\n"
        "  --dbc OUT       the wire as a DBC file for other CAN tools; - is standard output\n";

static int write_dbc(const char *file)
{
	char message[READ_MESSAGE_MAX];
	struct whole whole;
	int result;

	if (strcmp(file, "-") == 0) {
		if (dbc_write(stdout) == 0 && fflush(stdout) == 0)
			return COMMAND_DONE;
		command_error("standard output: %s", strerror(errno));
		return COMMAND_INPUT;
	}
	result = whole_open(&whole, file, message, sizeof(message));

	if (result == 0)
		result = whole_close(&whole, dbc_write(whole.out), message, sizeof(message));
	if (result == 0)
		return COMMAND_DONE;
	command_error("%s", message);
	return COMMAND_INPUT;
}

static int convert(const char *in, const char *out, const char *columns)
{
	char message[READ_MESSAGE_MAX];
	struct record record;
	int result = read_record(&record, in, columns, message);

	if (result == 0) {
		result = write_record(&record, out, message);
		record_free(&record);
	}
	if (result == 0)
		return COMMAND_DONE;
	command_error("%s", message);
	return COMMAND_INPUT;
}

int command_convert(int argc, char **argv)
{
	static const struct option options[] = {{"columns", required_argument, NULL, 'c'},
	                                        {"dbc", required_argument, NULL, 'd'},
	                                        {"help", no_argument, NULL, 'h'},
	                                        {0}};
	const char *columns = NULL, *dbc = NULL;
	int option;

	opterr = 0;
	while ((option = getopt_long(argc, argv, "h", options, NULL)) != -1) {
		if (option == 'c')
			columns = optarg;
		else if (option == 'd')
			dbc = optarg;
		else if (option == 'h') {
			fputs(help, stdout);
			return COMMAND_DONE;
		} else
			return command_option("convert", argv[optind - 1]);
	}
	if (dbc != NULL)
		return optind == argc ? write_dbc(dbc) : command_usage("convert", "--dbc takes no IN");
	if (optind + 2 != argc)
		return command_usage("convert", "expected IN OUT, %d given", argc - optind);
	if (command_is_input("convert", argv[optind + 1], argv[optind]))
		return COMMAND_USAGE;
	return convert(argv[optind], argv[optind + 1], columns);
}
