/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "common/link/temporary.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <ftw.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

enum {
	PARENT_MAX = 56,
	TRIES = 100, /* a sweep may take a folder away that is not locked yet */
	DEPTH = 16,
};

static const char *parent(void)
{
	const char *named = getenv("TMPDIR");

	return named != NULL && named[0] == '/' && strlen(named) <= PARENT_MAX ? named : "/tmp";
}

static int remove_one(const char *path, const struct stat *status, int type, struct FTW *walk)
{
	(void)status;
	(void)type;
	(void)walk;
	(void)remove(path);
	return 0;
}

/* The locked lock of a folder; -1: it cannot be had, or was swept between its opening and its locking. */
static int take_lock(const char *folder, int flags)
{
	char path[TEMPORARY_PATH_MAX + 8];
	struct stat status;
	int fd;

	snprintf(path, sizeof(path), "%s/lock", folder);
	fd = open(path, O_RDWR | O_CLOEXEC | O_NOFOLLOW | flags, 0600);
	if (fd >= 0 &&
	    (flock(fd, LOCK_EX | LOCK_NB) != 0 || fstat(fd, &status) != 0 || status.st_nlink == 0)) {
		close(fd);
		fd = -1;
	}
	return fd;
}

static void sweep_one(const char *folder)
{
	struct stat status;
	int lock;

	if (lstat(folder, &status) != 0 || !S_ISDIR(status.st_mode) || status.st_uid != geteuid())
		return;
	lock = take_lock(folder, 0);
	if (lock < 0)
		return; /* in use, or not ours to judge */
	nftw(folder, remove_one, DEPTH, FTW_DEPTH | FTW_PHYS | FTW_MOUNT);
	close(lock);
}

static void sweep(const char *purpose)
{
	char prefix[40], folder[TEMPORARY_PATH_MAX];
	DIR *all = opendir(parent());
	const struct dirent *entry;

	snprintf(prefix, sizeof(prefix), "droptower-%.16s-", purpose);
	while (all != NULL && (entry = readdir(all)) != NULL) {
		if (strncmp(entry->d_name, prefix, strlen(prefix)) != 0 ||
		    strlen(entry->d_name) != strlen(prefix) + 6)
			continue;
		snprintf(folder, sizeof(folder), "%s/%.40s", parent(), entry->d_name);
		sweep_one(folder);
	}
	if (all != NULL)
		closedir(all);
}

int temporary_make(struct temporary *temporary, const char *purpose)
{
	sweep(purpose);
	for (int i = 0; i < TRIES; i++) {
		snprintf(temporary->path, sizeof(temporary->path), "%s/droptower-%.16s-XXXXXX", parent(),
		         purpose);
		if (mkdtemp(temporary->path) == NULL)
			break;
		temporary->lock = take_lock(temporary->path, O_CREAT);
		if (temporary->lock >= 0)
			return 0;
		rmdir(temporary->path);
	}
	temporary->path[0] = '\0';
	return DT_E_SYSTEM;
}

void temporary_remove(struct temporary *temporary)
{
	if (temporary->path[0] == '\0')
		return;
	nftw(temporary->path, remove_one, DEPTH, FTW_DEPTH | FTW_PHYS | FTW_MOUNT);
	close(temporary->lock);
	temporary->path[0] = '\0';
}
