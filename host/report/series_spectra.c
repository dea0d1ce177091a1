/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <stdlib.h>

#include "host/report/series_private.h"
#include "host/shock/spectrum.h"

/* What droptower srs takes without options. */
static const struct spectrum_options options = {
        .srs = {.damping = 0.05, .quantity = SRS_ACCELERATION},
        .side = SRS_MAXIMAX,
        .part = SRS_TOTAL,
        .per_octave = 12,
};

/* The spectra of the drops that count and are drawn; the others have no channel. */
struct series_spectra {
	const struct series_page *page;
	struct spectrum *of;       /* [page->count] */
	struct script_range range; /* of all, so that heights compare by eye */
};

static bool has_spectra(const struct series_drop *drop)
{
	return drop->counts && series_is_drawn(drop);
}

static int spectra_open(struct series_spectra *spectra, const struct series_page *page)
{
	int result = 0;

	*spectra = (struct series_spectra){.page = page, .of = calloc(page->count + 1, sizeof(*spectra->of))};
	if (!spectra->of)
		return DT_E_MEMORY;
	for (size_t i = 0; i < page->count && result == 0; i++)
		if (has_spectra(page->drop[i])) {
			result = spectrum_compute(&page->drop[i]->record, &options, &spectra->of[i]);
			result = result == DT_E_EMPTY ? 0 : result;
		}
	return result;
}

static void spectra_close(struct series_spectra *spectra)
{
	for (size_t i = 0; spectra->of && i < spectra->page->count; i++)
		spectrum_free(&spectra->of[i]);
	free(spectra->of);
}

static const struct spectrum_channel *curve_of(const struct series_spectra *spectra, size_t drop,
                                               size_t sensor, char axis)
{
	const struct series_drop *d = spectra->page->drop[drop];
	const struct channel *c = series_channel(d, sensor, axis);

	return c && spectra->of[drop].channel ? &spectra->of[drop].channel[c - d->record.channels] : NULL;
}

static struct script_range range_of(const struct series_spectra *spectra)
{
	struct script_range range = {INFINITY, 0.0};

	for (size_t i = 0; i < spectra->page->count; i++)
		for (size_t picture = 0; picture < 4; picture++) {
			const struct spectrum *s = &spectra->of[i];
			const struct spectrum_channel *c =
			        curve_of(spectra, i, picture % 2, picture < 2 ? 'X' : 'Y');

			for (size_t k = 0; c && k < s->count; k++)
				if (c->side[SRS_MAXIMAX][k] > 0) {
					range.low = fmin(range.low, c->side[SRS_MAXIMAX][k]);
					range.high = fmax(range.high, c->side[SRS_MAXIMAX][k]);
				}
		}
	return range;
}

/* $dN; false where no frequency has a value. */
static bool write_curve(FILE *out, size_t number, const struct spectrum *spectrum,
                        const struct spectrum_channel *channel)
{
	bool any = false;

	fprintf(out, "$d%zu << EOD\n", number);
	for (size_t k = 0; k < spectrum->count; k++)
		if (channel->side[SRS_MAXIMAX][k] > 0) {
			fprintf(out, "%.5g %.5g\n", spectrum->frequency_hz[k], channel->side[SRS_MAXIMAX][k]);
			any = true;
		}
	fputs("EOD\n", out);
	return any;
}

static size_t write_curves(FILE *out, const struct series_spectra *spectra, size_t sensor, char axis)
{
	const struct spectrum *last = NULL;
	size_t drawn = 0;

	for (size_t i = 0; i < spectra->page->count; i++) {
		const struct spectrum_channel *c = curve_of(spectra, i, sensor, axis);

		if (c && write_curve(out, drawn, &spectra->of[i], c)) {
			last = &spectra->of[i];
			drawn++;
		}
	}
	if (last)
		script_spectrum_axes(out, 560, 300, last->frequency_hz[0],
		                     last->frequency_hz[last->count - 1], spectra->range);
	for (size_t i = 0; i < drawn; i++)
		fprintf(out, "%s$d%zu with lines linewidth 1.3 linecolor rgb '%s'", i > 0 ? ", " : "plot ", i,
		        sensor == 0 ? SCRIPT_COLOUR_S1 : SCRIPT_COLOUR_S2);
	fputc('\n', out);
	return drawn;
}

static void picture_spectra(struct series_page *page, const struct series_spectra *spectra, size_t sensor,
                            char axis)
{
	struct page *p = &page->page;
	struct text script;
	char label[64];
	size_t drawn;

	if (!page_begin_script(p, &script))
		return;
	drawn = write_curves(script.out, spectra, sensor, axis);
	snprintf(label, sizeof(label), "shock response spectra of S%zu %c", sensor + 1, axis);
	fprintf(p->out,
	        "<figure><figcaption><b>S%zu %c</b><span>g over Hz, %zu of %zu drops</span></figcaption>",
	        sensor + 1, axis, drawn, series_counted(page));
	page_draw(p, &script, drawn > 0, label);
	fputs("</figure>\n", p->out);
}

void series_spectra(struct series_page *page)
{
	struct series_spectra spectra;
	bool any = false;

	for (size_t i = 0; i < page->count; i++)
		any |= has_spectra(page->drop[i]);
	if (!any || page->page.error)
		return;
	page->page.error = spectra_open(&spectra, page);
	if (page->page.error) {
		snprintf(page->page.message, page->page.size, "%s", error_text(page->page.error));
	} else {
		spectra.range = range_of(&spectra);
		fputs("<h2>Shock response spectra of the drops that count</h2>\n<p class=\"soft\">What an "
		      "oscillator "
		      "on the sensor's place would reach: the largest acceleration, of either sign, during "
		      "the shock "
		      "and after it; damping ratio 0.05 (Q = 10). A sensor's high-pass is not undone. A "
		      "clipped shock "
		      "has a spectrum that is too low.</p>\n<div class=\"grid\">",
		      page->page.out);
		for (size_t picture = 0; picture < 4; picture++)
			picture_spectra(page, &spectra, picture % 2, picture < 2 ? 'X' : 'Y');
		fputs("</div>\n", page->page.out);
	}
	spectra_close(&spectra);
}
