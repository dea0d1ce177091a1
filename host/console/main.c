/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * droptower-console: the start and end of the threads. `droptower serve` becomes this program.
 */
#include <errno.h>
#include <gsl/gsl_errno.h>
#include <limits.h>
#include <semaphore.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#include "host/command/command.h"
#include "host/command/notify.h"
#include "host/console/auth.h"
#include "host/console/options.h"

enum {
	TICK_MS = 40,      /* 25 Hz */
	FILES_BESIDE = 64, /* descriptors that are no connection */
	SELECT_AGAIN_MS = 1000,
};

struct serve {
	struct console console;
	struct options options;
	char token[AUTH_TOKEN_MAX + 1];
	struct http *server;
	/* a question to the tower's thread, whose answer says that it is alive */
	struct job ping;
	sem_t pong;
	bool pinged;
	/* --series, until it is selected: a tower in motion, or not there yet, does not take it at once */
	struct job select;
	cJSON *select_body;
	sem_t selected;
	bool select_wanted, select_asked;
	int64_t select_due_ms;
};

static volatile sig_atomic_t stops; /* how often we were asked to end */

static void main_on_signal(int number)
{
	(void)number;
	stops = stops + 1;
}

/* Handlers and no mask: what is started inherits a mask, and a simulated tower must be stoppable. */
static void catch_signals(void)
{
	struct sigaction action;

	memset(&action, 0, sizeof(action));
	action.sa_handler = main_on_signal;
	action.sa_flags = SA_RESTART;
	sigemptyset(&action.sa_mask);
	sigaction(SIGINT, &action, NULL);
	sigaction(SIGTERM, &action, NULL);
	signal(SIGPIPE, SIG_IGN);
}

static int make_token(struct serve *serve)
{
	char message[AUTH_MESSAGE_MAX];

	if (serve->options.given.token_file == NULL) {
		auth_make_token(serve->token);
		return COMMAND_DONE;
	}
	if (auth_read_token(serve->options.given.token_file, serve->token, message) == 0)
		return COMMAND_DONE;
	command_error("%s", message);
	return COMMAND_INPUT;
}

/* ---- start ---- */

/* Connections are bounded: no more descriptors than they can need. */
static void allow_connections(void)
{
	struct rlimit limit;
	const rlim_t needed = HTTP_CONNECTIONS + FILES_BESIDE;

	if (getrlimit(RLIMIT_NOFILE, &limit) == 0 && limit.rlim_cur < needed) {
		limit.rlim_cur = limit.rlim_max < needed ? limit.rlim_max : needed;
		(void)setrlimit(RLIMIT_NOFILE, &limit);
	}
}

static int start_work(struct serve *serve)
{
	struct console *console = &serve->console;
	char message[ARCHIVE_MESSAGE_MAX];

	job_queue_init(&console->tower_queue);
	job_queue_init(&console->work_queue);
	console->live = live_create();
	if (console->live == NULL) {
		command_error("no memory");
		return COMMAND_INPUT;
	}
	console->work = work_start(console, &serve->options.work, message);
	if (console->work != NULL)
		return COMMAND_DONE;
	command_error("%s", message);
	return COMMAND_INPUT;
}

static int start_tower(struct serve *serve)
{
	char message[SESSION_MESSAGE_MAX];

	serve->console.tower = tower_start(&serve->console, &serve->options.tower, message);
	if (serve->console.tower != NULL)
		return COMMAND_DONE;
	command_error("%s", message);
	return COMMAND_LINK;
}

static int start_http(struct serve *serve)
{
	char message[HTTP_MESSAGE_MAX];

	serve->options.http.token = serve->token;
	serve->options.http.parts = page_parts;
	serve->options.http.part_count = page_part_count;
	/* The threads from here on step back behind the tower's: a page can wait. */
	errno = 0;
	if (nice(5) == -1 && errno != 0)
		command_error("nice: %s", strerror(errno));
	serve->server = http_start(&serve->console, &serve->options.http, message);
	if (serve->server != NULL)
		return COMMAND_DONE;
	command_error("%s", message);
	return COMMAND_LINK;
}

static void select_answered(struct job *job)
{
	struct serve *serve = job->maker;

	sem_post(&serve->selected);
}

/* As the page would. */
static void ask_select(struct serve *serve)
{
	serve->select = (struct job){.console = &serve->console,
	                             .body = serve->select_body,
	                             .done = select_answered,
	                             .maker = serve};
	serve->select_asked = true;
	tower_select(&serve->select);
}

static void take_select(struct serve *serve)
{
	serve->select_asked = false;
	serve->select_wanted = serve->select.status != 200;
	serve->select_due_ms = session_now_ms() + SELECT_AGAIN_MS;
}

static void tell_refused(const struct serve *serve)
{
	cJSON *answer = cJSON_ParseWithLength(serve->select.answer, serve->select.size);
	const char *why = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(answer, "error"));

	command_error("--series %s: %s", serve->options.given.series, why != NULL ? why : "no answer");
	cJSON_Delete(answer);
}

/* A series that is not there is an error; whatever else is in the way may pass. */
static int main_select_series(struct serve *serve)
{
	int status;

	if (serve->options.given.series == NULL)
		return COMMAND_DONE;
	serve->select_body = cJSON_CreateObject();
	cJSON_AddStringToObject(serve->select_body, "series", serve->options.given.series);
	ask_select(serve);
	while (sem_wait(&serve->selected) != 0)
		continue;
	take_select(serve);
	status = serve->select.status;
	if (status != 200)
		tell_refused(serve);
	free(serve->select.answer);
	return status == 404 || status == 400 ? COMMAND_INPUT : COMMAND_DONE;
}

/* Until it worked, or a page has selected one. */
static void select_again(struct serve *serve)
{
	struct tower_view view;

	if (serve->select_asked) {
		if (sem_trywait(&serve->selected) != 0)
			return;
		take_select(serve);
		free(serve->select.answer);
	}
	if (!serve->select_wanted || session_now_ms() < serve->select_due_ms)
		return;
	tower_look(serve->console.tower, &view);
	serve->select_wanted = view.series[0] == '\0';
	if (serve->select_wanted)
		ask_select(serve);
}

static bool loopback(const char *address)
{
	return strncmp(address, "127.", 4) == 0 || strcmp(address, "::1") == 0;
}

/* For who started it by hand; standard output has the address alone. */
static void tell_what_to_do(const struct serve *serve)
{
	char folder[PATH_MAX];

	fprintf(stderr,
	        "\nThe technician's page is ready%s. Open this address in a browser; Ctrl-C ends it.\n"
	        "Drops are kept in %s\n\n",
	        serve->options.tower.link == NULL ? ", with a simulated tower" : "",
	        realpath(serve->options.work.archive, folder) != NULL ? folder : serve->options.work.archive);
}

/* The token stands behind #, which a browser sends to nobody. */
static void tell_address(const struct serve *serve)
{
	const char *address = serve->options.http.address;
	bool six = strchr(address, ':') != NULL;

	if (!loopback(address))
		command_error(
		        "WARNING: --bind %s: everybody on that network can watch the token go by and then "
		        "drop; nothing is encrypted",
		        address);
	if (strcmp(address, "0.0.0.0") == 0 || strcmp(address, "::") == 0)
		address = six ? "::1" : "127.0.0.1";
	printf(six ? "http://[%s]:%u/#token=%s\n" : "http://%s:%u/#token=%s\n", address,
	       http_port(serve->server), serve->token);
	fflush(stdout);
}

/* ---- while it runs ---- */

static void run_ping(struct job *job)
{
	job_done(job);
}

static void answered(struct job *job)
{
	struct serve *serve = job->maker;

	sem_post(&serve->pong);
}

/* The watchdog is fed as long as the thread that keeps the tower's heartbeat answers. */
static void feed_watchdog(struct serve *serve)
{
	if (serve->pinged && sem_trywait(&serve->pong) != 0)
		return;
	notify_alive();
	serve->ping =
	        (struct job){.console = &serve->console, .run = run_ping, .done = answered, .maker = serve};
	serve->pinged = job_put(&serve->console.tower_queue, &serve->ping) == 0;
}

/* Asked once: when no drop is in motion, or only to be kept. Twice: at once. */
static bool may_end(const struct serve *serve, bool *told)
{
	struct tower_view view;

	if (stops == 0)
		return false;
	tower_look(serve->console.tower, &view);
	if (stops > 1 || view.phase < TOWER_MOVING)
		return true;
	if (!*told)
		command_error("a drop is under way: ends when it is kept; once more to end now");
	*told = true;
	return false;
}

/* The next tick; those that were slept through are left out. */
static void wait_tick(int64_t *next_ms)
{
	int64_t now_ms = session_now_ms();
	struct timespec then;

	*next_ms = *next_ms + TICK_MS > now_ms ? *next_ms + TICK_MS : now_ms;
	then.tv_sec = *next_ms / 1000;
	then.tv_nsec = *next_ms % 1000 * 1000000L;
	clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &then, NULL);
}

static void serve_until_stopped(struct serve *serve)
{
	int64_t next_ms = session_now_ms();
	bool told = false;

	while (!may_end(serve, &told)) {
		wait_tick(&next_ms);
		http_tick(serve->server);
		select_again(serve);
		feed_watchdog(serve);
	}
}

static void main_stop(struct serve *serve)
{
	struct console *console = &serve->console;

	if (console->tower != NULL)
		tower_disarm(console->tower);
	if (serve->server != NULL)
		http_stop(serve->server);
	if (console->tower != NULL)
		tower_stop(console->tower);
	if (console->work != NULL)
		work_stop(console->work);
	if (console->live != NULL) {
		live_destroy(console->live);
		job_queue_destroy(&console->work_queue);
		job_queue_destroy(&console->tower_queue);
	}
	cJSON_Delete(serve->select_body);
	options_free(&serve->options);
}

int main(int argc, char **argv)
{
	static struct serve serve;
	int code = options_read(&serve.options, argc, argv);

	if (code != OPTIONS_READ)
		return code;
	gsl_set_error_handler_off();
	sem_init(&serve.pong, 0, 0);
	sem_init(&serve.selected, 0, 0);
	code = make_token(&serve);
	if (code != COMMAND_DONE)
		return code;
	catch_signals();
	allow_connections();
	code = start_work(&serve);
	if (code == COMMAND_DONE)
		code = start_tower(&serve);
	if (code == COMMAND_DONE)
		code = start_http(&serve);
	if (code == COMMAND_DONE)
		code = main_select_series(&serve);
	if (code == COMMAND_DONE) {
		tell_what_to_do(&serve);
		tell_address(&serve);
		notify("READY=1");
		serve_until_stopped(&serve);
		notify("STOPPING=1");
	}
	main_stop(&serve);
	return code;
}
