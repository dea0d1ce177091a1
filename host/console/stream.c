/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/console/stream.h"

#include <inttypes.h>
#include <nettle/base64.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

#include "host/console/state.h"

enum {
	STATE_MS = 250, /* at least as often, though nothing changed */
	LOOK_MS = 20,
	EVENT_TICKS = 512, /* in one event */
	TICK_BYTES = 2 * 2 * LIVE_CHANNELS,
	LIVE_CHARS = BASE64_ENCODE_RAW_LENGTH(EVENT_TICKS * TICK_BYTES),
	SEND_BUFFER = 32 * 1024, /* the kernel's: what is in it is old */
	CHUNK = 16 * 1024,
};

struct stream {
	struct streams *streams;
	struct MHD_Connection *connection; /* NULL: the place is free */
	bool asleep;                       /* suspended */
	char console[HOLD_CONSOLE_MAX + 1];
	uint64_t state_told; /* number of the state that was sent last */
	bool mine, taken;    /* as told */
	uint64_t next_tick;
	char *text; /* being sent */
	size_t size, sent, room;
	bool told; /* all that was new since it was woken */
};

struct streams {
	struct console *console;
	struct hold *hold;
	pthread_mutex_t lock; /* of asleep, connection and ending */
	bool ending;
	struct stream stream[STREAM_MAX];
	/* the state, once for all of them */
	struct state state;
	char *state_text;
	uint64_t state_number;
	int64_t looked_ms, told_ms;
	struct live_tick ticks[EVENT_TICKS];
};

struct streams *streams_create(struct console *console, struct hold *hold)
{
	struct streams *streams = calloc(1, sizeof(*streams));

	if (streams == NULL)
		return NULL;
	streams->console = console;
	streams->hold = hold;
	pthread_mutex_init(&streams->lock, NULL);
	return streams;
}

void streams_destroy(struct streams *streams)
{
	for (int i = 0; i < STREAM_MAX; i++)
		free(streams->stream[i].text);
	pthread_mutex_destroy(&streams->lock);
	free(streams->state_text);
	free(streams);
}

/* Looks at the others' views; a new state has a new number. */
static void stream_look(struct streams *streams)
{
	struct console *console = streams->console;
	int64_t now_ms = session_now_ms();
	struct state now;
	char *text;

	if (streams->state_text != NULL && now_ms - streams->looked_ms < LOOK_MS)
		return;
	streams->looked_ms = now_ms;
	state_look(&now, console->tower, console->work, console->live);
	if (streams->state_text != NULL && now_ms - streams->told_ms < STATE_MS &&
	    !state_changed(&streams->state, &now))
		return;
	text = state_json(&now);
	if (text == NULL)
		return;
	free(streams->state_text);
	streams->state_text = text;
	streams->state_number++;
	streams->told_ms = now_ms;
	streams->state = now;
}

static void stream_say(struct stream *stream, const char *text)
{
	size_t length = strlen(text);

	if (stream->size + length > stream->room) {
		size_t room = 2 * (stream->size + length);
		char *more = realloc(stream->text, room);

		if (more == NULL)
			return; /* half an event is skipped by the page, the next state is whole */
		stream->text = more;
		stream->room = room;
	}
	memcpy(stream->text + stream->size, text, length);
	stream->size += length;
}

static void say_state(struct stream *stream)
{
	struct streams *streams = stream->streams;
	int64_t now_ms = session_now_ms();
	bool taken = hold_taken(streams->hold, now_ms);
	bool mine = hold_mine(streams->hold, stream->console, now_ms);
	char head[128];

	if (streams->state_text == NULL ||
	    (streams->state_number == stream->state_told && taken == stream->taken && mine == stream->mine))
		return;
	stream->state_told = streams->state_number;
	stream->taken = taken;
	stream->mine = mine;
	snprintf(head, sizeof(head), "event: state\ndata: {\"hold\":{\"mine\":%s,\"taken\":%s},",
	         mine ? "true" : "false", taken ? "true" : "false");
	stream_say(stream, head);
	stream_say(stream, streams->state_text + 1); /* behind its brace */
	stream_say(stream, "\n\n");
}

/* Little endian, whatever this machine is. */
static size_t put_ticks(uint8_t *out, const struct live_tick *ticks, size_t count)
{
	size_t size = 0;

	for (size_t i = 0; i < count; i++)
		for (int channel = 0; channel < LIVE_CHANNELS; channel++) {
			uint16_t low = (uint16_t)ticks[i].low[channel];
			uint16_t high = (uint16_t)ticks[i].high[channel];

			out[size++] = (uint8_t)low;
			out[size++] = (uint8_t)(low >> 8);
			out[size++] = (uint8_t)high;
			out[size++] = (uint8_t)(high >> 8);
		}
	return size;
}

/* Whether there is more. */
static bool say_live(struct stream *stream)
{
	struct streams *streams = stream->streams;
	uint8_t bytes[EVENT_TICKS * TICK_BYTES];
	char text[LIVE_CHARS + 1], head[96];
	uint64_t first;
	size_t count =
	        live_read(streams->console->live, &stream->next_tick, &first, streams->ticks, EVENT_TICKS);

	if (count == 0)
		return false;
	base64_encode_raw(text, put_ticks(bytes, streams->ticks, count), bytes);
	text[BASE64_ENCODE_RAW_LENGTH(count * TICK_BYTES)] = '\0';
	snprintf(head, sizeof(head),
	         "event: live\ndata: {\"first\":%" PRIu64 ",\"ticks\":%zu,\"envelope\":\"", first, count);
	stream_say(stream, head);
	stream_say(stream, text);
	stream_say(stream, "\"}\n\n");
	return count == EVENT_TICKS;
}

/* What is new; nothing of it is kept for later. Once for each time it was woken, so that what comes in the
 * meantime does not go out a crumb at a time. */
static void stream_compose(struct stream *stream)
{
	stream->size = 0;
	stream->sent = 0;
	if (stream->told)
		return;
	stream_look(stream->streams);
	say_state(stream);
	stream->told = !say_live(stream);
}

/* Asleep until the next tick; the end when there will be none. */
static ssize_t sleep_or_end(struct stream *stream)
{
	struct streams *streams = stream->streams;
	ssize_t result = 0;

	pthread_mutex_lock(&streams->lock);
	if (streams->ending) {
		result = MHD_CONTENT_READER_END_OF_STREAM;
	} else {
		stream->asleep = true;
		stream->told = false;
		MHD_suspend_connection(stream->connection);
	}
	pthread_mutex_unlock(&streams->lock);
	return result;
}

static ssize_t read_stream(void *context, uint64_t position, char *out, size_t room)
{
	struct stream *stream = context;
	size_t size;

	(void)position;
	if (stream->sent == stream->size)
		stream_compose(stream);
	size = stream->size - stream->sent;
	if (size == 0)
		return sleep_or_end(stream);
	if (size > room)
		size = room;
	memcpy(out, stream->text + stream->sent, size);
	stream->sent += size;
	return (ssize_t)size;
}

static void close_stream(void *context)
{
	struct stream *stream = context;

	pthread_mutex_lock(&stream->streams->lock);
	stream->connection = NULL;
	stream->asleep = false;
	pthread_mutex_unlock(&stream->streams->lock);
}

static struct stream *free_place(struct streams *streams)
{
	for (int i = 0; i < STREAM_MAX; i++)
		if (streams->stream[i].connection == NULL)
			return &streams->stream[i];
	return NULL;
}

static void stream_begin(struct stream *stream, struct streams *streams, struct MHD_Connection *connection,
                         const char *named)
{
	char *text = stream->text;
	size_t room = stream->room;

	memset(stream, 0, sizeof(*stream));
	stream->streams = streams;
	stream->connection = connection;
	stream->text = text;
	stream->room = room;
	snprintf(stream->console, sizeof(stream->console), "%s", named);
}

struct MHD_Response *stream_open(struct streams *streams, struct MHD_Connection *connection,
                                 const char *named)
{
	const union MHD_ConnectionInfo *info =
	        MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
	struct stream *stream;
	struct MHD_Response *response = NULL;
	int buffer = SEND_BUFFER;

	pthread_mutex_lock(&streams->lock);
	stream = free_place(streams);
	if (stream != NULL)
		stream_begin(stream, streams, connection, named);
	pthread_mutex_unlock(&streams->lock);
	if (stream == NULL)
		return NULL;
	if (info != NULL)
		(void)setsockopt(info->connect_fd, SOL_SOCKET, SO_SNDBUF, &buffer, sizeof(buffer));
	response =
	        MHD_create_response_from_callback(MHD_SIZE_UNKNOWN, CHUNK, read_stream, stream, close_stream);
	if (response == NULL)
		close_stream(stream);
	return response;
}

void streams_tick(struct streams *streams)
{
	pthread_mutex_lock(&streams->lock);
	for (int i = 0; i < STREAM_MAX; i++) {
		struct stream *stream = &streams->stream[i];

		if (stream->connection != NULL && stream->asleep) {
			stream->asleep = false;
			MHD_resume_connection(stream->connection);
		}
	}
	pthread_mutex_unlock(&streams->lock);
}

void streams_end(struct streams *streams)
{
	pthread_mutex_lock(&streams->lock);
	streams->ending = true;
	pthread_mutex_unlock(&streams->lock);
	streams_tick(streams);
}
