/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/command/beside.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>

int beside(const char *relative, char path[PATH_MAX])
{
	ssize_t length = readlink("/proc/self/exe", path, PATH_MAX);
	size_t size = strlen(relative) + 1;

	if (length <= 0)
		return -1;
	while (length > 0 && path[length - 1] != '/')
		length--;
	if ((size_t)length + size > PATH_MAX) {
		errno = ENAMETOOLONG;
		return -1;
	}
	memcpy(path + length, relative, size);
	return 0;
}

int beside_scene(const char *name, char path[PATH_MAX])
{
	char relative[NAME_MAX];

	if (access("common/scenes/geometry-2A.ini", R_OK) == 0) {
		snprintf(path, PATH_MAX, "common/scenes/%s", name);
		return 0;
	}
	snprintf(relative, sizeof(relative), "../share/droptower/scenes/%s", name);
	return beside(relative, path);
}
