/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "common/base/process.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

static int set_files(posix_spawn_file_actions_t *files, const struct process *process)
{
	int error =
	        process->folder != NULL ? posix_spawn_file_actions_addchdir_np(files, process->folder) : 0;

	for (int i = 0; i < 3 && error == 0; i++) {
		if (process->fd[i] == PROCESS_NOTHING)
			error = posix_spawn_file_actions_addopen(files, i, "/dev/null", O_RDWR, 0);
		else if (process->fd[i] != PROCESS_OURS)
			error = posix_spawn_file_actions_adddup2(files, process->fd[i], i);
	}
	return error;
}

static int set_signals(posix_spawnattr_t *attributes)
{
	sigset_t none, all;

	sigemptyset(&none);
	sigfillset(&all);
	if (posix_spawnattr_setsigmask(attributes, &none) != 0 ||
	    posix_spawnattr_setsigdefault(attributes, &all) != 0)
		return EINVAL;
	return posix_spawnattr_setflags(attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK |
	                                                    POSIX_SPAWN_SETSIGDEF);
}

int process_start(const struct process *process, pid_t *pid)
{
	union { /* posix_spawn promises not to write through its arguments */
		const char *const *given;
		char *const *taken;
	} words = {.given = process->words}, environment = {.given = process->environment};
	posix_spawn_file_actions_t files;
	posix_spawnattr_t attributes;
	int error;

	if (posix_spawn_file_actions_init(&files) != 0)
		return ENOMEM;
	if (posix_spawnattr_init(&attributes) != 0) {
		posix_spawn_file_actions_destroy(&files);
		return ENOMEM;
	}
	error = set_files(&files, process);
	if (error == 0 && process->alone)
		error = set_signals(&attributes);
	if (error == 0)
		error = posix_spawnp(pid, process->words[0], &files, &attributes, words.taken,
		                     process->environment != NULL ? environment.taken : environ);
	posix_spawnattr_destroy(&attributes);
	posix_spawn_file_actions_destroy(&files);
	return error;
}

int process_wait(pid_t pid)
{
	int status = 0;
	pid_t done;

	do
		done = waitpid(pid, &status, 0);
	while (done < 0 && errno == EINTR);
	if (done < 0)
		return -errno;
	return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

int process_write(int fd, const void *bytes, size_t size)
{
	const char *next = bytes;

	while (size > 0) {
		ssize_t n = write(fd, next, size);

		if (n < 0 && errno == EINTR)
			continue;
		if (n <= 0)
			return n < 0 ? errno : EIO;
		next += n;
		size -= (size_t)n;
	}
	return 0;
}

void process_streams_close(const struct process_streams *streams)
{
	for (int i = 0; i < 3; i++)
		if (streams->fd[i] >= 0)
			close(streams->fd[i]);
}

int process_streams_open(struct process_streams *streams, const void *bytes, size_t size)
{
	int error = 0;

	for (int i = 0; i < 3; i++) {
		streams->fd[i] = error == 0 ? memfd_create("stream", MFD_CLOEXEC) : -1;
		if (streams->fd[i] < 0 && error == 0)
			error = errno;
	}
	if (error == 0)
		error = process_write(streams->fd[0], bytes, size);
	if (error == 0 && lseek(streams->fd[0], 0, SEEK_SET) != 0)
		error = errno;
	if (error != 0)
		process_streams_close(streams);
	return error;
}

int process_scratch(void)
{
	const char *folder = getenv("TMPDIR");

	return open(folder != NULL && folder[0] == '/' ? folder : "/var/tmp", O_TMPFILE | O_RDWR | O_CLOEXEC,
	            0600);
}

int process_streams_open_file(struct process_streams *streams, const char *file)
{
	int error = 0;

	streams->fd[0] = open(file, O_RDONLY | O_CLOEXEC);
	streams->fd[1] = streams->fd[0] >= 0 ? process_scratch() : -1;
	streams->fd[2] = streams->fd[1] >= 0 ? memfd_create("stream", MFD_CLOEXEC) : -1;
	if (streams->fd[2] < 0) {
		error = errno;
		process_streams_close(streams);
	}
	return error;
}

int process_filter(const char *const *words, const struct process_streams *streams)
{
	struct process process = {.words = words, .fd = {streams->fd[0], streams->fd[1], streams->fd[2]}};
	pid_t pid;
	int error = process_start(&process, &pid);

	return error != 0 ? -error : process_wait(pid);
}

char *process_read(int fd, size_t *size)
{
	off_t end = lseek(fd, 0, SEEK_END);
	char *bytes = end < 0 ? NULL : malloc((size_t)end + 1);
	size_t have = 0;

	while (bytes != NULL && have < (size_t)end) {
		ssize_t n = pread(fd, bytes + have, (size_t)end - have, (off_t)have);

		if (n < 0 && errno == EINTR)
			continue;
		if (n <= 0) { /* not all of it is nothing */
			int error = n < 0 ? errno : EIO;

			free(bytes);
			errno = error;
			return NULL;
		}
		have += (size_t)n;
	}
	if (bytes != NULL)
		bytes[have] = '\0';
	*size = have;
	return bytes;
}
