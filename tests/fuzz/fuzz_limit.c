/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Any bytes as a limit curve; the first chooses its kind.
 */
#include "host/shock/limit.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
	char message[READ_MESSAGE_MAX] = "";
	struct limit_curve curve;
	struct limit_point at;
	enum limit_kind kind;
	const char *path;

	if (size < 1)
		return 0;
	kind = bytes[0] % 2 == 0 ? LIMIT_SPECTRUM : LIMIT_BAND;
	path = fuzz_file(bytes + 1, size - 1);
	if (limit_read(&curve, path, kind, message) != 0) {
		fuzz_check_message(message, path);
		return 0;
	}
	if (curve.count < 2)
		fuzz_fail("a curve of %zu points", curve.count);
	for (size_t i = 0; i < curve.count; i++)
		if (!limit_at(&curve, kind, curve.point[i].x, &at))
			fuzz_fail("point %zu is not on the curve", i);
	limit_free(&curve);
	return 0;
}
