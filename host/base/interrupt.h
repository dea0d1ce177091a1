/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_BASE_INTERRUPT_H
#define DT_HOST_BASE_INTERRUPT_H
/*
 * Ctrl-C, and SIGTERM: noted, and looked at where something waits. SIGPIPE is ignored, so that a write tells.
 * Any thread.
 */

void interrupt_catch(void);

/* Not 0 once either came after interrupt_catch. */
int interrupt_came(void);

#endif
