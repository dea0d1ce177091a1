/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_BASE_CHECKSUM_H
#define DT_HOST_BASE_CHECKSUM_H
/*
 * The CRC-32 of common/crc.h over much at once: 64 bytes by carry-less multiplication where the processor has
 * it, ten times as fast as by tables; elsewhere that one itself. Any thread.
 *
 * V. Gopal et al., Fast CRC Computation for Generic Polynomials Using PCLMULQDQ Instruction, Intel, 2009.
 */
#include <stddef.h>
#include <stdint.h>

/* As crc32: continues. */
uint32_t checksum_crc32(uint32_t crc, const uint8_t *bytes, size_t count);

#endif
