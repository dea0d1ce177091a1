/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Who may ask the console for what: token, Host, Origin, rates, the hold of the arm, and which names a path
 * may have.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/error.h"
#include "host/console/auth.h"
#include "host/console/hold.h"
#include "host/console/route.h"
#include "tests/unit/scratch.h"

static const char token[] = "00112233445566778899aabbccddeeff";

static void test_a_new_token_is_128_bit(void **state)
{
	char one[AUTH_TOKEN_MAX + 1] = "", other[AUTH_TOKEN_MAX + 1] = "";

	(void)state;
	auth_make_token(one);
	auth_make_token(other);
	assert_int_equal(strlen(one), 32);
	assert_int_equal(strspn(one, "0123456789abcdef"), 32);
	assert_string_not_equal(one, other);
}

static void test_token(void **state)
{
	static const char *const wrong[] = {
	        "",
	        "Bearer",
	        "Bearer ",
	        "Basic 00112233445566778899aabbccddeeff",
	        "Bearer 00112233445566778899aabbccddeefe",  /* the last differs */
	        "Bearer 10112233445566778899aabbccddeeff",  /* the first */
	        "Bearer 00112233445566778899aabbccddeef",   /* short */
	        "Bearer 00112233445566778899aabbccddeeff0", /* long */
	        "Bearer 00112233445566778899aabbccddeeff ",
	        "00112233445566778899aabbccddeeff",
	        "Bearer 00112233445566778899AABBCCDDEEFF",
	};

	(void)state;
	assert_true(auth_token_agrees(token, "Bearer 00112233445566778899aabbccddeeff"));
	assert_true(auth_token_agrees(token, "bearer 00112233445566778899aabbccddeeff"));
	assert_false(auth_token_agrees(token, NULL));
	for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++)
		if (auth_token_agrees(token, wrong[i]))
			fail_msg("'%s' was let in", wrong[i]);
}

static void write_file(const char *file, const char *text, mode_t mode)
{
	FILE *out = fopen(file, "w");

	assert_non_null(out);
	fputs(text, out);
	fclose(out);
	assert_int_equal(chmod(file, mode), 0);
}

static void test_token_file(void **state)
{
	char folder[SCRATCH_MAX], file[SCRATCH_MAX + 8], message[AUTH_MESSAGE_MAX];
	char made[AUTH_TOKEN_MAX + 1] = "", again[AUTH_TOKEN_MAX + 1] = "untouched";
	struct stat there;

	(void)state;
	assert_non_null(mkdtemp(scratch_name(folder, "guard")));
	snprintf(file, sizeof(file), "%s/token", folder);
	assert_int_equal(auth_read_token(file, made, message), 0);
	assert_int_equal(stat(file, &there), 0);
	assert_int_equal(there.st_mode & 0777, 0600);
	assert_int_equal(there.st_size, 33);
	assert_int_equal(auth_read_token(file, again, message), 0);
	assert_string_equal(again, made);

	chmod(file, 0604);
	assert_int_equal(auth_read_token(file, again, message), DT_E_STATE);
	assert_non_null(strstr(message, file));
	write_file(file, "too-short\n", 0600);
	assert_int_equal(auth_read_token(file, again, message), DT_E_FORMAT);
	write_file(file, "0011223344556677 8899aabbccddeeff\n", 0600);
	assert_int_equal(auth_read_token(file, again, message), DT_E_FORMAT);
	assert_string_equal(again, made); /* unchanged on errors */
	write_file(file, "0123456789abcdefghijklmnopqrstuvwxyz", 0400);
	assert_int_equal(auth_read_token(file, again, message), 0);
	assert_string_equal(again, "0123456789abcdefghijklmnopqrstuvwxyz");
	assert_int_equal(auth_read_token("/no/such/folder/token", again, message), DT_E_SYSTEM);
	unlink(file);
	rmdir(folder);
}

union address {
	struct sockaddr any;
	struct sockaddr_in four;
	struct sockaddr_in6 six;
};

static union address at(int family, const char *text, uint16_t port)
{
	union address address;

	memset(&address, 0, sizeof(address));
	address.any.sa_family = (sa_family_t)family;
	if (family == AF_INET) {
		assert_int_equal(inet_pton(AF_INET, text, &address.four.sin_addr), 1);
		address.four.sin_port = htons(port);
	} else {
		assert_int_equal(inet_pton(AF_INET6, text, &address.six.sin6_addr), 1);
		address.six.sin6_port = htons(port);
	}
	return address;
}

static void test_host_is_ours(void **state)
{
	union address four = at(AF_INET, "127.0.0.1", 8731), six = at(AF_INET6, "::1", 8731);
	union address web = at(AF_INET, "192.168.1.7", 80);

	(void)state;
	assert_true(auth_host_agrees("127.0.0.1:8731", &four.any));
	assert_true(auth_host_agrees("localhost:8731", &four.any));
	assert_true(auth_host_agrees("LOCALHOST:8731", &four.any));
	assert_true(auth_host_agrees("[::1]:8731", &six.any));
	assert_true(auth_host_agrees("192.168.1.7", &web.any));
	assert_true(auth_host_agrees("192.168.1.7:80", &web.any));
	assert_false(auth_host_agrees(NULL, &four.any));
	assert_false(auth_host_agrees("", &four.any));
	assert_false(auth_host_agrees("127.0.0.1", &four.any)); /* another port's */
	assert_false(auth_host_agrees("127.0.0.1:8732", &four.any));
	assert_false(auth_host_agrees("rebound.example:8731", &four.any));
	assert_false(auth_host_agrees("127.0.0.1.rebound.example:8731", &four.any));
	assert_false(auth_host_agrees("127.0.0.1:87310", &four.any));
	assert_false(auth_host_agrees("[::1]:8731", &four.any));
}

static void test_origin_is_ours(void **state)
{
	(void)state;
	assert_true(auth_origin_agrees(NULL, "127.0.0.1:8731"));
	assert_true(auth_origin_agrees("http://127.0.0.1:8731", "127.0.0.1:8731"));
	assert_false(auth_origin_agrees("null", "127.0.0.1:8731"));
	assert_false(auth_origin_agrees("", "127.0.0.1:8731"));
	assert_false(auth_origin_agrees("https://127.0.0.1:8731", "127.0.0.1:8731"));
	assert_false(auth_origin_agrees("http://127.0.0.1:8732", "127.0.0.1:8731"));
	assert_false(auth_origin_agrees("http://evil.example", "127.0.0.1:8731"));
	assert_false(auth_origin_agrees("http://localhost:8731", "127.0.0.1:8731"));
}

static void test_rate(void **state)
{
	struct auth_rate rate = {.burst = 3, .per_s = 2, .then_ms = 1000};

	(void)state;
	/* full at its first use, however late: 10 s at 2 a second is more than it holds */
	for (int i = 0; i < 3; i++)
		assert_true(auth_take(&rate, 11000));
	assert_false(auth_take(&rate, 11000));
	assert_false(auth_take(&rate, 11499));
	assert_true(auth_take(&rate, 11500));
	assert_false(auth_take(&rate, 11999));
	assert_true(auth_take(&rate, 12000));
	for (int i = 0; i < 3; i++)
		assert_true(auth_take(&rate, 60000));
	assert_false(auth_take(&rate, 60000));
}

static void test_hold(void **state)
{
	static const char one[] = "aaaaaaaaaaaaaaaa", other[] = "bbbbbbbbbbbbbbbb";
	struct hold hold = {.until_ms = 0};

	(void)state;
	assert_false(hold_taken(&hold, 0));
	assert_false(hold_take(&hold, "", 0)); /* nobody cannot hold it */
	assert_false(hold_mine(&hold, "", 0));
	assert_true(hold_take(&hold, one, 100));
	assert_true(hold_mine(&hold, one, 6099));
	assert_false(hold_mine(&hold, other, 6099));
	assert_false(hold_take(&hold, other, 6099));
	assert_true(hold_take(&hold, one, 6099)); /* renewed */
	assert_false(hold_take(&hold, other, 12098));
	hold_give(&hold, other); /* not its own */
	assert_true(hold_mine(&hold, one, 12098));
	assert_false(hold_mine(&hold, one, 12099)); /* run out */
	assert_false(hold_taken(&hold, 12099));
	assert_true(hold_take(&hold, other, 12099));
	assert_false(hold_take(&hold, one, 12100));
	hold_give(&hold, other);
	assert_true(hold_take(&hold, one, 12100));
}

static void test_console_names(void **state)
{
	char text[80];

	(void)state;
	assert_true(auth_console_valid("0123456789abcdEF"));
	assert_false(auth_console_valid("0123456789abcdE"));
	assert_false(auth_console_valid("0123456789abcdE-"));
	assert_false(auth_console_valid(""));
	memset(text, 'a', sizeof(text));
	text[64] = '\0';
	assert_true(auth_console_valid(text));
	text[64] = 'a';
	text[65] = '\0';
	assert_false(auth_console_valid(text));
}

/* What a path may say: nothing that a file system or a query would understand. */
static void test_names_in_paths(void **state)
{
	static const char *const wrong[] = {
	        "trace/../1",
	        "trace/..",
	        "trace/box/",
	        "trace/box/1/",
	        "trace/box/-1",
	        "trace/box/1x",
	        "trace/.box/1",
	        "trace/box",
	        "trace//1",
	        "trace/b ox/1",
	        "trace/b%2e/1",
	        "trace/b'x/1",
	        "trace/box/1/../2",
	        "trace/box\\1",
	        "trace/box/0x1",
	        "report/",
	        "report/a/b",
	        "report/..",
	        "report",
	        "trace/box/1234567890",
	        "stream/",
	        "arm/x",
	        "",
	        "/",
	        "trace/\xc3\xa4/1",
	};
	const struct route *route;
	const char *rest;
	bool other;

	(void)state;
	route = route_find("GET", "trace/box-30.a_b+c/12", &rest, &other);
	assert_non_null(route);
	assert_string_equal(rest, "box-30.a_b+c/12");
	assert_int_equal(route->kind, ROUTE_WORK);
	for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++)
		if (route_find("GET", wrong[i], &rest, &other) != NULL)
			fail_msg("'%s' was let through", wrong[i]);
	assert_non_null(route_find("POST", "abort", &rest, &other));
	assert_null(route_find("GET", "abort", &rest, &other));
	assert_true(other);
	assert_null(route_find("GET", "nothing", &rest, &other));
	assert_false(other);
}

/* Whatever moves something belongs to who holds the arm; ABORT to everybody. */
static void test_who_needs_the_hold(void **state)
{
	static const char *const held[] = {"arm", "release", "clear", "select", "series", "decide", "note"};
	const char *rest;
	bool other;

	(void)state;
	for (size_t i = 0; i < sizeof(held) / sizeof(held[0]); i++) {
		const struct route *route = route_find("POST", held[i], &rest, &other);

		assert_non_null(route);
		assert_true(route->needs_hold);
		assert_false(route->always);
	}
	assert_false(route_find("POST", "abort", &rest, &other)->needs_hold);
	assert_true(route_find("POST", "abort", &rest, &other)->always);
}

static unsigned granted(struct auth_rates *rates, const char *console, unsigned asked, int64_t now_ms)
{
	unsigned count = 0;

	for (unsigned i = 0; i < asked; i++)
		count += auth_take_of(rates, console, now_ms);
	return count;
}

/* Who asks for all there is takes nothing of another's; who makes names up gets what sixteen would. */
static void test_each_console_has_its_own_rate(void **state)
{
	struct auth_rates rates;
	char name[AUTH_CONSOLE_MAX + 1];
	unsigned all = 0;

	(void)state;
	auth_rates_init(&rates, 10, 5);
	assert_int_equal(granted(&rates, "greedygreedygreedy", 1000, 100000), 10);
	assert_int_equal(granted(&rates, "", 1000, 100000), 10);
	assert_int_equal(granted(&rates, "modestmodestmodest", 4, 100001), 4);
	assert_int_equal(granted(&rates, "greedygreedygreedy", 1000, 101000), 5);
	assert_int_equal(granted(&rates, "modestmodestmodest", 1000, 101001), 10);
	for (int i = 0; i < 1000; i++) {
		snprintf(name, sizeof(name), "madeup%012d", i);
		all += granted(&rates, name, 2, 101002);
	}
	assert_in_range(all, 1, 14 * 10 + 1);
}

static void test_json_with_nul(void **state)
{
	(void)state;
	assert_true(auth_json_has_nul("{\"a\":\"b\\u0000c\"}"));
	assert_true(auth_json_has_nul("\\\\\\u0000"));
	assert_false(auth_json_has_nul("\\\\u0000")); /* a backslash, and the letters */
	assert_false(auth_json_has_nul("{\"a\":\"\\u0001\\n\"}"));
	assert_false(auth_json_has_nul("\\"));
	assert_false(auth_json_has_nul(""));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(test_a_new_token_is_128_bit),
	        cmocka_unit_test(test_token),
	        cmocka_unit_test(test_token_file),
	        cmocka_unit_test(test_host_is_ours),
	        cmocka_unit_test(test_origin_is_ours),
	        cmocka_unit_test(test_rate),
	        cmocka_unit_test(test_hold),
	        cmocka_unit_test(test_console_names),
	        cmocka_unit_test(test_names_in_paths),
	        cmocka_unit_test(test_each_console_has_its_own_rate),
	        cmocka_unit_test(test_json_with_nul),
	        cmocka_unit_test(test_who_needs_the_hold),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
