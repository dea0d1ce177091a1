/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/batch/input.h"

#include <dirent.h>
#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "common/base/process.h"
#include "common/base/text.h"
#include "host/record/digest.h"
#include "host/record/mme.h"
#include "host/record/profile.h"

enum { SETTLED_S = 2 };

/* ---- which ---- */

/* FNV-1a: the same for a name whatever else is named. */
static uint64_t input_hash(const char *text)
{
	uint64_t hash = 0xcbf29ce484222325u;

	for (; *text != '\0'; text++)
		hash = (hash ^ (unsigned char)*text) * 0x100000001b3u;
	return hash ^ hash >> 32;
}

static int by_path(const void *a, const void *b)
{
	return strcmp(((const struct input *)a)->path, ((const struct input *)b)->path);
}

int inputs_take(struct inputs *inputs, char *const *path, size_t count, unsigned shard, unsigned shards)
{
	struct input *input = calloc(count > 0 ? count : 1, sizeof(*input));
	size_t kept = 0;

	*inputs = (struct inputs){.input = input};
	if (input == NULL)
		return DT_E_MEMORY;
	for (size_t i = 0; i < count; i++) {
		if (input_hash(path[i]) % shards != shard - 1)
			continue;
		input[inputs->count].path = strdup(path[i]);
		if (input[inputs->count].path == NULL)
			return DT_E_MEMORY;
		inputs->count++;
	}
	qsort(input, inputs->count, sizeof(*input), by_path);
	for (size_t i = 0; i < inputs->count; i++) {
		struct stat status;

		if (kept > 0 && strcmp(input[kept - 1].path, input[i].path) == 0) {
			free(input[i].path);
			continue;
		}
		input[kept] = input[i];
		input[kept].bytes = stat(input[i].path, &status) == 0 ? status.st_size : 0;
		inputs->bytes += input[kept++].bytes;
	}
	inputs->count = kept;
	return 0;
}

void inputs_free(struct inputs *inputs)
{
	for (size_t i = 0; i < inputs->count; i++) {
		free(inputs->input[i].noted.message);
		free(inputs->input[i].path);
	}
	free(inputs->input);
	*inputs = (struct inputs){.count = 0};
}

/* ---- what is known ---- */

static int64_t ns_of(struct timespec time)
{
	return (int64_t)time.tv_sec * 1000000000 + time.tv_nsec;
}

static void note_status(struct noted *noted, const struct stat *status)
{
	noted->size = status->st_size;
	noted->mtime_ns = ns_of(status->st_mtim);
	noted->ctime_ns = ns_of(status->st_ctim);
}

bool input_stayed(const struct input *input, const struct noted *noted)
{
	struct noted now;
	struct stat status;

	if (stat(input->path, &status) != 0)
		return false;
	note_status(&now, &status);
	return now.size == noted->size && now.mtime_ns == noted->mtime_ns && now.ctime_ns == noted->ctime_ns;
}

/* A profile that lies beside a recording. */
static bool put_profile(FILE *out, const char *path)
{
	char profile[PROFILE_PATH_MAX], digest[DIGEST_CHARS];
	int64_t size;

	if (!profile_beside(path, profile))
		return true;
	if (digest_file(profile, digest, &size, -1) != 0)
		return false;
	fprintf(out, "%s %s", digest, profile);
	return true;
}

/* The channels of a test of ISO 13499. */
static bool put_channels(FILE *out, const char *path)
{
	char folder[PATH_MAX], name[PATH_MAX], digest[DIGEST_CHARS];
	struct dirent **entry;
	int count = mme_is_test(path) ? mme_channels(path, folder, &entry) : 0;
	bool right = true;
	int64_t size;

	for (int i = 0; i < count; i++) {
		right = right && snprintf(name, sizeof(name), "%s/%s", folder, entry[i]->d_name) < PATH_MAX &&
		        digest_file(name, digest, &size, -1) == 0;
		fprintf(out, "%s %s\n", right ? digest : "", entry[i]->d_name);
		free(entry[i]);
	}
	if (count > 0)
		free(entry);
	return right;
}

/* What lies beside a recording and changes what is read. */
static bool input_add_beside(const char *path, char key[INPUT_KEY_CHARS])
{
	char digest[DIGEST_CHARS];
	struct text text;
	bool right;

	if (text_open(&text) != 0)
		return false;
	right = put_profile(text.out, path) && put_channels(text.out, path);
	if (text_close(&text, right ? 0 : DT_E_SYSTEM) != 0)
		return false;
	if (text.size > 0) {
		digest_of(text.bytes, text.size, digest);
		strcat(key, "-");
		strcat(key, digest);
	}
	free(text.bytes);
	return true;
}

bool input_is_noted(const struct input *input)
{
	char key[INPUT_KEY_CHARS];

	if (input->noted.key[0] == '\0' || !input_stayed(input, &input->noted))
		return false;
	snprintf(key, sizeof(key), "%.*s", (int)strcspn(input->noted.key, "-"), input->noted.key);
	return input_add_beside(input->path, key) && strcmp(key, input->noted.key) == 0;
}

int input_look(const struct input *input, struct noted *noted)
{
	struct stat status;
	int64_t size;

	*noted = (struct noted){.noted_s = 0};
	if (stat(input->path, &status) != 0)
		return DT_E_SYSTEM;
	note_status(noted, &status);
	if (digest_file(input->path, noted->key, &size, -1) != 0 ||
	    !input_add_beside(input->path, noted->key))
		return DT_E_SYSTEM;
	return 0;
}

int input_note(int fd, const struct input *input, const struct noted *noted, int code, const char *message)
{
	struct text text;
	int error;

	if (strpbrk(input->path, "\n\t") != NULL) /* looked at anew each time */
		return 0;
	if (text_open(&text) != 0)
		return ENOMEM;
	fprintf(text.out, "%s %" PRId64 " %" PRId64 " %" PRId64 " %" PRId64 " %d\t",
	        noted->key[0] != '\0' ? noted->key : "-", noted->size, noted->mtime_ns, noted->ctime_ns,
	        (int64_t)time(NULL), code);
	for (; message != NULL && *message != '\0' && *message != '\n'; message++)
		fputc(*message == '\t' ? ' ' : *message, text.out);
	fprintf(text.out, "\t%s\n", input->path);
	if (text_close(&text, 0) != 0)
		return ENOMEM;
	error = process_write(fd, text.bytes, text.size);
	free(text.bytes);
	return error;
}

/* ---- what was noted ---- */

static void recall_line(struct inputs *inputs, char *line, bool own)
{
	struct noted noted = {.code = 0};
	char *message = strchr(line, '\t'), *path = message != NULL ? strchr(message + 1, '\t') : NULL;
	struct input key, *input;

	if (path == NULL || strlen(path) < 2 || path[strlen(path) - 1] != '\n')
		return; /* cut, when its writer was killed */
	path[strlen(path) - 1] = '\0';
	*path++ = '\0';
	*message++ = '\0';
	if (sscanf(line, "%129s %" SCNd64 " %" SCNd64 " %" SCNd64 " %" SCNd64 " %d", noted.key, &noted.size,
	           &noted.mtime_ns, &noted.ctime_ns, &noted.noted_s, &noted.code) != 6)
		return;
	if (strcmp(noted.key, "-") == 0) /* of no content */
		noted.key[0] = '\0';
	if (!own && noted.noted_s * 1000000000 < noted.ctime_ns + (int64_t)SETTLED_S * 1000000000)
		return;
	key.path = path;
	input = bsearch(&key, inputs->input, inputs->count, sizeof(key), by_path);
	if (input == NULL || (!own && noted.noted_s < input->noted.noted_s))
		return;
	free(input->noted.message);
	noted.message = message[0] != '\0' ? strdup(message) : NULL;
	input->noted = noted;
}

static int recall_file(struct inputs *inputs, const char *path, bool own)
{
	FILE *in = fopen(path, "re");
	char *line = NULL;
	size_t room = 0;

	if (in == NULL)
		return DT_E_SYSTEM;
	while (getline(&line, &room, in) > 0)
		recall_line(inputs, line, own);
	free(line);
	fclose(in);
	return 0;
}

int inputs_recall(struct inputs *inputs, const struct store *store, const char *run)
{
	char folder[PATH_MAX], path[PATH_MAX], name[128];
	struct dirent **entry;
	int count, result = 0;

	store_path(store, "known", folder);
	count = scandir(folder, &entry, NULL, alphasort);
	if (count < 0)
		return DT_E_SYSTEM;
	for (int i = 0; i < count; i++) {
		if (entry[i]->d_name[0] != '.' && result == 0 &&
		    snprintf(name, sizeof(name), "known/%s", entry[i]->d_name) < (int)sizeof(name) &&
		    strcmp(entry[i]->d_name, run) != 0) {
			store_path(store, name, path);
			result = recall_file(inputs, path, false);
		}
		free(entry[i]);
	}
	free(entry);
	snprintf(name, sizeof(name), "known/%.100s", run);
	store_path(store, name, path);
	if (recall_file(inputs, path, true) != 0 && errno != ENOENT && result == 0)
		result = DT_E_SYSTEM;
	return result;
}
