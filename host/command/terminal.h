/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_COMMAND_TERMINAL_H
#define DT_HOST_COMMAND_TERMINAL_H
/*
 * The person at the terminal on standard input: single keys, as they are pressed, and a typed word. The
 * terminal is as before after terminal_close, and when the program exits without it. Ctrl-C stays a signal;
 * Ctrl-Z and Ctrl-\ are keys as all others. One thread.
 */
#include <stdbool.h>
#include <stddef.h>

/* Standard input is a terminal. */
bool terminal_there(void);

/* From now on keys are read. 0 or DT_E_SYSTEM. */
int terminal_open(void);
void terminal_close(void);

/* The next key without waiting for it, 0 when there is none, -1 when the terminal is gone. */
int terminal_key(void);

/* What was typed before something was asked answers nothing. */
void terminal_forget(void);

/* Shows prompt on standard error and reads a line, without its end; false when there is none or a signal
 * came. To be called while keys are not read. */
bool terminal_line(const char *prompt, char *line, size_t size);

#endif
