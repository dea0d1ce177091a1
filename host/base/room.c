/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/base/room.h"

#include <math.h>
#include <sys/statvfs.h>

double room_bytes(const char *folder)
{
	struct statvfs disk;

	return statvfs(folder, &disk) == 0 ? (double)disk.f_bavail * (double)disk.f_frsize : NAN;
}
