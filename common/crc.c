/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "common/crc.h"

/* The table of byte b is the remainder of b x^8; written as a sum over the bits of b it is a constant
 * expression, so that the compiler makes the tables and nobody types them. */
#define BIT(b, n, value) ((((b) >> (n)) & 1u) ? (value) : 0u)

#define CRC8_BYTE(b)                                                                          \
	(uint8_t)(BIT(b, 0, 0x2Fu) ^ BIT(b, 1, 0x5Eu) ^ BIT(b, 2, 0xBCu) ^ BIT(b, 3, 0x57u) ^ \
	          BIT(b, 4, 0xAEu) ^ BIT(b, 5, 0x73u) ^ BIT(b, 6, 0xE6u) ^ BIT(b, 7, 0xE3u))

#define CRC32_BYTE(b)                                                                                        \
	(BIT(b, 0, 0x77073096u) ^ BIT(b, 1, 0xEE0E612Cu) ^ BIT(b, 2, 0x076DC419u) ^ BIT(b, 3, 0x0EDB8832u) ^ \
	 BIT(b, 4, 0x1DB71064u) ^ BIT(b, 5, 0x3B6E20C8u) ^ BIT(b, 6, 0x76DC4190u) ^ BIT(b, 7, 0xEDB88320u))

#define FOUR(f, b) f(b), f((b) + 1u), f((b) + 2u), f((b) + 3u)
#define SIXTEEN(f, b) FOUR(f, b), FOUR(f, (b) + 4u), FOUR(f, (b) + 8u), FOUR(f, (b) + 12u)
#define SIXTY_FOUR(f, b) SIXTEEN(f, b), SIXTEEN(f, (b) + 16u), SIXTEEN(f, (b) + 32u), SIXTEEN(f, (b) + 48u)
#define ALL(f) SIXTY_FOUR(f, 0u), SIXTY_FOUR(f, 64u), SIXTY_FOUR(f, 128u), SIXTY_FOUR(f, 192u)

static const uint8_t table8[256] = {ALL(CRC8_BYTE)};
static const uint32_t table32[256] = {ALL(CRC32_BYTE)};

uint8_t crc8(uint8_t crc, const uint8_t *bytes, size_t count)
{
	crc ^= 0xFFu;
	for (size_t i = 0; i < count; i++)
		crc = table8[crc ^ bytes[i]];
	return crc ^ 0xFFu;
}

uint32_t crc32(uint32_t crc, const uint8_t *bytes, size_t count)
{
	crc = ~crc;
	for (size_t i = 0; i < count; i++)
		crc = table32[(crc ^ bytes[i]) & 0xFFu] ^ (crc >> 8);
	return ~crc;
}
