/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_COMMON_BASE_PROCESS_H
#define DT_COMMON_BASE_PROCESS_H
/*
 * Another program as a child of this one. Functions that return an errno return 0 when all is well.
 */
#include <stdbool.h>
#include <stddef.h>
#include <sys/types.h>

enum { PROCESS_OURS = 0, PROCESS_NOTHING = -1 };

struct process {
	const char *const *words; /* NULL behind; the first is the program, by path or looked for on PATH */
	const char *const *environment; /* NULL: ours */
	const char *folder;             /* where it works; NULL: where we do */
	int fd[3];                      /* its streams, PROCESS_OURS, or PROCESS_NOTHING: /dev/null */
	bool alone; /* a process group of its own and no signal handled or blocked: a Ctrl-C is not for it,
	             * and kill(-pid) ends what it has started, too */
};

/* An errno. */
int process_start(const struct process *process, pid_t *pid);

/* Until it ends: its exit status, or 128 plus the signal that ended it. */
int process_wait(pid_t pid);

/* A file without a name in $TMPDIR, else /var/tmp: its descriptor, or -1 with errno. */
int process_scratch(void);

/* Three streams as files in memory: no pipe can fill up while the other end waits. */
struct process_streams {
	int fd[3];
};

/* The first holds these bytes and is read from their beginning on. An errno; then there is nothing to close.
 */
int process_streams_open(struct process_streams *streams, const void *bytes, size_t size);

/* For large ones: the first is this file, the second a file on the disk. */
int process_streams_open_file(struct process_streams *streams, const char *file);
void process_streams_close(const struct process_streams *streams);

/* Runs words on the streams. Its exit status as process_wait, or minus an errno when it could not be started.
 */
int process_filter(const char *const *words, const struct process_streams *streams);

/* All that a stream holds with a NUL behind, to be freed; NULL with errno when not all of it could be read.
 */
char *process_read(int fd, size_t *size);

/* All bytes to fd. An errno. */
int process_write(int fd, const void *bytes, size_t size);

#endif
