/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What a browser says, line by line: token, Host, Origin, method, path, console; the rest is a body.
 */
#include <netinet/in.h>
#include <stdlib.h>
#include <string.h>

#include "common/plain.h"
#include "host/console/auth.h"
#include "host/console/job.h"
#include "host/console/route.h"
#include "tests/fuzz/fuzz.h"

enum { LINES = 6 };

static void try_body(const char *body)
{
	static const char *const keys[] = {"name", "drop", "text", "take", "scene", "decision"};
	struct job job = {0};
	cJSON *tree = plain_is_utf8(body, strlen(body)) && !auth_json_has_nul(body)
	                      ? cJSON_ParseWithOpts(body, NULL, true)
	                      : NULL;
	double number;

	job.body = tree;
	for (unsigned i = 0; cJSON_IsObject(tree) && i < sizeof(keys) / sizeof(keys[0]); i++) {
		const char *text = job_text(&job, keys[i], NULL);

		if (text != NULL && !plain_is_utf8(text, strlen(text)))
			fuzz_fail("a text that is no UTF-8");
		free(job.answer);
		job.answer = NULL;
		(void)job_number(&job, keys[i], 0, 100, 1, &number);
		free(job.answer);
		job.answer = NULL;
	}
	cJSON_Delete(tree);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
	static const char token[] = "00112233445566778899aabbccddeeff";
	struct sockaddr_in local = {.sin_family = AF_INET, .sin_port = htons(8731)};
	char *all = malloc(size + 1), *rest = all, *line[LINES];
	const char *behind;
	bool other;
	union {
		const struct sockaddr_in *four;
		const struct sockaddr *any;
	} address = {.four = &local};

	if (all == NULL)
		return 0;
	memcpy(all, bytes, size);
	all[size] = '\0';
	local.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
	for (unsigned i = 0; i < LINES; i++)
		if ((line[i] = strsep(&rest, "\n")) == NULL)
			line[i] = all + size;
	if (auth_token_agrees(token, line[0]) && strstr(line[0], token) == NULL)
		fuzz_fail("a wrong token");
	if (auth_host_agrees(line[1], address.any) && strcasecmp(line[1], "127.0.0.1:8731") != 0 &&
	    strcasecmp(line[1], "localhost:8731") != 0)
		fuzz_fail("a wrong Host");
	(void)auth_origin_agrees(line[2], line[1]);
	if (route_find(line[3], line[4], &behind, &other) != NULL && strstr(behind, "..") == behind)
		fuzz_fail("a path upwards: %s", line[4]);
	if (auth_console_valid(line[5]) && strlen(line[5]) > 64)
		fuzz_fail("a console's name too long");
	if (rest != NULL)
		try_body(rest);
	free(all);
	return 0;
}
