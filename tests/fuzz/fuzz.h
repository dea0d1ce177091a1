/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_FUZZ_FUZZ_H
#define DT_TESTS_FUZZ_FUZZ_H
/*
 * What the fuzz targets share. Each target is a program of its own around LLVMFuzzerTestOneInput; what must
 * not be ends in fuzz_fail, which libFuzzer takes for a crash and keeps the input of.
 */
#include <stddef.h>
#include <stdint.h>

#include "host/record/record.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

/* The bytes as a file, the same one each time; its path. */
const char *fuzz_file(const uint8_t *bytes, size_t size);

_Noreturn void fuzz_fail(const char *format, ...) __attribute__((format(printf, 1, 2)));

/* message must be one line that begins with path. */
void fuzz_check_message(const char *message, const char *path);

/* Samples and what is known of a drop are equal, or fuzz_fail. */
void fuzz_check_equal(const struct record *a, const struct record *b, const char *what);

#endif
