/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/command/simulated.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "host/command/beside.h"

enum { START_MS = 5000, ARGUMENTS_MAX = 40 };

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

static int wait_ready(int fd)
{
	struct pollfd poller = {.fd = fd, .events = POLLIN};
	char byte;

	if (poll(&poller, 1, START_MS) <= 0)
		return -1;
	return read(fd, &byte, 1) == 1 ? 0 : -1;
}

int simulated_start(struct simulated *tower, const char *const *arguments, char *message, unsigned size)
{
	char path[PATH_MAX];
	int pipes[2], ready;

	snprintf(tower->directory, sizeof(tower->directory), "/tmp/droptower-XXXXXX");
	if (beside("droptower-bench", path) != 0 || pipe2(pipes, O_CLOEXEC) != 0) {
		snprintf(message, size, "simulated tower: %s", strerror(errno));
		return -1;
	}
	if (mkdtemp(tower->directory) == NULL) {
		snprintf(message, size, "%s: %s", tower->directory, strerror(errno));
		close(pipes[0]);
		close(pipes[1]);
		return -1;
	}
	snprintf(tower->url, sizeof(tower->url), "unix:%s/bus", tower->directory);
	snprintf(tower->control, sizeof(tower->control), "%s/control", tower->directory);
	tower->pid = fork();
	if (tower->pid == 0) {
		sigset_t none;

		sigemptyset(&none); /* a thread of ours may have blocked them */
		sigprocmask(SIG_SETMASK, &none, NULL);
		fcntl(pipes[1], F_SETFD, 0);
		setpgid(0, 0); /* Ctrl-C is for us: we abort the drop, then end the tower */
		prctl(PR_SET_PDEATHSIG, SIGTERM); /* when we are killed, nobody else ends it */
		become_bench(tower, path, arguments, pipes[1]);
	}
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

void simulated_stop(struct simulated *tower)
{
	const char *bus = tower->url + strlen("unix:");

	if (tower->pid > 0) {
		kill(tower->pid, SIGTERM);
		while (waitpid(tower->pid, NULL, 0) < 0 && errno == EINTR)
			continue;
	}
	unlink(bus); /* of one that was killed */
	unlink(tower->control);
	rmdir(tower->directory);
	tower->pid = 0;
}
