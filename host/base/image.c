/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/base/image.h"

#include <stdbool.h>
#include <string.h>

#include "common/crc.h"

static const char cut_off[] = "cut off", no_picture[] = "no picture in it",
                  too_large[] = "over 100 megapixels";

/* What was read, and what was kept of it, in the same memory: kept is never ahead. */
struct strip {
	uint8_t *bytes;
	size_t size, at, kept;
	struct image *image;
	bool sized, drawn;
	const char *why;
};

static unsigned be16(const uint8_t *b)
{
	return (unsigned)(b[0] << 8 | b[1]);
}

static uint32_t be32(const uint8_t *b)
{
	return (uint32_t)be16(b) << 16 | be16(b + 2);
}

static bool fails(struct strip *s, const char *why)
{
	s->why = why;
	return false;
}

static void keep(struct strip *s, size_t count)
{
	memmove(s->bytes + s->kept, s->bytes + s->at, count);
	s->kept += count;
	s->at += count;
}

static bool measure(struct strip *s, uint32_t width, uint32_t height)
{
	if (width == 0 || height == 0)
		return fails(s, no_picture);
	if ((uint64_t)width * height > IMAGE_PIXELS_MAX)
		return fails(s, too_large);
	s->image->width = width;
	s->image->height = height;
	s->sized = true;
	return true;
}

/* ---- JPEG ---- */

enum {
	SOF0 = 0xC0,
	SOF2 = 0xC2,
	DHT = 0xC4,
	SOF15 = 0xCF,
	JPG = 0xC8,
	DAC = 0xCC,
	RST0 = 0xD0,
	RST7 = 0xD7,
	SOI = 0xD8,
	EOI = 0xD9,
	SOS = 0xDA,
	APP0 = 0xE0,
	APP1 = 0xE1,
	APP2 = 0xE2,
	APP14 = 0xEE,
	APP15 = 0xEF,
	COM = 0xFE,
};

/* How the picture is to be turned, of a segment with Exif in it; 1, as it is, when it does not say. */
static unsigned exif_turn(const uint8_t *tiff, size_t size)
{
	bool little = size >= 8 && memcmp(tiff, "II*\0", 4) == 0;
	uint32_t at;
	unsigned entries;

	if (!little && (size < 8 || memcmp(tiff, "MM\0*", 4) != 0))
		return 1;
	at = little ? (uint32_t)tiff[7] << 24 | (uint32_t)tiff[6] << 16 | (uint32_t)tiff[5] << 8 | tiff[4]
	            : be32(tiff + 4);
	if (at > size - 2)
		return 1;
	entries = little ? (unsigned)(tiff[at + 1] << 8 | tiff[at]) : be16(tiff + at);
	for (const uint8_t *e = tiff + at + 2; entries > 0 && e + 12 <= tiff + size; e += 12, entries--)
		if (memcmp(e, little ? "\x12\x01\x03\0" : "\x01\x12\0\x03", 4) == 0)
			return little ? e[8] : e[9];
	return 1;
}

/* In the place of a segment with Exif, which is never shorter than this, one that says the turn alone. */
static void keep_turn(struct strip *s, size_t size)
{
	static const uint8_t told[] = {0xFF, APP1, 0, 34, 'E', 'x', 'i', 'f', 0, 0,  'M', 'M',
	                               0,    '*',  0, 0,  0,   8,   0,   1,   1, 18, 0,   3,
	                               0,    0,    0, 1,  0,   1,   0,   0,   0, 0,  0,   0};
	enum { TURN = 29 };
	const uint8_t *from = s->bytes + s->at;
	unsigned turn = size >= sizeof(told) ? exif_turn(from + 10, size - 10) : 1;

	s->at += size;
	if (turn < 2 || turn > 8)
		return;
	memcpy(s->bytes + s->kept, told, sizeof(told));
	s->bytes[s->kept + TURN] = (uint8_t)turn;
	s->kept += sizeof(told);
}

static bool begins(const uint8_t *segment, size_t size, const char *word, size_t length)
{
	return size >= 4 + length && memcmp(segment + 4, word, length) == 0;
}

/* A segment that is there, marker and length included. */
static bool take_segment(struct strip *s, unsigned marker, size_t size)
{
	const uint8_t *from = s->bytes + s->at;

	if (marker >= SOF0 && marker <= SOF15 && marker != DHT && marker != JPG && marker != DAC) {
		if (marker > SOF2)
			return fails(s, "a kind of JPEG that browsers do not show");
		if (size < 9 || !measure(s, be16(from + 7), be16(from + 5)))
			return fails(s, s->why != NULL ? s->why : no_picture);
	}
	if (marker == APP1 && begins(from, size, "Exif\0\0", 6))
		keep_turn(s, size);
	else if (marker == COM || (marker == APP0 && !begins(from, size, "JFIF\0", 5)) ||
	         (marker == APP2 && !begins(from, size, "ICC_PROFILE\0", 12)) || marker == APP1 ||
	         (marker > APP2 && marker <= APP15 && marker != APP14))
		s->at += size;
	else
		keep(s, size);
	return true;
}

/* What a scan's header is followed by, up to the next marker that is one. */
static bool take_scan(struct strip *s)
{
	size_t end = s->at;

	s->drawn = true;
	for (;; end++) {
		const uint8_t *f = memchr(s->bytes + end, 0xFF, s->size - end);

		if (f == NULL || f + 1 >= s->bytes + s->size)
			return fails(s, cut_off);
		end = (size_t)(f - s->bytes);
		if (f[1] != 0 && f[1] != 0xFF && (f[1] < RST0 || f[1] > RST7))
			break;
	}
	keep(s, end - s->at);
	return true;
}

/* Up to its end; what is behind that is let go. */
static bool take_jpeg(struct strip *s)
{
	keep(s, 2);
	while (s->at + 2 <= s->size) {
		unsigned marker = s->bytes[s->at + 1];
		size_t size;

		if (s->bytes[s->at] != 0xFF)
			return fails(s, "damaged");
		if (marker == 0xFF) { /* filled up */
			s->at++;
			continue;
		}
		if (marker == EOI) {
			keep(s, 2);
			return s->drawn && s->sized ? true : fails(s, no_picture);
		}
		if (s->at + 4 > s->size)
			break;
		size = 2 + (size_t)be16(s->bytes + s->at + 2);
		if (marker < SOF0 || (marker >= RST0 && marker <= SOI) || size < 4)
			return fails(s, "damaged");
		if (size > s->size - s->at)
			return fails(s, cut_off);
		if (!take_segment(s, marker, size) || (marker == SOS && !take_scan(s)))
			return false;
	}
	return fails(s, cut_off);
}

/* ---- PNG ---- */

static const uint8_t png[] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'};

/* Parts that change what is seen: those that no reader may leave out, and those of colour and size. */
static bool png_stays(const uint8_t *name)
{
	static const char *const others[] = {"tRNS", "gAMA", "cHRM", "sRGB", "iCCP", "sBIT", "pHYs"};

	for (size_t i = 0; i < sizeof(others) / sizeof(others[0]); i++)
		if (memcmp(name, others[i], 4) == 0)
			return true;
	return (name[0] & 0x20) == 0;
}

static bool take_png(struct strip *s)
{
	keep(s, sizeof(png));
	while (s->size - s->at >= 12) {
		const uint8_t *part = s->bytes + s->at, *name = part + 4;
		size_t size = be32(part);
		bool end = memcmp(name, "IEND", 4) == 0;

		if (size > s->size - s->at - 12)
			return fails(s, cut_off);
		if (crc32(CRC32_INIT, name, size + 4) != be32(name + 4 + size) ||
		    (s->at == sizeof(png)) != (memcmp(name, "IHDR", 4) == 0))
			return fails(s, "damaged");
		if (!s->sized && (size < 13 || !measure(s, be32(name + 4), be32(name + 8))))
			return fails(s, s->why != NULL ? s->why : no_picture);
		s->drawn |= memcmp(name, "IDAT", 4) == 0;
		if (png_stays(name))
			keep(s, size + 12);
		else
			s->at += size + 12;
		if (end)
			return s->drawn ? true : fails(s, no_picture);
	}
	return fails(s, cut_off);
}

int image_strip(uint8_t *bytes, size_t *size, struct image *image, const char **why)
{
	struct image found = {0};
	struct strip s = {.bytes = bytes, .size = *size, .image = &found};
	bool whole;

	if (*size >= 4 && bytes[0] == 0xFF && bytes[1] == SOI && bytes[2] == 0xFF) {
		found.ending = ".jpg";
		found.type = "image/jpeg";
		whole = take_jpeg(&s);
	} else if (*size >= sizeof(png) && memcmp(bytes, png, sizeof(png)) == 0) {
		found.ending = ".png";
		found.type = "image/png";
		whole = take_png(&s);
	} else {
		whole = fails(&s, "neither JPEG nor PNG");
	}
	*why = s.why;
	if (!whole)
		return DT_E_FORMAT;
	*size = s.kept;
	*image = found;
	return 0;
}
