/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/archive/chain.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum { LINE_MAX_BYTES = 512, TAIL_BYTES = 4096 };

/* Before the first entry. */
static const char genesis[] = "droptower chain 1";

static void chain_path_of(const struct archive *archive, char path[ARCHIVE_PATH_MAX], const char *name)
{
	snprintf(path, ARCHIVE_PATH_MAX, "%s/%.200s", archive->folder, name);
}

static int chain_refuse_file(struct archive *archive, const char *path)
{
	return archive_refuse(archive, DT_E_SYSTEM, "%.500s: %s", path, strerror(errno));
}

/* ---- a line ---- */

/* What stands before the head of a line, to its end. */
static void head_of(const char *before, const char *said, size_t length, char head[DIGEST_CHARS])
{
	struct sha256_ctx context;

	sha256_init(&context);
	sha256_update(&context, strlen(before), (const uint8_t *)before);
	sha256_update(&context, 1, (const uint8_t *)" ");
	sha256_update(&context, length, (const uint8_t *)said);
	digest_end(&context, head);
}

static bool is_hash(const char *text)
{
	return strlen(text) == DIGEST_CHARS - 1 && text[strspn(text, "0123456789abcdef")] == '\0';
}

/* "17 TIME PATH 5123 HASH HEAD"; cuts it into its words. before: the head it should follow from. */
static bool parse(char *line, const char *before, struct chain_entry *entry)
{
	char *word[6], *rest = line, *end, head[DIGEST_CHARS];
	size_t count = 0, said = strlen(line);

	if (said < DIGEST_CHARS || said >= LINE_MAX_BYTES)
		return false;
	said -= DIGEST_CHARS; /* the blank and the head */
	head_of(before, line, said, head);
	while (count < 6 && (word[count] = strsep(&rest, " ")) != NULL)
		count++;
	if (count < 6 || rest != NULL || !is_hash(word[5]) ||
	    (!is_hash(word[4]) && strcmp(word[4], CHAIN_REMOVED) != 0))
		return false;
	*entry = (struct chain_entry){.number = strtoll(word[0], &end, 10),
	                              .path = word[2],
	                              .bytes = strtoll(word[3], NULL, 10),
	                              .hash = word[4],
	                              .head = word[5],
	                              .sound = strcmp(head, word[5]) == 0};
	return *end == '\0' && entry->number > 0;
}

/* ---- all of it ---- */

static int by_path(const void *a, const void *b, void *entries)
{
	const struct chain_entry *entry = entries, *x = &entry[*(const size_t *)a],
	                         *y = &entry[*(const size_t *)b];
	int order = strcmp(x->path, y->path);

	return order != 0 ? order : x < y ? -1 : x > y;
}

static int chain_sort(struct chain *chain)
{
	chain->by_path = calloc(chain->count + 1, sizeof(*chain->by_path));
	if (chain->by_path == NULL)
		return DT_E_MEMORY;
	for (size_t i = 0; i < chain->count; i++)
		chain->by_path[i] = i;
	qsort_r(chain->by_path, chain->count, sizeof(*chain->by_path), by_path, chain->entry);
	return 0;
}

static void note_broken(struct chain *chain, int64_t number)
{
	if (chain->broken == 0)
		chain->broken = number;
}

/* A line that ends with the file and not with a line's end was never acknowledged. */
static void read_lines(struct chain *chain)
{
	char before[DIGEST_CHARS];
	int64_t expected = 1;

	snprintf(before, sizeof(before), "%s", genesis);
	for (char *line = chain->text, *end; (end = strchr(line, '\n')) != NULL; line = end + 1, expected++) {
		struct chain_entry *entry = &chain->entry[chain->count];

		*end = '\0';
		if (!parse(line, before, entry)) {
			note_broken(chain, expected);
			continue;
		}
		if (!entry->sound || entry->number != expected)
			note_broken(chain, expected);
		expected = entry->number;
		snprintf(before, sizeof(before), "%s", entry->head);
		chain->count++;
	}
}

int chain_load(struct archive *archive, struct chain *chain)
{
	char path[ARCHIVE_PATH_MAX];
	size_t lines = 1;

	*chain = (struct chain){0};
	chain_path_of(archive, path, CHAIN_FILE);
	chain->text = durable_read(path, &chain->size);
	if (chain->text == NULL)
		return errno == ENOENT || errno == ENOTDIR ? 0 : chain_refuse_file(archive, path);
	for (const char *c = chain->text; c < chain->text + chain->size; c++)
		lines += *c == '\n';
	chain->entry = calloc(lines, sizeof(*chain->entry));
	if (chain->entry != NULL)
		read_lines(chain);
	if (chain->entry != NULL && chain_sort(chain) == 0)
		return 0;
	chain_free(chain);
	return archive_refuse(archive, DT_E_MEMORY, "%s", error_text(DT_E_MEMORY));
}

void chain_free(struct chain *chain)
{
	free(chain->text);
	free(chain->entry);
	free(chain->by_path);
	*chain = (struct chain){0};
}

const struct chain_entry *chain_find(const struct chain *chain, const char *path)
{
	size_t low = 0, high = chain->count; /* the first that is behind path */

	while (low < high) {
		size_t middle = (low + high) / 2;

		if (strcmp(chain->entry[chain->by_path[middle]].path, path) <= 0)
			low = middle + 1;
		else
			high = middle;
	}
	if (low == 0 || strcmp(chain->entry[chain->by_path[low - 1]].path, path) != 0)
		return NULL;
	return &chain->entry[chain->by_path[low - 1]];
}

const struct chain_entry *chain_find_hash(const struct chain *chain, const char *hash)
{
	for (size_t i = chain->count; i > 0; i--)
		if (strcmp(chain->entry[i - 1].hash, hash) == 0)
			return &chain->entry[i - 1];
	return NULL;
}

const struct chain_entry *chain_place(const struct chain *chain, const char *path, int64_t number,
                                      struct chain_place *place)
{
	size_t at = number > 0 && (uint64_t)number <= chain->count ? (size_t)number - 1 : 0;

	if (at < chain->count && chain->entry[at].number != number) /* the chain is broken */
		for (at = 0; at < chain->count && chain->entry[at].number != number;)
			at++;
	if (number < 1 || at >= chain->count || strcmp(chain->entry[at].path, path) != 0)
		return NULL;
	*place = (struct chain_place){.number = number};
	snprintf(place->head, sizeof(place->head), "%s", at > 0 ? chain->entry[at - 1].head : genesis);
	return &chain->entry[at];
}

/* ---- growing ---- */

/* The end of the file into tail; how much there is, and where the file ends. */
static int read_tail(const char *path, char tail[TAIL_BYTES + 1], int64_t *end)
{
	int fd = open(path, O_RDONLY | O_CLOEXEC);
	off_t size, from;
	ssize_t n = -1;

	if (fd < 0)
		return DT_E_SYSTEM;
	size = lseek(fd, 0, SEEK_END);
	from = size > TAIL_BYTES ? size - TAIL_BYTES : 0;
	if (size >= 0)
		n = pread(fd, tail, TAIL_BYTES, from);
	close(fd);
	if (n < 0)
		return DT_E_SYSTEM;
	tail[n] = '\0';
	*end = size;
	return 0;
}

/* The last line of tail that can be read; half a line at its end is cut off. */
static bool last_entry(char tail[TAIL_BYTES + 1], int64_t *end, struct chain_entry *entry)
{
	char *stop = strrchr(tail, '\n'), *start;

	*end -= (int64_t)strlen(stop != NULL ? stop + 1 : tail);
	while (stop != NULL) {
		*stop = '\0';
		start = strrchr(tail, '\n');
		if (parse(start != NULL ? start + 1 : tail, "", entry))
			return true;
		stop = start;
	}
	return false;
}

/* Where an index whose chain is gone goes on: what is missing shows. */
static int place_of_index(struct archive *archive, struct chain_place *place)
{
	sqlite3_stmt *s;
	int result = sql_query(archive, &s, "SELECT entries, head FROM chain", "");

	if (result != 0)
		return result;
	*place = (struct chain_place){.number = 1};
	snprintf(place->head, sizeof(place->head), "%s", genesis);
	result = sql_step(archive, s);
	if (result > 0) {
		place->number = sqlite3_column_int64(s, 0) + 1;
		snprintf(place->head, sizeof(place->head), "%.64s", sql_text(s, 1));
	}
	sqlite3_finalize(s);
	return result < 0 ? result : 0;
}

int chain_finish(struct archive *archive, const struct chain_entry *entry)
{
	char path[ARCHIVE_PATH_MAX], part[ARCHIVE_PATH_MAX + 8], hash[DIGEST_CHARS];
	int64_t bytes;

	chain_path_of(archive, path, entry->path);
	snprintf(part, sizeof(part), "%s.part", path);
	if (digest_file(part, hash, &bytes, -1) != 0 || strcmp(hash, entry->hash) != 0)
		return 0;
	return durable_publish(path) == 0 ? 0 : chain_refuse_file(archive, path);
}

int chain_next(struct archive *archive, struct chain_place *place)
{
	char path[ARCHIVE_PATH_MAX], tail[TAIL_BYTES + 1];
	struct chain_entry last;
	int result = place_of_index(archive, place);

	chain_path_of(archive, path, CHAIN_FILE);
	if (result != 0)
		return result;
	if (read_tail(path, tail, &place->at) != 0)
		return errno == ENOENT ? 0 : chain_refuse_file(archive, path);
	if (!last_entry(tail, &place->at, &last))
		return 0;
	place->number = last.number + 1;
	snprintf(place->head, sizeof(place->head), "%s", last.head);
	return chain_finish(archive, &last);
}

int chain_note(struct archive *archive, int64_t number, const char *head)
{
	return sql_run(archive, "INSERT OR REPLACE INTO chain (id, entries, head) VALUES (1, ?, ?)", "is",
	               number, head);
}

int chain_enter(struct archive *archive, const struct chain_place *place, const char *path, int64_t bytes,
                const char *hash)
{
	char line[LINE_MAX_BYTES], head[DIGEST_CHARS], now[ARCHIVE_TIME_CHARS], file[ARCHIVE_PATH_MAX];
	int said;

	archive_time(now, time(NULL));
	said = snprintf(line, sizeof(line), "%lld %s %.200s %lld %s", (long long)place->number, now, path,
	                (long long)bytes, hash);
	head_of(place->head, line, (size_t)said, head);
	snprintf(line + said, sizeof(line) - (size_t)said, " %s\n", head);
	chain_path_of(archive, file, CHAIN_FILE);
	if (durable_folders(file) != 0 || durable_append(file, place->at, line, strlen(line)) != 0)
		return chain_refuse_file(archive, file);
	return chain_note(archive, place->number, head);
}

int chain_reaches(struct archive *archive, const struct chain *chain)
{
	struct chain_place noted;
	int result = place_of_index(archive, &noted);

	if (result != 0)
		return result;
	if (noted.number == 1)
		return 1;
	for (size_t i = chain->count; i > 0; i--)
		if (chain->entry[i - 1].number == noted.number - 1 &&
		    strcmp(chain->entry[i - 1].head, noted.head) == 0)
			return 1;
	archive_refuse(archive, DT_E_CORRUPT,
	               CHAIN_FILE ": %s: %lld entries, expected %lld with the head %.64s",
	               chain->count == 0 ? "missing" : "cut or exchanged", (long long)chain->count,
	               (long long)noted.number - 1, noted.head);
	return 0;
}

bool chain_is_of_one(const struct chain *chain, int64_t noted, const char **path)
{
	*path = NULL;
	for (size_t i = chain->count; i > 0 && chain->entry[i - 1].number > noted; i--) {
		if (*path != NULL && strcmp(*path, chain->entry[i - 1].path) != 0)
			return false;
		*path = chain->entry[i - 1].path;
	}
	return true;
}

/* The sidecar whose entries the index does not know of, NULL: none; 1, or 0 as chain_is_reached. */
static int left_behind(struct archive *archive, const struct chain *chain, const char **path)
{
	struct chain_place noted;
	int result = place_of_index(archive, &noted);

	if (result != 0)
		return result;
	if (chain_is_of_one(chain, noted.number - 1, path))
		return 1;
	archive_refuse(archive, DT_E_CORRUPT,
	               "index.sqlite: behind: it knows of %lld entries of " CHAIN_FILE
	               ", expected %lld: was an earlier one put back? 'droptower series --rebuild' makes it "
	               "again",
	               (long long)noted.number - 1, (long long)chain->entry[chain->count - 1].number);
	return 0;
}

int chain_is_reached(struct archive *archive, const struct chain *chain)
{
	const char *path;

	return left_behind(archive, chain, &path);
}

int chain_left(struct archive *archive, char file[ARCHIVE_PATH_MAX])
{
	struct chain_place next, noted;
	struct chain chain;
	const char *path;
	int result = chain_next(archive, &next);

	if (result == 0)
		result = place_of_index(archive, &noted);
	if (result != 0 || next.number <= noted.number)
		return result;
	result = chain_load(archive, &chain);
	if (result != 0)
		return result;
	result = left_behind(archive, &chain, &path);
	if (result > 0)
		snprintf(file, ARCHIVE_PATH_MAX, "%s", path != NULL ? path : "");
	chain_free(&chain);
	return result > 0 ? file[0] != '\0' : result < 0 ? result : DT_E_CORRUPT;
}
