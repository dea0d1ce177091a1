/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What stays of a drop: a log and what the analysis made of it, in a folder or in an archive.
 */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "host/command/command.h"
#include "host/command/evaluate.h"
#include "host/base/room.h"
#include "host/command/run_private.h"
#include "host/record/write.h"

/* ---- before the drop: the scene, and a log of its own ---- */

/* Makes OUT and takes the first number for which no log is there, by making it. */
static int choose_stem(struct run *run)
{
	if (mkdir(run->out, 0777) != 0 && errno != EEXIST) {
		command_error("%s: %s", run->out, strerror(errno));
		return COMMAND_INPUT;
	}
	for (int number = 1; number < 10000; number++) {
		int fd;

		snprintf(run->stem, sizeof(run->stem), "%.4000s/drop-%04d", run->out, number);
		snprintf(run->log, sizeof(run->log), "%s.log", run->stem);
		fd = open(run->log, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
		if (fd >= 0) {
			close(fd);
			return COMMAND_DONE;
		}
		if (errno != EEXIST) {
			command_error("%s: %s", run->log, strerror(errno));
			return COMMAND_INPUT;
		}
	}
	command_error("%s: 9999 drops are there already", run->out);
	return COMMAND_INPUT;
}

static int begin_in_folder(struct run *run)
{
	int code = evaluate_read_scene(&run->scene, run->scene_file, run->angle_deg);

	if (code == COMMAND_DONE)
		code = evaluate_check_tower(&run->scene, run->scene_file);
	if (code == COMMAND_DONE && run->chain != NULL)
		code = evaluate_check_chain(run->chain);
	if (code == COMMAND_DONE)
		code = choose_stem(run);
	if (code != COMMAND_DONE)
		run->log[0] = '\0'; /* that one is not ours */
	return code;
}

static int begin_in_archive(struct run *run)
{
	char message[ARCHIVE_MESSAGE_MAX];

	run->archive = archive_open(run->archive_folder, ARCHIVE_WRITE, message);
	if (run->archive == NULL) {
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	if (archive_scene(run->archive, run->series, &run->scene) != 0)
		return archived_failed(run->archive);
	if (evaluate_check_tower(&run->scene, run->series) != COMMAND_DONE)
		return COMMAND_INPUT;
	if (archive_begin(run->archive, run->series, run->operator_name, ".log", run->link == NULL,
	                  &run->recording) != 0)
		return archived_failed(run->archive);
	snprintf(run->log, sizeof(run->log), "%s", run->recording.log);
	run->scene_file = run->series_scene;
	return archived_scene_file(run->archive, run->series, run->series_scene);
}

int run_keep_begin(struct run *run)
{
	return run->series != NULL ? begin_in_archive(run) : begin_in_folder(run);
}

int run_keep_room(const struct run *run)
{
	double bytes = room_bytes(run->series != NULL ? run->archive_folder : run->out);

	if (!(bytes < ROOM_RESERVE_BYTES))
		return COMMAND_DONE;
	command_error("%.0f MB left on the disk, expected %.0f MB for a drop", bytes / 1e6,
	              ROOM_RESERVE_BYTES / 1e6);
	return COMMAND_INPUT;
}

/* ---- after it ---- */

/* The drop is in memory, and shown; what could not be kept of it is told. */
static int run_keep_tell_lost(const struct run *run)
{
	command_error("%s: could not be written; %s", run->log,
	              run->kept ? "the tower holds the drop, the next run fetches it"
	                        : "the tower has let go of the drop");
	return COMMAND_INPUT;
}

/* A drop that is not what it seems ends with a word and a code of its own. */
static int tell_oddity(const struct run *run, const struct record *record, int code)
{
	if (run->aborted)
		command_error("aborted; what was recorded is kept");
	if (run->earlier)
		command_error("drop %u was still in the tower from an earlier run; nothing was released now",
		              record->drop_id);
	return code == COMMAND_DONE && (run->aborted || run->earlier) ? COMMAND_REFUSED : code;
}

/* How far the series is, and what is left to do. */
static int tell_series(void *context, const struct archive_series *series)
{
	FILE *out = context;

	fprintf(out,
	        "series   %u of %u planned accepted, %u to decide: 'droptower series accept' or 'reject'\n",
	        series->accepted, series->planned,
	        series->recorded - series->accepted - series->rejected - series->faulty);
	return 0;
}

/* The drop is recorded before it is looked at. */
static int report_archived(struct run *run, struct record *record)
{
	struct evaluate_options options = {
	        .scene = &run->scene, .iepe_time_constant_s = NAN, .json = run->json, .strict = run->strict};
	const struct archive_recording *r = &run->recording;
	const char *note = run->aborted      ? "aborted in motion"
	                   : run->earlier    ? "was still in the tower from an earlier run"
	                   : run->unattended ? "released unattended"
	                                     : "";
	struct archive_filter mine = archive_filter_none();
	FILE *out = run->json ? stderr : stdout;
	int code, shown;

	options.simulated = run->link == NULL;
	if (evaluate_sign(record, &options, run->operator_name) != COMMAND_DONE)
		return COMMAND_INPUT;
	if (run->log_failed || archive_finish(run->archive, &run->recording, 0, note) != 0) {
		(void)evaluate(record, &options);
		return run->log_failed ? run_keep_tell_lost(run) : archived_failed(run->archive);
	}
	run_progress(run, "recorded  %s/%u", r->series, r->number);
	code = archived_analyse(run->archive, r->series, r->number, NULL);
	snprintf(record->file, sizeof(record->file), "%s", r->raw);
	shown = evaluate(record, &options);
	mine.series = r->series;
	if (shown == COMMAND_DONE || shown == COMMAND_LIMIT) {
		fprintf(out, "\ndrop     %s/%u\nraw log  %s\n", r->series, r->number, r->log);
		if (archive_each_series(run->archive, &mine, tell_series, out) != 0)
			return archived_failed(run->archive);
	}
	return tell_oddity(run, record, code != COMMAND_DONE ? code : shown);
}

static int report_files(struct run *run, struct record *record)
{
	char csv[4200], json[4200], html[4200], message[READ_MESSAGE_MAX];
	struct evaluate_options options = {.scene = &run->scene,
	                                   .chain = run->chain,
	                                   .limits = run->limits,
	                                   .band.channel = run->channel,
	                                   .iepe_time_constant_s = NAN,
	                                   .json = run->json,
	                                   .html = html,
	                                   .json_file = json,
	                                   .strict = run->strict,
	                                   .simulated = run->link == NULL,
	                                   .unattended = run->unattended};
	int code;

	snprintf(csv, sizeof(csv), "%s.csv", run->stem);
	snprintf(json, sizeof(json), "%s.json", run->stem);
	snprintf(html, sizeof(html), "%s.html", run->stem);
	snprintf(record->file, sizeof(record->file), "%.4000s.log", run->stem);
	code = evaluate_sign(record, &options, run->operator_name);
	if (code != COMMAND_DONE)
		return code;
	if (run->log_failed || write_record(record, csv, message) != 0) {
		options.html = options.json_file = NULL;
		(void)evaluate(record, &options);
		if (run->log_failed)
			return run_keep_tell_lost(run);
		command_error("%s", message);
		return COMMAND_INPUT;
	}
	code = evaluate(record, &options);
	if (code == COMMAND_DONE || code == COMMAND_LIMIT)
		fprintf(run->json ? stderr : stdout,
		        "\nraw log  %s.log\ntable    %s\nJSON     %s\nreport   %s\n", run->stem, csv, json,
		        html);
	return tell_oddity(run, record, code);
}

int run_keep_report(struct run *run, struct record *record)
{
	return run->archive != NULL ? report_archived(run, record) : report_files(run, record);
}

/* Nothing released: no drop. Else what there is of it stays, partial. */
static void leave_recording(struct run *run)
{
	if (run->recording.lock < 0)
		return;
	if (run->released || run->earlier)
		archive_abandon(&run->recording);
	else
		archive_discard(run->archive, &run->recording);
}

void run_keep_end(struct run *run)
{
	if (run->series == NULL) {
		/* a run that released nothing, and fetched nothing, leaves no file */
		if (run->log[0] != '\0' && !run->released && !run->earlier)
			unlink(run->log);
		return;
	}
	leave_recording(run);
	archive_close(run->archive);
}
