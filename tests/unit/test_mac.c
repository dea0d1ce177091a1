/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Messages on LCM that prove who sent them. Bytes and MACs were worked out apart: the message encoded by
 * lcm-gen's Python, the MAC by Python's hmac over b"DT_COMMAND\0" and the message without its last 32 bytes.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/wire.h"
#include "host/session/loopback.h"
#include "host/session/mac.h"
#include "host/session/publish.h"
#include "tests/unit/scratch.h"

enum {
	SIZE = 114,
	FORGERIES = 1000000,
};

#define SESSION 0xDEADBEEFu
#define NOW_US INT64_C(1700000000123456)

static const char message_hex[] = "95f1ef55c8eda91200060a241820224000000000deadbeef000000000000002a0002000000"
                                  "000102030400000000000000076"
                                  "16e6e2f63746c5b343731315d00000000000000000000000000000000000000";

static struct mac_key counted_key(size_t size, unsigned step)
{
	struct mac_key key = {.size = size};

	for (size_t i = 0; i < size; i++)
		key.bytes[i] = (uint8_t)(i * step);
	return key;
}

static void from_hex(const char *hex, uint8_t *bytes)
{
	for (size_t i = 0; i < strlen(hex) / 2; i++) {
		unsigned value;

		assert_int_equal(sscanf(hex + 2 * i, "%2x", &value), 1);
		bytes[i] = (uint8_t)value;
	}
}

static droptower_command example(void)
{
	droptower_command command = {.utime = NOW_US,
	                             .session = SESSION,
	                             .counter = 42,
	                             .op = WIRE_OP_RELEASE,
	                             .nonce = 0x01020304,
	                             .argument = 7};

	memcpy(command.sender, "ann/ctl[4711]", sizeof("ann/ctl[4711]"));
	return command;
}

static void encode(const droptower_command *command, const struct mac_key *key, uint8_t bytes[SIZE])
{
	assert_int_equal(droptower_command_encode(bytes, 0, SIZE, command), SIZE);
	if (key != NULL)
		mac_seal(key, PUBLISH_COMMAND, bytes, SIZE);
}

static void layout(void **state)
{
	static const struct {
		size_t size;
		unsigned step;
		const char *channel, *mac;
	} cases[] = {
	        {32, 1, "DT_COMMAND", "14c71e44ead66429158a74088f1b531a04c30ab186d364d6756668edc40eaf9b"},
	        {100, 7, "DT_COMMAND", "69e5d2a6fd8382f75466b4ff9e4439266dc50a496bc0f781f3de4fa38147c3a3"},
	        {32, 1, "DT_STATE", "456166eceb5d9593647309dd3937e0db7d5a2b1fd1fdf7acb827e1c44aa3ce84"},
	};
	droptower_command command = example();
	uint8_t bytes[SIZE], expected[SIZE] = {0};

	(void)state;
	from_hex(message_hex, expected);
	encode(&command, NULL, bytes);
	assert_memory_equal(bytes, expected, SIZE);
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct mac_key key = counted_key(cases[i].size, cases[i].step);

		from_hex(cases[i].mac, expected + SIZE - 32);
		mac_seal(&key, cases[i].channel, bytes, SIZE);
		assert_memory_equal(bytes, expected, SIZE);
		assert_true(mac_holds(&key, cases[i].channel, bytes, SIZE));
		assert_false(mac_holds(&key, "DT_DROP", bytes, SIZE));
		for (size_t bit = 0; bit < 8 * SIZE; bit++) { /* any bit changed */
			bytes[bit / 8] ^= (uint8_t)(1u << bit % 8);
			assert_false(mac_holds(&key, cases[i].channel, bytes, SIZE));
			bytes[bit / 8] ^= (uint8_t)(1u << bit % 8);
		}
		for (size_t size = 0; size < SIZE; size++)
			assert_false(mac_holds(&key, cases[i].channel, bytes, size));
	}
}

static enum mac_refusal judge(struct mac_taker *taker, const droptower_command *command,
                              const struct mac_key *key, int64_t now_us)
{
	droptower_command decoded;
	uint8_t bytes[SIZE];

	encode(command, key, bytes);
	return mac_judge(taker, bytes, SIZE, now_us, &decoded);
}

static void reasons(void **state)
{
	struct mac_key key = counted_key(32, 1), other = counted_key(32, 3), longer = counted_key(33, 1);
	struct mac_taker taker = {.key = &key, .session = SESSION};
	droptower_command command = example(), later, foreign;

	(void)state;
	assert_int_equal(judge(&taker, &command, NULL, NOW_US), MAC_WRONG);
	assert_int_equal(judge(&taker, &command, &other, NOW_US), MAC_WRONG);
	assert_int_equal(judge(&taker, &command, &longer, NOW_US), MAC_WRONG);
	assert_int_equal(judge(&taker, &command, &key, NOW_US + 1000001), MAC_TIME);
	assert_int_equal(judge(&taker, &command, &key, NOW_US - 1000001), MAC_TIME);
	foreign = command;
	foreign.session = SESSION + 1;
	assert_int_equal(judge(&taker, &foreign, &key, NOW_US), MAC_SESSION);
	foreign.session = SESSION - (INT64_C(1) << 32); /* the low half agrees */
	assert_int_equal(judge(&taker, &foreign, &key, NOW_US), MAC_SESSION);
	assert_int_equal(taker.counter, 0); /* nothing refused moves it */
	assert_int_equal(judge(&taker, &command, &key, NOW_US + 1000000), MAC_TAKEN);
	assert_int_equal(taker.counter, 42);
	assert_int_equal(judge(&taker, &command, &key, NOW_US), MAC_REPEATED);
	later = command;
	later.counter = 44;
	assert_int_equal(judge(&taker, &later, &key, NOW_US), MAC_TAKEN);
	later.counter = 43; /* overtaken */
	assert_int_equal(judge(&taker, &later, &key, NOW_US), MAC_REPEATED);
	taker.key = NULL;
	later.counter = 45;
	assert_int_equal(judge(&taker, &later, &key, NOW_US), MAC_CLOSED);
	assert_int_equal(taker.refused[MAC_TAKEN], 2);
	assert_int_equal(taker.refused[MAC_WRONG], 3);
	assert_int_equal(taker.refused[MAC_TIME], 2);
	assert_int_equal(taker.refused[MAC_SESSION], 2);
	assert_int_equal(taker.refused[MAC_REPEATED], 2);
	assert_int_equal(taker.refused[MAC_CLOSED], 1);
}

static void no_command(void **state)
{
	struct mac_key key = counted_key(32, 1);
	struct mac_taker taker = {.key = &key, .session = SESSION};
	droptower_command command = example(), decoded;
	uint8_t bytes[SIZE + 1];

	(void)state;
	encode(&command, &key, bytes);
	for (size_t size = 0; size < SIZE; size++)
		assert_int_equal(mac_judge(&taker, bytes, size, NOW_US, &decoded), MAC_FORM);
	assert_int_equal(mac_judge(&taker, bytes, SIZE + 1, NOW_US, &decoded), MAC_FORM);
	bytes[0] ^= 1; /* another fingerprint */
	assert_int_equal(mac_judge(&taker, bytes, SIZE, NOW_US, &decoded), MAC_FORM);
	for (int refusal = -1; refusal <= MAC_REFUSALS; refusal++)
		assert_non_null(mac_text((enum mac_refusal)refusal));
}

/* splitmix64 */
static uint64_t draw(uint64_t *seed)
{
	uint64_t z = *seed += UINT64_C(0x9E3779B97F4A7C15);

	z = (z ^ z >> 30) * UINT64_C(0xBF58476D1CE4E5B9);
	z = (z ^ z >> 27) * UINT64_C(0x94D049BB133111EB);
	return z ^ z >> 31;
}

/* A recorder heard 100 commands, signed and taken, and tries everything with them but knowing the key. */
static void forgeries(void **state)
{
	enum { HEARD = 100 };
	static uint8_t heard[HEARD][SIZE];
	struct mac_key key = counted_key(32, 5), guess = counted_key(32, 9);
	struct mac_taker taker = {.key = &key, .session = SESSION}, another = {.key = &key, .session = 77};
	uint64_t seed = 20, kinds[6] = {0}, taken = 0;
	int64_t now_us = NOW_US;
	droptower_command command = example(), decoded;

	(void)state;
	printf("# seed %" PRIu64 "\n", seed);
	for (unsigned i = 0; i < HEARD; i++, now_us += 1000) {
		command.utime = now_us;
		command.counter = i + 1;
		command.op = (int16_t)(1 + i % 4);
		encode(&command, &key, heard[i]);
		assert_int_equal(mac_judge(&taker, heard[i], SIZE, now_us, &decoded), MAC_TAKEN);
	}
	for (unsigned n = 0; n < FORGERIES; n++) {
		uint8_t bytes[SIZE];
		unsigned kind = (unsigned)(draw(&seed) % 6);
		int64_t at_us = NOW_US + (int64_t)(draw(&seed) % 1000000);

		memcpy(bytes, heard[draw(&seed) % HEARD], SIZE);
		switch (kind) {
		case 0: /* again, soon or late */
			break;
		case 1: /* a later counter, or another field */
			bytes[8 + draw(&seed) % (SIZE - 8)] ^= (uint8_t)(1 + draw(&seed) % 255);
			break;
		case 2: /* made anew, with a MAC by a guessed key */
			command.counter = (int64_t)(draw(&seed) >> 2);
			command.utime = at_us;
			encode(&command, &guess, bytes);
			break;
		case 3: /* made anew, with a MAC that was heard */
			command.counter = (int64_t)(draw(&seed) >> 2);
			command.utime = at_us;
			memcpy(bytes + SIZE - 32, heard[draw(&seed) % HEARD] + SIZE - 32, 32);
			assert_int_equal(droptower_command_encode(bytes, 0, SIZE, &command), SIZE);
			break;
		case 4: /* held back for longer than a second, from a bridge that restarted and forgot */
			taken += mac_judge(&(struct mac_taker){.key = &key, .session = SESSION}, bytes, SIZE,
			                   now_us + 1000000 + at_us % 1000000000, &decoded) == MAC_TAKEN;
			break;
		default: /* to another bridge with the same key */
			taken += mac_judge(&another, bytes, SIZE, at_us, &decoded) == MAC_TAKEN;
		}
		kinds[kind]++;
		taken += mac_judge(&taker, bytes, SIZE, at_us, &decoded) == MAC_TAKEN;
	}
	assert_int_equal(taken, 0);
	assert_int_equal(taker.refused[MAC_TAKEN], HEARD);
	for (unsigned i = 0; i < 6; i++)
		assert_true(kinds[i] > FORGERIES / 7);
	command.counter = HEARD + 1; /* and the right one still works */
	command.utime = now_us;
	encode(&command, &key, heard[0]);
	assert_int_equal(mac_judge(&taker, heard[0], SIZE, now_us, &decoded), MAC_TAKEN);
}

/* ---- the key's file ---- */

static void write_key(const char *path, size_t size, mode_t mode)
{
	FILE *file = fopen(path, "w");

	assert_non_null(file);
	for (size_t i = 0; i < size; i++)
		fputc((int)(i & 0xFF), file);
	assert_int_equal(fclose(file), 0);
	assert_int_equal(chmod(path, mode), 0);
}

static void refuses(const char *path, const char *what)
{
	struct mac_key key = {.size = 7};
	char message[MAC_MESSAGE_MAX] = "";

	assert_int_equal(mac_read_key(path, &key, message), DT_E_ARGUMENT);
	assert_int_equal(key.size, 7);
	assert_non_null(strstr(message, path));
	assert_non_null(strstr(message, what));
	assert_non_null(strstr(message, "expected"));
	assert_null(strchr(message, '\n'));
}

static void key_files(void **state)
{
	char folder[SCRATCH_MAX], path[SCRATCH_MAX + 8], message[MAC_MESSAGE_MAX];
	static const mode_t open_to_others[] = {0640, 0620, 0604, 0644, 0610, 0601, 0660, 0666};
	struct mac_key key;

	(void)state;
	assert_non_null(mkdtemp(scratch_name(folder, "proof")));
	snprintf(path, sizeof(path), "%s/key", folder);
	refuses(path, "No such file");
	write_key(path, 32, 0600);
	assert_int_equal(mac_read_key(path, &key, message), 0);
	assert_int_equal(key.size, 32);
	assert_int_equal(key.bytes[31], 31);
	write_key(path, 4096, 0600);
	assert_int_equal(mac_read_key(path, &key, message), 0);
	assert_int_equal(key.size, 4096);
	for (size_t i = 0; i < sizeof(open_to_others) / sizeof(open_to_others[0]); i++) {
		assert_int_equal(chmod(path, open_to_others[i]), 0);
		refuses(path, "mode 06");
	}
	write_key(path, 31, 0600);
	refuses(path, "31 bytes");
	write_key(path, 0, 0600);
	refuses(path, "0 bytes");
	write_key(path, 4097, 0600);
	refuses(path, "4097 bytes");
	assert_int_equal(unlink(path), 0);
	refuses(folder, "not a regular file");
	assert_int_equal(mkfifo(path, 0600), 0); /* does not wait for a writer */
	refuses(path, "not a regular file");
	assert_int_equal(unlink(path), 0);
	if (geteuid() == 0) {
		write_key(path, 32, 0600);
		assert_int_equal(chown(path, 65534, 65534), 0);
		refuses(path, "belongs to user 65534");
		assert_int_equal(unlink(path), 0);
	}
	assert_int_equal(rmdir(folder), 0);
}

static void urls(void **state)
{
	(void)state;
	assert_true(loopback_only(PUBLISH_URL));
	assert_true(loopback_only("udpm://"));
	assert_true(loopback_only("udpm://239.255.76.67:7667"));
	assert_true(loopback_only("udpm://239.255.76.67:7667?ttl=0"));
	assert_false(loopback_only("udpm://239.255.76.67:7667?ttl=1"));
	assert_false(loopback_only("udpm://239.255.76.67:7667?recv_buf_size=100&ttl=12"));
	assert_int_equal(loopback_confine("udpm://239.255.76.67:9"), DT_E_SYSTEM); /* no such socket here */
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(layout),    cmocka_unit_test(reasons),   cmocka_unit_test(no_command),
	        cmocka_unit_test(forgeries), cmocka_unit_test(key_files), cmocka_unit_test(urls),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
