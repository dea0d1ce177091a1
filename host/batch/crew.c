/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/batch/crew.h"

#include <errno.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "common/base/process.h"
#include "common/base/text.h"
#include "host/base/interrupt.h"

enum { SAID_LINES_MAX = 20, ATTEMPTS = 2, IDLE_DEATHS_MAX = 100, TELL_NS = 200000000 };

/* What the processes share. */
struct shared {
	atomic_size_t next;
	atomic_ulong files, found, refused, results, failed, limited;
	atomic_llong bytes, new_bytes;
	atomic_size_t current[]; /* of each place in the crew: a file's number, from 1; 0: none */
};

struct worker {
	struct crew *crew;
	struct shared *shared;
	int out, err; /* memory behind its standard streams */
};

/* ---- one file ---- */

/* The program's and the file's name belong to this place, not to the content. */
static const char *without_names(const char *line, const char *path)
{
	static const char ours[] = "droptower: ";
	size_t length = strlen(path);

	if (strncmp(line, ours, sizeof(ours) - 1) == 0)
		line += sizeof(ours) - 1;
	if (strncmp(line, path, length) == 0 && line[length] == ':')
		line += length + 1 + (line[length + 1] == ' ');
	return line;
}

/* Its lines of complaint as a part has them, or the first one alone as why there is no result. */
static int said_of(struct text *text, const char *err, const char *path, bool first_alone)
{
	int result = text_open(text);

	for (int i = 0; result == 0 && *err != '\0' && i < (first_alone ? 1 : SAID_LINES_MAX); i++) {
		int length = (int)strcspn(err, "\n");
		const char *line = without_names(err, path);

		fprintf(text->out, first_alone ? "%.*s" : "said %.*s\n", length - (int)(line - err), line);
		err += length + (err[length] == '\n');
	}
	return result == 0 ? text_close(text, 0) : result;
}

static void refuse_input(struct worker *worker, const struct input *input, const struct noted *noted,
                         int code, const char *why)
{
	atomic_fetch_add(&worker->shared->refused, 1);
	input_note(worker->crew->notes, input, noted, code, why[0] != '\0' ? why : "no result");
}

static unsigned long lines_in(const char *text)
{
	unsigned long lines = 0;

	for (; (text = strchr(text, '\n')) != NULL; text++)
		lines++;
	return lines;
}

static void count_results(struct worker *worker, unsigned long results, int code)
{
	struct shared *shared = worker->shared;

	atomic_fetch_add(&shared->results, results);
	if (code == worker->crew->limit_code)
		atomic_fetch_add(&shared->limited, 1);
	else if (code != 0)
		atomic_fetch_add(&shared->failed, 1);
}

static void keep_part(struct worker *worker, const struct input *input, const struct noted *noted, int code,
                      char *out, const char *err)
{
	struct part part = {.bytes = out, .size = strlen(out), .results = lines_in(out), .code = code};
	struct text said;

	if (said_of(&said, err, input->path, part.results == 0) != 0) {
		refuse_input(worker, input, noted, worker->crew->failed_code, error_text(DT_E_MEMORY));
		return;
	}
	part.said = said.bytes;
	part.said_size = said.size;
	if (!input_stayed(input, noted))
		refuse_input(worker, input, noted, worker->crew->failed_code, "changed while it was read");
	else if (part.results == 0)
		refuse_input(worker, input, noted, code, said.bytes);
	else if (store_put(worker->crew->store, noted->key, &part) != 0)
		refuse_input(worker, input, noted, worker->crew->failed_code, strerror(errno));
	else {
		count_results(worker, part.results, code);
		input_note(worker->crew->notes, input, noted, code, NULL);
	}
	free(said.bytes);
}

static bool empty(int fd)
{
	return ftruncate(fd, 0) == 0 && lseek(fd, 0, SEEK_SET) == 0;
}

static void analyse(struct worker *worker, const struct input *input, const struct noted *noted)
{
	char *out = NULL, *err = NULL;
	size_t size;
	int code;

	if (!empty(worker->out) || !empty(worker->err)) {
		refuse_input(worker, input, noted, worker->crew->failed_code, strerror(errno));
		return;
	}
	code = worker->crew->analyse(input->path, worker->crew->context);
	if (fflush(stdout) == 0 && !ferror(stdout) && fflush(stderr) == 0) {
		out = process_read(worker->out, &size);
		err = process_read(worker->err, &size);
	}
	if (out != NULL && err != NULL)
		keep_part(worker, input, noted, code, out, err);
	else
		refuse_input(worker, input, noted, worker->crew->failed_code, error_text(DT_E_MEMORY));
	clearerr(stdout);
	free(out);
	free(err);
	atomic_fetch_add(&worker->shared->new_bytes, input->bytes);
}

static void crew_do(struct worker *worker, const struct input *input)
{
	bool was_noted = input_is_noted(input);
	struct noted noted = input->noted;
	struct part part;

	if (!was_noted && input_look(input, &noted) != 0) {
		refuse_input(worker, input, &noted, worker->crew->failed_code, strerror(errno));
	} else if (store_get(worker->crew->store, noted.key, &part)) {
		atomic_fetch_add(&worker->shared->found, 1);
		count_results(worker, part.results, part.code);
		if (!was_noted || noted.message != NULL)
			input_note(worker->crew->notes, input, &noted, part.code, NULL);
		part_free(&part);
	} else {
		analyse(worker, input, &noted);
	}
	atomic_fetch_add(&worker->shared->bytes, input->bytes);
	atomic_fetch_add(&worker->shared->files, 1);
}

/* ---- a process ---- */

/* A stream of ours into memory. */
static bool redirect(int *memory, int stream)
{
	*memory = memfd_create("analysis", MFD_CLOEXEC);
	return *memory >= 0 && dup2(*memory, stream) == stream;
}

/* From the file numbered first, or the next one when that is 0. */
static void worker_run(struct worker *worker, unsigned place, size_t first)
{
	const struct inputs *inputs = worker->crew->inputs;
	size_t number = first;

	if (!redirect(&worker->out, STDOUT_FILENO) || !redirect(&worker->err, STDERR_FILENO))
		_exit(1);
	if (number == 0)
		number = atomic_fetch_add(&worker->shared->next, 1) + 1;
	while (number <= inputs->count) {
		atomic_store(&worker->shared->current[place], number);
		crew_do(worker, &inputs->input[number - 1]);
		atomic_store(&worker->shared->current[place], 0);
		number = atomic_fetch_add(&worker->shared->next, 1) + 1;
	}
	_exit(0);
}

/* A signal ends it at once: what it is at is begun anew. It does not outlive who started it. */
static pid_t worker_start(struct crew *crew, struct shared *shared, unsigned place, size_t first)
{
	static const int ends[] = {SIGINT, SIGTERM, SIGHUP};
	struct worker worker = {.crew = crew, .shared = shared};
	pid_t parent = getpid(), pid = fork();
	sigset_t none;

	if (pid != 0)
		return pid;
	for (size_t i = 0; i < sizeof(ends) / sizeof(ends[0]); i++)
		signal(ends[i], SIG_DFL);
	sigemptyset(&none);
	sigprocmask(SIG_SETMASK, &none, NULL);
	if (prctl(PR_SET_PDEATHSIG, SIGKILL) == 0 && getppid() == parent)
		worker_run(&worker, place, first);
	_exit(1);
}

/* ---- all of them ---- */

struct leading {
	struct crew *crew;
	struct shared *shared;
	unsigned char *attempts; /* at each file that ended a process */
	pid_t *pid;              /* 0: ended */
	unsigned alive, idle_deaths;
};

static void tell(struct leading *leading)
{
	struct crew_progress *p = &leading->crew->progress;
	struct shared *s = leading->shared;

	*p = (struct crew_progress){.files = atomic_load(&s->files),
	                            .found = atomic_load(&s->found),
	                            .refused = atomic_load(&s->refused),
	                            .results = atomic_load(&s->results),
	                            .failed = atomic_load(&s->failed),
	                            .bytes = atomic_load(&s->bytes),
	                            .new_bytes = atomic_load(&s->new_bytes)};
	if (p->refused + p->failed > 0)
		p->code = leading->crew->failed_code;
	else if (atomic_load(&s->limited) > 0)
		p->code = leading->crew->limit_code;
	if (leading->crew->tell != NULL)
		leading->crew->tell(p, leading->crew->context);
}

/* A file that has ended so many processes is done without a result. */
static size_t crew_give_up(struct leading *leading, size_t number, int status)
{
	const struct input *input = &leading->crew->inputs->input[number - 1];
	struct worker worker = {.crew = leading->crew, .shared = leading->shared};
	struct noted noted = {.code = 0};
	char why[80];

	if (++leading->attempts[number - 1] < ATTEMPTS)
		return number;
	snprintf(why, sizeof(why), "the analysis died of it, %d times, by %s %d", ATTEMPTS,
	         WIFSIGNALED(status) ? "signal" : "exit",
	         WIFSIGNALED(status) ? WTERMSIG(status) : WEXITSTATUS(status));
	refuse_input(&worker, input, &noted, leading->crew->failed_code, why);
	atomic_fetch_add(&leading->shared->bytes, input->bytes);
	atomic_fetch_add(&leading->shared->files, 1);
	return 0;
}

static int crew_replace(struct leading *leading, unsigned place, int status)
{
	size_t number = atomic_exchange(&leading->shared->current[place], 0);

	if (number == 0 && ++leading->idle_deaths > IDLE_DEATHS_MAX)
		return DT_E_SYSTEM;
	if (number > 0)
		number = crew_give_up(leading, number, status);
	leading->pid[place] = worker_start(leading->crew, leading->shared, place, number);
	if (leading->pid[place] > 0)
		return 0;
	leading->pid[place] = 0;
	leading->alive--;
	return DT_E_SYSTEM;
}

static int reap(struct leading *leading)
{
	int result = 0;

	for (unsigned place = 0; place < leading->crew->jobs; place++) {
		int status;

		if (leading->pid[place] == 0 || waitpid(leading->pid[place], &status, WNOHANG) == 0)
			continue;
		if ((WIFEXITED(status) && WEXITSTATUS(status) == 0) || interrupt_came()) {
			leading->pid[place] = 0;
			leading->alive--;
		} else if (crew_replace(leading, place, status) != 0) {
			result = DT_E_SYSTEM;
		}
	}
	return result;
}

static void crew_end(struct leading *leading)
{
	for (unsigned place = 0; place < leading->crew->jobs; place++)
		if (leading->pid[place] != 0) {
			kill(leading->pid[place], SIGTERM);
			waitpid(leading->pid[place], NULL, 0);
			leading->pid[place] = 0;
		}
}

static int lead(struct leading *leading)
{
	const struct timespec patience = {.tv_nsec = TELL_NS};
	int result = 0;
	sigset_t child;

	sigemptyset(&child);
	sigaddset(&child, SIGCHLD);
	sigprocmask(SIG_BLOCK, &child, NULL);
	for (unsigned place = 0; place < leading->crew->jobs && result == 0; place++) {
		pid_t pid = worker_start(leading->crew, leading->shared, place, 0);

		leading->pid[place] = pid > 0 ? pid : 0;
		leading->alive += pid > 0;
		result = pid > 0 ? 0 : DT_E_SYSTEM;
	}
	while (leading->alive > 0 && result == 0 && !interrupt_came()) {
		sigtimedwait(&child, NULL, &patience);
		result = reap(leading);
		tell(leading);
	}
	crew_end(leading);
	tell(leading);
	sigprocmask(SIG_UNBLOCK, &child, NULL);
	return result;
}

int crew_work(struct crew *crew)
{
	size_t size = sizeof(struct shared) + crew->jobs * sizeof(atomic_size_t);
	struct leading leading = {.crew = crew,
	                          .attempts = calloc(crew->inputs->count + 1, 1),
	                          .pid = calloc(crew->jobs, sizeof(pid_t))};
	int result = DT_E_MEMORY;

	leading.shared = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
	fflush(NULL); /* or each process prints it again */
	if (leading.shared != MAP_FAILED && leading.attempts != NULL && leading.pid != NULL)
		result = lead(&leading);
	if (leading.shared != MAP_FAILED)
		munmap(leading.shared, size);
	free(leading.attempts);
	free(leading.pid);
	return result;
}
