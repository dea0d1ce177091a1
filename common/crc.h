/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_COMMON_CRC_H
#define DT_COMMON_CRC_H
/*
 * The two checksums of the wire. Any context, no state of their own.
 *
 * crc8: AUTOSAR CRC8H2F (polynomial 0x2F, initial 0xFF, final 0xFF), Hamming distance 4 up to 119 bits,
 *       2 for a whole block; CAN's own CRC is in front of it. Check value of "123456789": 0xDF.
 * crc32: IEEE 802.3 as in zlib (reflected 0x04C11DB7). Check value of "123456789": 0xCBF43926.
 *
 * Both continue: crc(crc(CRC_INIT, a), b) is the checksum of a followed by b.
 */
#include <stddef.h>
#include <stdint.h>

#define CRC8_INIT ((uint8_t)0)
#define CRC32_INIT ((uint32_t)0)

uint8_t crc8(uint8_t crc, const uint8_t *bytes, size_t count);
uint32_t crc32(uint32_t crc, const uint8_t *bytes, size_t count);

#endif
