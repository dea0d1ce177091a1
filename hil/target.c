/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "common/base/process.h"
#include "hil/target.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/signalfd.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>
#include <wordexp.h>

#include "common/link/temporary.h"

enum {
	SILENCE_MS = 5000, /* a firmware that asks for nothing hangs */
	SLICE_MS = 100,
	LOOK_EACH = 256,  /* requests from inside, then for a signal */
	ENDING_MS = 2000, /* how long it may take to end by itself */
	PATH_MAX_BYTES = 4096,
};

struct target {
	struct temporary folder;
	char prefix[104], request_path[112], answer_path[112];
	pid_t pid;                             /* 0: not running */
	bool killed;                           /* by us, after it did not end */
	int wait_status;                       /* of waitpid, once it has ended */
	const struct sensorbus_inside *inside; /* in place of process and pipes; else NULL */
	unsigned asked;                        /* requests of it */
	uint8_t output[SENSORBUS_MESSAGE_MAX];
	int request_fd, answer_fd, signal_fd;
	sigset_t signals_before;
	size_t fill; /* bytes of the next request that are here */
	uint8_t input[SENSORBUS_MESSAGE_MAX];
};

/* ---- the way down, also from half-way up ---- */

static void close_all(struct target *target)
{
	if (target->request_fd >= 0)
		close(target->request_fd);
	if (target->answer_fd >= 0)
		close(target->answer_fd);
	temporary_remove(&target->folder);
	if (target->signal_fd >= 0) {
		close(target->signal_fd);
		sigprocmask(SIG_SETMASK, &target->signals_before, NULL);
	}
	free(target);
}

static bool has_ended(struct target *target)
{
	if (target->pid != 0 && waitpid(target->pid, &target->wait_status, WNOHANG) == target->pid)
		target->pid = 0;
	return target->pid == 0;
}

static void wait_for_end(struct target *target, int timeout_ms)
{
	const struct timespec ms = {.tv_nsec = 1000000};

	for (int i = 0; i < timeout_ms && !has_ended(target); i++)
		nanosleep(&ms, NULL);
}

static int say_status(const struct target *target, char message[TARGET_MESSAGE_MAX])
{
	int status = target->wait_status;

	if (target->killed)
		snprintf(message, TARGET_MESSAGE_MAX, "the firmware did not end when told, and was killed");
	else if (WIFSIGNALED(status))
		snprintf(message, TARGET_MESSAGE_MAX, "the firmware died of signal %d (%s)", WTERMSIG(status),
		         strsignal(WTERMSIG(status)));
	else if (WEXITSTATUS(status) != 0)
		snprintf(message, TARGET_MESSAGE_MAX, "the firmware ended with exit status %d",
		         WEXITSTATUS(status));
	else
		return 0;
	return DT_E_LINK;
}

static void kill_now(struct target *target)
{
	if (has_ended(target))
		return;
	kill(target->pid, SIGKILL);
	waitpid(target->pid, &target->wait_status, 0);
	target->pid = 0;
	target->killed = true;
}

int target_end(struct target *target, char message[TARGET_MESSAGE_MAX])
{
	int result;

	if (target == NULL)
		return 0;
	if (target->inside != NULL) {
		const uint8_t *request;

		(void)target->inside->ask(&request); /* it takes the last answer, which says stop, and ends */
		close_all(target);
		return 0;
	}
	wait_for_end(target, ENDING_MS);
	kill_now(target);
	result = say_status(target, message);
	close_all(target);
	return result;
}

/* ---- the way up ---- */

static int block_signals(struct target *target)
{
	sigset_t signals;

	sigemptyset(&signals);
	sigaddset(&signals, SIGINT);
	sigaddset(&signals, SIGTERM);
	sigaddset(&signals, SIGHUP);
	sigprocmask(SIG_BLOCK, &signals, &target->signals_before);
	target->signal_fd = signalfd(-1, &signals, SFD_CLOEXEC | SFD_NONBLOCK);
	return target->signal_fd;
}

static int make_bus(struct target *target)
{
	if (temporary_make(&target->folder, "bench") != 0)
		return -1;
	snprintf(target->prefix, sizeof(target->prefix), "%s/bus", target->folder.path);
	snprintf(target->request_path, sizeof(target->request_path), "%s.request", target->prefix);
	snprintf(target->answer_path, sizeof(target->answer_path), "%s.answer", target->prefix);
	if (mkfifo(target->request_path, 0600) != 0 || mkfifo(target->answer_path, 0600) != 0)
		return -1;
	/* Neither open waits for the firmware: a reader need not, and read-write counts as both ends. */
	target->request_fd = open(target->request_path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
	target->answer_fd = open(target->answer_path, O_RDWR | O_CLOEXEC);
	return target->request_fd < 0 || target->answer_fd < 0 ? -1 : 0;
}

/* droptower-firmware next to this program. */
static int firmware_beside(char path[PATH_MAX_BYTES])
{
	static const char name[] = "droptower-firmware";
	ssize_t length = readlink("/proc/self/exe", path, PATH_MAX_BYTES - sizeof(name));
	char *slash;

	if (length < 0)
		return -1;
	path[length] = '\0';
	slash = strrchr(path, '/');
	if (slash == NULL)
		return -1;
	memcpy(slash + 1, name, sizeof(name));
	return 0;
}

/* Request and answer take turns: on one processor each wakes the other at once, on two it has to be woken
 * from idle, which takes ten times as long. The firmware inherits it; a refusal does not matter. */
static void share_processor(void)
{
	int processor = sched_getcpu();
	cpu_set_t set;

	if (processor < 0)
		return;
	CPU_ZERO(&set);
	CPU_SET((unsigned)processor, &set);
	(void)sched_setaffinity(0, sizeof(set), &set);
}

/* An option and its number, in text; nothing for 0. Returns the words. */
static size_t target_add_number(const char **argv, const char *option, unsigned number, char *text,
                                size_t size)
{
	if (number == 0)
		return 0;
	snprintf(text, size, "%u", number);
	argv[0] = option;
	argv[1] = text;
	return 2;
}

static int run_command(struct target *target, const struct target_options *options,
                       char message[TARGET_MESSAGE_MAX])
{
	const char *command = options->command;
	char cause_text[12], kept_text[12];
	wordexp_t words = {.we_offs = 0};
	char beside[PATH_MAX_BYTES];
	const char *argv[68];
	size_t count = 0;
	int error;

	if (command == NULL && firmware_beside(beside) != 0) {
		snprintf(message, TARGET_MESSAGE_MAX, "cannot tell where this program lies, give --firmware");
		return -1;
	}
	if (command == NULL) {
		argv[count++] = beside;
	} else if (wordexp(command, &words, WRDE_NOCMD | WRDE_UNDEF) != 0 || words.we_wordc == 0 ||
	           words.we_wordc > 60) {
		snprintf(message, TARGET_MESSAGE_MAX, "--firmware \"%s\": not a command with 1 to 60 words",
		         command);
		return -1;
	}
	for (size_t i = 0; command != NULL && i < words.we_wordc; i++)
		argv[count++] = words.we_wordv[i];
	argv[count++] = "--bus";
	argv[count++] = target->prefix;
	if (options->realtime)
		argv[count++] = "--realtime";
	count += target_add_number(argv + count, "--reset-cause", options->cause, cause_text,
	                           sizeof(cause_text));
	count += target_add_number(argv + count, "--kept", options->kept, kept_text, sizeof(kept_text));
	argv[count] = NULL;
	/* a Ctrl-C reaches the bench alone, which then ends the firmware in order */
	error = process_start(&(struct process){.words = argv, .fd = {PROCESS_NOTHING}, .alone = true},
	                      &target->pid);
	if (error != 0)
		target->pid = 0;
	if (error != 0)
		snprintf(message, TARGET_MESSAGE_MAX, "cannot run the firmware %s: %s", argv[0],
		         strerror(error));
	if (command != NULL)
		wordfree(&words);
	return error == 0 ? 0 : -1;
}

struct target *target_start(const struct target_options *options, char message[TARGET_MESSAGE_MAX])
{
	struct target *target = calloc(1, sizeof(*target));

	if (target == NULL) {
		snprintf(message, TARGET_MESSAGE_MAX, "out of memory");
		return NULL;
	}
	target->request_fd = target->answer_fd = target->signal_fd = -1;
	target->inside = options->inside;
	if (block_signals(target) < 0 || (target->inside == NULL && make_bus(target) != 0)) {
		snprintf(message, TARGET_MESSAGE_MAX, "cannot make the sensor bus in %s: %s",
		         target->folder.path[0] ? target->folder.path : "a temporary directory",
		         strerror(errno));
		close_all(target);
		return NULL;
	}
	if (target->inside != NULL) {
		target->inside->start(options->cause, (uint8_t)options->kept);
		return target;
	}
	if (!options->realtime)
		share_processor();
	if (run_command(target, options, message) != 0) {
		close_all(target);
		return NULL;
	}
	return target;
}

/* ---- requests and answers ---- */

/* Bytes the request needs as far as it can be told from those that are here; negative if it is none. */
static int bytes_needed(const struct target *target)
{
	struct sensorbus_request request;
	size_t needed = SENSORBUS_REQUEST_BYTES;

	if (target->fill < needed)
		return (int)needed;
	sensorbus_get_request(target->input, &request);
	if (request.frames > SENSORBUS_FRAMES_MAX)
		return DT_E_FORMAT;
	for (unsigned i = 0; i < request.frames; i++) {
		struct frame frame;
		unsigned behind;
		int length = needed + 4 <= target->fill
		                     ? sensorbus_frame_head(target->input + needed, &frame, &behind)
		                     : 0;

		if (length < 0)
			return DT_E_FORMAT;
		needed += 4u + (unsigned)length;
		if (needed > target->fill)
			break;
	}
	return (int)needed;
}

static void unpack_request(struct target *target, struct sensorbus_request *request, struct frame *frames)
{
	const uint8_t *p = target->input + sensorbus_get_request(target->input, request);

	for (unsigned i = 0; i < request->frames; i++) {
		unsigned behind;

		frames[i] = (struct frame){0};
		(void)sensorbus_frame_head(p, &frames[i], &behind);
		frames[i].time_us = behind;
		memcpy(frames[i].data, p + 4, frames[i].length);
		p += 4u + frames[i].length;
	}
	target->fill = 0;
}

static int say_gone(struct target *target, char message[TARGET_MESSAGE_MAX])
{
	wait_for_end(target, ENDING_MS);
	if (!has_ended(target))
		snprintf(message, TARGET_MESSAGE_MAX, "the firmware closed the sensor bus");
	else if (say_status(target, message) == 0)
		snprintf(message, TARGET_MESSAGE_MAX, "the firmware ended by itself with exit status 0");
	return DT_E_CLOSED;
}

static int say_silent(struct target *target, char message[TARGET_MESSAGE_MAX])
{
	kill_now(target);
	snprintf(message, TARGET_MESSAGE_MAX,
	         "the firmware asked for no sample for %d s, expected two times a millisecond; it was killed",
	         SILENCE_MS / 1000);
	return DT_E_TIMEOUT;
}

static int say_garbage(struct target *target, char message[TARGET_MESSAGE_MAX])
{
	kill_now(target);
	snprintf(message, TARGET_MESSAGE_MAX,
	         "the firmware wrote bytes that are no request (common/sensorbus.h); it was killed");
	return DT_E_FORMAT;
}

static bool is_told_to_stop(struct target *target)
{
	struct signalfd_siginfo signal;

	return read(target->signal_fd, &signal, sizeof(signal)) > 0;
}

/* 1 when there are bytes or their end, else as target_receive. */
static int wait_for_bytes(struct target *target, char message[TARGET_MESSAGE_MAX])
{
	struct pollfd fds[2] = {{.fd = target->request_fd, .events = POLLIN},
	                        {.fd = target->signal_fd, .events = POLLIN}};

	for (int waited_ms = 0; waited_ms < SILENCE_MS; waited_ms += SLICE_MS) {
		if (poll(fds, 2, SLICE_MS) < 0)
			continue;
		if (fds[1].revents && is_told_to_stop(target))
			return 0;
		if (fds[0].revents)
			return 1;
		/* One that never opened the bus leaves no end of file. */
		if (has_ended(target))
			return say_gone(target, message);
	}
	return say_silent(target, message);
}

/* 1; 0 when told to stop. */
static int ask_inside(struct target *target)
{
	const uint8_t *request;

	if (target->asked++ % LOOK_EACH == 0 && is_told_to_stop(target))
		return 0;
	target->fill = target->inside->ask(&request);
	memcpy(target->input, request, target->fill);
	return 1;
}

static int say_no_request(char message[TARGET_MESSAGE_MAX])
{
	snprintf(message, TARGET_MESSAGE_MAX, "the firmware ended, or gave no request");
	return DT_E_CLOSED;
}

int target_receive(struct target *target, struct sensorbus_request *request,
                   struct frame frames[SENSORBUS_FRAMES_MAX], char message[TARGET_MESSAGE_MAX])
{
	int result = target->inside != NULL ? ask_inside(target) : 1;

	if (result != 1)
		return result;
	for (;;) {
		int needed = bytes_needed(target);
		ssize_t got;

		if (needed < 0 || target->fill > (size_t)needed)
			return say_garbage(target, message);
		if (target->fill == (size_t)needed)
			break;
		if (target->inside != NULL)
			return say_no_request(message);
		result = wait_for_bytes(target, message);
		if (result != 1)
			return result;
		got = read(target->request_fd, target->input + target->fill,
		           sizeof(target->input) - target->fill);
		if (got == 0)
			return say_gone(target, message);
		if (got > 0)
			target->fill += (size_t)got;
	}
	unpack_request(target, request, frames);
	return 1;
}

int target_answer(struct target *target, const struct sensorbus_answer *answers, unsigned count,
                  const struct frame *frames, char message[TARGET_MESSAGE_MAX])
{
	uint8_t *output = target->output;
	size_t length = 0;

	for (unsigned i = 0; i < count; i++)
		length += sensorbus_put_answer(output + length, &answers[i]);
	for (unsigned i = 0; i < answers[count - 1].frames; i++)
		length += sensorbus_put_frame(output + length, &frames[i], 0);
	if (target->inside != NULL) {
		target->inside->answer(output, length);
		return 0;
	}
	/* Shorter than PIPE_BUF, so it is written whole; this end is a reader too, so it never breaks. */
	if (write(target->answer_fd, output, length) == (ssize_t)length)
		return 0;
	snprintf(message, TARGET_MESSAGE_MAX, "cannot write to the sensor bus: %s", strerror(errno));
	return DT_E_SYSTEM;
}
