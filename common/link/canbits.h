/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_COMMON_LINK_CANBITS_H
#define DT_COMMON_LINK_CANBITS_H
/*
 * How long a frame can be on the bus: the most bits that a frame with an 11-bit identifier and so many bytes
 * of data takes, over all data, from its start to the end of the intermission. From ISO 11898-1:2015.
 *
 * Classic: bit stuffing from the start of frame to the end of the CRC, whose 15 bits may be anything too, so
 * that this is a bound that not every identifier reaches. FD: bit stuffing from the start of frame to the
 * last data bit, then the stuff count (4 bits), a CRC of 17 bits up to 16 bytes and 21 above, with a fixed
 * stuff bit before the field and after every fourth bit of it; one data pattern at least takes exactly so
 * long.
 *
 * The rate changes at the sample points of the BRS bit and of the CRC delimiter. What the first loses to the
 * data rate the second gives back, so they count as one nominal bit and one data bit, wherever the sample
 * points are. The sender is error-active, the acknowledgement one bit.
 */
#include <stdint.h>

struct canbits {
	unsigned nominal, data; /* bits at either rate */
};

/* length 0 to 8 */
struct canbits canbits_classic(uint32_t id, unsigned length);

/* length one that FD has, not 0; with bit-rate switching */
struct canbits canbits_fd(uint32_t id, unsigned length);

/* Rates in Mbit/s. */
double canbits_us(struct canbits bits, double nominal, double data);

#endif
