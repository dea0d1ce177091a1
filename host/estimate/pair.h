/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_ESTIMATE_PAIR_H
#define DT_HOST_ESTIMATE_PAIR_H
/*
 * Two numbers side by side, in what the processor has for it: element by element like one number, [0] and [1]
 * alone. What gcc and clang offer beyond C11; as exact as two numbers.
 */
#define PAIR double __attribute__((vector_size(2 * sizeof(double))))

#endif
