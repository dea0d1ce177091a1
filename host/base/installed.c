/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/base/installed.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>

enum { SCENE_NAME_MAX = 100 };

int installed_path(const char *relative, char path[PATH_MAX])
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

/* What was installed with the program comes first; a program that was not lies in the sources' build folder.
 */
int installed_scene(const char *name, char path[PATH_MAX])
{
	static const char *const folders[] = {"../share/droptower/scenes", "../common/scenes",
	                                      "../../common/scenes"};
	char relative[NAME_MAX];

	for (size_t i = 0; i < sizeof(folders) / sizeof(folders[0]); i++) {
		if (installed_path(folders[i], path) != 0)
			return -1;
		if (access(path, R_OK) != 0)
			continue;
		snprintf(relative, sizeof(relative), "%s/%s", folders[i], name);
		return installed_path(relative, path);
	}
	errno = ENOENT;
	return -1;
}

const char *installed_scene_file(const char *name, char path[PATH_MAX])
{
	static const char *const endings[] = {"", ".ini"};
	char file[NAME_MAX];

	if (access(name, F_OK) == 0 || strchr(name, '/') != NULL || strlen(name) > SCENE_NAME_MAX)
		return name;
	for (size_t i = 0; i < sizeof(endings) / sizeof(endings[0]); i++) {
		snprintf(file, sizeof(file), "%s%s", name, endings[i]);
		if (installed_scene(file, path) == 0 && access(path, F_OK) == 0)
			return path;
	}
	return name;
}
