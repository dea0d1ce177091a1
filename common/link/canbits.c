/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "common/link/canbits.h"

#include "common/link/transport.h"

enum {
	RUN = 5, /* equal bits, then a stuff bit */
	ID_BITS = 11,
	DLC_BITS = 4,
	CLASSIC_CRC_BITS = 15,
	CLASSIC_END_BITS = 1 + 1 + 1 + 7 + 3, /* CRC delimiter, ACK, ACK delimiter, EOF, intermission */
	FD_END_BITS = 1 + 1 + 7 + 3,          /* the CRC delimiter counts as a data bit */
	FD_COUNT_BITS = 4,
};

struct coder {
	unsigned bits; /* with stuff bits */
	unsigned run, last;
};

static void canbits_put(struct coder *coder, unsigned bit)
{
	coder->run = bit == coder->last ? coder->run + 1 : 1;
	coder->last = bit;
	coder->bits++;
	if (coder->run < RUN)
		return;
	coder->bits++;
	coder->last = !bit;
	coder->run = 1;
}

static void put_word(struct coder *coder, uint32_t word, unsigned count)
{
	while (count-- > 0)
		canbits_put(coder, word >> count & 1);
}

/* Data that fill the run under way and then change with every stuff bit. */
static void put_worst(struct coder *coder, unsigned count)
{
	while (count-- > 0)
		canbits_put(coder, coder->last);
}

static struct coder canbits_start(uint32_t id)
{
	struct coder coder = {.last = 1}; /* idle: stuffing begins with the frame */

	canbits_put(&coder, 0);
	put_word(&coder, id, ID_BITS);
	return coder;
}

struct canbits canbits_classic(uint32_t id, unsigned length)
{
	struct coder coder = canbits_start(id);

	put_word(&coder, 0, 3); /* RTR, IDE, r0 */
	put_word(&coder, length, DLC_BITS);
	put_worst(&coder, 8 * length + CLASSIC_CRC_BITS);
	return (struct canbits){.nominal = coder.bits + CLASSIC_END_BITS};
}

struct canbits canbits_fd(uint32_t id, unsigned length)
{
	struct coder coder = canbits_start(id);
	unsigned field = FD_COUNT_BITS + (length > 16 ? 21 : 17);
	unsigned nominal;

	put_word(&coder, 0x5, 5); /* RRS 0, IDE 0, FDF 1, res 0, BRS 1 */
	nominal = coder.bits;
	canbits_put(&coder, 0); /* ESI */
	put_word(&coder, link_code_of_length(length), DLC_BITS);
	put_worst(&coder, 8 * length - 1);
	coder.bits++; /* after the last data bit a fixed stuff bit comes anyway */
	return (struct canbits){
	        .nominal = nominal + FD_END_BITS,
	        .data = coder.bits - nominal + 1 + field / 4 + field + 1,
	};
}

double canbits_us(struct canbits bits, double nominal, double data)
{
	return bits.nominal / nominal + bits.data / data;
}
