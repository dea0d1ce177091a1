/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CONSOLE_GUARD_H
#define DT_HOST_CONSOLE_GUARD_H
/*
 * Who may ask for what, before anything else looks at a request: the token, the Host and Origin a browser
 * names, and how often. THREATS.md says against whom. Times in milliseconds of session_now_ms. One thread.
 */
#include <stdbool.h>
#include <stdint.h>
#include <sys/socket.h>

enum { GUARD_TOKEN_MIN = 32, GUARD_TOKEN_MAX = 128, GUARD_MESSAGE_MAX = 4400 };

/* A new token: 128 bit from the kernel as 32 hexadecimal digits. */
void guard_make_token(char token[GUARD_TOKEN_MAX + 1]);

/* The token in file, made there (mode 0600) when there is no file. 0, or DT_E_* with one line in message: not
 * readable, readable for everybody, or not 32 to 128 letters and digits. */
int guard_read_token(const char *file, char token[GUARD_TOKEN_MAX + 1], char message[GUARD_MESSAGE_MAX]);

/* authorization: what the request says, NULL: nothing. Takes as long for any wrong one. */
bool guard_token_agrees(const char *token, const char *authorization);

/* A browser that was led here by somebody else's name says that name: only this machine's address at the
 * connection's end, or localhost, is the console's. host NULL: the request named none. */
bool guard_host_agrees(const char *host, const struct sockaddr *local);

/* origin: "http://" and the request's host; NULL (no browser, or its own page's GET) is right. */
bool guard_origin_agrees(const char *origin, const char *host);

/* A console's name, 16 to 64 letters and digits. */
bool guard_console_valid(const char *console);

/* So many at once, and so many a second. */
struct guard_rate {
	double burst, per_s;
	double left;
	int64_t then_ms;
};
/* Takes one; false when there is none left. */
bool guard_take(struct guard_rate *rate, int64_t now_ms);

/* A rate for each console that asks, and one for all that do not say who they are. A console that is new
 * takes the place of the one that was quiet the longest, with what that had left: names made up do not get
 * more. */
enum { GUARD_CONSOLES = 16, GUARD_CONSOLE_MAX = 64 };
struct guard_rates {
	struct guard_console {
		char name[GUARD_CONSOLE_MAX + 1];
		struct guard_rate rate;
	} console[GUARD_CONSOLES];
	struct guard_rate unnamed;
};
void guard_rates_init(struct guard_rates *rates, double burst, double per_s);

/* As guard_take; console: valid, or "". */
bool guard_take_of(struct guard_rates *rates, const char *console, int64_t now_ms);

/* ---- what a request may look like ---- */

/* A JSON text has the escape of NUL in it, which would end a text within. */
bool guard_json_has_nul(const char *text);

#endif
