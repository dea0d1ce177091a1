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

static void become_bench(const char *path, const char *const *arguments, const char *url, int ready_fd)
{
	const char *argv[ARGUMENTS_MAX] = {path, "--link", url, "--ready-fd"};
	char number[16];
	int count = 4;
	union { /* execv promises not to write through its argument */
		const char **given;
		char *const *taken;
	} words = {.given = argv};

	snprintf(number, sizeof(number), "%d", ready_fd);
	argv[count++] = number;
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
	tower->pid = fork();
	if (tower->pid == 0) {
		fcntl(pipes[1], F_SETFD, 0);
		setpgid(0, 0); /* Ctrl-C is for us: we abort the drop, then end the tower */
		prctl(PR_SET_PDEATHSIG, SIGTERM); /* when we are killed, nobody else ends it */
		become_bench(path, arguments, tower->url, pipes[1]);
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

void simulated_stop(struct simulated *tower)
{
	char bus[96];

	if (tower->pid > 0) {
		kill(tower->pid, SIGTERM);
		while (waitpid(tower->pid, NULL, 0) < 0 && errno == EINTR)
			continue;
	}
	snprintf(bus, sizeof(bus), "%s/bus", tower->directory);
	unlink(bus);
	rmdir(tower->directory);
	tower->pid = 0;
}
