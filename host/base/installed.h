/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_BASE_INSTALLED_H
#define DT_HOST_BASE_INSTALLED_H
/*
 * Where what was installed together is found: seen from the folder of this program, wherever that was put.
 */
#include <limits.h>

/* Folder of this program, then relative. 0, or -1 with errno where it is too long or unknown. Whether there
 * is something is not looked at. */
int installed_path(const char *relative, char path[PATH_MAX]);

/* A scene that comes along, or a pattern of them: those that were installed with this program, or the
 * sources' when it lies in their build folder. As beside; -1 when there are none. */
int installed_scene(const char *name, char path[PATH_MAX]);

/* The scene file that a user means by name: that file, if there is one; else, when it names no folder, the
 * scene of that name that comes along, with or without its .ini, if there is one, in path; else name. */
const char *installed_scene_file(const char *name, char path[PATH_MAX]);

#endif
