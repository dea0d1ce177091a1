/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/record/dbc.h"

#include "common/wire_table.h"

/* VFrameFormat's value for "StandardCAN_FD" in the list below. */
enum { STANDARD_CAN_FD = 14 };

static void write_signal(FILE *out, const struct wire_field *field, unsigned element, const char *receiver)
{
	char index[8] = "";

	if (field->count > 1)
		snprintf(index, sizeof(index), "%u", element);
	fprintf(out, " SG_ %s%s : %u|%u@1%c (%.9g,0) [0|0] \"%s\" %s\n", field->name, index,
	        8u * (field->offset + element * field->size), 8u * field->size, field->is_signed ? '-' : '+',
	        field->scale, field->unit, receiver);
}

static void write_message(FILE *out, const struct wire_message *message)
{
	const char *receiver = message->sender[0] == 't' ? "host" : "tower";

	fprintf(out, "\nBO_ %u %s: %u %s\n", (unsigned)message->id, message->name, message->layout->length,
	        message->sender);
	for (size_t f = 0; f < message->layout->field_count; f++)
		for (unsigned element = 0; element < message->layout->fields[f].count; element++)
			write_signal(out, &message->layout->fields[f], element, receiver);
}

static void write_texts(FILE *out, const struct wire_message *message)
{
	fprintf(out, "CM_ BO_ %u \"%s%s%s\";\n", (unsigned)message->id, message->layout->doc,
	        message->doc[0] != '\0' ? "; " : "", message->doc);
	for (size_t f = 0; f < message->layout->field_count; f++) {
		const struct wire_field *field = &message->layout->fields[f];

		if (field->doc[0] != '\0' && field->count == 1)
			fprintf(out, "CM_ SG_ %u %s \"%s\";\n", (unsigned)message->id, field->name,
			        field->doc);
	}
}

int dbc_write(FILE *out)
{
	fputs("VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_: tower host\n", out);
	for (size_t i = 0; i < wire_message_count; i++)
		write_message(out, &wire_messages[i]);
	fputs("\n", out);
	for (size_t i = 0; i < wire_message_count; i++)
		write_texts(out, &wire_messages[i]);
	fputs("BA_DEF_ BO_ \"VFrameFormat\" ENUM \"StandardCAN\",\"ExtendedCAN\",\"reserved\",\"reserved\","
	      "\"reserved\",\"reserved\",\"reserved\",\"reserved\",\"reserved\",\"reserved\",\"reserved\","
	      "\"reserved\",\"reserved\",\"reserved\",\"StandardCAN_FD\",\"ExtendedCAN_FD\";\n"
	      "BA_DEF_DEF_ \"VFrameFormat\" \"StandardCAN\";\n",
	      out);
	for (size_t i = 0; i < wire_message_count; i++)
		if (wire_messages[i].layout->length > 8)
			fprintf(out, "BA_ \"VFrameFormat\" BO_ %u %d;\n", (unsigned)wire_messages[i].id,
			        STANDARD_CAN_FD);
	return fflush(out) == 0 && !ferror(out) ? 0 : DT_E_SYSTEM;
}
