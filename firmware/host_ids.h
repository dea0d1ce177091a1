/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_FIRMWARE_HOST_IDS_H
#define DT_FIRMWARE_HOST_IDS_H
/*
 * The identifiers that a host may send: what a port's controller lets through, and nothing else.
 */
#include <stdint.h>

#define SENDER_host(id) (id),
#define SENDER_tower(id)
static const uint16_t host_ids[] = {
#define WIRE_ID(NAME, id, layout, sender, doc) SENDER_##sender(id)
#include "common/wire.def"
};

#define HOST_IDS (sizeof(host_ids) / sizeof(host_ids[0]))

#endif
