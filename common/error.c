/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "common/error.h"

const char *error_text(int code)
{
	switch (code) {
	case 0:
		return "done";
#define DT_ERROR(NAME, value, text) \
	case DT_E_##NAME:           \
		return text;
#include "common/error.def"
#undef DT_ERROR
	default:
		return "unknown error";
	}
}
