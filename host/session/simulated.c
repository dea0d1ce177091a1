/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/session/simulated.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "host/base/installed.h"
#include "host/base/interrupt.h"

enum { START_MS = 5000, END_MS = 1000, TURN_MS = 10, ARGUMENTS_MAX = 40 };

static void become_bench(const struct simulated *tower, const char *path, const char *const *arguments,
                         int ready_fd)
{
	char number[16];
	const char *argv[ARGUMENTS_MAX] = {path,           "--link",     tower->url, "--control",
	                                   tower->control, "--ready-fd", number};
	int count = 7;
	union { /* execv promises not to write through its argument */
		const char **given;
		char *const *taken;
	} words = {.given = argv};

	snprintf(number, sizeof(number), "%d", ready_fd);
	while (*arguments != NULL && count < ARGUMENTS_MAX - 1)
		argv[count++] = *arguments++;
	execv(path, words.taken);
	fprintf(stderr, "droptower: %s: %s\n", path, strerror(errno));
	_exit(127);
}

/* Until it says so, ends, or nobody wants it any longer. */
static int wait_ready(int fd)
{
	struct pollfd poller = {.fd = fd, .events = POLLIN};
	char byte;

	for (int waited_ms = 0; waited_ms < START_MS && !interrupt_came(); waited_ms += TURN_MS) {
		int got = poll(&poller, 1, TURN_MS);

		if (got > 0)
			return read(fd, &byte, 1) == 1 ? 0 : -1;
		if (got < 0 && errno != EINTR)
			return -1;
	}
	return -1;
}

/* As a program is started from a shell: what we do with signals is not its business. */
static void default_signals(void)
{
	const int ours[] = {SIGINT, SIGTERM, SIGHUP, SIGPIPE};
	sigset_t none;

	for (size_t i = 0; i < sizeof(ours) / sizeof(ours[0]); i++)
		signal(ours[i], SIG_DFL);
	sigemptyset(&none);
	sigprocmask(SIG_SETMASK, &none, NULL);
}

/* No signal finds the child with our handlers: SIGTERM, before it is the bench, must end it. */
static pid_t fork_bench(const struct simulated *tower, const char *path, const char *const *arguments,
                        int ready_fd)
{
	sigset_t all, before;
	pid_t parent = getpid(), pid;

	sigfillset(&all);
	pthread_sigmask(SIG_BLOCK, &all, &before);
	pid = fork();
	if (pid == 0) {
		prctl(PR_SET_PDEATHSIG, SIGTERM); /* when we are killed, nobody else ends it */
		default_signals();
		if (getppid() != parent)
			_exit(127);
		fcntl(ready_fd, F_SETFD, 0);
		setpgid(0, 0); /* Ctrl-C is for us: we abort the drop, then end the tower */
		become_bench(tower, path, arguments, ready_fd);
	}
	pthread_sigmask(SIG_SETMASK, &before, NULL);
	return pid;
}

int simulated_start(struct simulated *tower, const char *const *arguments, char *message, unsigned size)
{
	char path[PATH_MAX];
	int pipes[2], ready;

	if (installed_path("droptower-bench", path) != 0 || pipe2(pipes, O_CLOEXEC) != 0) {
		snprintf(message, size, "simulated tower: %s", strerror(errno));
		return -1;
	}
	if (temporary_make(&tower->folder, "tower") != 0) {
		snprintf(message, size, "a folder for the simulated tower: %s", strerror(errno));
		close(pipes[0]);
		close(pipes[1]);
		return -1;
	}
	snprintf(tower->url, sizeof(tower->url), "unix:%s/bus", tower->folder.path);
	snprintf(tower->control, sizeof(tower->control), "%s/control", tower->folder.path);
	tower->pid = fork_bench(tower, path, arguments, pipes[1]);
	close(pipes[1]);
	ready = tower->pid > 0 ? wait_ready(pipes[0]) : -1;
	close(pipes[0]);
	if (ready == 0)
		return 0;
	snprintf(message, size, "the simulated tower did not start");
	simulated_stop(tower);
	return -1;
}

bool simulated_alive(struct simulated *tower)
{
	if (tower->pid > 0 && waitpid(tower->pid, NULL, WNOHANG) == tower->pid)
		tower->pid = 0;
	return tower->pid > 0;
}

/* It ends by itself at SIGTERM, but not for ever. */
static void end_bench(pid_t pid)
{
	const struct timespec turn = {.tv_nsec = TURN_MS * 1000000};

	kill(pid, SIGTERM);
	for (int waited_ms = 0; waited_ms < END_MS; waited_ms += TURN_MS) {
		if (waitpid(pid, NULL, WNOHANG) != 0)
			return;
		nanosleep(&turn, NULL);
	}
	kill(pid, SIGKILL);
	while (waitpid(pid, NULL, 0) < 0 && errno == EINTR)
		continue;
}

void simulated_stop(struct simulated *tower)
{
	if (tower->pid > 0)
		end_bench(tower->pid);
	temporary_remove(&tower->folder);
	tower->pid = 0;
}
