/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <droptower_version.h>
#include <getopt.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/archive/print.h"
#include "host/command/archived.h"
#include "host/command/command.h"
#include "host/record/seal.h"
#include "common/base/text.h"
#include "host/report/pdf.h"
#include "host/report/pdf_attach.h"
#include "host/report/series.h"

struct arguments {
	const char *archive, *html, *pdf, *csv, *laboratory;
	const struct language *language;
	bool undecided, partial, strict;
};

static const struct option_row rows[] = {
        OPTION_TEXT("html", "FILE", struct arguments, html,
                    "one page that holds all of it and needs nothing else"),
        OPTION_TEXT("pdf", "FILE", struct arguments, pdf,
                    "the same on paper; needs chromium, chromium-browser or google-chrome"),
        OPTION_TEXT("csv", "FILE", struct arguments, csv,
                    "the table for spreadsheets, as series show --csv; - is standard output, here and above"),
        OPTION_TEXT(
                "laboratory", "FILE", struct arguments, laboratory,
                "a report under ISO/IEC 17025, 7.8: laboratory, customer, item, sensors from this .ini file; "
                "what it lacks makes the report a draft"),
        COMMAND_LANGUAGE_ROW(struct arguments, language),
        OPTION_FLAG("strict", struct arguments, strict,
                    "with --laboratory: no report with a sensor whose calibration was overdue (exit 3)"),
        OPTION_TEXT("archive", "DIR", struct arguments, archive,
                    "the archive's folder; without it $DROPTOWER_ARCHIVE, else ./archive"),
        OPTION_FLAG("undecided", struct arguments, undecided, "drops that are not decided count, too"),
        OPTION_FLAG("partial", struct arguments, partial,
                    "even when a trace cannot be drawn or a file is not what was recorded"),
};

static const struct option_table known_options = {
        .program = "droptower",
        .command = "report",
        .head = "usage: droptower report SERIES [OPTIONS]\n"
                "\n"
                "What a series of drops came to, for whoever ordered it: what was dropped and how, every "
                "drop's\n"
                "traces, means and uncertainties, what was rejected and why, the model beside it, what "
                "proves it.\n"
                "\n",
        OPTION_ROWS(rows),
        .words = true,
};

static int failed(const char *message)
{
	command_error("%s", message);
	return COMMAND_INPUT;
}

/* The archive knows best what was wrong with it. */
static int report_failed(const struct series_report *request, int result)
{
	const char *message = archive_message(request->archive);

	return failed(message[0] != '\0' ? message : error_text(result));
}

/* The table of the series' drops, which goes into each of the files. */
static int report_make_data(const struct series_report *request, struct text *data)
{
	struct archive_filter filter = archive_filter_none();
	int result = text_open(data);

	filter.series = request->series;
	if (result == 0)
		result = text_close(data, print_drops(request->archive, &filter, request->undecided,
		                                      TABLE_CSV, data->out));
	return result == 0 ? COMMAND_DONE : report_failed(request, result);
}

/* The PDF, the table of drops as an attachment, and the page's evidence as comments. */
static int put_evidence(const char *page, const char *pdf, size_t length, const struct pdf_file *data,
                        FILE *out)
{
	const char *line = strstr(page, SERIES_EVIDENCE), *end;
	size_t start;

	if (line == NULL || pdf_attach(pdf, length, data, out, &start) != 0)
		return DT_E_FORMAT;
	fputs("%droptower evidence\n", out);
	for (line += strlen(SERIES_EVIDENCE); (end = strchr(line, '\n')) != NULL && *line != '-';
	     line = end + 1)
		if (strncmp(line, SEAL_WORD, strlen(SEAL_WORD)) != 0)
			fprintf(out, "%%%.*s\n", (int)(end - line), line);
	fputs("%" SEAL_BLANK "\n", out);
	pdf_attach_end(out, start);
	return 0;
}

static int write_pdf(const struct series_report *request, const struct text *page, const char *file)
{
	char message[ARCHIVE_MESSAGE_MAX] = "no PDF: the browser's is none that an attachment fits into",
	     *pdf = NULL, name[ARCHIVE_NAME_MAX + 8];
	struct pdf_file data = {.name = name, .bytes = request->data, .size = request->data_size};
	struct text sealed = {.bytes = NULL};
	size_t length = 0;
	int code, result = pdf_print(page->bytes, page->size, interrupt_came, &pdf, &length, message,
	                             sizeof(message));

	snprintf(name, sizeof(name), "%s.csv", request->series);
	if (result == 0)
		result = text_open(&sealed);
	if (result == 0)
		result = text_close(&sealed, put_evidence(page->bytes, pdf, length, &data, sealed.out));
	if (result == 0)
		result = seal_fill(sealed.bytes, sealed.size);
	code = result == 0 ? command_write(file, sealed.bytes, sealed.size) : failed(message);
	free(sealed.bytes);
	free(pdf);
	return code;
}

static void report_tell(void *context, const char *text)
{
	(void)context;
	command_error("%s", text);
}

/* Whether its drops are what was recorded, when nobody wants a page. */
static int report_look(const struct series_report *request)
{
	int lacks = archive_verify(request->archive, request->series, 0, report_tell, NULL);

	if (lacks < 0)
		return archived_failed(request->archive);
	if (lacks == 0 || request->partial)
		return COMMAND_DONE;
	command_error("%s: files are not what was recorded; --partial writes the table all the same",
	              request->series);
	return COMMAND_INPUT;
}

/* The page is made once for both. */
static int report_make(const struct series_report *request, struct text *page)
{
	char message[ARCHIVE_MESSAGE_MAX] = "";
	int result = text_open(page);

	if (result == 0)
		result = text_close(page, series_report_html(request, page->out, message, sizeof(message)));
	if (result == 0)
		result = seal_fill(page->bytes, page->size);
	if (result != 0)
		return message[0] != '\0' ? failed(message) : report_failed(request, result);
	return COMMAND_DONE;
}

static int report_write_page(const struct series_report *request, const struct arguments *a,
                             const struct text *page)
{
	int code = a->html != NULL ? command_write(a->html, page->bytes, page->size) : COMMAND_DONE;

	return code == COMMAND_DONE && a->pdf != NULL ? write_pdf(request, page, a->pdf) : code;
}

static int report_write_all(struct archive *archive, const char *series, const struct arguments *a)
{
	const struct translation translation = {a->language, command_untranslated, NULL};
	char message[SETTINGS_MESSAGE_MAX];
	struct laboratory laboratory;
	struct series_report request = {.archive = archive,
	                                .series = series,
	                                .undecided = a->undecided,
	                                .laboratory = a->laboratory != NULL ? &laboratory : NULL,
	                                .strict = a->strict,
	                                .translation = &translation,
	                                .version = DT_VERSION,
	                                .partial = a->partial,
	                                .lacking = report_tell};
	struct scene scene;
	struct text page = {.bytes = NULL}, data = {.bytes = NULL};
	int code;

	if (a->laboratory != NULL && laboratory_read(&laboratory, a->laboratory, message) != 0)
		return failed(message);
	if (archive_scene(archive, series, &scene) != 0)
		return archived_failed(archive);
	code = report_make_data(&request, &data);
	request.data = data.bytes;
	request.data_size = data.size;
	if (code == COMMAND_DONE)
		code = a->html != NULL || a->pdf != NULL ? report_make(&request, &page)
		                                         : report_look(&request);
	if (code == COMMAND_DONE && a->csv != NULL)
		code = command_write(a->csv, data.bytes, data.size);
	if (code == COMMAND_DONE)
		code = report_write_page(&request, a, &page);
	free(page.bytes);
	free(data.bytes);
	return code;
}

int command_report(int argc, char **argv)
{
	struct arguments a = {0};
	char message[ARCHIVE_MESSAGE_MAX];
	struct archive *archive;
	int code = option_read(&known_options, &a, argc, argv);

	if (code != OPTIONS_READ)
		return code;
	if (argc - optind != 1)
		return command_usage("report", "%d words, expected one SERIES", argc - optind);
	if (a.html == NULL && a.pdf == NULL && a.csv == NULL)
		return command_usage("report", "nothing to write: expected --html, --pdf or --csv");
	archive = archive_open(archived_folder(a.archive), ARCHIVE_READ, message);
	if (archive == NULL)
		return failed(message);
	interrupt_catch();
	code = report_write_all(archive, argv[optind], &a);
	archive_close(archive);
	return code;
}
