/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/base/mapped.h"

#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "common/base/process.h"

enum { EXIT_INPUT = 3, STAY_STEP = 64 };

/* Those there are. */
struct region {
	struct region *next;
	char *at;
	size_t bytes;
};

static struct region *regions;

/* Memory that stays, and what of it is taken: in the order of places. */
enum { STAY_ARRAYS = MAPPED_STAY / MAPPED_LEAST };
static struct {
	char *at;
	unsigned arrays;
	struct {
		size_t from, until;
	} array[STAY_ARRAYS];
} stay;

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

/* Room for all of them, in pages of 2 MiB where the system has them: each of 4 KiB costs it as much as to go
 * through what it holds. NULL without memory. */
static char *stay_begin(void)
{
	const size_t page = (size_t)2 << 20;
	char *at = mmap(NULL, MAPPED_STAY + page, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);

	if (at == MAP_FAILED)
		return NULL;
	at += (page - (uintptr_t)at % page) % page;
	(void)madvise(at, MAPPED_STAY, MADV_HUGEPAGE);
	return at;
}

/* The first gap that is large enough. */
static void *stay_take(size_t bytes)
{
	size_t from = 0;
	unsigned i = 0;

	if (stay.at == NULL || stay.arrays == STAY_ARRAYS)
		return NULL;
	for (; i < stay.arrays && stay.array[i].from - from < bytes; i++)
		from = stay.array[i].until;
	if (bytes > MAPPED_STAY - from)
		return NULL;
	memmove(&stay.array[i + 1], &stay.array[i], (stay.arrays++ - i) * sizeof(stay.array[0]));
	stay.array[i].from = from;
	stay.array[i].until = from + bytes;
	return stay.at + from;
}

static void *array_that_stays(size_t bytes)
{
	void *array;

	bytes += -bytes % STAY_STEP;
	pthread_mutex_lock(&regions_lock);
	if (stay.at == NULL && bytes <= MAPPED_STAY)
		stay.at = stay_begin();
	array = stay_take(bytes);
	pthread_mutex_unlock(&regions_lock);
	return array;
}

/* Whether the array was one of them. */
static bool stay_free(const void *array)
{
	unsigned i = 0;
	bool is;

	pthread_mutex_lock(&regions_lock);
	while (i < stay.arrays && stay.at + stay.array[i].from != array)
		i++;
	is = i < stay.arrays;
	if (is)
		memmove(&stay.array[i], &stay.array[i + 1], (--stay.arrays - i) * sizeof(stay.array[0]));
	pthread_mutex_unlock(&regions_lock);
	return is;
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
		array = array_that_stays(count * size);
	if (array == NULL && count * size >= MAPPED_LEAST)
		array = array_on_disk(count * size);
	return array != NULL ? array : malloc(count > 0 ? count * size : 1);
}

void *mapped_work(size_t bytes)
{
	void *work = bytes >= MAPPED_LEAST ? array_that_stays(bytes) : NULL;

	return work != NULL ? work : malloc(bytes);
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
	struct region *region;

	if (stay_free(memory))
		return;
	region = take_region(memory);
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
