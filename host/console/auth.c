/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/console/auth.h"

#include <arpa/inet.h>
#include <ctype.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <nettle/memops.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/error.h"

void auth_make_token(char token[AUTH_TOKEN_MAX + 1])
{
	unsigned char random[AUTH_TOKEN_MIN / 2];

	/* without randomness there is no console */
	if (getrandom(random, sizeof(random), 0) != (ssize_t)sizeof(random))
		abort();
	for (size_t i = 0; i < sizeof(random); i++)
		snprintf(token + 2 * i, 3, "%02x", random[i]);
}

static bool letters_and_digits(const char *text, size_t min, size_t max)
{
	size_t length = strnlen(text, max + 1);

	for (size_t i = 0; i < length; i++)
		if (!isalnum((unsigned char)text[i]))
			return false;
	return length >= min && length <= max;
}

static int write_token(int fd, const char *token)
{
	size_t size = strlen(token);
	bool written = write(fd, token, size) == (ssize_t)size && write(fd, "\n", 1) == 1 && fsync(fd) == 0;

	return close(fd) == 0 && written ? 0 : -1;
}

/* The first line of an open file, and that it is nobody's business. */
static int take_token(int fd, const char *file, char token[AUTH_TOKEN_MAX + 1],
                      char message[AUTH_MESSAGE_MAX])
{
	char text[AUTH_TOKEN_MAX + 2] = "";
	struct stat there;
	ssize_t size = fstat(fd, &there) == 0 ? read(fd, text, sizeof(text) - 1) : -1;

	if (size < 0) {
		snprintf(message, AUTH_MESSAGE_MAX, "%s: %s", file, strerror(errno));
		return DT_E_SYSTEM;
	}
	if ((there.st_mode & 027) != 0) {
		snprintf(message, AUTH_MESSAGE_MAX,
		         "%s: mode %04o lets others at the token, expected 0600 (chmod 600)", file,
		         there.st_mode & 07777);
		return DT_E_STATE;
	}
	text[strcspn(text, "\r\n")] = '\0';
	if (!letters_and_digits(text, AUTH_TOKEN_MIN, AUTH_TOKEN_MAX)) {
		snprintf(message, AUTH_MESSAGE_MAX, "%s: no token, expected %d to %d letters and digits",
		         file, AUTH_TOKEN_MIN, AUTH_TOKEN_MAX);
		return DT_E_FORMAT;
	}
	strcpy(token, text);
	return 0;
}

int auth_read_token(const char *file, char token[AUTH_TOKEN_MAX + 1], char message[AUTH_MESSAGE_MAX])
{
	int fd = open(file, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600), result;

	if (fd >= 0) {
		auth_make_token(token);
		if (write_token(fd, token) == 0)
			return 0;
		snprintf(message, AUTH_MESSAGE_MAX, "%s: %s", file, strerror(errno));
		unlink(file);
		return DT_E_SYSTEM;
	}
	/* where nothing can be made, what is there may still be read: a service's credentials */
	fd = open(file, O_RDONLY | O_CLOEXEC);
	if (fd < 0) {
		snprintf(message, AUTH_MESSAGE_MAX, "%s: %s", file, strerror(errno));
		return DT_E_SYSTEM;
	}
	result = take_token(fd, file, token, message);
	close(fd);
	return result;
}

bool auth_token_agrees(const char *token, const char *authorization)
{
	static const char scheme[] = "Bearer ";
	size_t length = strlen(token);

	if (authorization == NULL || strncasecmp(authorization, scheme, sizeof(scheme) - 1) != 0)
		return false;
	authorization += sizeof(scheme) - 1;
	return strlen(authorization) == length && memeql_sec(authorization, token, length) != 0;
}

/* "127.0.0.1" "[::1]" */
static unsigned own_address(const struct sockaddr *local, char text[INET6_ADDRSTRLEN + 2])
{
	union { /* what the kernel gave is as large as its family says */
		const struct sockaddr *any;
		const struct sockaddr_in *four;
		const struct sockaddr_in6 *six;
	} address = {.any = local};
	char number[INET6_ADDRSTRLEN] = "";

	if (local->sa_family == AF_INET6) {
		inet_ntop(AF_INET6, &address.six->sin6_addr, number, sizeof(number));
		snprintf(text, INET6_ADDRSTRLEN + 2, "[%s]", number);
		return ntohs(address.six->sin6_port);
	}
	inet_ntop(AF_INET, &address.four->sin_addr, text, INET6_ADDRSTRLEN);
	return ntohs(address.four->sin_port);
}

bool auth_host_agrees(const char *host, const struct sockaddr *local)
{
	char address[INET6_ADDRSTRLEN + 2], wanted[sizeof(address) + 8];
	unsigned port = own_address(local, address);
	const char *const names[] = {address, "localhost"};

	for (unsigned i = 0; i < 2 && host != NULL; i++) {
		snprintf(wanted, sizeof(wanted), "%s:%u", names[i], port);
		if (strcasecmp(host, wanted) == 0 || (port == 80 && strcasecmp(host, names[i]) == 0))
			return true;
	}
	return false;
}

bool auth_origin_agrees(const char *origin, const char *host)
{
	static const char scheme[] = "http://";

	return origin == NULL || (strncasecmp(origin, scheme, sizeof(scheme) - 1) == 0 &&
	                          strcasecmp(origin + sizeof(scheme) - 1, host) == 0);
}

bool auth_console_valid(const char *console)
{
	return letters_and_digits(console, 16, 64);
}

bool auth_take(struct auth_rate *rate, int64_t now_ms)
{
	rate->left += (double)(now_ms - rate->then_ms) / 1000.0 * rate->per_s;
	rate->then_ms = now_ms;
	if (rate->left > rate->burst)
		rate->left = rate->burst;
	if (rate->left < 1.0)
		return false;
	rate->left -= 1.0;
	return true;
}

void auth_rates_init(struct auth_rates *rates, double burst, double per_s)
{
	*rates = (struct auth_rates){.unnamed = {.burst = burst, .per_s = per_s}};
	for (unsigned i = 0; i < AUTH_CONSOLES; i++)
		rates->console[i].rate = rates->unnamed;
}

bool auth_take_of(struct auth_rates *rates, const char *console, int64_t now_ms)
{
	struct auth_console *place = &rates->console[0];

	if (console[0] == '\0')
		return auth_take(&rates->unnamed, now_ms);
	for (unsigned i = 0; i < AUTH_CONSOLES; i++) {
		struct auth_console *other = &rates->console[i];

		if (strcmp(other->name, console) == 0)
			return auth_take(&other->rate, now_ms);
		if (other->rate.then_ms < place->rate.then_ms)
			place = other;
	}
	snprintf(place->name, sizeof(place->name), "%s", console);
	return auth_take(&place->rate, now_ms);
}

bool auth_json_has_nul(const char *text)
{
	while ((text = strchr(text, '\\')) != NULL && text[1] != '\0') {
		if (strncmp(text + 1, "u0000", 5) == 0)
			return true;
		text += 2;
	}
	return false;
}
