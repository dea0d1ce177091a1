/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/session/mac.h"

#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <nettle/hmac.h>
#include <nettle/memops.h>

#include "host/session/publish.h"

/* ---- the key ---- */

__attribute__((format(printf, 2, 3))) static int mac_refuse(char message[MAC_MESSAGE_MAX], const char *format,
                                                            ...)
{
	va_list arguments;

	va_start(arguments, format);
	vsnprintf(message, MAC_MESSAGE_MAX, format, arguments);
	va_end(arguments);
	return DT_E_ARGUMENT;
}

static int check_key(const char *path, const struct stat *file, char message[MAC_MESSAGE_MAX])
{
	if (!S_ISREG(file->st_mode))
		return mac_refuse(message, "%.160s: not a regular file, expected a key file", path);
	if (file->st_uid != geteuid() && file->st_uid != 0)
		return mac_refuse(message,
		                  "%.120s: belongs to user %u, expected a key file of user %u or of root",
		                  path, (unsigned)file->st_uid, (unsigned)geteuid());
	if ((file->st_mode & 077) != 0)
		return mac_refuse(message,
		                  "%.120s: mode %04o, expected 0600: a key that others may read is none",
		                  path, (unsigned)(file->st_mode & 07777));
	if (file->st_size < MAC_KEY_MIN || file->st_size > MAC_KEY_MAX)
		return mac_refuse(message, "%.120s: %lld bytes, expected a key of %d to %d", path,
		                  (long long)file->st_size, MAC_KEY_MIN, MAC_KEY_MAX);
	return 0;
}

static int read_open_key(int fd, const char *path, struct mac_key *key, char message[MAC_MESSAGE_MAX])
{
	struct stat file;
	int result;

	if (fstat(fd, &file) != 0)
		return mac_refuse(message, "%.160s: %s, expected a key file", path, strerror(errno));
	result = check_key(path, &file, message);
	if (result != 0)
		return result;
	key->size = 0;
	while (key->size < (size_t)file.st_size) {
		ssize_t got = read(fd, key->bytes + key->size, (size_t)file.st_size - key->size);

		if (got < 0 && errno == EINTR)
			continue;
		if (got <= 0)
			return mac_refuse(message, "%.160s: %s, expected a key file", path,
			                  got < 0 ? strerror(errno) : "it became shorter");
		key->size += (size_t)got;
	}
	return 0;
}

int mac_read_key(const char *path, struct mac_key *key, char message[MAC_MESSAGE_MAX])
{
	int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
	int result;

	if (fd < 0)
		return mac_refuse(message, "%.160s: %s, expected a key file", path, strerror(errno));
	result = read_open_key(fd, path, key, message);
	close(fd);
	return result;
}

/* ---- the MAC ---- */

static void digest(const struct mac_key *key, const char *channel, const uint8_t *bytes, size_t size,
                   uint8_t mac[MAC_BYTES])
{
	struct hmac_sha256_ctx hmac;

	hmac_sha256_set_key(&hmac, key->size, key->bytes);
	hmac_sha256_update(&hmac, strlen(channel) + 1, (const uint8_t *)channel);
	hmac_sha256_update(&hmac, size, bytes);
	hmac_sha256_digest(&hmac, MAC_BYTES, mac);
}

void mac_seal(const struct mac_key *key, const char *channel, uint8_t *bytes, size_t size)
{
	digest(key, channel, bytes, size - MAC_BYTES, bytes + size - MAC_BYTES);
}

bool mac_holds(const struct mac_key *key, const char *channel, const void *bytes, size_t size)
{
	const uint8_t *message = bytes;
	uint8_t mac[MAC_BYTES];

	if (size < MAC_BYTES)
		return false;
	digest(key, channel, message, size - MAC_BYTES, mac);
	return memeql_sec(mac, message + size - MAC_BYTES, MAC_BYTES) != 0;
}

/* ---- commands ---- */

const char *mac_text(enum mac_refusal refusal)
{
	static const char *const texts[MAC_REFUSALS] = {
	        [MAC_TAKEN] = "taken",
	        [MAC_FORM] = "no command of this version",
	        [MAC_CLOSED] = "this bridge takes no commands: it was started without --commands",
	        [MAC_WRONG] = "not signed with this bridge's key",
	        [MAC_SESSION] = "for another bridge, or from before its restart",
	        [MAC_TIME] = "sent more than a second ago, or the clocks differ",
	        [MAC_REPEATED] = "repeated, or behind a later one",
	        [MAC_BUSY] = "another command waits",
	};

	return (unsigned)refusal < MAC_REFUSALS ? texts[refusal] : "refused";
}

static enum mac_refusal session_mac_judge(const struct mac_taker *taker, const void *bytes, size_t size,
                                          int64_t now_us, const droptower_command *command)
{
	if (taker->key == NULL)
		return MAC_CLOSED;
	if (!mac_holds(taker->key, PUBLISH_COMMAND, bytes, size))
		return MAC_WRONG;
	if (command->session != taker->session)
		return MAC_SESSION;
	if (command->utime < now_us - MAC_AGE_US || command->utime > now_us + MAC_AGE_US)
		return MAC_TIME;
	return command->counter > taker->counter ? MAC_TAKEN : MAC_REPEATED;
}

enum mac_refusal mac_judge(struct mac_taker *taker, const void *bytes, size_t size, int64_t now_us,
                           droptower_command *command)
{
	enum mac_refusal refusal = MAC_FORM;

	if (size <= INT32_MAX && droptower_command_decode(bytes, 0, (int)size, command) == (int)size)
		refusal = session_mac_judge(taker, bytes, size, now_us, command);
	if (refusal == MAC_TAKEN)
		taker->counter = command->counter;
	taker->refused[refusal]++;
	return refusal;
}
