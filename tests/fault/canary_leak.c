/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Memory that nothing points to any more, for the sanitized build to catch. */
#include <stdio.h>
#include <stdlib.h>

static char *volatile kept;

static void lose(int count)
{
	for (int i = 0; i < count; i++)
		kept = malloc(100);
}

int main(int argc, char **argv)
{
	(void)argv;
	lose(argc + 9);
	kept = NULL;
	puts("done");
	return 0;
}
