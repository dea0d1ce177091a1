/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/digest.h"

#include <stdint.h>

void digest_end(struct sha256_ctx *context, char text[DIGEST_CHARS])
{
	static const char digits[] = "0123456789abcdef";
	uint8_t digest[SHA256_DIGEST_SIZE];

	sha256_digest(context, sizeof(digest), digest);
	for (size_t i = 0; i < sizeof(digest); i++) {
		text[2 * i] = digits[digest[i] >> 4];
		text[2 * i + 1] = digits[digest[i] & 15];
	}
	text[DIGEST_CHARS - 1] = '\0';
}

void digest_of(const void *bytes, size_t size, char text[DIGEST_CHARS])
{
	struct sha256_ctx context;

	sha256_init(&context);
	sha256_update(&context, size, bytes);
	digest_end(&context, text);
}
