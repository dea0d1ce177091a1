/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_UNIT_LOCAL_BUS_H
#define DT_TESTS_UNIT_LOCAL_BUS_H
/*
 * A bus of processes for one test: a socket in a folder of its own, members that join it, frames by number.
 */
#include "common/link/link.h"

enum { WAIT_MS = 10000 }; /* for what must come; a test that waits this long has failed */

/* Of this test's bus, and what the latest opening said. */
extern char bus_folder[64], bus_path[96], bus_url[128], bus_message[256];

/* Around each test. */
int local_bus_set_up(void **state);
int local_bus_tear_down(void **state);
#define BUS_TEST(f) cmocka_unit_test_setup_teardown(f, local_bus_set_up, local_bus_tear_down)

struct link *local_bus_join(enum link_mode mode);

/* Frame number n, with the number in its data; every kind has its turn. */
struct frame local_bus_numbered(uint32_t n);
int local_bus_same(const struct frame *a, const struct frame *b);

void local_bus_expect(struct link *link, const struct frame *expected);
void local_bus_expect_nothing(struct link *link);

/* Lets a link that serves do its work once. */
void local_bus_serve(struct link *link);

#endif
