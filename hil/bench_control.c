/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <errno.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "hil/bench_private.h"
#include "hil/scenario_private.h"

enum {
	LINE_MAX_BYTES = SCENARIO_EVENT_MAX, /* of a datagram; more is cut off and not understood */
	LINES_PER_MS = 16,
	ANSWER_MAX = 1500,
};

struct sender {
	struct sockaddr_un address;
	socklen_t size;
};

/* Who has no address of its own, or does not fetch its answers, gets none. */
static void bench_control_answer(const struct bench *bench, const struct sender *to, const char *text)
{
	if (to->size > sizeof(sa_family_t))
		(void)sendto(bench->control, text, strlen(text), MSG_DONTWAIT,
		             (const struct sockaddr *)&to->address, to->size);
}

static void refuse_line(const struct bench *bench, const struct sender *to, const char *line)
{
	char text[ANSWER_MAX];
	int used = snprintf(text, sizeof(text), "error: '%.60s', expected faults, %s, where FAULT is one of",
	                    line, scenario_actions);

	for (int i = 0; i < TOWER_FAULTS; i++)
		used += snprintf(text + used, sizeof(text) - (size_t)used, " %s",
		                 tower_fault_name((enum tower_fault)i));
	snprintf(text + used, sizeof(text) - (size_t)used, "\n");
	bench_control_answer(bench, to, text);
}

static void tell_faults(const struct bench *bench, const struct sender *to)
{
	char text[ANSWER_MAX];
	int used = 0;

	for (int i = 0; i < TOWER_FAULTS; i++)
		used += snprintf(text + used, sizeof(text) - (size_t)used, "%s%s=%d", i ? " " : "",
		                 tower_fault_name((enum tower_fault)i),
		                 tower_has_fault(bench->tower, (enum tower_fault)i));
	snprintf(text + used, sizeof(text) - (size_t)used, "\n");
	bench_control_answer(bench, to, text);
}

static void bench_control_take_line(struct bench *bench, const struct sender *from, const char *line)
{
	char text[LINE_MAX_BYTES + 1];
	char *words[SCENARIO_WORDS_MAX];
	struct event event = {0};
	unsigned count;

	snprintf(text, sizeof(text), "%s", line);
	count = scenario_split(text, words);
	if (count == 1 && strcmp(words[0], "faults") == 0)
		tell_faults(bench, from);
	else if (count > 0 && scenario_parse_action(count, words, bench->control_sequence, &event))
		bench_event(bench, &event);
	else
		refuse_line(bench, from, line);
	bench->control_sequence++;
}

void bench_control(struct bench *bench)
{
	char line[LINE_MAX_BYTES + 1];

	for (unsigned i = 0; bench->control >= 0 && i < LINES_PER_MS; i++) {
		struct sender from = {.size = sizeof(from.address)};
		ssize_t got = recvfrom(bench->control, line, LINE_MAX_BYTES, MSG_DONTWAIT,
		                       (struct sockaddr *)&from.address, &from.size);

		if (got < 0)
			return;
		line[got] = '\0';
		line[strcspn(line, "\r\n")] = '\0';
		bench_control_take_line(bench, &from, line);
	}
}

/* ---- the socket ---- */

/* A socket whose owner is gone stays in the folder and is in the way. */
static void remove_stale(const struct sockaddr_un *address)
{
	int probe = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
	struct stat entry;

	if (probe < 0)
		return;
	if (lstat(address->sun_path, &entry) == 0 && S_ISSOCK(entry.st_mode) &&
	    connect(probe, (const struct sockaddr *)address, sizeof(*address)) < 0 && errno == ECONNREFUSED)
		(void)unlink(address->sun_path);
	close(probe);
}

void bench_control_open(struct bench *bench)
{
	const char *path = bench->options->control;
	struct sockaddr_un address = {.sun_family = AF_UNIX};

	if (path == NULL)
		return;
	if (path[0] == '\0' || strlen(path) >= sizeof(address.sun_path)) {
		bench_fail(bench, BENCH_LINK, "--control %s: expected a path of 1 to %zu characters", path,
		           sizeof(address.sun_path) - 1);
		return;
	}
	memcpy(address.sun_path, path, strlen(path));
	remove_stale(&address);
	bench->control = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
	if (bench->control >= 0 && bind(bench->control, (struct sockaddr *)&address, sizeof(address)) == 0)
		return;
	bench_fail(bench, BENCH_LINK, "--control %s: %s", path, strerror(errno));
	if (bench->control >= 0)
		close(bench->control);
	bench->control = -1;
}

void bench_control_close(struct bench *bench)
{
	if (bench->control < 0)
		return;
	(void)unlink(bench->options->control);
	close(bench->control);
	bench->control = -1;
}
