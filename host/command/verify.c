/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * `droptower verify`: whether a file, a drop, an archive or a report is what left the tower.
 */
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "host/command/archived.h"
#include "host/command/command.h"
#include "host/command/verify.h"
#include "host/record/log_capture.h"
#include "host/record/read.h"

/* ---- an archive, a drop ---- */

static void verify_tell(void *context, const char *text)
{
	(void)context;
	command_error("%s", text);
}

static int with_archive(const char *folder, const char *name,
                        int (*verify)(struct archive *archive, const char *name))
{
	char message[ARCHIVE_MESSAGE_MAX];
	struct archive *archive = archive_open(folder, ARCHIVE_READ, message);
	int code;

	if (archive == NULL) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	code = verify(archive, name);
	archive_close(archive);
	return code;
}

static int proven(struct archive *archive, const char *name)
{
	struct archive_seal seal;

	if (archive_seal(archive, &seal) != 0)
		return archived_failed(archive);
	printf("%s: proven: %lld drops, chain at entry %lld, head %s\n", name, (long long)seal.drops,
	       (long long)seal.entry, seal.head);
	return COMMAND_DONE;
}

static int verify_archive(struct archive *archive, const char *name)
{
	int told = archive_verify(archive, NULL, 0, verify_tell, NULL);
	struct archive_seal seal;

	if (told < 0 || archive_seal(archive, &seal) != 0)
		return archived_failed(archive);
	if (seal.not_sealed > 0)
		command_error("%s: not sealed: %lld of %lld drops, recorded before there was a chain", name,
		              (long long)seal.not_sealed, (long long)seal.drops);
	return told > 0 || seal.not_sealed > 0 ? COMMAND_INPUT : proven(archive, name);
}

struct seen {
	bool there, recorded, sealed;
};

static int see(void *context, const struct archive_drop *drop)
{
	*(struct seen *)context = (struct seen){true, drop->sha256[0] != '\0', drop->sealed};
	return 0;
}

static int verify_drop(struct archive *archive, const char *name)
{
	const char *slash = strrchr(name, '/');
	struct archive_filter filter = archive_filter_none();
	char series[ARCHIVE_NAME_MAX + 1];
	struct seen seen = {.there = false};
	int told;

	snprintf(series, sizeof(series), "%.*s", (int)(slash - name), name);
	filter.series = series;
	filter.number = (unsigned)strtoul(slash + 1, NULL, 10);
	if (filter.number > 0 && archive_each_drop(archive, &filter, see, &seen) != 0)
		return archived_failed(archive);
	if (!seen.there || !seen.recorded) {
		command_error(seen.there ? "%s was never completely recorded, in %s"
		                         : "no file and no drop '%s', in %s",
		              name, archive_folder(archive));
		return COMMAND_INPUT;
	}
	told = archive_verify(archive, series, filter.number, verify_tell, NULL);
	if (told < 0)
		return archived_failed(archive);
	if (told == 0 && !seen.sealed)
		command_error("%s: not sealed: recorded before there was a chain", name);
	if (told > 0 || !seen.sealed)
		return COMMAND_INPUT;
	printf("%s: proven: log, sidecar and results are what was recorded\n", name);
	return COMMAND_DONE;
}

/* ---- a file ---- */

/* What is not proven of a recording; NULL: nothing. */
static const char *doubt(const struct record *r)
{
	bool ours = strcmp(r->format, "delimited") != 0 && strcmp(r->format, "lvm") != 0;
	bool log = strcmp(r->format, "candump") == 0;

	if (!ours)
		return "not sealed: no file of ours, and nothing in it says what was measured";
	if (!log && !r->file_sealed)
		return "not sealed: it has no SHA-256, as files of older versions and of other programs";
	if (!r->is_drop)
		return log ? "no drop of a tower" : NULL;
	if (!r->crc_known)
		return "cut: without a capture end, nothing says what the tower sent";
	if (r->lost_samples > 0)
		return "cut: samples are lost that the tower sent";
	if (!r->crc_agrees)
		return "altered: the capture's CRC-32 does not agree with its samples";
	if (!r->seal_known)
		return "not sealed: its capture end has no checksum, as those of older towers";
	if (!r->seal_agrees)
		return "altered: the capture end does not agree with its seal";
	return r->flags & RECORD_FLAG_ALTERED
	               ? "altered: the parameters are not those whose CRC-32 the capture end names"
	               : NULL;
}

struct proving {
	const char *file;
	bool doubted;
};

static void verify_judge(struct proving *proving, const char *name, const struct record *record)
{
	const char *why = doubt(record);

	if (why != NULL) {
		proving->doubted = true;
		command_error("%s: %s", name, why);
	} else if (record->is_drop) {
		printf("%s: proven: drop %u, every sample (CRC-32 %08lx) and the capture end (seal %08lx)%s "
		       "as "
		       "the tower sent them%s\n",
		       name, record->drop_id, (unsigned long)record->crc32, (unsigned long)record->seal,
		       record->parameters_known ? ", the parameters" : "",
		       record->file_sealed ? ", the file as it was written" : "");
	} else {
		printf("%s: proven: as it was written; no drop of a tower\n", name);
	}
}

/* Each capture of a log; record is NULL when no block of it is held. */
static int prove(void *context, const struct log_capture *capture, struct record *record)
{
	struct proving *proving = context;
	char name[READ_MESSAGE_MAX];

	if (capture == NULL || capture->alone)
		snprintf(name, sizeof(name), "%.400s", proving->file);
	else
		snprintf(name, sizeof(name), "%.400s, drop %u", proving->file, capture->number);
	if (record == NULL) {
		proving->doubted = true;
		command_error("%s: cut: no block of it", name);
		return 0;
	}
	verify_judge(proving, name, record);
	record_free(record);
	return 0;
}

static int verify_recording(const char *file)
{
	struct proving proving = {.file = file};
	char message[READ_MESSAGE_MAX];

	if (read_each(file, NULL, prove, &proving, message) != 0) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	return proving.doubted ? COMMAND_INPUT : COMMAND_DONE;
}

/* ---- which of them ---- */

static int verify(const char *name, const char *folder)
{
	struct stat status;

	if (stat(name, &status) == 0)
		return S_ISDIR(status.st_mode)  ? with_archive(name, name, verify_archive)
		       : verify_is_report(name) ? verify_report(name, folder)
		                                : verify_recording(name);
	if (strchr(name, '/') != NULL)
		return with_archive(archived_folder(folder), name, verify_drop);
	command_error("%s: no such file, and no drop, expected SERIES/NUMBER", name);
	return COMMAND_INPUT;
}

struct arguments {
	const char *archive;
};

static const struct option_row rows[] = {
        OPTION_TEXT("archive", "DIR", struct arguments, archive,
                    "of a drop or a report; without it $DROPTOWER_ARCHIVE, else ./archive"),
};

static const struct option_table known_options = {
        .program = "droptower",
        .command = "verify",
        .head = "usage: droptower verify FILE|DROP|ARCHIVE|REPORT [--archive DIR]\n"
                "\n"
                "Whether it is what left the tower. One line says that it is, or one for each file what it "
                "is\n"
                "instead: altered, exchanged, cut, emptied, missing, the chain broken. Exit code 0 only when "
                "all is\n"
                "proven, else 3.\n"
                "\n"
                "  FILE      a log: of each of its captures every sample came, and CRC-32 and seal agree. "
                "Our CSV,\n"
                "            LCM, universal and HDF5 files: their own SHA-256 as well\n"
                "  DROP      SERIES/NUMBER: log, sidecar and results of a drop in an archive\n"
                "  ARCHIVE   a folder: all of its drops, its chain and its index\n"
                "  REPORT    the HTML or PDF of a series: its own SHA-256, its hashes and its head of the "
                "chain\n"
                "            against the archive\n"
                "\n",
        OPTION_ROWS(rows),
        .words = true,
};

int command_verify(int argc, char **argv)
{
	struct arguments arguments = {0};
	int code = option_read(&known_options, &arguments, argc, argv);

	if (code != OPTIONS_READ)
		return code;
	if (argc - optind != 1)
		return command_usage("verify", "%d words, expected a FILE, DROP, ARCHIVE or REPORT",
		                     argc - optind);
	return verify(argv[optind], arguments.archive);
}
