/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What there is only of a simulated tower: the bench that we start ourselves, and its control socket.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include "host/console/tower_private.h"

enum {
	WORDS_MAX = 32,
	ANSWER_MAX = 1024,
	ANSWER_MS = 1000,
	ASK_MS = 1000, /* another may have changed them */
};

/* ---- the bench ---- */

int tower_bench_start(struct tower *tower)
{
	const char *words[WORDS_MAX + 1] = {"--quiet", "--scene", tower->scene_file};
	unsigned count = 3;
	char angle[32];

	if (simulated_alive(&tower->simulated))
		return 0;
	tower_bench_stop(tower);
	if (!isnan(tower->angle_deg)) {
		snprintf(angle, sizeof(angle), "%.17g", tower->angle_deg);
		words[count++] = "--angle";
		words[count++] = angle;
	}
	for (unsigned i = 0; tower->bench_words != NULL && tower->bench_words[i] != NULL && count < WORDS_MAX;
	     i++)
		words[count++] = tower->bench_words[i];
	if (simulated_start(&tower->simulated, words, tower->link_trouble, sizeof(tower->link_trouble)) != 0)
		return -1;
	snprintf(tower->url, sizeof(tower->url), "%s", tower->simulated.url);
	return tower_bench_control(tower, tower->simulated.control);
}

void tower_bench_stop(struct tower *tower)
{
	if (tower->simulated.folder.path[0] != '\0')
		simulated_stop(&tower->simulated);
	tower->simulated = (struct simulated){0};
	if (tower->control >= 0)
		close(tower->control);
	tower->control = -1;
	tower->simulated_count = 0;
	tower->simulated_faults = 0;
	if (tower->simulating != NULL) {
		job_refuse(tower->simulating, 503, "the simulated tower has ended");
		job_done(tower->simulating);
		tower->simulating = NULL;
	}
}

int tower_bench_scene(struct tower *tower, const struct handover_scene *scene)
{
	size_t length = strlen(scene->text);
	int fd = memfd_create("scene", MFD_CLOEXEC);

	if (fd < 0 || write(fd, scene->text, length) != (ssize_t)length) {
		if (fd >= 0)
			close(fd);
		return DT_E_SYSTEM;
	}
	if (tower->scene_fd >= 0)
		close(tower->scene_fd);
	tower->scene_fd = fd;
	tower->angle_deg = scene->scene.drop_angle_deg;
	snprintf(tower->scene_file, sizeof(tower->scene_file), "/proc/%ld/fd/%d", (long)getpid(), fd);
	return 0;
}

/* ---- its control socket ---- */

int tower_bench_control(struct tower *tower, const char *path)
{
	struct sockaddr_un own = {.sun_family = AF_UNIX};

	tower->control_path = own;
	if (strlen(path) >= sizeof(tower->control_path.sun_path)) {
		snprintf(tower->link_trouble, sizeof(tower->link_trouble),
		         "the control socket's path is longer than %zu characters",
		         sizeof(tower->control_path.sun_path) - 1);
		return -1;
	}
	snprintf(tower->control_path.sun_path, sizeof(tower->control_path.sun_path), "%s", path);
	tower->control = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
	/* with no name given the kernel makes one, for the answers */
	if (tower->control < 0 ||
	    bind(tower->control, (const struct sockaddr *)&own, sizeof(own.sun_family)) != 0) {
		snprintf(tower->link_trouble, sizeof(tower->link_trouble), "control socket: %s",
		         strerror(errno));
		return -1;
	}
	tower->control_due_ms = 0;
	tower->answers_due = 0;
	return 0;
}

static int tower_bench_send_line(const struct tower *tower, const char *line)
{
	ssize_t sent = sendto(tower->control, line, strlen(line), MSG_DONTWAIT | MSG_NOSIGNAL,
	                      (const struct sockaddr *)&tower->control_path, sizeof(tower->control_path));

	return sent < 0 ? -errno : 0;
}

static int ask_faults(struct tower *tower)
{
	int result = tower_bench_send_line(tower, "faults");

	tower->answers_due += result == 0;
	return result;
}

void tower_bench_say(struct tower *tower, struct job *job, const char *line)
{
	int result;

	if (tower->simulating != NULL) {
		job_refuse(job, 409, "the simulated tower is still busy with the last line");
		job_done(job);
		return;
	}
	result = tower->control < 0 ? -ENOTCONN : tower_bench_send_line(tower, line);
	if (result == 0)
		result = ask_faults(tower);
	if (result != 0) {
		job_refuse(job, 503, "the simulated tower's control socket: %s", strerror(-result));
		job_done(job);
		return;
	}
	tower->simulating = job;
	tower->line_refused = false;
	tower->simulating_until_ms = session_now_ms() + ANSWER_MS;
}

static void tower_bench_finish(struct tower *tower)
{
	tower_publish(tower);
	job_done(tower->simulating);
	tower->simulating = NULL;
}

/* "estop=0 door=1 ..." */
static void take_faults(struct tower *tower, char *text)
{
	char *rest = NULL;
	unsigned count = 0;

	tower->simulated_faults = 0;
	for (char *word = strtok_r(text, " \n", &rest); word != NULL && count < TOWER_SIMULATED_MAX;
	     word = strtok_r(NULL, " \n", &rest)) {
		char *equals = strchr(word, '=');

		if (equals == NULL)
			continue;
		*equals = '\0';
		snprintf(tower->simulated_name[count], sizeof(tower->simulated_name[count]), "%s", word);
		tower->simulated_faults |= (uint32_t)(equals[1] == '1') << count;
		count++;
	}
	tower->simulated_count = count;
	if (tower->answers_due > 0)
		tower->answers_due--;
	if (tower->simulating == NULL || tower->answers_due > 0)
		return; /* the line's own answer is still to come */
	if (!tower->line_refused)
		job_answer_json(tower->simulating, cJSON_CreateObject());
	tower_bench_finish(tower);
}

void tower_bench_hear(struct tower *tower)
{
	char text[ANSWER_MAX + 1];
	ssize_t got;

	if (tower->control < 0)
		return;
	while ((got = recv(tower->control, text, ANSWER_MAX, MSG_DONTWAIT)) > 0) {
		text[got] = '\0';
		if (strncmp(text, "error: ", 7) != 0) {
			take_faults(tower, text);
		} else if (tower->simulating != NULL) {
			tower->line_refused = true;
			text[strcspn(text, "\n")] = '\0';
			job_refuse(tower->simulating, 400, "%s", text + 7);
		}
	}
	if (tower->simulating != NULL && session_now_ms() > tower->simulating_until_ms) {
		tower->answers_due = 0;
		job_refuse(tower->simulating, 504, "the simulated tower does not answer");
		tower_bench_finish(tower);
	}
	if (tower->simulating != NULL || session_now_ms() < tower->control_due_ms)
		return;
	tower->control_due_ms = session_now_ms() + ASK_MS;
	tower->answers_due = 0;
	(void)ask_faults(tower);
}
