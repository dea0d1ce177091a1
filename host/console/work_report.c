/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The report of a series. Its pictures take seconds, during which a drop may come: another process makes it,
 * `droptower report`, one at a time, and the thread looks now and then whether it has ended.
 */
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "common/base/process.h"
#include "host/base/durable.h"
#include "host/base/installed.h"
#include "host/console/work_private.h"

enum { NICE = 10 };

static int run_program(struct work_report *r, const char *folder, const char *series)
{
	char path[PATH_MAX];
	const char *words[] = {path, "report", series, "--archive", folder, "--html", r->file, NULL};
	int result;

	if (installed_path("droptower", path) != 0)
		return errno;
	result = process_start(&(struct process){.words = words, .fd = {[STDERR_FILENO] = r->errors}},
	                       &r->pid);
	if (result == 0)
		setpriority(PRIO_PROCESS, (id_t)r->pid, NICE);
	return result;
}

static void work_report_forget(struct work_report *r)
{
	temporary_remove(&r->folder);
	close(r->errors);
	job_done(r->job);
	r->job = NULL;
}

/* A folder for the page that nobody else can look into, and a file without a name for what goes wrong. */
static bool make_files(struct work_report *r)
{
	FILE *errors = tmpfile();

	r->errors = errors != NULL ? fcntl(fileno(errors), F_DUPFD_CLOEXEC, 3) : -1;
	if (errors != NULL)
		fclose(errors);
	if (r->errors < 0)
		return false;
	if (temporary_make(&r->folder, "report") == 0) {
		snprintf(r->file, sizeof(r->file), "%s/report.html", r->folder.path);
		return true;
	}
	close(r->errors);
	return false;
}

static void work_report_start(struct work *work, struct job *job)
{
	struct work_report *r = &work->report;
	int result;

	if (!make_files(r)) {
		job_refuse(job, 507, "no place for the report: %s", strerror(errno));
		job_done(job);
		return;
	}
	r->job = job;
	result = run_program(r, work->options.archive, job->path);
	if (result == 0)
		return;
	job_refuse(job, 500, "droptower report: %s", strerror(result));
	work_report_forget(r);
}

void work_report(struct job *job)
{
	struct work *work = job->console->work;
	struct scene scene;
	int result = archive_scene(work->archive, job->path, &scene);

	if (result != 0) {
		work_refuse(job, result);
		return;
	}
	if (work->report.job == NULL && atomic_load(&work->console->at_rest)) {
		work_report_start(work, job);
		return;
	}
	job_refuse(job, 409, "%s",
	           work->report.job != NULL ? "another report is being made"
	                                    : "a drop is under way: reports are made when it is over");
	job_done(job);
}

/* What the program said, its first line. */
static void refuse_report(const struct work_report *r)
{
	char text[512] = "";
	ssize_t size = pread(r->errors, text, sizeof(text) - 1, 0);

	text[size > 0 ? size : 0] = '\0';
	text[strcspn(text, "\n")] = '\0';
	job_refuse(r->job, 500, "%s", text[0] != '\0' ? text : "droptower report ended without a word");
}

void work_report_look(struct work *work, bool now)
{
	struct work_report *r = &work->report;
	size_t size = 0;
	char *page;
	int status = 0;

	if (r->job == NULL)
		return;
	if (now)
		kill(r->pid, SIGTERM);
	if (waitpid(r->pid, &status, now ? 0 : WNOHANG) != r->pid)
		return;
	page = WIFEXITED(status) && WEXITSTATUS(status) == 0 ? durable_read(r->file, &size) : NULL;
	if (page != NULL)
		job_answer_bytes(r->job, "text/html; charset=utf-8", page, size);
	else
		refuse_report(r);
	work_report_forget(r);
}
