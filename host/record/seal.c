/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/seal.h"

#include <string.h>

#include "host/base/mapped.h"
#include "host/record/digest.h"

enum {
	WORD = sizeof(SEAL_WORD) - 1,
	DIGITS = DIGEST_CHARS - 1,
	BLANK = WORD + DIGITS,
	PART = 1 << 20, /* bytes of a pass, then mapped_seen is told */
};

int seal_fill(char *bytes, size_t size)
{
	char digits[DIGEST_CHARS];

	for (size_t at = size; at >= BLANK; at--) {
		if (memcmp(bytes + at - BLANK, SEAL_BLANK, BLANK) != 0)
			continue;
		digest_of(bytes, size, digits);
		memcpy(bytes + at - DIGITS, digits, DIGITS);
		return 0;
	}
	return DT_E_FORMAT;
}

/* The digits of the first seal from *at on, behind which *at moves; NULL when there is none. */
static const char *next_seal(const struct source *source, size_t *at)
{
	while (*at < source->size) {
		size_t left = source->size - *at, part = left < PART ? left : PART, digits = 0;
		const char *word = memmem(source->bytes + *at, part, SEAL_WORD, WORD);

		mapped_seen(part);
		if (word == NULL) {
			*at += part == left ? left : part - (WORD - 1);
			continue;
		}
		*at = (size_t)(word - source->bytes) + WORD;
		while (digits < DIGITS && *at + digits < source->size &&
		       memchr("0123456789abcdef", source->bytes[*at + digits], 16) != NULL)
			digits++;
		if (digits == DIGITS)
			return source->bytes + *at;
	}
	return NULL;
}

static void take_bytes(struct sha256_ctx *context, const char *bytes, size_t size)
{
	for (size_t at = 0; at < size; at += PART) {
		size_t part = size - at < PART ? size - at : PART;

		sha256_update(context, part, (const uint8_t *)bytes + at);
		mapped_seen(part);
	}
}

int seal_check(const struct source *source, char message[READ_MESSAGE_MAX])
{
	static const char blank[] = SEAL_BLANK;
	size_t at = 0, behind;
	const char *seal = next_seal(source, &at);
	char found[DIGEST_CHARS];
	struct sha256_ctx context;

	if (seal == NULL || next_seal(source, &at) != NULL)
		return 0;
	behind = (size_t)(seal - source->bytes) + DIGITS;
	sha256_init(&context);
	take_bytes(&context, source->bytes, (size_t)(seal - source->bytes));
	sha256_update(&context, DIGITS, (const uint8_t *)blank + WORD);
	take_bytes(&context, source->bytes + behind, source->size - behind);
	digest_end(&context, found);
	if (memcmp(found, seal, DIGITS) == 0)
		return 1;
	return source_refuse(message, DT_E_CORRUPT, source->file, 0,
	                     "altered: its SHA-256 is %s, expected %.64s as it says itself", found, seal);
}
