/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_COMMON_UNITS_H
#define DT_COMMON_UNITS_H
/*
 * The one place for the numbers that turn units into each other.
 */

/* Standard gravity as the study uses it, m/s^2. One g of a reading is this much. */
#define UNITS_G_M_S2 9.81

#define UNITS_PI 3.14159265358979323846

#define UNITS_RAD(deg) ((deg) * (UNITS_PI / 180.0))
#define UNITS_DEG(rad) ((rad) * (180.0 / UNITS_PI))

#endif
