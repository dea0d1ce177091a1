/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_REPORT_PDF_H
#define DT_HOST_REPORT_PDF_H
/*
 * A page on paper: HTML in, PDF out, printed by a Chromium without a window, which is looked for on PATH as
 * chromium, chromium-browser and google-chrome. No shell of ours is involved; the browser gets a home and a
 * profile of its own that are removed with it, little environment, and one minute. Its sandbox stays on
 * unless root runs it, who cannot have one.
 *
 * stop may be NULL; it is asked ten times a second, and true ends the browser.
 *
 * *pdf is malloc'ed, freed by the caller. 0; DT_E_UNKNOWN without a browser, DT_E_TIMEOUT, DT_E_CLOSED when
 * stopped, DT_E_SYSTEM, DT_E_MEMORY, with a line in message.
 */
#include <stddef.h>

#include "common/error.h"

DT_MUST_USE int pdf_print(const char *page, size_t length, int (*stop)(void), char **pdf, size_t *pdf_length,
                          char *message, size_t size);

#endif
