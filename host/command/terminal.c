/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/command/terminal.h"

#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#include "common/error.h"

static struct termios before;
static bool is_open, at_exit;

bool terminal_there(void)
{
	return isatty(STDIN_FILENO) == 1;
}

int terminal_open(void)
{
	struct termios keys;

	if (is_open)
		return 0;
	if (tcgetattr(STDIN_FILENO, &before) != 0)
		return DT_E_SYSTEM;
	keys = before;
	keys.c_lflag &= ~(tcflag_t)(ICANON | ECHO);
	keys.c_cc[VMIN] = 1;
	keys.c_cc[VTIME] = 0;
	keys.c_cc[VSUSP] = keys.c_cc[VQUIT] = _POSIX_VDISABLE;
	if (tcsetattr(STDIN_FILENO, TCSAFLUSH, &keys) != 0)
		return DT_E_SYSTEM;
	is_open = true;
	if (!at_exit)
		at_exit = atexit(terminal_close) == 0;
	return 0;
}

void terminal_close(void)
{
	if (is_open)
		(void)tcsetattr(STDIN_FILENO, TCSAFLUSH, &before);
	is_open = false;
}

int terminal_key(void)
{
	struct pollfd poller = {.fd = STDIN_FILENO, .events = POLLIN};
	unsigned char key;

	if (poll(&poller, 1, 0) <= 0)
		return 0;
	return read(STDIN_FILENO, &key, 1) == 1 && key != 0 ? key : -1;
}

void terminal_forget(void)
{
	(void)tcflush(STDIN_FILENO, TCIFLUSH);
}

bool terminal_line(const char *prompt, char *line, size_t size)
{
	ssize_t length;

	fputs(prompt, stderr);
	length = read(STDIN_FILENO, line, size - 1);
	if (length <= 0) {
		fputc('\n', stderr);
		return false;
	}
	line[length] = '\0';
	line[strcspn(line, "\r\n")] = '\0';
	return true;
}
