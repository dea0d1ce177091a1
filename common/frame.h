/* SPDX-License-Identifier: GPL-2.0-or-later */
#ifndef DT_COMMON_FRAME_H
#define DT_COMMON_FRAME_H
/*
 * One CAN or CAN FD frame as it travels through firmware, links, bench and host.
 */
#include <stdint.h>

#define FRAME_DATA_MAX 64u

enum {
	FRAME_FD = 1u << 0,       /* CAN FD format */
	FRAME_BRS = 1u << 1,      /* FD: data phase at the fast bit rate */
	FRAME_ESI = 1u << 2,      /* FD: the sender is error-passive */
	FRAME_EXTENDED = 1u << 3, /* 29-bit identifier */
	FRAME_REMOTE = 1u << 4,   /* classic remote request: no data, length = length asked for */
	FRAME_ERROR = 1u << 5, /* not a frame of the bus: an error report, id = SocketCAN error class bits */
};

struct frame {
	int64_t time_us; /* receive time, us since the epoch of the link's clock; 0 = unknown */
	uint32_t id;     /* 11 or 29 bits, without flag bits */
	uint8_t flags;   /* FRAME_* */
	uint8_t length;  /* bytes of data that count; FD allows 0-8, 12, 16, 20, 24, 32, 48, 64 */
	uint8_t data[FRAME_DATA_MAX];
};

#endif
