/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/ebml.h"

#include <stdio.h>
#include <string.h>

#include "host/record/table_data.h"

struct ebml ebml_bytes(const char *bytes, size_t size)
{
	return (struct ebml){bytes, bytes + size};
}

struct ebml ebml_inside(const struct ebml_element *element)
{
	return ebml_bytes(element->data, element->size);
}

/* A number as long as its leading zero bits say; 0: there is none. */
static size_t take_number(const struct ebml *ebml, size_t most, uint64_t *value)
{
	unsigned first = ebml->at < ebml->end ? (unsigned char)*ebml->at : 0;
	size_t length = 1;

	while (length <= most && (first & 0x80u >> (length - 1)) == 0)
		length++;
	if (length > most || length > (size_t)(ebml->end - ebml->at))
		return 0;
	*value = bytes_whole(ebml->at, length, true);
	return length;
}

int ebml_next(struct ebml *ebml, struct ebml_element *element)
{
	uint64_t id, size;
	size_t length;

	if (ebml->at == ebml->end)
		return 0;
	length = take_number(ebml, 4, &id);
	ebml->at += length;
	if (length == 0)
		return DT_E_FORMAT;
	length = take_number(ebml, 8, &size);
	ebml->at += length;
	if (length == 0)
		return DT_E_FORMAT;
	size &= (UINT64_C(1) << 7 * length) - 1;
	if (size == (UINT64_C(1) << 7 * length) - 1)
		size = (uint64_t)(ebml->end - ebml->at);
	if (size > (uint64_t)(ebml->end - ebml->at))
		return DT_E_FORMAT;
	*element = (struct ebml_element){(uint32_t)id, ebml->at, (size_t)size};
	ebml->at += size;
	return 1;
}

bool ebml_whole(const struct ebml_element *element, uint64_t *value)
{
	if (element->size > 8)
		return false;
	*value = bytes_whole(element->data, element->size, true);
	return true;
}

bool ebml_real(const struct ebml_element *element, double *value)
{
	if (element->size != 0 && element->size != 4 && element->size != 8)
		return false;
	*value = element->size == 0
	                 ? 0
	                 : bytes_value(element->data, element->size == 4 ? BYTES_F32 : BYTES_F64, true);
	return true;
}

void ebml_text(const struct ebml_element *element, char *text, size_t size)
{
	snprintf(text, size, "%.*s", (int)(element->size < size ? element->size : size - 1), element->data);
}
