/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/digest.h"

#include <errno.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/base/process.h"

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

int digest_file(const char *path, char text[DIGEST_CHARS], int64_t *bytes, int copy)
{
	struct sha256_ctx context;
	uint8_t block[32768];
	int fd = open(path, O_RDONLY | O_CLOEXEC | O_NOCTTY | O_NONBLOCK), result = 0, failed;
	struct stat status = {.st_mode = 0};
	int64_t total = 0;
	ssize_t n = 0;

	if (fd < 0)
		return DT_E_SYSTEM;
	if (fstat(fd, &status) != 0 || !S_ISREG(status.st_mode)) { /* a FIFO or a device would have no end */
		close(fd);
		errno = S_ISDIR(status.st_mode) ? EISDIR : EINVAL;
		return DT_E_SYSTEM;
	}
	sha256_init(&context);
	while (result == 0 && ((n = read(fd, block, sizeof(block))) > 0 || (n < 0 && errno == EINTR))) {
		if (n < 0)
			continue;
		sha256_update(&context, (size_t)n, block);
		total += n;
		if (copy >= 0)
			result = process_write(copy, block, (size_t)n);
	}
	failed = errno;
	close(fd); /* what was read loses nothing by it */
	errno = failed;
	if (result != 0 || n != 0)
		return DT_E_SYSTEM;
	digest_end(&context, text);
	*bytes = total;
	return 0;
}
