/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_COMMON_UNITS_H
#define DT_COMMON_UNITS_H
/*
 * The one place for the numbers that turn units into each other.
 */

/* Standard gravity, m/s^2 (ISO 80000-3): what one g of a reading is, everywhere. What a product falls with is
 * the scene's gravity_m_s2. */
#define UNITS_G_M_S2 9.80665

#define UNITS_PI 3.14159265358979323846

#define UNITS_RAD(deg) ((deg) * (UNITS_PI / 180.0))
#define UNITS_DEG(rad) ((rad) * (180.0 / UNITS_PI))

#endif
