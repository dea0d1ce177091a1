/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <droptower_version.h>
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>

#include "host/archive/print.h"
#include "host/command/archived.h"
#include "host/command/command.h"
#include "host/record/whole.h"
#include "host/report/pdf.h"
#include "host/report/series.h"

static const char help[] =
        "usage: droptower report SERIES [OPTIONS]\n"
        "\n"
        "What a series of drops came to, for whoever ordered it: what was dropped and how, every drop's\n"
        "traces, means and uncertainties, what was rejected and why, the model beside it, what proves it.\n"
        "\n"
        "  --html FILE      one page that holds all of it and needs nothing else\n"
        "  --pdf FILE       the same on paper; needs chromium, chromium-browser or google-chrome\n"
        "  --csv FILE       the table for spreadsheets, as series show --csv\n"
        "  --archive DIR    the archive's folder; without it $DROPTOWER_ARCHIVE, else ./archive\n"
        "  --undecided      drops that are not decided count, too\n";

enum { OPTION_ARCHIVE = 256, OPTION_HTML, OPTION_PDF, OPTION_CSV, OPTION_UNDECIDED };

static const struct option long_options[] = {
        {"archive", required_argument, NULL, OPTION_ARCHIVE},
        {"html", required_argument, NULL, OPTION_HTML},
        {"pdf", required_argument, NULL, OPTION_PDF},
        {"csv", required_argument, NULL, OPTION_CSV},
        {"undecided", no_argument, NULL, OPTION_UNDECIDED},
        {"help", no_argument, NULL, 'h'},
        {0},
};

struct arguments {
	const char *archive, *html, *pdf, *csv;
	bool undecided, help;
};

static int parse(struct arguments *a, int argc, char **argv)
{
	int option;

	opterr = 0;
	while ((option = getopt_long(argc, argv, "h", long_options, NULL)) != -1) {
		switch (option) {
		case OPTION_ARCHIVE:
			a->archive = optarg;
			break;
		case OPTION_HTML:
			a->html = optarg;
			break;
		case OPTION_PDF:
			a->pdf = optarg;
			break;
		case OPTION_CSV:
			a->csv = optarg;
			break;
		case OPTION_UNDECIDED:
			a->undecided = true;
			break;
		case 'h':
			a->help = true;
			return COMMAND_DONE;
		default:
			return command_option("report", argv[optind - 1]);
		}
	}
	if (argc - optind != 1)
		return command_usage("report", "%d words, expected one SERIES", argc - optind);
	if (a->html == NULL && a->pdf == NULL && a->csv == NULL)
		return command_usage("report", "nothing to write: expected --html, --pdf or --csv");
	return COMMAND_DONE;
}

static int failed(const char *message)
{
	command_error("%s", message);
	return COMMAND_INPUT;
}

static int write_csv(const struct series_report *request, const char *file)
{
	struct archive_filter filter = archive_filter_none();
	char message[ARCHIVE_MESSAGE_MAX];
	struct whole whole;
	int result = whole_open(&whole, file, message, sizeof(message));

	filter.series = request->series;
	if (result == 0)
		result = whole_close(
		        &whole,
		        print_drops(request->archive, &filter, request->undecided, PRINT_CSV, whole.out),
		        message, sizeof(message));
	return result == 0 ? COMMAND_DONE : failed(message);
}

static int write_pdf(const char *page, size_t length, const char *file)
{
	char message[ARCHIVE_MESSAGE_MAX], *pdf = NULL;
	size_t pdf_length = 0;
	int result =
	        pdf_print(page, length, command_interrupted, &pdf, &pdf_length, message, sizeof(message));

	if (result == 0)
		result = whole_write(file, pdf, pdf_length, message, sizeof(message));
	free(pdf);
	return result == 0 ? COMMAND_DONE : failed(message);
}

/* The page is made once for both. */
static int write_page(const struct series_report *request, const struct arguments *a)
{
	char message[ARCHIVE_MESSAGE_MAX], *page = NULL;
	size_t length = 0;
	FILE *out = open_memstream(&page, &length);
	int result, code = COMMAND_DONE;

	if (out == NULL)
		return failed(error_text(DT_E_MEMORY));
	result = series_report_html(request, out, message, sizeof(message));
	if (fclose(out) != 0 && result == 0) {
		snprintf(message, sizeof(message), "%s", error_text(DT_E_MEMORY));
		result = DT_E_MEMORY;
	}
	if (result == 0 && a->html != NULL)
		result = whole_write(a->html, page, length, message, sizeof(message));
	if (result != 0)
		code = failed(message);
	else if (a->pdf != NULL)
		code = write_pdf(page, length, a->pdf);
	free(page);
	return code;
}

static int write_all(struct archive *archive, const char *series, const struct arguments *a)
{
	struct series_report request = {archive, series, a->undecided, DT_VERSION};
	struct scene scene;
	int code = COMMAND_DONE;

	if (archive_scene(archive, series, &scene) != 0)
		return archived_failed(archive);
	if (a->csv != NULL)
		code = write_csv(&request, a->csv);
	if (code == COMMAND_DONE && (a->html != NULL || a->pdf != NULL))
		code = write_page(&request, a);
	return code;
}

int command_report(int argc, char **argv)
{
	struct arguments a = {0};
	char message[ARCHIVE_MESSAGE_MAX];
	struct archive *archive;
	int code = parse(&a, argc, argv);

	if (code != COMMAND_DONE)
		return code;
	if (a.help) {
		fputs(help, stdout);
		return COMMAND_DONE;
	}
	archive = archive_open(archived_folder(a.archive), ARCHIVE_READ, message);
	if (archive == NULL)
		return failed(message);
	command_catch_signals();
	code = write_all(archive, argv[optind], &a);
	archive_close(archive);
	return code;
}
