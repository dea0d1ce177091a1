/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_COMMON_ASSERT_H
#define DT_COMMON_ASSERT_H
/*
 * Assertions of our own logic, kept in what is shipped. Input is never asserted: it is checked and refused.
 *
 * On the board a false one resets at once, as a crash does: a reset de-energises latch and dampers and pulls
 * the magnet up; the core finds PORT_RESET_WATCHDOG. Any program on Linux says file, line and condition and
 * ends with ASSERT_EXIT, without writing anything more. The emulated firmware says so, too, and ends. Any
 * context.
 */

enum { ASSERT_EXIT = 70 };

/* Each port and common/link has one. */
_Noreturn void assert_failed(const char *file, int line, const char *condition);

#ifdef DT_MUTANTS /* tests/fault makes mistakes in the product, not in its assertions */
#define DT_ASSERT(condition)
#else
#define DT_ASSERT(condition) ((condition) ? (void)0 : assert_failed(__FILE__, __LINE__, #condition))
#endif

#endif
