/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The bus of processes: members in children, where they must run at once, pause, or die.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "tests/unit/local_bus.h"

#define MANY 20000u

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
		local_bus_serve(server);
		pause_ms(1);
		assert_int_equal(waitid(P_PID, (id_t)child, &info, WEXITED | WNOHANG | WNOWAIT), 0);
	}
	expect_exit(child, 0);
}

static int send_many(void)
{
	struct link *link = link_open(bus_url, LINK_WRITE, bus_message, sizeof(bus_message));

	if (link == NULL)
		return 1;
	for (uint32_t n = 0; n < MANY; n++) {
		struct frame frame = local_bus_numbered(n);

		if (link_send(link, &frame) != 0)
			return 2;
	}
	return link_close(link) == 0 ? 0 : 3;
}

/* All frames in order and no loss told: 0. */
static int receive_many(struct link *link, uint32_t first)
{
	for (uint32_t n = first; n < MANY; n++) {
		struct frame frame, expected = local_bus_numbered(n);

		if (link_receive(link, &frame, WAIT_MS) != 1)
			return 4;
		if (!local_bus_same(&frame, &expected))
			return 5;
	}
	return link_counters(link)->receive_lost == 0 && link_counters(link)->malformed == 0 ? 0 : 6;
}

static int join_and_pause(void)
{
	struct link *link = link_open(bus_url, LINK_READ_WRITE, bus_message, sizeof(bus_message));
	struct frame frame = {.id = 1}, first = local_bus_numbered(0);
	int result;

	if (link == NULL || link_send(link, &frame) != 0)
		return 1;
	if (link_receive(link, &frame, WAIT_MS) != 1 || !local_bus_same(&frame, &first))
		return 2;
	pause_ms(500);
	result = receive_many(link, 1);
	return link_close(link) == 0 ? result : 3;
}

/* Sender, server and a reader that stops reading while the frames come. */
static void test_paused_reader_loses_nothing(void **state)
{
	struct link *server = local_bus_join(LINK_READ_WRITE);
	struct frame hello = {.id = 1};
	pid_t reader, sender;

	(void)state;
	reader = run_child(join_and_pause);
	local_bus_expect(server, &hello);
	sender = run_child(send_many);
	assert_int_equal(receive_many(server, 0), 0);
	expect_exit(sender, 0);
	expect_exit_while_serving(server, reader);
	assert_int_equal(link_close(server), 0);
}

static void test_paused_server_loses_nothing(void **state)
{
	struct link *server = local_bus_join(LINK_READ_WRITE);
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
	struct link *link = link_open(bus_url, LINK_READ_WRITE, bus_message, sizeof(bus_message));
	struct frame frame;

	while (link != NULL && link_receive(link, &frame, WAIT_MS) >= 0)
		continue;
	return 1;
}

static void wait_for_file(void)
{
	for (int i = 0; i < WAIT_MS && access(bus_path, F_OK) != 0; i++)
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
	struct frame frame = local_bus_numbered(8);

	(void)state;
	wait_for_file();
	a = local_bus_join(LINK_READ_WRITE);
	b = local_bus_join(LINK_READ_WRITE);
	assert_int_equal(link_send(a, &frame), 0);
	local_bus_expect(b, &frame); /* the child relays */
	kill_child(child);
	assert_int_equal(access(bus_path, F_OK), 0); /* stale */
	local_bus_serve(a);                          /* takes over */
	local_bus_serve(b);
	local_bus_serve(a);
	assert_int_equal(link_send(b, &frame), 0);
	local_bus_expect(a, &frame);
	assert_int_equal(link_send(a, &frame), 0);
	local_bus_expect(b, &frame);
	assert_int_equal(link_counters(a)->restarts, 1);
	assert_int_equal(link_counters(b)->restarts, 1);
	assert_int_equal(link_close(b), 0);
	assert_int_equal(link_close(a), 0);
}

static void test_server_leaves(void **state)
{
	struct link *server = local_bus_join(LINK_READ_WRITE), *a = local_bus_join(LINK_READ_WRITE),
	            *b = local_bus_join(LINK_READ_WRITE);
	struct frame last = local_bus_numbered(3), frame = local_bus_numbered(4);

	(void)state;
	local_bus_serve(server);
	assert_int_equal(link_send(server, &last), 0);
	assert_int_equal(link_close(server), 0);
	local_bus_expect(a, &last); /* its last words */
	local_bus_expect(b, &last);
	local_bus_serve(a);
	assert_int_equal(link_send(b, &frame), 0); /* joins the new server by itself */
	local_bus_expect(a, &frame);
	server = local_bus_join(LINK_READ_WRITE); /* comes back as a client */
	local_bus_expect_nothing(a);
	assert_int_equal(link_send(server, &frame), 0);
	local_bus_expect(a, &frame);
	local_bus_expect(b, &frame);
	assert_int_equal(link_counters(b)->restarts, 1);
	assert_int_equal(link_close(server), 0);
	assert_int_equal(link_close(a), 0);
	assert_int_equal(link_close(b), 0);
	assert_int_equal(access(bus_path, F_OK), -1);
}

/* What the dead server's socket had not taken yet goes to the next one, in order. */
static void test_unsent_frames_survive_the_server(void **state)
{
	struct link *server = local_bus_join(LINK_READ_WRITE), *next = local_bus_join(LINK_READ_WRITE),
	            *client = local_bus_join(LINK_READ_WRITE);
	struct frame frame, expected;
	uint32_t n, number;

	(void)state;
	for (n = 0; n < 5000; n++) {
		frame = local_bus_numbered(n);
		assert_int_equal(link_send(client, &frame), 0);
	}
	assert_int_equal(link_close(server), 0);
	while (link_receive(next, &frame, 0) == 1) /* what the old server still handed on */
		continue;
	assert_int_equal(link_counters(next)->restarts, 1);
	local_bus_serve(client);
	assert_int_equal(link_receive(next, &frame, WAIT_MS), 1);
	number = (uint32_t)frame.data[0] | (uint32_t)frame.data[1] << 8;
	assert_in_range(number, 1, 4999);
	while (++number < 5000) {
		expected = local_bus_numbered(number);
		local_bus_expect(next, &expected);
		local_bus_serve(client);
	}
	assert_int_equal(link_close(client), 0);
	assert_int_equal(link_close(next), 0);
}

static void test_bus_gone_for_good(void **state)
{
	struct link *server = local_bus_join(LINK_READ_WRITE), *client = local_bus_join(LINK_READ_WRITE);
	struct frame frame = local_bus_numbered(0);

	(void)state;
	assert_int_equal(link_close(server), 0);
	assert_int_equal(rmdir(bus_folder), 0);
	assert_int_equal(link_receive(client, &frame, WAIT_MS), DT_E_CLOSED);
	assert_int_equal(link_send(client, &frame), DT_E_CLOSED);
	assert_int_equal(link_close(client), 0);
	assert_int_equal(mkdir(bus_folder, 0700), 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        BUS_TEST(test_paused_reader_loses_nothing),
	        BUS_TEST(test_paused_server_loses_nothing),
	        BUS_TEST(test_server_killed),
	        BUS_TEST(test_server_leaves),
	        BUS_TEST(test_unsent_frames_survive_the_server),
	        BUS_TEST(test_bus_gone_for_good),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
