/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <cmocka.h>

#include "tests/unit/shipped.h"

struct scene shipped_scene(const char *geometry)
{
	char file[64], message[SCENE_MESSAGE_MAX];
	struct scene scene;

	snprintf(file, sizeof(file), "common/scenes/geometry-%s.ini", geometry);
	if (scene_read(&scene, file, message) != 0)
		fail_msg("%s", message);
	return scene;
}
