/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Any bytes as a scene: what is read is within its limits and makes predictions or a line that says why not.
 */
#include <stdio.h>
#include <string.h>

#include "common/scenes/scene.h"
#include "host/model/model.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
	const char *path = fuzz_file(bytes, size);
	char message[SCENE_MESSAGE_MAX] = "", why[MODEL_MESSAGE_MAX] = "";
	struct model_prediction prediction;
	struct scene scene;

	if (scene_read(&scene, path, message) != 0) {
		fuzz_check_message(message, path);
		return 0;
	}
	if (scene_check(&scene, "read", message) != 0)
		fuzz_fail("read and refused: %s", message);
	if (model_solve(&scene, MODEL_SDOF, NULL, &prediction, why) != 0 &&
	    (why[0] == '\0' || strchr(why, '\n')))
		fuzz_fail("no prediction, and no line: \"%s\"", why);
	return 0;
}
