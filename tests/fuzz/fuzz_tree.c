/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What a helper tells of a file of arrays: the bytes are entries behind the head. The first byte chooses what
 * the columns are said to be.
 */
#include <stdlib.h>
#include <string.h>

#include "host/record/tree.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
	static const char *const columns[] = {NULL, "a:g@1000", "time:s,a:g"};
	const size_t head = strlen(TREE_HEAD);
	struct table_data table = {.format = NULL};
	struct source source = {.file = "tree"};
	char message[READ_MESSAGE_MAX] = "", *whole;
	struct record record;
	int error;

	if (size < 1)
		return 0;
	whole = malloc(head + size - 1);
	if (whole == NULL)
		return 0;
	memcpy(whole, TREE_HEAD, head);
	memcpy(whole + head, bytes + 1, size - 1);
	error = read_tree(&table, "tree", whole, head + size - 1, &source, message);
	free(whole);
	if (!error)
		error = table_data_record(&table, &record, &source, columns[bytes[0] % 3], message);
	table_data_free(&table);
	if (error)
		fuzz_check_message(message, "tree");
	else
		record_free(&record);
	return 0;
}
