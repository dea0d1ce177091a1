/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A report against the archive that it was made of: its comment says what it rests on.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include <nettle/base64.h>

#include "common/base/text.h"
#include "host/archive/print.h"
#include "host/command/archived.h"
#include "host/command/command.h"
#include "host/command/verify.h"
#include "host/command/verify_data.h"
#include "host/record/seal.h"

struct evidence {
	const char *file;
	char *text; /* all of the file, with a NUL behind each line */
	size_t size;
	char series[ARCHIVE_NAME_MAX + 1], head[65];
	long long entry;
	char *first;  /* line behind the mark */
	bool altered; /* by its own SHA-256, so that what it says is only looked at for what was altered */
	struct archive *archive;
	unsigned logs, wrong;
};

bool verify_is_report(const char *file)
{
	FILE *in = fopen(file, "re");
	char head[16] = "";

	if (in == NULL)
		return false;
	if (fgets(head, sizeof(head), in) == NULL)
		head[0] = '\0';
	fclose(in);
	return strncmp(head, "%PDF-", 5) == 0 || strncmp(head, "<!DOCTYPE html", 14) == 0 ||
	       strncmp(head, "<!doctype html", 14) == 0;
}

static void tell_wrong(struct evidence *e, const char *what)
{
	e->wrong++;
	command_error("%s: %s", e->file, what);
}

/* ---- what it says ---- */

/* The next line, without the '%' of a PDF's comment; NULL behind the last of the comment. */
static char *next_line(const struct evidence *e, char **at)
{
	char *line = *at + (**at == '%');

	if (*at >= e->text + e->size || strncmp(line, SEAL_WORD, strlen(SEAL_WORD)) == 0)
		return NULL;
	*at += strlen(*at) + 1;
	return line;
}

/* False when there is no such comment. */
static bool verify_report_split(struct evidence *e)
{
	static const char mark[] = "droptower evidence\n";
	char *at = memmem(e->text, e->size, mark, sizeof(mark) - 1), *line;

	if (at == NULL)
		return false;
	for (char *c = at; c < e->text + e->size; c++)
		if (*c == '\n')
			*c = '\0';
	at += sizeof(mark) - 1;
	e->first = at;
	while ((line = next_line(e, &at)) != NULL) {
		if (strncmp(line, "series ", 7) == 0)
			snprintf(e->series, sizeof(e->series), "%s", line + 7);
		else if (strncmp(line, "chain ", 6) == 0 &&
		         sscanf(line + 6, "%lld %64s", &e->entry, e->head) != 2)
			e->entry = 0;
	}
	return e->series[0] != '\0';
}

static int load(struct evidence *e)
{
	char message[READ_MESSAGE_MAX];
	struct source source;
	int sealed;

	if (source_load(&source, e->file, "a report", message) != 0) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	sealed = seal_check(&source, message);
	e->altered = sealed < 0;
	e->text = sealed != 0 ? calloc(1, source.size + 1) : NULL;
	e->size = source.size;
	if (e->text != NULL)
		memcpy(e->text, source.bytes, source.size);
	source_free(&source);
	if (sealed < 0) {
		command_error("%s", message);
		return e->text != NULL && verify_report_split(e) ? COMMAND_DONE : COMMAND_INPUT;
	}
	if (sealed == 0)
		command_error("%s: not sealed: no report of a series, or one of an older version", e->file);
	else if (e->text != NULL && verify_report_split(e))
		return COMMAND_DONE;
	else
		command_error("%s: no report of a series: it names no drops", e->file);
	return COMMAND_INPUT;
}

/* ---- against the archive ---- */

/* The line of this log; NULL when it is not named. */
static char *verify_report_line_of(const struct evidence *e, const char *raw)
{
	char *at = e->first, *line;
	size_t length = strlen(raw);

	while ((line = next_line(e, &at)) != NULL)
		if (strncmp(line, "log ", 4) == 0 && strncmp(line + 4, raw, length) == 0 &&
		    line[4 + length] == ' ')
			return line + 4 + length + 1;
	return NULL;
}

static int hold_drop(void *context, const struct archive_drop *drop)
{
	struct evidence *e = context;
	const char *hash = verify_report_line_of(e, drop->raw);
	char text[ARCHIVE_MESSAGE_MAX];

	if (hash == NULL)
		return 0; /* made since */
	e->logs++;
	if (strcmp(hash, drop->sha256) != 0) {
		snprintf(text, sizeof(text), "exchanged: it names SHA-256 %.64s for %s/%u, expected %s", hash,
		         drop->series.name, drop->number, drop->sha256);
		tell_wrong(e, text);
	}
	return 0;
}

static void verify_report_tell(void *context, const char *text)
{
	tell_wrong(context, text);
}

static unsigned verify_report_named(const struct evidence *e)
{
	char *at = e->first, *line;
	unsigned count = 0;

	while ((line = next_line(e, &at)) != NULL)
		count += strncmp(line, "log ", 4) == 0;
	return count;
}

/* The table that it carries along, in words of its own memory; NULL when it has none that can be read. */
static char *verify_report_table(const struct evidence *e)
{
	char *at = e->first, *line, *table = NULL;
	struct base64_decode_ctx decoder;
	size_t size = 0;

	while ((line = next_line(e, &at)) != NULL && strncmp(line, "data ", 5) != 0)
		;
	if (line != NULL) {
		size = BASE64_DECODE_LENGTH(strlen(line + 5));
		table = calloc(1, size + 1);
	}
	if (table == NULL)
		return NULL;
	base64_decode_init(&decoder);
	if (base64_decode_update(&decoder, &size, (uint8_t *)table, strlen(line + 5), line + 5) == 1 &&
	    base64_decode_final(&decoder) == 1 && strlen(table) == size)
		return table;
	free(table);
	return NULL;
}

/* That table against the archive's; one that cannot be read is wrong. */
static int verify_report_data(struct evidence *e, const struct archive_filter *filter)
{
	char *was = verify_report_table(e);
	struct text is = {.bytes = NULL};
	int result = text_open(&is);

	if (result == 0)
		result = text_close(&is, print_drops(e->archive, filter, false, TABLE_CSV, is.out));
	if (result == 0 && (was == NULL || verify_data(was, is.bytes, verify_report_tell, e) < 0))
		tell_wrong(e, "its table of drops cannot be read");
	free(is.bytes);
	free(was);
	return result;
}

static int verify_report_hold(struct evidence *e)
{
	struct archive_filter filter = archive_filter_none();
	char text[ARCHIVE_MESSAGE_MAX];
	int reaches = archive_reaches(e->archive, e->entry, e->head);

	filter.series = e->series;
	if (reaches < 0 || archive_each_drop(e->archive, &filter, hold_drop, e) != 0 ||
	    archive_verify(e->archive, e->series, 0, verify_report_tell, e) < 0 ||
	    verify_report_data(e, &filter) != 0)
		return archived_failed(e->archive);
	if (reaches == 0) {
		snprintf(text, sizeof(text), "%s in %.400s: no entry %lld with the head %s",
		         e->entry == 0 ? "not sealed" : "chain broken", archive_folder(e->archive), e->entry,
		         e->head);
		tell_wrong(e, text);
	}
	if (e->logs < verify_report_named(e)) {
		snprintf(text, sizeof(text), "missing: it names %u drops of %s, %.300s has %u of them",
		         verify_report_named(e), e->series, archive_folder(e->archive), e->logs);
		tell_wrong(e, text);
	}
	if (e->wrong > 0 || e->altered)
		return COMMAND_INPUT;
	printf("%s: proven: as it was written, %u logs and its table as the archive has them, its chain "
	       "reaches "
	       "entry %lld\n",
	       e->file, e->logs, e->entry);
	return COMMAND_DONE;
}

/* The folder a report stands in, when that is an archive, or one named archive in it. */
static const char *verify_report_folder_of(const char *file, const char *given, char beside[ARCHIVE_PATH_MAX])
{
	static const char *const names[] = {"", "/archive"};
	const char *slash = strrchr(file, '/');
	char index[ARCHIVE_PATH_MAX + 16];
	struct stat status;

	for (size_t i = 0; i < 2 && given == NULL; i++) {
		snprintf(beside, ARCHIVE_PATH_MAX, "%.*s%s", slash != NULL ? (int)(slash - file) : 1,
		         slash != NULL ? file : ".", names[i]);
		snprintf(index, sizeof(index), "%s/index.sqlite", beside);
		if (stat(index, &status) == 0)
			return beside;
	}
	return archived_folder(given);
}

int verify_report(const char *file, const char *folder)
{
	struct evidence e = {.file = file};
	char message[ARCHIVE_MESSAGE_MAX], beside[ARCHIVE_PATH_MAX];
	int code = load(&e);

	if (code == COMMAND_DONE) {
		e.archive =
		        archive_open(verify_report_folder_of(file, folder, beside), ARCHIVE_READ, message);
		if (e.archive == NULL) {
			command_error("%s", message);
			code = COMMAND_INPUT;
		} else {
			code = verify_report_hold(&e);
			archive_close(e.archive);
		}
	}
	free(e.text);
	return code;
}
