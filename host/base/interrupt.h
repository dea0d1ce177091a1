/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_BASE_INTERRUPT_H
#define DT_HOST_BASE_INTERRUPT_H
/*
 * Ctrl-C, SIGTERM, and SIGHUP of a terminal that is gone, unless nohup has it ignored: noted, and looked at
 * where something waits. SIGPIPE is ignored, so that a write tells. Any thread.
 */

void interrupt_catch(void);

/* Not 0 once one of them came after interrupt_catch. */
int interrupt_came(void);

#endif
