/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The bus of processes: members in one process where one thread can play all parts, in children where they
 * must run at once or die, and a raw socket where the bytes themselves are looked at.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "common/link/link.h"
#include "tests/unit/interrupted.h"
#include "tests/unit/scratch.h"

#define PACKET_BYTES 76u
#define MANY 20000u
#define WAIT_MS 10000 /* for what must come; a test that waits this long has failed */

static char directory[64], path[96], url[128], message[256];

static int set_up(void **state)
{
	(void)state;
	if (mkdtemp(scratch_name(directory, "unix")) == NULL)
		return -1;
	(void)snprintf(path, sizeof(path), "%s/bus", directory);
	(void)snprintf(url, sizeof(url), "unix:%s", path);
	return 0;
}

static int tear_down(void **state)
{
	(void)state;
	(void)unlink(path);
	return rmdir(directory);
}

static struct link *join(enum link_mode mode)
{
	struct link *link = link_open(url, mode, message, sizeof(message));

	if (link == NULL)
		fail_msg("%s", message);
	return link;
}

/* Frame number n, with the number in its data; every kind has its turn. */
static struct frame numbered(uint32_t n)
{
	static const struct frame kinds[] = {
	        {.id = 0x181, .flags = FRAME_FD | FRAME_BRS, .length = 64},
	        {.id = 0x7FF, .flags = 0, .length = 8},
	        {.id = 0x1FFFFFFF, .flags = FRAME_EXTENDED | FRAME_FD | FRAME_ESI, .length = 12},
	        {.id = 0x80, .flags = FRAME_ERROR, .length = 8},
	};
	struct frame frame = kinds[n % 4];

	for (unsigned i = 0; i < frame.length; i++)
		frame.data[i] = (uint8_t)(i < 4 ? n >> (8 * i) : n + i);
	return frame;
}

static int same(const struct frame *a, const struct frame *b)
{
	return a->id == b->id && a->flags == b->flags && a->length == b->length &&
	       memcmp(a->data, b->data, a->length) == 0;
}

static void expect(struct link *link, const struct frame *expected)
{
	struct frame frame = {0};

	assert_int_equal(link_receive(link, &frame, WAIT_MS), 1);
	assert_true(same(&frame, expected));
	assert_true(frame.time_us > 1600000000000000);
}

static void expect_nothing(struct link *link)
{
	struct frame frame;

	assert_int_equal(link_receive(link, &frame, 0), 0);
}

/* Lets a link that serves do its work once. */
static void serve(struct link *link)
{
	struct frame frame;

	assert_int_equal(link_receive(link, &frame, 0), 0);
}

static void test_everyone_hears_everyone(void **state)
{
	struct link *server = join(LINK_READ_WRITE), *a = join(LINK_READ_WRITE), *b = join(LINK_READ_WRITE);

	(void)state;
	serve(server);
	for (uint32_t n = 0; n < 200; n++) {
		struct frame frame = numbered(n);

		assert_int_equal(link_send(server, &frame), 0);
		expect(a, &frame);
		expect(b, &frame);
		assert_int_equal(link_send(a, &frame), 0);
		expect(server, &frame);
		expect(b, &frame);
		assert_int_equal(link_send(b, &frame), 0);
		expect(server, &frame);
		expect(a, &frame);
	}
	expect_nothing(server);
	expect_nothing(a);
	expect_nothing(b);
	assert_int_equal(link_counters(a)->sent, 200);
	assert_int_equal(link_counters(a)->received, 400);
	assert_int_equal(link_counters(a)->errors, 100);
	assert_int_equal(link_close(a), 0);
	assert_int_equal(link_close(b), 0);
	assert_int_equal(link_close(server), 0);
	assert_int_equal(access(path, F_OK), -1);
}

static void test_members_come_and_go(void **state)
{
	struct link *server = join(LINK_READ_WRITE);

	(void)state;
	for (uint32_t n = 0; n < 200; n++) {
		struct link *member = join(LINK_READ_WRITE);
		struct frame frame = numbered(n);

		assert_int_equal(link_send(member, &frame), 0);
		if (n % 2 == 0) { /* what it said before it left is heard */
			assert_int_equal(link_close(member), 0);
			expect(server, &frame);
			serve(server);
			continue;
		}
		expect(server, &frame);
		assert_int_equal(link_send(server, &frame), 0);
		if (n % 4 == 1) /* else it leaves with a frame unread */
			expect(member, &frame);
		assert_int_equal(link_close(member), 0);
		serve(server);
	}
	assert_int_equal(link_close(server), 0);
}

static void test_more_members_than_places(void **state)
{
	struct link *server = join(LINK_READ_WRITE), *members[40];
	struct frame frame = numbered(1), got;
	unsigned heard = 0;

	(void)state;
	for (unsigned i = 0; i < 40; i++) {
		members[i] = join(LINK_READ_WRITE);
		serve(server);
	}
	assert_int_equal(link_send(server, &frame), 0);
	for (unsigned i = 0; i < 40; i++)
		heard += link_receive(members[i], &got, 0) == 1;
	assert_int_equal(heard, 32);
	assert_int_equal(link_close(members[0]), 0);
	for (unsigned i = 0; i < 40; i++)
		serve(server);
	assert_int_equal(link_send(server, &frame), 0);
	expect(members[32], &frame); /* has the place of the one that left */
	for (unsigned i = 1; i < 40; i++)
		assert_int_equal(link_close(members[i]), 0);
	assert_int_equal(link_close(server), 0);
}

/* ---- children --------------------------------------------------------------------------------------- */

/* Forks; in the child runs what and exits with its result. */
static pid_t run_child(int (*what)(void))
{
	pid_t child = fork();

	assert_true(child >= 0);
	if (child == 0)
		_exit(what());
	return child;
}

static void pause_ms(int ms)
{
	struct timespec time = {.tv_nsec = (long)ms * 1000000};

	while (nanosleep(&time, &time) != 0 && errno == EINTR)
		continue;
}

static void expect_exit(pid_t child, int code)
{
	int status = -1;

	assert_true(waitpid(child, &status, 0) == child);
	assert_true(WIFEXITED(status));
	assert_int_equal(WEXITSTATUS(status), code);
}

static void expect_exit_while_serving(struct link *server, pid_t child)
{
	siginfo_t info = {0};

	for (int i = 0; i < WAIT_MS && info.si_pid == 0; i++) {
		serve(server);
		pause_ms(1);
		assert_int_equal(waitid(P_PID, (id_t)child, &info, WEXITED | WNOHANG | WNOWAIT), 0);
	}
	expect_exit(child, 0);
}

static int send_many(void)
{
	struct link *link = link_open(url, LINK_WRITE, message, sizeof(message));

	if (link == NULL)
		return 1;
	for (uint32_t n = 0; n < MANY; n++) {
		struct frame frame = numbered(n);

		if (link_send(link, &frame) != 0)
			return 2;
	}
	return link_close(link) == 0 ? 0 : 3;
}

/* All frames in order and no loss told: 0. */
static int receive_many(struct link *link, uint32_t first)
{
	for (uint32_t n = first; n < MANY; n++) {
		struct frame frame, expected = numbered(n);

		if (link_receive(link, &frame, WAIT_MS) != 1)
			return 4;
		if (!same(&frame, &expected))
			return 5;
	}
	return link_counters(link)->receive_lost == 0 && link_counters(link)->malformed == 0 ? 0 : 6;
}

static int join_and_pause(void)
{
	struct link *link = link_open(url, LINK_READ_WRITE, message, sizeof(message));
	struct frame frame = {.id = 1}, first = numbered(0);
	int result;

	if (link == NULL || link_send(link, &frame) != 0)
		return 1;
	if (link_receive(link, &frame, WAIT_MS) != 1 || !same(&frame, &first))
		return 2;
	pause_ms(500);
	result = receive_many(link, 1);
	return link_close(link) == 0 ? result : 3;
}

/* Sender, server and a reader that stops reading while the frames come. */
static void test_paused_reader_loses_nothing(void **state)
{
	struct link *server = join(LINK_READ_WRITE);
	struct frame hello = {.id = 1};
	pid_t reader, sender;

	(void)state;
	reader = run_child(join_and_pause);
	expect(server, &hello);
	sender = run_child(send_many);
	assert_int_equal(receive_many(server, 0), 0);
	expect_exit(sender, 0);
	expect_exit_while_serving(server, reader);
	assert_int_equal(link_close(server), 0);
}

static void test_paused_server_loses_nothing(void **state)
{
	struct link *server = join(LINK_READ_WRITE);
	pid_t sender;

	(void)state;
	sender = run_child(send_many);
	pause_ms(500);
	assert_int_equal(receive_many(server, 0), 0);
	expect_exit(sender, 0);
	assert_int_equal(link_close(server), 0);
}

static int serve_until_killed(void)
{
	struct link *link = link_open(url, LINK_READ_WRITE, message, sizeof(message));
	struct frame frame;

	while (link != NULL && link_receive(link, &frame, WAIT_MS) >= 0)
		continue;
	return 1;
}

static void wait_for_file(void)
{
	for (int i = 0; i < WAIT_MS && access(path, F_OK) != 0; i++)
		pause_ms(1);
}

static void kill_child(pid_t child)
{
	assert_int_equal(kill(child, SIGKILL), 0);
	assert_true(waitpid(child, NULL, 0) == child);
}

static void test_server_killed(void **state)
{
	pid_t child = run_child(serve_until_killed);
	struct link *a, *b;
	struct frame frame = numbered(8);

	(void)state;
	wait_for_file();
	a = join(LINK_READ_WRITE);
	b = join(LINK_READ_WRITE);
	assert_int_equal(link_send(a, &frame), 0);
	expect(b, &frame); /* the child relays */
	kill_child(child);
	assert_int_equal(access(path, F_OK), 0); /* stale */
	serve(a);                                /* takes over */
	serve(b);
	serve(a);
	assert_int_equal(link_send(b, &frame), 0);
	expect(a, &frame);
	assert_int_equal(link_send(a, &frame), 0);
	expect(b, &frame);
	assert_int_equal(link_counters(a)->restarts, 1);
	assert_int_equal(link_counters(b)->restarts, 1);
	assert_int_equal(link_close(b), 0);
	assert_int_equal(link_close(a), 0);
}

static void test_server_leaves(void **state)
{
	struct link *server = join(LINK_READ_WRITE), *a = join(LINK_READ_WRITE), *b = join(LINK_READ_WRITE);
	struct frame last = numbered(3), frame = numbered(4);

	(void)state;
	serve(server);
	assert_int_equal(link_send(server, &last), 0);
	assert_int_equal(link_close(server), 0);
	expect(a, &last); /* its last words */
	expect(b, &last);
	serve(a);
	assert_int_equal(link_send(b, &frame), 0); /* joins the new server by itself */
	expect(a, &frame);
	server = join(LINK_READ_WRITE); /* comes back as a client */
	expect_nothing(a);
	assert_int_equal(link_send(server, &frame), 0);
	expect(a, &frame);
	expect(b, &frame);
	assert_int_equal(link_counters(b)->restarts, 1);
	assert_int_equal(link_close(server), 0);
	assert_int_equal(link_close(a), 0);
	assert_int_equal(link_close(b), 0);
	assert_int_equal(access(path, F_OK), -1);
}

/* What the dead server's socket had not taken yet goes to the next one, in order. */
static void test_unsent_frames_survive_the_server(void **state)
{
	struct link *server = join(LINK_READ_WRITE), *next = join(LINK_READ_WRITE),
	            *client = join(LINK_READ_WRITE);
	struct frame frame, expected;
	uint32_t n, number;

	(void)state;
	for (n = 0; n < 5000; n++) {
		frame = numbered(n);
		assert_int_equal(link_send(client, &frame), 0);
	}
	assert_int_equal(link_close(server), 0);
	while (link_receive(next, &frame, 0) == 1) /* what the old server still handed on */
		continue;
	assert_int_equal(link_counters(next)->restarts, 1);
	serve(client);
	assert_int_equal(link_receive(next, &frame, WAIT_MS), 1);
	number = (uint32_t)frame.data[0] | (uint32_t)frame.data[1] << 8;
	assert_in_range(number, 1, 4999);
	while (++number < 5000) {
		expected = numbered(number);
		expect(next, &expected);
		serve(client);
	}
	assert_int_equal(link_close(client), 0);
	assert_int_equal(link_close(next), 0);
}

static void test_bus_gone_for_good(void **state)
{
	struct link *server = join(LINK_READ_WRITE), *client = join(LINK_READ_WRITE);
	struct frame frame = numbered(0);

	(void)state;
	assert_int_equal(link_close(server), 0);
	assert_int_equal(rmdir(directory), 0);
	assert_int_equal(link_receive(client, &frame, WAIT_MS), DT_E_CLOSED);
	assert_int_equal(link_send(client, &frame), DT_E_CLOSED);
	assert_int_equal(link_close(client), 0);
	assert_int_equal(mkdir(directory, 0700), 0);
}

/* ---- slow and strange peers ------------------------------------------------------------------------- */

static void test_stalled_reader_is_told_its_loss(void **state)
{
	struct link *server = join(LINK_READ_WRITE), *client = join(LINK_READ_WRITE);
	struct frame frame, last;
	uint32_t sent = 40000, got = 0;

	(void)state;
	serve(server);
	for (uint32_t n = 0; n < sent; n++) {
		frame = numbered(n);
		assert_int_equal(link_send(server, &frame), 0);
	}
	while (link_receive(client, &frame, 0) == 1 || got < 30000) {
		last = numbered(got++);
		assert_true(same(&frame, &last));
		serve(server);
	}
	assert_in_range(got, 32768, sent - 1);
	last = numbered(sent);
	assert_int_equal(link_send(server, &last), 0);
	expect(client, &last);
	assert_int_equal(link_counters(client)->received + link_counters(client)->receive_lost, sent + 1);
	assert_int_equal(link_close(client), 0);
	assert_int_equal(link_close(server), 0);
}

static void test_client_of_a_stuck_server_is_told(void **state)
{
	struct link *server = join(LINK_READ_WRITE), *client = join(LINK_READ_WRITE);
	struct frame frame = numbered(0), expected;
	uint32_t sent = 0;
	int error;

	(void)state;
	while ((error = link_send(client, &frame)) == 0)
		frame = numbered(++sent);
	assert_int_equal(error, DT_E_FULL);
	assert_int_equal(link_counters(client)->send_lost, 1);
	assert_int_equal(link_counters(client)->sent, sent);
	assert_in_range(sent, 32768, 100000);
	for (uint32_t n = 0; n < sent; n++) {
		expected = numbered(n);
		expect(server, &expected);
		if (n % 64 == 0)
			expect_nothing(client); /* hands on what waits */
	}
	assert_int_equal(link_close(client), 0);
	assert_int_equal(link_close(server), 0);
}

static int raw_connect(void)
{
	struct sockaddr_un address = {.sun_family = AF_UNIX};
	int socket_ = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0);

	memcpy(address.sun_path, path, strlen(path));
	assert_int_equal(connect(socket_, (const struct sockaddr *)&address, sizeof(address)), 0);
	return socket_;
}

/* id 0x12345678 extended, FD with BRS, 12 bytes; version 1 */
static const uint8_t good[PACKET_BYTES] = {0x78, 0x56, 0x34, 0x12, 0x0B, 12, 1, 0, 0, 0,  0,  0,
                                           1,    2,    3,    4,    5,    6,  7, 8, 9, 10, 11, 12};

static void test_bytes_of_a_packet(void **state)
{
	struct link *server = join(LINK_READ_WRITE);
	struct frame frame = {.id = 0x12345678,
	                      .flags = FRAME_EXTENDED | FRAME_FD | FRAME_BRS,
	                      .length = 12,
	                      .data = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}};
	uint8_t packet[PACKET_BYTES + 1];
	int raw = raw_connect();

	(void)state;
	assert_true(send(raw, good, sizeof(good), 0) == (ssize_t)sizeof(good));
	expect(server, &frame);
	assert_int_equal(link_send(server, &frame), 0);
	assert_true(recv(raw, packet, sizeof(packet), 0) == (ssize_t)sizeof(good));
	assert_memory_equal(packet, good, sizeof(good));
	(void)close(raw);
	assert_int_equal(link_close(server), 0);
}

/* Closing with frames unread resets the connection; what was said before is heard all the same. */
static void test_last_words_of_a_deaf_peer(void **state)
{
	struct link *server = join(LINK_READ_WRITE);
	struct frame frame = numbered(0);
	int raw = raw_connect();

	(void)state;
	serve(server);
	assert_int_equal(link_send(server, &frame), 0);
	assert_true(send(raw, good, sizeof(good), 0) == (ssize_t)sizeof(good));
	(void)close(raw);
	assert_int_equal(link_receive(server, &frame, WAIT_MS), 1);
	assert_int_equal(frame.id, 0x12345678);
	assert_int_equal(link_close(server), 0);
}

static void test_malformed_packets(void **state)
{
	static const struct {
		unsigned at;
		uint8_t value;
	} faults[] = {{3, 0x32}, {4, 0x4B}, {4, 0x03}, {4, 0x1B}, {4, 0x0A}, {5, 9},
	              {5, 65},   {5, 255},  {6, 0},    {6, 2},    {7, 1}};
	const unsigned fault_count = sizeof(faults) / sizeof(faults[0]);
	struct link *server = join(LINK_READ_WRITE), *client = join(LINK_READ_WRITE);
	struct frame frame;
	int raw = raw_connect();

	(void)state;
	for (unsigned i = 0; i < fault_count; i++) {
		uint8_t packet[PACKET_BYTES];

		memcpy(packet, good, sizeof(packet));
		packet[faults[i].at] = faults[i].value;
		assert_true(send(raw, packet, sizeof(packet), 0) == (ssize_t)sizeof(packet));
	}
	for (size_t size = 1; size < 200; size++) {
		uint8_t packet[200] = {0};

		memcpy(packet, good, sizeof(good));
		if (size != PACKET_BYTES)
			assert_true(send(raw, packet, size, 0) == (ssize_t)size);
		while (link_receive(server, &frame, 0) != 0)
			fail_msg("a packet of %zu bytes was taken", size);
	}
	for (int i = 0; i < 10; i++)
		serve(server);
	expect_nothing(client);
	assert_int_equal(link_counters(server)->malformed, fault_count + 198);
	assert_int_equal(link_counters(server)->received, 0);
	(void)close(raw);
	assert_int_equal(link_close(client), 0);
	assert_int_equal(link_close(server), 0);
}

/* ---- opening ---------------------------------------------------------------------------------------- */

static void expect_refused(const char *what, const char *reason)
{
	(void)snprintf(message, sizeof(message), "-");
	assert_null(link_open(what, LINK_READ_WRITE, message, sizeof(message)));
	if (strstr(message, reason) == NULL || strncmp(message, what, strlen(what)) != 0 ||
	    strchr(message, '\n') != NULL)
		fail_msg("\"%s\" lacks \"%s\"", message, reason);
}

static void test_stale_socket_is_replaced(void **state)
{
	struct sockaddr_un address = {.sun_family = AF_UNIX};
	int stale = socket(AF_UNIX, SOCK_SEQPACKET, 0);
	struct link *server, *client;
	struct frame frame = numbered(2);

	(void)state;
	memcpy(address.sun_path, path, strlen(path));
	assert_int_equal(bind(stale, (const struct sockaddr *)&address, sizeof(address)), 0);
	server = join(LINK_READ_WRITE); /* bound, but nobody listens */
	(void)close(stale);
	client = join(LINK_READ_WRITE);
	assert_int_equal(link_send(client, &frame), 0);
	expect(server, &frame);
	assert_int_equal(link_close(client), 0);
	assert_int_equal(link_close(server), 0);
}

static void test_other_files_are_left_alone(void **state)
{
	int file = open(path, O_CREAT | O_WRONLY, 0600);
	struct stat status;

	(void)state;
	assert_true(write(file, "keep", 4) == 4);
	(void)close(file);
	expect_refused(url, "is no socket");
	assert_int_equal(stat(path, &status), 0);
	assert_int_equal(status.st_size, 4);
	assert_int_equal(unlink(path), 0);
}

static void test_refused_paths(void **state)
{
	char long_url[256] = "unix:/tmp/";

	(void)state;
	memset(long_url + strlen(long_url), 'x', 150);
	expect_refused(long_url, "expected at most 107");
	expect_refused("unix:/nonexistent/bus", "no such directory");
	expect_refused("unix:", "expected unix:PATH");
	expect_refused("unix", "expected unix:PATH");
	expect_refused("tcp:x", "expected unix:PATH");
	assert_null(link_open("unix:/nonexistent/bus", LINK_READ_WRITE, NULL, 0));
}

static void test_socket_of_another_kind(void **state)
{
	struct sockaddr_un address = {.sun_family = AF_UNIX};
	int other = socket(AF_UNIX, SOCK_STREAM, 0);

	(void)state;
	memcpy(address.sun_path, path, strlen(path));
	assert_int_equal(bind(other, (const struct sockaddr *)&address, sizeof(address)), 0);
	assert_int_equal(listen(other, 1), 0);
	expect_refused(url, "another kind");
	assert_int_equal(access(path, F_OK), 0);
	(void)close(other);
}

/* A replaced file is not ours to remove. */
static void test_close_removes_only_its_own_file(void **state)
{
	struct link *server = join(LINK_READ_WRITE), *second;

	(void)state;
	assert_int_equal(unlink(path), 0);
	second = join(LINK_READ_WRITE);
	assert_int_equal(link_close(server), 0);
	assert_int_equal(access(path, F_OK), 0);
	assert_int_equal(link_close(second), 0);
	assert_int_equal(access(path, F_OK), -1);
}

/* ---- the interface ---------------------------------------------------------------------------------- */

static void test_frames_taken_in_while_sending(void **state)
{
	struct link *server = join(LINK_READ_WRITE), *client = join(LINK_READ_WRITE);
	struct frame frames[] = {numbered(1), numbered(2), numbered(3)};

	(void)state;
	serve(server);
	serve(client);
	for (int i = 0; i < 2; i++)
		assert_int_equal(link_send(client, &frames[i]), 0);
	assert_int_equal(link_send(server, &frames[2]), 0); /* takes the client's frames in by the way */
	for (int i = 0; i < 2; i++)
		expect(server, &frames[i]);
	expect(client, &frames[2]);
	assert_int_equal(link_close(client), 0);
	assert_int_equal(link_close(server), 0);
}

static void test_directions(void **state)
{
	struct link *reader = join(LINK_READ), *writer = join(LINK_WRITE);
	struct frame frame = numbered(0), bad = {.id = 0x800};

	(void)state;
	assert_int_equal(link_send(reader, &frame), DT_E_STATE);
	assert_int_equal(link_receive(writer, &frame, 0), DT_E_STATE);
	assert_int_equal(link_send(writer, &bad), DT_E_ARGUMENT);
	bad = (struct frame){.flags = FRAME_FD, .length = 9};
	assert_int_equal(link_send(writer, &bad), DT_E_ARGUMENT);
	bad = (struct frame){.flags = FRAME_FD | FRAME_REMOTE};
	assert_int_equal(link_send(writer, &bad), DT_E_ARGUMENT);
	bad = (struct frame){.flags = 0x40};
	assert_int_equal(link_send(writer, &bad), DT_E_ARGUMENT);
	assert_int_equal(link_counters(writer)->sent, 0);
	assert_string_equal(link_url(writer), url);
	assert_int_equal(link_close(reader), 0);
	assert_int_equal(link_close(writer), 0);
	assert_int_equal(link_close(NULL), 0);
}

static void test_timeout_under_interrupts(void **state)
{
	struct link *server = join(LINK_READ_WRITE);

	(void)state;
	interrupted_receive(server);
	assert_int_equal(link_close(server), 0);
}

#define BUS_TEST(f) cmocka_unit_test_setup_teardown(f, set_up, tear_down)

int main(void)
{
	const struct CMUnitTest tests[] = {
	        BUS_TEST(test_everyone_hears_everyone),
	        BUS_TEST(test_members_come_and_go),
	        BUS_TEST(test_more_members_than_places),
	        BUS_TEST(test_paused_reader_loses_nothing),
	        BUS_TEST(test_paused_server_loses_nothing),
	        BUS_TEST(test_server_killed),
	        BUS_TEST(test_server_leaves),
	        BUS_TEST(test_unsent_frames_survive_the_server),
	        BUS_TEST(test_bus_gone_for_good),
	        BUS_TEST(test_stalled_reader_is_told_its_loss),
	        BUS_TEST(test_client_of_a_stuck_server_is_told),
	        BUS_TEST(test_bytes_of_a_packet),
	        BUS_TEST(test_last_words_of_a_deaf_peer),
	        BUS_TEST(test_malformed_packets),
	        BUS_TEST(test_stale_socket_is_replaced),
	        BUS_TEST(test_other_files_are_left_alone),
	        BUS_TEST(test_refused_paths),
	        BUS_TEST(test_socket_of_another_kind),
	        BUS_TEST(test_close_removes_only_its_own_file),
	        BUS_TEST(test_frames_taken_in_while_sending),
	        BUS_TEST(test_directions),
	        BUS_TEST(test_timeout_under_interrupts),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
