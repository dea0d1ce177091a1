/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * droptower: one program with subcommands.
 */
#include <malloc.h>
#include <stdio.h>
#include <string.h>

#include <gsl/gsl_errno.h>

#include "host/command/command.h"

static const struct {
	const char *name;
	int (*run)(int argc, char **argv);
	const char *what;
} commands[] = {
        {"run", command_run, "arm, drop, capture, analyse and report; without --link on a simulated tower"},
        {"analyze", command_analyze, "logged drops and foreign recordings to results"},
        {"batch", command_batch, "any number of recordings to one union of results, on many processors"},
        {"model", command_model, "what a drop should look like: prediction, sweeps, Monte Carlo"},
        {"fit", command_fit, "a product's parameters from its drops, with uncertainty; the next drop to do"},
        {"scene", command_scene, "a first scene of a product from its masses and sizes"},
        {"srs", command_srs, "shock response spectra, against a limit curve"},
        {"replay", command_replay, "a logged drop onto CAN or LCM, in its own time"},
        {"convert", command_convert, "candump, LCM, CSV, UFF58 and HDF5 into each other; the wire as DBC"},
        {"series", command_series, "series of drops in an archive: means, decisions, tables"},
        {"verify", command_verify, "whether a file, a drop, an archive or a report is what left the tower"},
        {"report", command_report, "a series for whoever ordered it: a page, on paper, as CSV"},
        {"chart", command_chart, "what the estimates cost and where they fail, in simulated drops"},
        {"ctl", command_ctl, "the operator's verbs: status, arm, release, abort, clear, set"},
        {"bridge", command_bridge, "CAN to LCM and commands back"},
        {"serve", command_serve, "the technician's page, for a tower or a simulated one"},
};
enum { COMMANDS = sizeof(commands) / sizeof(commands[0]) };

static void help(FILE *out)
{
	fputs("usage: droptower COMMAND [OPTIONS]\n\n", out);
	for (int i = 0; i < COMMANDS; i++)
		fprintf(out, "  %-8s %s\n", commands[i].name, commands[i].what);
	fputs("\n'droptower COMMAND --help' tells the options, 'droptower --schema' what a result is. Exit "
	      "codes: 0 done, 2 usage, 3 input "
	      "unusable,\n"
	      "4 link or hardware, 5 refused by an interlock or stopped, 6 a limit of the test plan is not "
	      "met.\n",
	      out);
}

static int main_run(int argc, char **argv)
{
	const char *names[COMMANDS + 1] = {NULL}, *meant;

	if (argc < 2) {
		help(stderr);
		return COMMAND_USAGE;
	}
	if (strcmp(argv[1], "--help") == 0 || strcmp(argv[1], "-h") == 0 || strcmp(argv[1], "help") == 0) {
		help(stdout);
		return COMMAND_DONE;
	}
	if (strcmp(argv[1], "--version") == 0) {
		return command_version();
	}
	if (strcmp(argv[1], "--schema") == 0)
		return command_schema();
	for (int i = 0; i < COMMANDS; i++)
		if (strcmp(argv[1], commands[i].name) == 0)
			return commands[i].run(argc - 1, argv + 1);
	for (int i = 0; i < COMMANDS; i++)
		names[i] = commands[i].name;
	meant = option_nearest(argv[1], names);
	if (meant != NULL)
		command_error("no command '%s', perhaps '%s'; 'droptower --help' lists them", argv[1], meant);
	else
		command_error("no command '%s'; 'droptower --help' lists them", argv[1]);
	return COMMAND_USAGE;
}

/* What one file took is there for the next: pages that the system takes back and hands out again, cleared,
 * for each of many drops cost more than the drops. */
static void keep_memory(void)
{
#ifdef __GLIBC__
	enum { KEPT_BYTES = 16 << 20, MAPPED_BYTES = 8 << 20 };

	mallopt(M_TRIM_THRESHOLD, KEPT_BYTES);
	mallopt(M_MMAP_THRESHOLD, MAPPED_BYTES);
#endif
}

int main(int argc, char **argv)
{
	int code;

	keep_memory();
	gsl_set_error_handler_off();
	code = main_run(argc, argv);
	/* a command that failed has said why */
	if ((fflush(stdout) != 0 || ferror(stdout)) && code == COMMAND_DONE)
		code = command_output_failed("not all of it could be written");
	return code;
}
