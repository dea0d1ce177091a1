/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_UNIT_DESK_H
#define DT_TESTS_UNIT_DESK_H
/*
 * The console's archive thread without page and tower: a folder, an archive with drops by hand, what the page
 * asks for and the curves that it gets, taken apart by the words of host/console/README.md. What does not
 * come fails the test.
 */
#include <semaphore.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "host/archive/archive.h"
#include "host/console/job.h"
#include "tests/unit/drop_by_hand.h"

#define DESK_SCENE "common/scenes/geometry-2A.ini"
#define DESK_BARE "common/scenes/geometry-1.ini"

extern char desk_folder[64], desk_message[ARCHIVE_MESSAGE_MAX];
extern struct console desk_console;
extern sem_t desk_answered; /* posted by desk_on_done */

#define AT_THE_DESK(test) cmocka_unit_test_setup_teardown(test, desk_make_folder, desk_remove_folder)
int desk_make_folder(void **state);
int desk_remove_folder(void **state);

void desk_start(void);
void desk_stop(void);
void desk_on_done(struct job *job);

/* Does one job of the page, asked as in "series=one&undecided=1"; what it answers is to be freed. */
struct job desk_ask(void (*run)(struct job *job), const char *path, const char *asked, const char *body);
void desk_expect(int status, void (*run)(struct job *job), const char *path, const char *asked,
                 const char *body);
cJSON *desk_ask_json(void (*run)(struct job *job), const char *path, const char *asked, const char *body);
const char *desk_text(const cJSON *tree, const char *key);
double desk_number(const cJSON *tree, const char *key);

struct archive *desk_open_beside(enum archive_mode mode);

/* ---- a drop ---- */

#define DESK_TRIGGER_S 0.1
#define DESK_PULSE_S 0.003
#define DESK_S2X_G 400.0
#define DESK_S2Y_G 200.0
enum { DESK_TICKS = 300 };

extern struct hand_drop desk_hand;

/* Its frames as a log; the block of that tick of S2 is left out (negative: none). */
void desk_write_hand(const char *path, int lost_tick);

/* An archive with series "one": drop 1 whole, drop 2 without one block, drop 3 interrupted. */
void desk_start_with_drops(void);

/* ---- curves ---- */

struct desk_curves {
	struct job job;
	cJSON *head;
	const unsigned char *at; /* the first channel's samples */
};

struct desk_curve {
	double rate_hz, start_s;
	size_t count;
	float *value; /* to be freed */
};

struct desk_curves desk_ask_curves(void (*run)(struct job *job), const char *path);
void desk_free_curves(struct desk_curves *c);
struct desk_curve desk_curve(const struct desk_curves *c, const char *name);

/* One axis is the drop by hand, but for that tick of S2. */
void desk_check_samples(const struct desk_curves *c, unsigned sensor, int axis, size_t lost_tick);

#endif
