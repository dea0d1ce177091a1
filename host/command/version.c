/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <droptower_version.h>
#include <gsl/gsl_version.h>
#include <inttypes.h>
#include <lcm/lcm.h>
#include <sqlite3.h>
#include <stdio.h>

#include "common/wire.h"
#include "host/command/command.h"
#include "host/report/report.h"

int command_version(void)
{
	printf("droptower %s\nwire %08" PRIx32 "\nGSL %s\nLCM %d.%d.%d\nSQLite %s\n", DT_VERSION, wire_hash(),
	       gsl_version, LCM_MAJOR_VERSION, LCM_MINOR_VERSION, LCM_MICRO_VERSION, sqlite3_libversion());
	return COMMAND_DONE;
}

int command_schema(void)
{
	return report_schema(stdout) == 0 ? COMMAND_DONE
	                                  : command_output_failed("the schema cannot be written");
}
