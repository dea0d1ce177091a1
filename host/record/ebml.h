/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_EBML_H
#define DT_HOST_RECORD_EBML_H
/*
 * Elements of EBML (RFC 8794), one behind the other: an identifier, a size, and data, which are a number, a
 * text, bytes, or elements again. Nothing is copied.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"

struct ebml_element {
	uint32_t id; /* with its marker bits: 0x1A45DFA3 */
	const char *data;
	size_t size;
};

/* Those between at and end. */
struct ebml {
	const char *at, *end;
};

struct ebml ebml_bytes(const char *bytes, size_t size);
struct ebml ebml_inside(const struct ebml_element *element);

/* 1: the next one; 0: there is none; DT_E_FORMAT: cut or damaged. One of unknown size goes to the end. */
DT_MUST_USE int ebml_next(struct ebml *ebml, struct ebml_element *element);

/* Numbers of 0 to 8 bytes; of none 0. False for any other size. */
DT_MUST_USE bool ebml_whole(const struct ebml_element *element, uint64_t *value);
DT_MUST_USE bool ebml_real(const struct ebml_element *element, double *value);

/* A text up to its first NUL, cut to what there is room for. */
void ebml_text(const struct ebml_element *element, char *text, size_t size);

#endif
