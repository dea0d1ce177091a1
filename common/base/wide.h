/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_COMMON_BASE_WIDE_H
#define DT_COMMON_BASE_WIDE_H
/*
 * A function marked WIDE uses registers of 32 bytes where the processor has them; which it is, is found as
 * the program starts. The numbers are the same, as nothing is fused or reordered.
 */
#if defined(__x86_64__) && defined(__gnu_linux__)
#define WIDE __attribute__((target_clones("avx2", "default")))
#else
#define WIDE
#endif

#endif
