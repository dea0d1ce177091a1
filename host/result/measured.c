/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/result/measured.h"

#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/* All ones say that it was not measured. */
static double scaled_u16(uint16_t value, double scale)
{
	return value == UINT16_MAX ? (double)NAN : value * scale;
}

struct measured measured_of(const struct record *record)
{
	const struct wire_measured *m = &record->measured;
	struct measured all = {NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, false, false};

	all.seal_agrees = record->seal_agrees;
	all.calibrated = (record->marks & WIRE_MARK_CALIBRATED) != 0;
	if (record->crc_known && record->seal_known)
		all.parameters_crc32 = record->parameters_crc32;
	if (!record->measured_known)
		return all;
	return (struct measured){
	        .seal_agrees = all.seal_agrees,
	        .calibrated = all.calibrated,
	        .parameters_crc32 = all.parameters_crc32,
	        .dropout_s = scaled_u16(m->dropout_us, 1e-6),
	        .dropout_used_s = scaled_u16(m->dropout_used_us, 1e-6),
	        .separation_m = m->separation_um == UINT32_MAX ? (double)NAN : m->separation_um * 1e-6,
	        .separation_speed_m_s = scaled_u16(m->separation_mm_s, 1e-3),
	        .acceleration_m_s2 = scaled_u16(m->acceleration_mm_s2, 1e-3),
	        .latch_delay_s = scaled_u16(m->latch_delay_us, 1e-6),
	        .clock_ratio_ppm = m->clock_ppm == INT16_MAX ? (double)NAN : m->clock_ppm,
	        .trigger_latency_s = scaled_u16(m->trigger_latency_us, 1e-6),
	};
}

/* Behind what stands there, and only with a value. */
static void __attribute__((format(printf, 4, 0)))
measured_add(char *text, size_t size, double value, const char *format, ...)
{
	size_t length = strlen(text);
	va_list arguments;

	if (!isfinite(value))
		return;
	va_start(arguments, format);
	snprintf(text + length, size - length, "%s", length > 0 ? ", " : "");
	length = strlen(text);
	vsnprintf(text + length, size - length, format, arguments);
	va_end(arguments);
}

void measured_text(const struct record *record, char *text, size_t size)
{
	struct measured m = measured_of(record);

	text[0] = '\0';
	measured_add(text, size, m.dropout_s, "magnet drop-out %.2f ms (planned with %.2f ms%s)",
	             m.dropout_s * 1e3, m.dropout_used_s * 1e3, m.calibrated ? ", calibrated" : "");
	measured_add(text, size, m.separation_m, "separated at %.1f mm", m.separation_m * 1e3);
	measured_add(text, size, m.separation_speed_m_s, "%.3f m/s", m.separation_speed_m_s);
	measured_add(text, size, m.acceleration_m_s2, "frame %.3f m/s2", m.acceleration_m_s2);
	measured_add(text, size, m.latch_delay_s, "latch %.1f ms", m.latch_delay_s * 1e3);
	measured_add(text, size, m.clock_ratio_ppm, "clock ratio %+.0f ppm", m.clock_ratio_ppm);
	measured_add(text, size, m.trigger_latency_s, "trigger after %.2f ms", m.trigger_latency_s * 1e3);
	if (record->crc_known && record->seal_known)
		measured_add(text, size, 0.0, "parameters %08" PRIx32, record->parameters_crc32);
}
