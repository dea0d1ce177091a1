/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CONSOLE_AUTH_H
#define DT_HOST_CONSOLE_AUTH_H
/*
 * Who may ask for what, before anything else looks at a request: the token, the Host and Origin a browser
 * names, and how often. THREATS.md says against whom. Times in milliseconds of session_now_ms. One thread.
 */
#include <stdbool.h>
#include <stdint.h>
#include <sys/socket.h>

enum { AUTH_TOKEN_MIN = 32, AUTH_TOKEN_MAX = 128, AUTH_MESSAGE_MAX = 4400 };

/* A new token: 128 bit from the kernel as 32 hexadecimal digits. */
void auth_make_token(char token[AUTH_TOKEN_MAX + 1]);

/* The token in file, made there (mode 0600) when there is no file. 0, or DT_E_* with one line in message: not
 * readable, readable for everybody, or not 32 to 128 letters and digits. */
int auth_read_token(const char *file, char token[AUTH_TOKEN_MAX + 1], char message[AUTH_MESSAGE_MAX]);

/* authorization: what the request says, NULL: nothing. Takes as long for any wrong one. */
bool auth_token_agrees(const char *token, const char *authorization);

/* A browser that was led here by somebody else's name says that name: only this machine's address at the
 * connection's end, or localhost, is the console's. host NULL: the request named none. */
bool auth_host_agrees(const char *host, const struct sockaddr *local);

/* origin: "http://" and the request's host; NULL (no browser, or its own page's GET) is right. */
bool auth_origin_agrees(const char *origin, const char *host);

/* A console's name, 16 to 64 letters and digits. */
bool auth_console_valid(const char *console);

/* So many at once, and so many a second. */
struct auth_rate {
	double burst, per_s;
	double left;
	int64_t then_ms;
};
/* Takes one; false when there is none left. */
bool auth_take(struct auth_rate *rate, int64_t now_ms);

/* A rate for each console that asks, and one for all that do not say who they are. A console that is new
 * takes the place of the one that was quiet the longest, with what that had left: names made up do not get
 * more. */
enum { AUTH_CONSOLES = 16, AUTH_CONSOLE_MAX = 64 };
struct auth_rates {
	struct auth_console {
		char name[AUTH_CONSOLE_MAX + 1];
		struct auth_rate rate;
	} console[AUTH_CONSOLES];
	struct auth_rate unnamed;
};
void auth_rates_init(struct auth_rates *rates, double burst, double per_s);

/* As auth_take; console: valid, or "". */
bool auth_take_of(struct auth_rates *rates, const char *console, int64_t now_ms);

/* ---- what a request may look like ---- */

/* A JSON text has the escape of NUL in it, which would end a text within. */
bool auth_json_has_nul(const char *text);

#endif
