/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "firmware/port/qemu/semihost.h"

enum {
	SYS_OPEN = 0x01,
	SYS_WRITE0 = 0x04,
	SYS_WRITE = 0x05,
	SYS_READ = 0x06,
	SYS_GET_CMDLINE = 0x15,
	SYS_EXIT_EXTENDED = 0x20,
	ADP_STOPPED_APPLICATION_EXIT = 0x20026,
};

static uintptr_t call(uintptr_t operation, const void *arguments)
{
	register uintptr_t r0 __asm__("r0") = operation;
	register const void *r1 __asm__("r1") = arguments;

	__asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
	return r0;
}

static size_t text_length(const char *text)
{
	size_t length = 0;

	while (text[length] != '\0')
		length++;
	return length;
}

int semihost_open(const char *path, int mode)
{
	const uintptr_t block[] = {(uintptr_t)path, (uintptr_t)mode, text_length(path)};

	return (int)call(SYS_OPEN, block);
}

size_t semihost_read(int handle, void *bytes, size_t count)
{
	const uintptr_t block[] = {(uintptr_t)handle, (uintptr_t)bytes, count};

	return call(SYS_READ, block);
}

size_t semihost_write(int handle, const void *bytes, size_t count)
{
	const uintptr_t block[] = {(uintptr_t)handle, (uintptr_t)bytes, count};

	return call(SYS_WRITE, block);
}

int semihost_command_line(char *line, size_t size)
{
	uintptr_t block[] = {(uintptr_t)line, size};

	return (int)call(SYS_GET_CMDLINE, block);
}

void semihost_say(const char *text)
{
	(void)call(SYS_WRITE0, text);
}

void semihost_say_number(const char *text, uint32_t value, unsigned base)
{
	char digits[11];
	char *p = &digits[sizeof(digits) - 1];

	*p = '\0';
	do {
		*--p = "0123456789abcdef"[value % base];
		value /= base;
	} while (value != 0);
	semihost_say(text);
	semihost_say(p);
}

void semihost_exit(int code)
{
	const uintptr_t block[] = {ADP_STOPPED_APPLICATION_EXIT, (uintptr_t)code};

	for (;;)
		(void)call(SYS_EXIT_EXTENDED, block);
}
