/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_CONSOLE_TOWER_PRIVATE_H
#define DT_HOST_CONSOLE_TOWER_PRIVATE_H
/*
 * What the files of the tower share: tower.c has the thread, the link and the view, tower_verbs.c what the
 * operator asks for, tower_refuse.c why not, tower_drop.c the drop from its ARM to its hand-over,
 * tower_bench.c what there is only of a simulated tower. Everything below runs on the tower's thread unless
 * it says otherwise.
 */
#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>
#include <sys/un.h>

#include "host/session/simulated.h"
#include "host/console/job.h"
#include "host/console/handover.h"
#include "host/console/live.h"
#include "host/console/tower.h"

struct tower {
	/* since the start */
	struct console *console;
	char url[256];
	const char *const *bench_words;
	bool own;          /* a simulated tower of our own */
	bool is_simulated; /* that, or one whose control socket we were given */
	pthread_t thread;
	sem_t started; /* the thread is at work, or has failed to begin */
	bool failed;

	/* any thread's */
	atomic_bool stopping;
	atomic_uint aborts; /* asked for */
	pthread_mutex_t lock;
	struct tower_view view;

	/* the link */
	struct session *session; /* NULL: not open */
	int64_t open_due_ms;
	char link_trouble[SESSION_MESSAGE_MAX];
	unsigned aborted; /* aborts that were sent */
	int abort_result; /* of the last one */
	unsigned wanted;  /* what is under way is given up when aborts is beyond this */

	/* set-up */
	char series[ARCHIVE_NAME_MAX + 1];
	struct scene scene;
	bool setup_due; /* the scene is to be written */
	int64_t setup_due_ms;
	char setup_trouble[SESSION_MESSAGE_MAX];

	/* the drop under way */
	enum tower_phase phase;
	struct handover_drop *drop; /* NULL: none, or work has it */
	const char *origin;         /* of a drop that comes without one */
	struct link *log;
	char drop_name[ARCHIVE_NAME_MAX + 16];
	int64_t phase_ms;       /* since when */
	int64_t rest_ms;        /* since when it is at rest; 0: it is not */
	uint64_t rest_statuses; /* and how many had been heard then */
	int64_t armed_until_ms; /* 0: not armed */
	uint8_t fault;          /* seen in it */
	bool abort_moving;      /* the operator aborted it after its release */
	char drop_trouble[ARCHIVE_TEXT_MAX];

	/* the simulated tower */
	struct simulated simulated; /* our own: what it is called with ... */
	char scene_file[4096];
	int scene_fd;     /* ... the file, when it is none on disk, or -1 */
	double angle_deg; /* NAN: the scene's */
	int control;      /* socket; -1: a real tower */
	struct sockaddr_un control_path;
	int64_t control_due_ms; /* to be asked how things are */
	struct job *simulating; /* waits for the bench's answer */
	int64_t simulating_until_ms;
	bool line_refused;    /* its */
	unsigned answers_due; /* to "faults" */
	unsigned simulated_count;
	char simulated_name[TOWER_SIMULATED_MAX][24];
	uint32_t simulated_faults;
};

/* ---- tower.c ---- */

/* Closes the link; it is opened again after delay_ms. */
void tower_link_close(struct tower *tower, int delay_ms);

/* Puts what is known where others look. */
void tower_publish(struct tower *tower);

/* Writes the scene into the tower when that is due and can be. 0 or DT_E_*, then setup_trouble says why; 0
 * too when it cannot be yet. */
int tower_set_up(struct tower *tower);

/* ---- tower_verbs.c ---- */

/* Sends an ABORT that was asked for and is not sent yet. */
void tower_obey_abort(struct tower *tower);

/* ---- tower_refuse.c ---- */

/* An ABORT came after the first so many. Any thread. */
bool tower_is_void(struct tower *tower, unsigned aborted);

/* That, or the thread ends: job is refused. */
bool tower_refuse_void(struct job *job, unsigned aborted);

/* A command failed with result. */
void tower_refuse_result(struct job *job, int result);

/* What is published speaks for arming, for selecting a series; else job is refused. Any thread. */
bool tower_check_arm(struct job *job);
bool tower_check_select(struct job *job);

/* ---- tower_drop.c ---- */

/* NULL without memory. */
struct handover_drop *tower_drop_new(const struct tower *tower, const char *series);

/* Takes drop over and opens its log. False with drop_trouble. */
bool tower_drop_begin(struct tower *tower, struct handover_drop *drop);

/* The tower has taken ARM, RELEASE. */
void tower_drop_armed(struct tower *tower);
void tower_drop_released(struct tower *tower);

/* Takes drop over: nothing came of it, or nothing that was collected (released). */
void tower_drop_discard(struct tower *tower, struct handover_drop *drop);

/* What became of the one that was to be kept. Takes it over. */
void tower_drop_saved(struct tower *tower, struct handover_drop *drop);

/* Nothing comes of it, or nothing more. */
void tower_drop_end(struct tower *tower);

/* The log could not be written. */
void tower_drop_log_failed(struct tower *tower);

/* The thread ends: aborts what is armed. */
void tower_drop_leave(struct tower *tower);

/* Follows the tower's state; collects and hands over. */
void tower_drop_follow(struct tower *tower);

/* ---- tower_bench.c ---- */

/* Starts a simulated tower of our own from scene_file and angle_deg, unless it runs. 0, or -1 with
 * link_trouble.
 */
int tower_bench_start(struct tower *tower);
void tower_bench_stop(struct tower *tower);

/* From now on it is started with this scene. 0 or DT_E_SYSTEM. */
int tower_bench_scene(struct tower *tower, const struct handover_scene *scene);

/* The control socket of the bench is at path. 0, or -1 with link_trouble. */
int tower_bench_control(struct tower *tower, const char *path);

/* Sends line and asks which faults are on; job is answered when the bench has answered. */
void tower_bench_say(struct tower *tower, struct job *job, const char *line);

/* Takes the bench's answers. */
void tower_bench_hear(struct tower *tower);

#endif
