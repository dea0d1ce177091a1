/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Preloaded: the Nth request for memory of the program named in FAULT_PROGRAM finds none, FAULT_MEMORY=N.
 * With FAULT_COUNT its number of requests is written there when it ends. What it starts is left alone.
 */
#include <errno.h>
#include <fcntl.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

void *__libc_malloc(size_t size);
void *__libc_calloc(size_t count, size_t size);
void *__libc_realloc(void *old, size_t size);

static atomic_ulong requests;
static unsigned long wanted;
static bool armed;

__attribute__((constructor)) static void begin(void)
{
	const char *program = getenv("FAULT_PROGRAM"), *number = getenv("FAULT_MEMORY");
	char own[4096];
	ssize_t length = readlink("/proc/self/exe", own, sizeof(own) - 1);

	own[length > 0 ? length : 0] = '\0';
	armed = program != NULL && strrchr(own, '/') != NULL && strcmp(program, strrchr(own, '/') + 1) == 0;
	wanted = number != NULL ? strtoul(number, NULL, 10) : 0;
	atomic_store(&requests, 0);
}

__attribute__((destructor)) static void end(void)
{
	const char *file = armed ? getenv("FAULT_COUNT") : NULL;
	int fd = file != NULL ? open(file, O_WRONLY | O_CREAT | O_TRUNC, 0600) : -1;

	if (fd >= 0) {
		(void)dprintf(fd, "%lu\n", atomic_load(&requests));
		close(fd);
	}
}

static bool refuses(void)
{
	if (!armed || atomic_fetch_add(&requests, 1) + 1 != wanted)
		return false;
	errno = ENOMEM;
	return true;
}

void *malloc(size_t size)
{
	return refuses() ? NULL : __libc_malloc(size);
}

void *calloc(size_t count, size_t size)
{
	return refuses() ? NULL : __libc_calloc(count, size);
}

void *realloc(void *old, size_t size)
{
	return refuses() ? NULL : __libc_realloc(old, size);
}
