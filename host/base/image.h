/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_BASE_IMAGE_H
#define DT_HOST_BASE_IMAGE_H
/*
 * A photo as a phone sends it: whether it is a whole JPEG or PNG, by its content alone, and the same without
 * what is no picture. A photo tells where and by whose camera it was taken, and may carry a film behind its
 * end; none of that belongs into a report. What stays: the picture, how it is to be turned, its colours
 * (ICC). Pixels are not decoded. JPEG: ITU-T T.81, annex B, the kinds that browsers show (baseline, extended
 * and progressive); Exif 2.3, 4.6; PNG: ISO/IEC 15948, 11.2 and 11.3, with the checksum of each part.
 */
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"

enum { IMAGE_PIXELS_MAX = 100000000 };

struct image {
	const char *ending, *type; /* ".jpg", "image/jpeg" */
	unsigned width, height;    /* in pixels, before it is turned */
};

/* Takes what is no picture out of bytes, and *size becomes what is left. 0, or DT_E_FORMAT with *why, "cut
 * off", and then bytes are changed. */
DT_MUST_USE int image_strip(uint8_t *bytes, size_t *size, struct image *image, const char **why);

#endif
