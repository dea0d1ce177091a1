/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_PORT_QEMU_SEMIHOST_H
#define DT_FIRMWARE_PORT_QEMU_SEMIHOST_H
/*
 * The emulator's way out: files, messages, exit (Arm, Semihosting for AArch32 and AArch64, 2.0). A call that
 * waits for the host keeps the whole machine still, its clocks too. Any context.
 */
#include <stddef.h>
#include <stdint.h>

enum { SEMIHOST_READ = 1, SEMIHOST_WRITE = 5 }; /* "rb", "wb" */

/* A handle above 0, or -1. Waits until a FIFO's other end is open. */
int semihost_open(const char *path, int mode);

/* The bytes that were not read or written; all of them at the end of the file or after an error. */
size_t semihost_read(int handle, void *bytes, size_t count);
size_t semihost_write(int handle, const void *bytes, size_t count);

/* The words after -semihosting-config arg=, with blanks between them. 0 or -1. */
int semihost_command_line(char *line, size_t size);

/* Onto the emulator's stderr. */
void semihost_say(const char *text);
void semihost_say_number(const char *text, uint32_t value, unsigned base);

/* Ends the emulator. */
_Noreturn void semihost_exit(int code);

#endif
