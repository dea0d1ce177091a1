/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/log_index.h"

#include <droptower_version.h>
#include <inttypes.h>
#include <nettle/sha2.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "common/wire_table.h"
#include "host/base/atomic_file.h"

#define HEAD "# droptower index "

enum { FORMAT = 2, ENDS_BYTES = 1 << 16, LINE_MAX_BYTES = 4096, DIGEST_CHARS = 2 * SHA256_DIGEST_SIZE + 1 };

/* ---- whose index ---- */

static void digest_text(struct sha256_ctx *hash, char text[DIGEST_CHARS])
{
	uint8_t digest[SHA256_DIGEST_SIZE];

	sha256_digest(hash, SHA256_DIGEST_SIZE, digest);
	for (unsigned i = 0; i < SHA256_DIGEST_SIZE; i++)
		sprintf(text + 2 * (size_t)i, "%02x", digest[i]);
}

static void hash_part(struct log_file *log, uint64_t at, struct sha256_ctx *hash)
{
	size_t held;
	const char *bytes = log_file_get(log, at, ENDS_BYTES, &held);

	sha256_update(hash, held < ENDS_BYTES ? held : ENDS_BYTES, (const uint8_t *)bytes);
}

/* The file's own size: an index beside a log in blocks is of its contents. */
static bool is_as_opened(const struct log_file *log, const struct stat *status)
{
	return log->blocks != NULL || (uint64_t)status->st_size == log->size;
}

/* The two lines that an index of this log begins with, by this program; false when it cannot have one.
 * Inside: of one in the log's own file, which has no time of change. */
static bool describe(struct log_file *log, bool inside, char lines[LINE_MAX_BYTES])
{
	char ends[DIGEST_CHARS];
	struct sha256_ctx hash;
	struct stat status = {0};

	if (log->size < LOG_INDEX_LEAST)
		return false;
	if (!inside &&
	    (log->descriptor < 0 || fstat(log->descriptor, &status) != 0 || !is_as_opened(log, &status)))
		return false;
	sha256_init(&hash);
	hash_part(log, 0, &hash);
	hash_part(log, log->size - ENDS_BYTES, &hash);
	digest_text(&hash, ends);
	snprintf(lines, LINE_MAX_BYTES, HEAD "%d, %s, wire %08" PRIx32 "\nlog %" PRIu64 " %lld.%09ld %s\n",
	         FORMAT, DT_VERSION, wire_hash(), log->size, (long long)status.st_ctim.tv_sec,
	         status.st_ctim.tv_nsec, ends);
	return log->failed == 0;
}

static char *index_name(const struct log_file *log)
{
	char *name;

	return asprintf(&name, "%s.index", log->file) < 0 ? NULL : name;
}

/* ---- reading ---- */

/* Whether all of it is there, by its last line. */
static bool log_index_is_whole(FILE *index)
{
	char line[LINE_MAX_BYTES], wanted[LINE_MAX_BYTES], digest[DIGEST_CHARS];
	struct sha256_ctx hash, copy;
	uint64_t lines = 0;

	sha256_init(&hash);
	while (fgets(line, sizeof(line), index) != NULL) {
		if (strncmp(line, "end ", 4) == 0) {
			copy = hash;
			digest_text(&copy, digest);
			snprintf(wanted, sizeof(wanted), "end %" PRIu64 " %s\n", lines, digest);
			return strcmp(line, wanted) == 0 && fgetc(index) == EOF;
		}
		sha256_update(&hash, strlen(line), (const uint8_t *)line);
		lines++;
	}
	return false;
}

static bool is_of(FILE *index, struct log_file *log, bool inside)
{
	char wanted[LINE_MAX_BYTES], found[LINE_MAX_BYTES];
	size_t length;

	if (!describe(log, inside, wanted))
		return false;
	length = strlen(wanted);
	return fread(found, 1, length, index) == length && memcmp(found, wanted, length) == 0;
}

/* That of a log in blocks, which is in it. */
static FILE *open_inside(struct log_file *log)
{
	size_t size = 0;
	char *text = log->blocks != NULL ? blocks_index(log->blocks, &size) : NULL;
	FILE *index = text != NULL && size > 0 ? fmemopen(NULL, size + 1, "w+") : NULL;

	if (index != NULL) {
		fwrite(text, 1, size, index);
		rewind(index);
	}
	free(text);
	return index;
}

static FILE *open_beside(struct log_file *log)
{
	char *name = index_name(log);
	struct stat status;
	FILE *index = NULL;

	if (name != NULL && stat(name, &status) == 0 && S_ISREG(status.st_mode))
		index = fopen(name, "re");
	free(name);
	return index;
}

static FILE *believed(FILE *index, struct log_file *log, bool inside)
{
	if (index == NULL)
		return NULL;
	if (is_of(index, log, inside)) {
		rewind(index);
		if (log_index_is_whole(index))
			return index;
	}
	fclose(index);
	return NULL;
}

FILE *log_index_open(struct log_file *log)
{
	FILE *index = believed(open_inside(log), log, true);

	return index != NULL ? index : believed(open_beside(log), log, false);
}

static bool read_parameters(char *text, struct log_capture_parameters *parameters)
{
	for (char *word = strtok(text, " \n"); word != NULL; word = strtok(NULL, " \n")) {
		unsigned index, value, i = 0;

		if (sscanf(word, "%x=%u", &index, &value) != 2)
			return false;
		while (i < WIRE_PARAMETERS && wire_parameters[i].index != index)
			i++;
		if (i == WIRE_PARAMETERS)
			return false;
		parameters->known[i] = true;
		parameters->value[i] = value;
	}
	return true;
}

static bool read_capture(char *line, uint64_t size, struct log_capture *c)
{
	struct record_counters *n = &c->counters;
	unsigned alone, ended, agrees, sealed, seal_agrees;
	int used = 0, fields;

	*c = (struct log_capture){0};
	fields = sscanf(line,
	                "capture %u %u %" SCNu64 " %" SCNu64 " %" SCNd64 " %u %" SCNu16 " %" SCNu16
	                " %" SCNu32 " %" SCNu32 " %" SCNx32 " %" SCNu16 " %u %u %u %" SCNx32 " %" SCNu64
	                " %" SCNu64 " %" SCNu64 " %" SCNu64 " %" SCNu64 " %" SCNu64 " %" SCNu64 "%n",
	                &c->number, &alone, &c->from, &c->to, &c->time_us, &ended, &c->drop_id, &c->marks,
	                &c->first_tick_ms, &c->last_tick_ms, &c->crc32, &c->frame_speed_mm_s, &agrees,
	                &sealed, &seal_agrees, &c->seal, &n->blocks, &n->repeated, &n->reordered, &n->corrupt,
	                &n->gaps, &n->resent, &n->conflicting, &used);
	c->alone = alone != 0;
	c->ended = ended != 0;
	c->crc_agrees = agrees != 0;
	c->seal_known = sealed != 0;
	c->seal_agrees = seal_agrees != 0;
	return fields == 23 && c->from <= c->to && c->to <= size &&
	       read_parameters(line + used, &c->parameters);
}

static bool read_event(const char *line, struct log_event *e)
{
	*e = (struct log_event){.kind = LOG_START};
	if (sscanf(line, "start %" SCNu64 " %" SCNd64, &e->at, &e->time_us) == 2)
		return true;
	e->kind = LOG_FAULT;
	if (sscanf(line, "fault %" SCNu64 " %" SCNd64 " %u %x %" SCNu32, &e->at, &e->time_us, &e->fault,
	           &e->emcy, &e->tick_ms) == 5)
		return true;
	e->kind = LOG_HEARTBEATS;
	return sscanf(line, "heartbeats %" SCNu64 " %" SCNd64 " %" SCNu64 " %" SCNd64 " %" SCNd64, &e->at,
	              &e->time_us, &e->count, &e->first_us, &e->longest_us) == 5;
}

int log_index_visit(FILE *index, const struct log_file *log, const struct log_visitor *visitor)
{
	char line[LINE_MAX_BYTES];
	int result = 0;

	rewind(index);
	while (result == 0 && fgets(line, sizeof(line), index) != NULL) {
		struct log_capture capture;
		struct log_event event;

		if (line[0] == '#' || strncmp(line, "log ", 4) == 0)
			continue;
		if (strncmp(line, "end ", 4) == 0)
			return 0;
		if (read_capture(line, log->size, &capture))
			result = visitor->capture(visitor->context, &capture, NULL);
		else if (!read_event(line, &event))
			result = DT_E_FORMAT;
		else if (visitor->event != NULL)
			result = visitor->event(visitor->context, &event);
	}
	return result != 0 ? result : DT_E_FORMAT;
}

/* ---- making ---- */

struct making {
	struct log_visitor *to;
	struct atomic_file atomic;
	bool open;
	FILE *out; /* of whole, or text in memory */
	struct sha256_ctx hash;
	uint64_t lines;
};

__attribute__((format(printf, 2, 3))) static void log_index_put(struct making *making, const char *format,
                                                                ...)
{
	char text[LINE_MAX_BYTES];
	va_list list;

	if (!making->open)
		return;
	va_start(list, format);
	vsnprintf(text, sizeof(text), format, list);
	va_end(list);
	fputs(text, making->out); /* whoever closes it says whether all was written */
	sha256_update(&making->hash, strlen(text), (const uint8_t *)text);
	for (const char *p = text; *p != '\0'; p++)
		making->lines += *p == '\n';
}

static int put_capture(void *context, const struct log_capture *c, struct record *record)
{
	struct making *making = context;
	const struct record_counters *n = &c->counters;

	log_index_put(making,
	              "capture %u %u %" PRIu64 " %" PRIu64 " %" PRId64 " %u %u %u %" PRIu32 " %" PRIu32
	              " %08" PRIx32 " %u %u %u %u %08" PRIx32 " %" PRIu64 " %" PRIu64 " %" PRIu64 " %" PRIu64
	              " %" PRIu64 " %" PRIu64 " %" PRIu64,
	              c->number, c->alone, c->from, c->to, c->time_us, c->ended, c->drop_id, c->marks,
	              c->first_tick_ms, c->last_tick_ms, c->crc32, c->frame_speed_mm_s, c->crc_agrees,
	              c->seal_known, c->seal_agrees, c->seal, n->blocks, n->repeated, n->reordered,
	              n->corrupt, n->gaps, n->resent, n->conflicting);
	for (unsigned i = 0; i < WIRE_PARAMETERS; i++)
		if (c->parameters.known[i])
			log_index_put(making, " %x=%u", wire_parameters[i].index,
			              (unsigned)c->parameters.value[i]);
	log_index_put(making, "\n");
	return making->to->capture(making->to->context, c, record);
}

static int log_index_put_event(void *context, const struct log_event *e)
{
	struct making *making = context;

	if (e->kind == LOG_START)
		log_index_put(making, "start %" PRIu64 " %" PRId64 "\n", e->at, e->time_us);
	else if (e->kind == LOG_FAULT)
		log_index_put(making, "fault %" PRIu64 " %" PRId64 " %u %x %" PRIu32 "\n", e->at, e->time_us,
		              e->fault, e->emcy, e->tick_ms);
	else
		log_index_put(making,
		              "heartbeats %" PRIu64 " %" PRId64 " %" PRIu64 " %" PRId64 " %" PRId64 "\n",
		              e->at, e->time_us, e->count, e->first_us, e->longest_us);
	return making->to->event != NULL ? making->to->event(making->to->context, e) : 0;
}

/* Nothing is there, or an index, whatever of: another file of that name stays. */
static bool may_write(const char *name)
{
	char head[sizeof(HEAD)] = "";
	struct stat status;
	FILE *file;
	bool ours;

	if (stat(name, &status) != 0)
		return true;
	file = S_ISREG(status.st_mode) ? fopen(name, "re") : NULL;
	if (file == NULL)
		return false;
	ours = status.st_size == 0 || (fgets(head, sizeof(head), file) != NULL && strcmp(head, HEAD) == 0);
	fclose(file);
	return ours;
}

static void log_index_begin(struct making *making, const char *name, const char *lines)
{
	char message[READ_MESSAGE_MAX];

	sha256_init(&making->hash);
	if (name != NULL && may_write(name))
		making->open = atomic_file_open(&making->atomic, name, message, sizeof(message)) == 0;
	making->out = making->atomic.out;
	log_index_put(making, "%s", lines);
}

static void put_end(struct making *making)
{
	struct sha256_ctx hash = making->hash;
	char digest[DIGEST_CHARS];

	digest_text(&hash, digest);
	fprintf(making->out, "end %" PRIu64 " %s\n", making->lines, digest);
}

/* Kept if the log was walked to its end and is still the one that was opened. */
static void log_index_end(struct making *making, struct log_file *log, int result, const char *lines)
{
	char now[LINE_MAX_BYTES], message[READ_MESSAGE_MAX];

	if (!making->open)
		return;
	put_end(making);
	if (result == 0 &&
	    (!describe(log, false, now) || strcmp(now, lines) != 0 || ferror(making->atomic.out)))
		result = DT_E_STATE;
	if (atomic_file_close(&making->atomic, result, message, sizeof(message)) != 0)
		making->open = false; /* there is none then, as in a folder that cannot be written */
}

int log_index_walk(struct log_file *log, struct log_visitor *visitor, struct log_contents *contents,
                   char message[READ_MESSAGE_MAX])
{
	struct making making = {.to = visitor};
	struct log_visitor put_first = {.context = &making,
	                                .wanted = visitor->wanted,
	                                .capture = put_capture,
	                                .event = log_index_put_event};
	char lines[LINE_MAX_BYTES], *name;
	int result;

	if (!describe(log, false, lines))
		return log_walk(log, 0, log->size, visitor, contents, message);
	name = index_name(log);
	log_index_begin(&making, name, lines);
	result = log_walk(log, 0, log->size, &put_first, contents, message);
	log_index_end(&making, log, result == 0 && contents->captures == 0 ? DT_E_EMPTY : result, lines);
	free(name);
	return result;
}

/* ---- inside a log in blocks ---- */

static int pass_by(void *context, const struct log_capture *capture, struct record *record)
{
	(void)context;
	(void)capture;
	(void)record; /* none is asked for */
	return 0;
}

int log_index_text(struct log_file *log, struct text *text, char message[READ_MESSAGE_MAX])
{
	struct log_visitor nothing = {.capture = pass_by};
	struct making making = {.to = &nothing, .open = true};
	struct log_visitor put_first = {
	        .context = &making, .capture = put_capture, .event = log_index_put_event};
	struct log_contents contents;
	char lines[LINE_MAX_BYTES];
	int result;

	*text = (struct text){0};
	if (!describe(log, true, lines))
		return log_file_error(log, message);
	if (text_open(text) != 0)
		return source_no_memory(message, log->file);
	making.out = text->out;
	sha256_init(&making.hash);
	log_index_put(&making, "%s", lines);
	result = log_walk(log, 0, log->size, &put_first, &contents, message);
	put_end(&making);
	if (text_close(text, result) != 0)
		return result ? result : source_no_memory(message, log->file);
	return 0;
}
