/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_SESSION_JOURNAL_H
#define DT_HOST_SESSION_JOURNAL_H
/*
 * One file of every verb that somebody gave a tower on this machine, taken or refused, with who and when.
 * `ctl`, `run`, the page and the bridge write it; nothing ever shortens it.
 *
 *     2026-11-23T20:14:37.123Z ctl[4711] ann session 1a2b3c4d ARM taken
 *     2026-11-23T20:14:39.001Z bridge[4700] ann/run[4720] session 1a2b3c4d RELEASE refused: the warning is
 * not over yet
 *
 * $DROPTOWER_JOURNAL; else droptower/journal.log in $XDG_STATE_HOME, else in ~/.local/state. A line is one
 * write(2) at the end of the file (O_APPEND), so that the lines of several programs do not mix; it is with
 * the kernel when the call returns, on the disk when that writes it. Folders are made, mode 0700, the file
 * 0600.
 *
 * Context: any one thread; call it after the verb, so that ABORT waits for no disk. A journal that cannot be
 * written is told once on stderr and stops no verb.
 */
#include <stddef.h>
#include <stdint.h>

struct journal_line {
	const char *program; /* ctl, run, bridge, page */
	const char *who;     /* operator, or the sender over LCM; NULL: the user that runs this */
	uint32_t session;
	const char *verb;
	const char *refusal; /* why it was refused; NULL: taken */
};

void journal_write(const struct journal_line *line);

/* "user/program[pid]", cut to size: who a command over LCM comes from. */
void journal_sender(const char *program, char *text, size_t size);

#endif
