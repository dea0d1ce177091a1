/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_COMMON_LINK_SOCKETCAN_H
#define DT_COMMON_LINK_SOCKETCAN_H
/*
 * Our frame to the kernel's and back, apart from the sockets so that it is testable where the kernel has no
 * CAN. (linux/can.h; the two kernel structs share their layout, the size tells which it is)
 * Any context; no state.
 */
#include <linux/can.h>
#include <stddef.h>

#include "common/error.h"
#include "common/frame.h"

/* Bytes of *kernel to write, CAN_MTU or CANFD_MTU, or DT_E_ARGUMENT for an error report: a controller would
 * send it as a data frame with some other identifier. */
DT_MUST_USE int socketcan_pack(struct canfd_frame *kernel, const struct frame *frame);

/* size: bytes read. 0, time_us is 0; or DT_E_FORMAT with *frame unchanged. */
DT_MUST_USE int socketcan_unpack(struct frame *frame, const struct canfd_frame *kernel, size_t size);

#endif
