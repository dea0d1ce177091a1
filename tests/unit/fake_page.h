/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_TESTS_UNIT_FAKE_PAGE_H
#define DT_TESTS_UNIT_FAKE_PAGE_H
/*
 * A console with its tower and archive threads, an archive in a folder of its own and the fake tower on its
 * bus; asked as the page asks it. What is waited for fails the test when it does not come.
 */
#include <stdbool.h>

#include "host/archive/archive.h"
#include "host/console/job.h"
#include "host/console/tower.h"

enum { FAKE_PAGE_WAIT_MS = 15000 }; /* for what must come; a test that waits this long has failed */

extern char fake_page_directory[64], fake_page_bus[96], fake_page_url[128], fake_page_archive[96];
extern struct console console;

/* Series from other heights, the last without a name; each next one is selected after the one before, on one
 * tower. */
struct fake_page_height {
	const char *series;
	double height_m;
};
extern const struct fake_page_height fake_page_heights[];

/* For cmocka; holding: with a tower that holds a drop when the console comes. */
int fake_page_set_up(void **state);
int fake_page_set_up_holding(void **state);
int fake_page_tear_down(void **state);

/* The console alone. */
void fake_page_open(void);
void fake_page_close(void);

struct fake_page_asked {
	struct job job;
	cJSON *body, *answer;
};

void fake_page_ask(struct fake_page_asked *asked, void (*verb)(struct job *), const char *body);
void fake_page_wait_answer(void);

/* Its HTTP status; the answer's text goes to text. */
int fake_page_take_answer(struct fake_page_asked *asked, char text[512]);

/* All three; must: it is answered with 200. */
int fake_page_say(void (*verb)(struct job *), const char *body, char text[512]);
void fake_page_must(void (*verb)(struct job *), const char *body);

/* The token; what is released with it, after the warning. */
unsigned fake_page_arm(void);
void fake_page_release(unsigned token);

void fake_page_nap(void);

/* Waits until the view is as told. */
struct tower_view fake_page_wait(bool (*as_told)(const struct tower_view *view));

bool fake_page_is_heard(const struct tower_view *view);
bool fake_page_is_idle(const struct tower_view *view);
bool fake_page_is_ready(const struct tower_view *view);
bool fake_page_is_armed(const struct tower_view *view);
bool fake_page_is_moving(const struct tower_view *view);
bool fake_page_is_set_up(const struct tower_view *view);

/* Until the fake tower was told this so often, until the drop's result is there. */
void fake_page_wait_heard(unsigned op, unsigned count);
void fake_page_wait_recorded(const char *drop);

void fake_page_select_box(void);

/* Released and in motion, where it stays. */
void fake_page_begin_to_fall(void);

/* What the archive holds once the console has ended: how many drops, and the last of them. */
struct fake_page_found {
	unsigned count;
	char state[32], note[ARCHIVE_TEXT_MAX], raw[200];
};
struct fake_page_found fake_page_archived(void);

#endif
