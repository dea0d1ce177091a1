/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/report/pdf_attach.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

enum { PLACE = 20 /* bytes of an entry in the table of places */ };

/* The parts of a PDF that an update names. */
struct parts {
	const char *pdf;
	size_t length;
	size_t table;           /* where the table of places begins */
	unsigned objects, root; /* how many; the catalogue's number */
	struct {
		const char *at;
		size_t length;
	} trailer, catalogue; /* what stands between << and >> */
};

/* The text from at on, to the end of the PDF; NULL when it is not there. */
static const char *find(const struct parts *p, size_t at, const char *text)
{
	return at < p->length ? memmem(p->pdf + at, p->length - at, text, strlen(text)) : NULL;
}

static const char *find_last(const struct parts *p, const char *text)
{
	const char *found = NULL, *next = find(p, 0, text);

	while (next != NULL) {
		found = next;
		next = find(p, (size_t)(next + 1 - p->pdf), text);
	}
	return found;
}

/* A number behind a word, both from at on; false without one. The PDF ends with a NUL (durable_read). */
static bool number_behind(const struct parts *p, size_t at, const char *word, unsigned long *number)
{
	const char *found = find(p, at, word);
	char *end;

	if (found == NULL)
		return false;
	*number = strtoul(found + strlen(word), &end, 10);
	return end > found + strlen(word);
}

/* What stands between the first << behind at and the last >> before the word. */
static bool dictionary(const struct parts *p, size_t at, const char *word, const char **text, size_t *length)
{
	const char *begin = find(p, at, "<<"), *end = find(p, at, word);

	while (end != NULL && begin != NULL && end > begin && memcmp(end, ">>", 2) != 0)
		end--;
	if (begin == NULL || end == NULL || end < begin + 2)
		return false;
	*text = begin + 2;
	*length = (size_t)(end - *text);
	return true;
}

/* Where an object begins, by the table, which is one piece. */
static bool place_of(const struct parts *p, unsigned object, size_t *place)
{
	const char *rows = find(p, p->table, "\n0 ");
	char *end;

	rows = rows != NULL ? memchr(rows + 1, '\n', p->length - (size_t)(rows + 1 - p->pdf)) : NULL;
	if (rows == NULL || object >= p->objects ||
	    (size_t)(rows + 1 - p->pdf) + (object + 1ul) * PLACE > p->length)
		return false;
	*place = strtoul(rows + 1 + (size_t)object * PLACE, &end, 10);
	return *place > 0 && *place < p->length;
}

static bool take_apart(struct parts *p)
{
	const char *last = find_last(p, "startxref");
	unsigned long table, size, root;
	size_t place, trailer;

	if (last == NULL || !number_behind(p, (size_t)(last - p->pdf), "startxref", &table) ||
	    table + 4 >= p->length || memcmp(p->pdf + table, "xref", 4) != 0)
		return false;
	p->table = table;
	if (find(p, table, "trailer") == NULL)
		return false;
	trailer = (size_t)(find(p, table, "trailer") - p->pdf);
	if (!number_behind(p, trailer, "/Size", &size) || !number_behind(p, trailer, "/Root", &root) ||
	    !dictionary(p, trailer, "startxref", &p->trailer.at, &p->trailer.length) || size > 10000000)
		return false;
	p->objects = (unsigned)size;
	p->root = (unsigned)root;
	return place_of(p, p->root, &place) &&
	       dictionary(p, place, "endobj", &p->catalogue.at, &p->catalogue.length) &&
	       memmem(p->catalogue.at, p->catalogue.length, "/Names", 6) == NULL &&
	       memmem(p->trailer.at, p->trailer.length, "/Prev", 5) == NULL;
}

/* The trailer's words but the count of objects, which grew. */
static void write_trailer(const struct parts *p, FILE *out)
{
	const char *size = memmem(p->trailer.at, p->trailer.length, "/Size", 5), *rest = size + 5;

	rest += strspn(rest, " \r\n");
	rest += strspn(rest, "0123456789");
	fprintf(out, "trailer\n<<%.*s/Size %u%.*s\n/Prev %zu>>\n", (int)(size - p->trailer.at), p->trailer.at,
	        p->objects + 2, (int)(p->trailer.at + p->trailer.length - rest), rest, p->table);
}

int pdf_attach(const char *pdf, size_t length, const struct pdf_file *file, FILE *out, size_t *start)
{
	struct parts p = {.pdf = pdf, .length = length};
	size_t place[3], at = length + 1;
	unsigned stream;

	if (!take_apart(&p))
		return DT_E_FORMAT;
	stream = p.objects;
	fwrite(pdf, 1, length, out);
	fputc('\n', out);
	place[0] = at;
	at += (size_t)fprintf(out,
	                      "%u 0 obj\n<</Type /EmbeddedFile\n/Subtype /text#2Fcsv\n/Params <</Size "
	                      "%zu>>\n/Length %zu>>\nstream\n",
	                      stream, file->size, file->size);
	at += fwrite(file->bytes, 1, file->size, out);
	at += (size_t)fprintf(out, "\nendstream\nendobj\n");
	place[1] = at;
	at += (size_t)fprintf(out,
	                      "%u 0 obj\n<</Type /Filespec\n/F (%s)\n/UF (%s)\n/AFRelationship /Data\n/EF "
	                      "<</F %u 0 R\n/UF %u 0 R>>>>\nendobj\n",
	                      stream + 1, file->name, file->name, stream, stream);
	place[2] = at;
	at += (size_t)fprintf(out,
	                      "%u 0 obj\n<<%.*s\n/Names <</EmbeddedFiles <</Names [(%s) %u 0 R]>>>>\n/AF [%u "
	                      "0 R]>>\nendobj\n",
	                      p.root, (int)p.catalogue.length, p.catalogue.at, file->name, stream + 1,
	                      stream + 1);
	*start = at;
	fprintf(out, "xref\n%u 1\n%010zu 00000 n \n%u 2\n%010zu 00000 n \n%010zu 00000 n \n", p.root,
	        place[2], stream, place[0], place[1]);
	write_trailer(&p, out);
	return 0;
}

void pdf_attach_end(FILE *out, size_t start)
{
	fprintf(out, "startxref\n%zu\n%%%%EOF\n", start);
}
