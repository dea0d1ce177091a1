/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A signed overflow, for the sanitized build to catch. */
#include <limits.h>
#include <stdio.h>

int main(int argc, char **argv)
{
	volatile int most = INT_MAX;

	(void)argv;
	most = most + argc;
	printf("%d\n", most);
	return 0;
}
