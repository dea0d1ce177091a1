/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/base/mapped.h"

#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "common/base/process.h"

enum { EXIT_INPUT = 3 };

/* Those there are. */
struct region {
	struct region *next;
	char *at;
	size_t bytes;
};

static struct region *regions;
static pthread_mutex_t regions_lock = PTHREAD_MUTEX_INITIALIZER;
static _Thread_local size_t seen;

static void mapped_shrunk(int signal)
{
	static const char text[] =
	        "droptower: a file became shorter, or the disk failed, while it was read\n";

	(void)signal;
	(void)!write(STDERR_FILENO, text, sizeof(text) - 1);
	_exit(EXIT_INPUT);
}

static void watch_for_shrinking(void)
{
	struct sigaction action = {.sa_handler = mapped_shrunk};

	sigemptyset(&action.sa_mask);
	(void)sigaction(SIGBUS, &action, NULL);
}

static void *add_region(int descriptor, size_t bytes, int protection, int flags)
{
	struct region *region = malloc(sizeof(*region));
	void *at = region != NULL ? mmap(NULL, bytes, protection, flags, descriptor, 0) : MAP_FAILED;

	if (at == MAP_FAILED) {
		free(region);
		return NULL;
	}
	pthread_mutex_lock(&regions_lock);
	if (regions == NULL)
		watch_for_shrinking();
	*region = (struct region){.next = regions, .at = at, .bytes = bytes};
	regions = region;
	pthread_mutex_unlock(&regions_lock);
	return at;
}

char *mapped_file(int descriptor, size_t size)
{
	return add_region(descriptor, size, PROT_READ, MAP_PRIVATE);
}

static void *array_on_disk(size_t bytes)
{
	int descriptor = process_scratch();
	void *array = NULL;

	if (descriptor < 0)
		return NULL;
	if (posix_fallocate(descriptor, 0, (off_t)bytes) == 0)
		array = add_region(descriptor, bytes, PROT_READ | PROT_WRITE, MAP_SHARED);
	close(descriptor);
	return array;
}

void *mapped_array(size_t count, size_t size)
{
	void *array = NULL;

	if (count > SIZE_MAX / 2 / size)
		return NULL;
	if (count * size >= MAPPED_LEAST)
		array = array_on_disk(count * size);
	return array != NULL ? array : calloc(count > 0 ? count : 1, size);
}

void *mapped_array_resize(void *array, size_t held, size_t count, size_t size)
{
	size_t bytes = (held < count ? held : count) * size;
	char *other = mapped_array(count, size);

	for (size_t at = 0; other != NULL && at < bytes; at += MAPPED_STEP) {
		size_t part = bytes - at < MAPPED_STEP ? bytes - at : MAPPED_STEP;

		memcpy(other + at, (char *)array + at, part);
		mapped_seen(2 * part);
	}
	if (other != NULL)
		mapped_free(array);
	return other;
}

static struct region *take_region(const void *memory)
{
	struct region **at = &regions, *region;

	pthread_mutex_lock(&regions_lock);
	while (*at != NULL && (*at)->at != memory)
		at = &(*at)->next;
	region = *at;
	if (region != NULL)
		*at = region->next;
	pthread_mutex_unlock(&regions_lock);
	return region;
}

void mapped_free(void *memory)
{
	struct region *region = take_region(memory);

	if (region == NULL) {
		free(memory);
		return;
	}
	(void)munmap(region->at, region->bytes);
	free(region);
}

void mapped_seen(size_t bytes)
{
	seen += bytes;
	if (seen < MAPPED_STEP)
		return;
	seen = 0;
	pthread_mutex_lock(&regions_lock);
	for (const struct region *region = regions; region != NULL; region = region->next)
		(void)madvise(region->at, region->bytes, MADV_DONTNEED);
	pthread_mutex_unlock(&regions_lock);
}
