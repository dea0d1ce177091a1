/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The bus of processes: members in one process, where one thread can play all parts, and a raw socket where
 * the bytes themselves are looked at.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "tests/unit/interrupted.h"
#include "tests/unit/local_bus.h"

#define PACKET_BYTES 76u

static void test_everyone_hears_everyone(void **state)
{
	struct link *server = local_bus_join(LINK_READ_WRITE), *a = local_bus_join(LINK_READ_WRITE),
	            *b = local_bus_join(LINK_READ_WRITE);

	(void)state;
	local_bus_serve(server);
	for (uint32_t n = 0; n < 200; n++) {
		struct frame frame = local_bus_numbered(n);

		assert_int_equal(link_send(server, &frame), 0);
		local_bus_expect(a, &frame);
		local_bus_expect(b, &frame);
		assert_int_equal(link_send(a, &frame), 0);
		local_bus_expect(server, &frame);
		local_bus_expect(b, &frame);
		assert_int_equal(link_send(b, &frame), 0);
		local_bus_expect(server, &frame);
		local_bus_expect(a, &frame);
	}
	local_bus_expect_nothing(server);
	local_bus_expect_nothing(a);
	local_bus_expect_nothing(b);
	assert_int_equal(link_counters(a)->sent, 200);
	assert_int_equal(link_counters(a)->received, 400);
	assert_int_equal(link_counters(a)->errors, 100);
	assert_int_equal(link_close(a), 0);
	assert_int_equal(link_close(b), 0);
	assert_int_equal(link_close(server), 0);
	assert_int_equal(access(bus_path, F_OK), -1);
}

static void test_members_come_and_go(void **state)
{
	struct link *server = local_bus_join(LINK_READ_WRITE);

	(void)state;
	for (uint32_t n = 0; n < 200; n++) {
		struct link *member = local_bus_join(LINK_READ_WRITE);
		struct frame frame = local_bus_numbered(n);

		assert_int_equal(link_send(member, &frame), 0);
		if (n % 2 == 0) { /* what it said before it left is heard */
			assert_int_equal(link_close(member), 0);
			local_bus_expect(server, &frame);
			local_bus_serve(server);
			continue;
		}
		local_bus_expect(server, &frame);
		assert_int_equal(link_send(server, &frame), 0);
		if (n % 4 == 1) /* else it leaves with a frame unread */
			local_bus_expect(member, &frame);
		assert_int_equal(link_close(member), 0);
		local_bus_serve(server);
	}
	assert_int_equal(link_close(server), 0);
}

static void test_more_members_than_places(void **state)
{
	struct link *server = local_bus_join(LINK_READ_WRITE), *members[40];
	struct frame frame = local_bus_numbered(1), got;
	unsigned heard = 0;

	(void)state;
	for (unsigned i = 0; i < 40; i++) {
		members[i] = local_bus_join(LINK_READ_WRITE);
		local_bus_serve(server);
	}
	assert_int_equal(link_send(server, &frame), 0);
	for (unsigned i = 0; i < 40; i++)
		heard += link_receive(members[i], &got, 0) == 1;
	assert_int_equal(heard, 32);
	assert_int_equal(link_close(members[0]), 0);
	for (unsigned i = 0; i < 40; i++)
		local_bus_serve(server);
	assert_int_equal(link_send(server, &frame), 0);
	local_bus_expect(members[32], &frame); /* has the place of the one that left */
	for (unsigned i = 1; i < 40; i++)
		assert_int_equal(link_close(members[i]), 0);
	assert_int_equal(link_close(server), 0);
}

/* ---- slow and strange peers ------------------------------------------------------------------------- */

static void test_stalled_reader_is_told_its_loss(void **state)
{
	struct link *server = local_bus_join(LINK_READ_WRITE), *client = local_bus_join(LINK_READ_WRITE);
	struct frame frame, last;
	uint32_t sent = 40000, got = 0;

	(void)state;
	local_bus_serve(server);
	for (uint32_t n = 0; n < sent; n++) {
		frame = local_bus_numbered(n);
		assert_int_equal(link_send(server, &frame), 0);
	}
	while (link_receive(client, &frame, 0) == 1 || got < 30000) {
		last = local_bus_numbered(got++);
		assert_true(local_bus_same(&frame, &last));
		local_bus_serve(server);
	}
	assert_in_range(got, 32768, sent - 1);
	last = local_bus_numbered(sent);
	assert_int_equal(link_send(server, &last), 0);
	local_bus_expect(client, &last);
	assert_int_equal(link_counters(client)->received + link_counters(client)->receive_lost, sent + 1);
	assert_int_equal(link_close(client), 0);
	assert_int_equal(link_close(server), 0);
}

static void test_client_of_a_stuck_server_is_told(void **state)
{
	struct link *server = local_bus_join(LINK_READ_WRITE), *client = local_bus_join(LINK_READ_WRITE);
	struct frame frame = local_bus_numbered(0), expected;
	uint32_t sent = 0;
	int error;

	(void)state;
	while ((error = link_send(client, &frame)) == 0)
		frame = local_bus_numbered(++sent);
	assert_int_equal(error, DT_E_FULL);
	assert_int_equal(link_counters(client)->send_lost, 1);
	assert_int_equal(link_counters(client)->sent, sent);
	assert_in_range(sent, 32768, 100000);
	for (uint32_t n = 0; n < sent; n++) {
		expected = local_bus_numbered(n);
		local_bus_expect(server, &expected);
		if (n % 64 == 0)
			local_bus_expect_nothing(client); /* hands on what waits */
	}
	assert_int_equal(link_close(client), 0);
	assert_int_equal(link_close(server), 0);
}

static int raw_connect(void)
{
	struct sockaddr_un address = {.sun_family = AF_UNIX};
	int socket_ = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0);

	memcpy(address.sun_path, bus_path, strlen(bus_path));
	assert_int_equal(connect(socket_, (const struct sockaddr *)&address, sizeof(address)), 0);
	return socket_;
}

/* id 0x12345678 extended, FD with BRS, 12 bytes; version 1 */
static const uint8_t good[PACKET_BYTES] = {0x78, 0x56, 0x34, 0x12, 0x0B, 12, 1, 0, 0, 0,  0,  0,
                                           1,    2,    3,    4,    5,    6,  7, 8, 9, 10, 11, 12};

static void test_bytes_of_a_packet(void **state)
{
	struct link *server = local_bus_join(LINK_READ_WRITE);
	struct frame frame = {.id = 0x12345678,
	                      .flags = FRAME_EXTENDED | FRAME_FD | FRAME_BRS,
	                      .length = 12,
	                      .data = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}};
	uint8_t packet[PACKET_BYTES + 1];
	int raw = raw_connect();

	(void)state;
	assert_true(send(raw, good, sizeof(good), 0) == (ssize_t)sizeof(good));
	local_bus_expect(server, &frame);
	assert_int_equal(link_send(server, &frame), 0);
	assert_true(recv(raw, packet, sizeof(packet), 0) == (ssize_t)sizeof(good));
	assert_memory_equal(packet, good, sizeof(good));
	(void)close(raw);
	assert_int_equal(link_close(server), 0);
}

/* Closing with frames unread resets the connection; what was said before is heard all the same. */
static void test_last_words_of_a_deaf_peer(void **state)
{
	struct link *server = local_bus_join(LINK_READ_WRITE);
	struct frame frame = local_bus_numbered(0);
	int raw = raw_connect();

	(void)state;
	local_bus_serve(server);
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
	struct link *server = local_bus_join(LINK_READ_WRITE), *client = local_bus_join(LINK_READ_WRITE);
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
		local_bus_serve(server);
	local_bus_expect_nothing(client);
	assert_int_equal(link_counters(server)->malformed, fault_count + 198);
	assert_int_equal(link_counters(server)->received, 0);
	(void)close(raw);
	assert_int_equal(link_close(client), 0);
	assert_int_equal(link_close(server), 0);
}

/* ---- opening ---------------------------------------------------------------------------------------- */

static void expect_refused(const char *what, const char *reason)
{
	(void)snprintf(bus_message, sizeof(bus_message), "-");
	assert_null(link_open(what, LINK_READ_WRITE, bus_message, sizeof(bus_message)));
	if (strstr(bus_message, reason) == NULL || strncmp(bus_message, what, strlen(what)) != 0 ||
	    strchr(bus_message, '\n') != NULL)
		fail_msg("\"%s\" lacks \"%s\"", bus_message, reason);
}

static void test_stale_socket_is_replaced(void **state)
{
	struct sockaddr_un address = {.sun_family = AF_UNIX};
	int stale = socket(AF_UNIX, SOCK_SEQPACKET, 0);
	struct link *server, *client;
	struct frame frame = local_bus_numbered(2);

	(void)state;
	memcpy(address.sun_path, bus_path, strlen(bus_path));
	assert_int_equal(bind(stale, (const struct sockaddr *)&address, sizeof(address)), 0);
	server = local_bus_join(LINK_READ_WRITE); /* bound, but nobody listens */
	(void)close(stale);
	client = local_bus_join(LINK_READ_WRITE);
	assert_int_equal(link_send(client, &frame), 0);
	local_bus_expect(server, &frame);
	assert_int_equal(link_close(client), 0);
	assert_int_equal(link_close(server), 0);
}

static void test_other_files_are_left_alone(void **state)
{
	int file = open(bus_path, O_CREAT | O_WRONLY, 0600);
	struct stat status;

	(void)state;
	assert_true(write(file, "keep", 4) == 4);
	(void)close(file);
	expect_refused(bus_url, "is no socket");
	assert_int_equal(stat(bus_path, &status), 0);
	assert_int_equal(status.st_size, 4);
	assert_int_equal(unlink(bus_path), 0);
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
	memcpy(address.sun_path, bus_path, strlen(bus_path));
	assert_int_equal(bind(other, (const struct sockaddr *)&address, sizeof(address)), 0);
	assert_int_equal(listen(other, 1), 0);
	expect_refused(bus_url, "another kind");
	assert_int_equal(access(bus_path, F_OK), 0);
	(void)close(other);
}

/* A replaced file is not ours to remove. */
static void test_close_removes_only_its_own_file(void **state)
{
	struct link *server = local_bus_join(LINK_READ_WRITE), *second;

	(void)state;
	assert_int_equal(unlink(bus_path), 0);
	second = local_bus_join(LINK_READ_WRITE);
	assert_int_equal(link_close(server), 0);
	assert_int_equal(access(bus_path, F_OK), 0);
	assert_int_equal(link_close(second), 0);
	assert_int_equal(access(bus_path, F_OK), -1);
}

/* ---- the interface ---------------------------------------------------------------------------------- */

static void test_frames_taken_in_while_sending(void **state)
{
	struct link *server = local_bus_join(LINK_READ_WRITE), *client = local_bus_join(LINK_READ_WRITE);
	struct frame frames[] = {local_bus_numbered(1), local_bus_numbered(2), local_bus_numbered(3)};

	(void)state;
	local_bus_serve(server);
	local_bus_serve(client);
	for (int i = 0; i < 2; i++)
		assert_int_equal(link_send(client, &frames[i]), 0);
	assert_int_equal(link_send(server, &frames[2]), 0); /* takes the client's frames in by the way */
	for (int i = 0; i < 2; i++)
		local_bus_expect(server, &frames[i]);
	local_bus_expect(client, &frames[2]);
	assert_int_equal(link_close(client), 0);
	assert_int_equal(link_close(server), 0);
}

static void test_directions(void **state)
{
	struct link *reader = local_bus_join(LINK_READ), *writer = local_bus_join(LINK_WRITE);
	struct frame frame = local_bus_numbered(0), bad = {.id = 0x800};

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
	assert_string_equal(link_url(writer), bus_url);
	assert_int_equal(link_close(reader), 0);
	assert_int_equal(link_close(writer), 0);
	assert_int_equal(link_close(NULL), 0);
}

static void test_timeout_under_interrupts(void **state)
{
	struct link *server = local_bus_join(LINK_READ_WRITE);

	(void)state;
	interrupted_receive(server);
	assert_int_equal(link_close(server), 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        BUS_TEST(test_everyone_hears_everyone),
	        BUS_TEST(test_members_come_and_go),
	        BUS_TEST(test_more_members_than_places),
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
