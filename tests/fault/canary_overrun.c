/* SPDX-License-Identifier: GPL-3.0-or-later */
/* One byte read beyond an allocation, for the sanitized build to catch. */
#include <stdio.h>
#include <stdlib.h>

int main(int argc, char **argv)
{
	volatile char *bytes = calloc(16, 1);
	int sum = 0;

	(void)argv;
	if (bytes == NULL)
		return 1;
	for (int i = 0; i < 16 + argc; i++)
		sum += bytes[i];
	printf("%d\n", sum);
	free((void *)(unsigned long)bytes);
	return 0;
}
