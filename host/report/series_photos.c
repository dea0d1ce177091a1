/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Photos of drops, whole within the page.
 */
#include <stdlib.h>

#include "host/report/series_private.h"

struct photos {
	struct series_page *page;
	const struct series_drop *drop;
	size_t count;
};

static void fail_page(struct series_page *page, int result)
{
	if (page->page.error)
		return;
	page->page.error = result;
	snprintf(page->page.message, page->page.size, "%s",
	         result == DT_E_MEMORY ? error_text(result) : archive_message(page->request->archive));
}

static int put_photo(void *context, const struct archive_photo *photo)
{
	struct photos *photos = context;
	struct series_page *page = photos->page;
	const char *moment = photo->after ? "after" : "before";
	FILE *out = page->page.out;
	char *bytes;
	size_t size;
	int result = archive_photo_bytes(page->request->archive, photo, &bytes, &size);

	if (result == DT_E_CORRUPT || result == DT_E_SYSTEM)
		return 0; /* the drop is altered, which is told */
	if (result != 0)
		return result;
	fputs(photos->count++ == 0 ? "<div class=\"photos\">" : "", out);
	fprintf(out,
	        "<figure><figcaption>%s drop %u</figcaption><img alt=\"%s drop %u\" src=\"data:%s;base64,",
	        moment, photos->drop->a.number, moment, photos->drop->a.number, photo->type);
	result = series_base64(out, bytes, size);
	fputs("\"></figure>\n", out);
	free(bytes);
	return result;
}

static int each_photo(struct series_page *page, const struct series_drop *drop,
                      int (*each)(void *context, const struct archive_photo *photo), void *context)
{
	char name[ARCHIVE_NAME_MAX + 16];

	if (!drop->a.sha256[0]) /* never recorded */
		return 0;
	snprintf(name, sizeof(name), "%.60s/%u", page->series.name, drop->a.number);
	return archive_each_photo(page->request->archive, name, each, context);
}

void series_photos(struct series_page *page, const struct series_drop *drop)
{
	struct photos photos = {page, drop, 0};
	int result = each_photo(page, drop, put_photo, &photos);

	fputs(photos.count ? "</div>\n" : "", page->page.out);
	if (result != 0)
		fail_page(page, result);
}

static int count_photo(void *context, const struct archive_photo *photo)
{
	(void)photo;
	(*(size_t *)context)++;
	return 0;
}

size_t series_photos_count(struct series_page *page)
{
	size_t count = 0;
	int result = 0;

	for (size_t i = 0; i < page->count && result == 0; i++)
		result = each_photo(page, page->drop[i], count_photo, &count);
	if (result != 0)
		fail_page(page, result);
	return count;
}
