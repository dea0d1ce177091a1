/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_UNIT_SHIPPED_H
#define DT_TESTS_UNIT_SHIPPED_H
/*
 * The scenes that come along.
 */
#include "common/scenes/scene.h"

/* geometry: "1", "2A", "2B". Fails the test when it cannot be read. */
struct scene shipped_scene(const char *geometry);

#endif
