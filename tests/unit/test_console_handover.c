/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * What the tower's thread hands to the archive's: drops, and the series' scene.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "host/console/handover.h"
#include "host/console/work.h"
#include "host/record/read.h"
#include "tests/unit/desk.h"
#include "tests/unit/near.h"

static char saved_trouble[ARCHIVE_MESSAGE_MAX];
static bool saved_on_disk;

static struct handover_drop *new_drop(const char *series)
{
	struct handover_drop *drop = calloc(1, sizeof(*drop));

	assert_non_null(drop);
	record_init(&drop->record);
	drop->recording.lock = -1;
	drop->simulated = true;
	snprintf(drop->series, sizeof(drop->series), "%s", series);
	return drop;
}

static void and_then(struct job *job)
{
	job_answer_json(job, cJSON_CreateObject());
	job_done(job);
}

/* The job as it comes to the tower; NULL when it was answered with that status instead. */
static struct job *hand_over(struct job *job, int status)
{
	job->console = &desk_console;
	job->done = desk_on_done;
	assert_int_equal(job_put(&desk_console.work_queue, job), 0);
	if (status == 0) {
		struct job *come = job_take(&desk_console.tower_queue, 5000);

		assert_ptr_equal(come, job);
		assert_int_equal(come->message, JOB_RUN);
		return come;
	}
	while (sem_wait(&desk_answered) != 0)
		continue;
	assert_int_equal(job->status, status);
	free(job->answer);
	return NULL;
}

static struct handover_drop *begin(const char *series)
{
	struct job job = {.run = and_then, .message = JOB_BEGIN, .payload = new_drop(series)};

	return hand_over(&job, 0)->payload;
}

static void read_hand(struct record *record, int lost_tick)
{
	char path[100];

	snprintf(path, sizeof(path), "%s/by-hand.log", desk_folder);
	desk_write_hand(path, lost_tick);
	assert_int_equal(read_record(record, path, NULL, desk_message), 0);
	assert_int_equal(unlink(path), 0);
}

/* What the tower's thread sends of a drop. */
static void give(struct handover_drop *drop, enum job_message sent)
{
	drop->way = (struct job){.console = &desk_console, .message = sent, .maker = drop};
	assert_int_equal(job_put_first(&desk_console.work_queue, &drop->way), 0);
}

static void select_series(const char *series)
{
	struct handover_scene *scene = calloc(1, sizeof(*scene));

	assert_non_null(scene);
	strcpy(scene->series, series);
	scene->way = (struct job){.console = &desk_console, .message = JOB_SELECTED, .maker = scene};
	assert_int_equal(job_put_first(&desk_console.work_queue, &scene->way), 0);
}

static void wait_saved(const char *drop)
{
	struct job *come = job_take(&desk_console.tower_queue, 5000);
	struct handover_drop *saved;
	char name[128] = "";

	assert_non_null(come);
	assert_int_equal(come->message, JOB_SAVED);
	saved = come->maker;
	strcpy(saved_trouble, saved->trouble);
	saved_on_disk = saved->on_disk;
	if (saved->trouble[0] == '\0')
		snprintf(name, sizeof(name), "%s/%u", saved->recording.series, saved->recording.number);
	free(saved);
	assert_string_equal(name, drop);
}

static bool is_simulated(const char *series, int number)
{
	char words[64];
	cJSON *tree;
	bool yes;

	snprintf(words, sizeof(words), "series=%s&number=%d", series, number);
	tree = desk_ask_json(work_drops, NULL, words, NULL);
	assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(tree, "drops")), 1);
	yes = cJSON_IsTrue(
	        cJSON_GetObjectItem(cJSON_GetArrayItem(cJSON_GetObjectItem(tree, "drops"), 0), "simulated"));
	cJSON_Delete(tree);
	return yes;
}

static void test_a_drop_is_kept_and_analysed(void **state)
{
	struct handover_drop *drop;
	struct work_view view;
	cJSON *tree;

	(void)state;
	desk_start_with_drops();
	select_series("one");
	drop = begin("one");
	assert_int_equal(drop->recording.number, 4);
	desk_write_hand(drop->recording.log, -1);
	read_hand(&drop->record, -1);
	strcpy(drop->note, "a note");
	give(drop, JOB_KEEP);
	wait_saved("one/4");
	assert_string_equal(saved_trouble, "");
	tree = desk_ask_json(work_result, "one/4", NULL, NULL);
	cJSON_Delete(tree);
	tree = desk_ask_json(work_drops, NULL, "series=one", NULL);
	assert_string_equal(desk_text(cJSON_GetArrayItem(cJSON_GetObjectItem(tree, "drops"), 3), "note"),
	                    "a note");
	assert_near(desk_number(cJSON_GetArrayItem(cJSON_GetObjectItem(tree, "drops"), 3), "s2_x_g"),
	            DESK_S2X_G, 2);
	cJSON_Delete(tree);
	assert_false(is_simulated("one", 1));
	assert_true(is_simulated("one", 4));
	work_look(desk_console.work, &view);
	assert_string_equal(view.result, "one/4");
	assert_string_equal(view.trouble, "");
	assert_string_equal(view.series.name, "one");
	assert_string_equal(view.series.campaign, "trial");
	assert_int_equal(view.series.recorded, 3);
	assert_int_equal(view.series.partial, 1);
	assert_true(view.disk_free_bytes > 0);
}

static void wait_for_all(struct job *job)
{
	while (sem_wait(job->maker) != 0)
		continue;
	job_done(job);
}

static unsigned counted;
static bool saved_first; /* before the first that was counted */

static void count(struct job *job)
{
	if (counted++ == 0) {
		pthread_mutex_lock(&desk_console.tower_queue.lock);
		saved_first = desk_console.tower_queue.count == 1;
		pthread_mutex_unlock(&desk_console.tower_queue.lock);
	}
	job_done(job);
}

/* Whatever the page has asked for, and however much. */
static void test_a_drop_goes_first(void **state)
{
	static struct job waiting[1000];
	struct handover_drop *drop = new_drop("one");
	sem_t all;
	struct job first = {
	        .console = &desk_console, .run = wait_for_all, .done = desk_on_done, .maker = &all};
	unsigned put = 0;

	(void)state;
	desk_start_with_drops();
	sem_init(&all, 0, 0);
	counted = 0;
	assert_int_equal(job_put(&desk_console.work_queue, &first), 0);
	do
		waiting[put] = (struct job){.console = &desk_console, .run = count, .done = desk_on_done};
	while (job_put(&desk_console.work_queue, &waiting[put]) == 0 && ++put < 1000);
	assert_in_range(put, 10, 999);
	read_hand(&drop->record, -1);
	give(drop, JOB_KEEP);
	sem_post(&all);
	for (unsigned i = 0; i <= put; i++)
		while (sem_wait(&desk_answered) != 0)
			continue;
	wait_saved("one/4");
	assert_true(saved_first);
	assert_int_equal(counted, put);
	sem_destroy(&all);
}

static unsigned frames_in(const char *log)
{
	FILE *in = fopen(log, "r");
	unsigned count = 0;
	int c;

	assert_non_null(in);
	while ((c = fgetc(in)) != EOF)
		count += c == '\n';
	fclose(in);
	return count;
}

/* A drop from a tower that fell behind, and a log that a full disk has left with holes. */
static void test_a_log_that_lacks_frames_is_written_again(void **state)
{
	char log[ARCHIVE_PATH_MAX];
	struct handover_drop *drop;
	struct desk_curves c;

	(void)state;
	desk_start_with_drops();
	drop = new_drop("one");
	read_hand(&drop->record, -1);
	give(drop, JOB_KEEP);
	wait_saved("one/4");
	assert_true(is_simulated("one", 4));
	drop = begin("one");
	strcpy(log, drop->recording.log);
	desk_write_hand(log, 150);
	assert_int_equal(frames_in(log), 2 * DESK_TICKS);
	read_hand(&drop->record, -1);
	give(drop, JOB_KEEP);
	wait_saved("one/5");
	assert_int_equal(frames_in(log), 2 * DESK_TICKS + 1); /* nothing is left of what was there */
	drop = begin("one");
	desk_write_hand(drop->recording.log, 150);
	read_hand(&drop->record, 150);
	give(drop, JOB_KEEP);
	wait_saved("one/6");
	for (int i = 4; i <= 6; i++) {
		char name[16];

		snprintf(name, sizeof(name), "one/%d", i);
		c = desk_ask_curves(work_trace, name);
		desk_check_samples(&c, 2, 0, i == 6 ? 150 : DESK_TICKS);
		desk_free_curves(&c);
	}
}

static void test_what_the_archive_does_not_take_is_not_lost(void **state)
{
	struct handover_drop *drop;
	struct work_view view;
	struct record record, expected;
	char path[200] = "", *at;

	(void)state;
	desk_start_with_drops();
	drop = new_drop("nowhere");
	read_hand(&drop->record, -1);
	read_hand(&expected, -1);
	give(drop, JOB_KEEP);
	wait_saved("");
	work_look(desk_console.work, &view);
	assert_string_equal(view.trouble, saved_trouble);
	assert_non_null(strstr(saved_trouble, "no series 'nowhere'"));
	assert_true(saved_on_disk);
	at = strstr(saved_trouble, "the drop is in ");
	assert_non_null(at);
	snprintf(path, sizeof(path), "%.*s", (int)strcspn(at + 15, ","), at + 15);
	assert_non_null(strstr(path, desk_folder));
	assert_int_equal(read_record(&record, path, NULL, desk_message), 0);
	hand_check_equal(&record, &expected);
	record_free(&record);
	record_free(&expected);
	drop = begin("one");
	read_hand(&drop->record, -1);
	give(drop, JOB_KEEP);
	wait_saved("one/4");
	work_look(desk_console.work, &view);
	assert_string_equal(view.trouble, "");
}

static void test_a_drop_that_did_not_come(void **state)
{
	struct job refused = {.run = and_then, .message = JOB_BEGIN};
	struct handover_drop *drop;
	cJSON *tree, *drops;

	(void)state;
	desk_start_with_drops();
	give(begin("one"), JOB_DISCARD);
	drop = begin("one");
	assert_int_equal(drop->recording.number, 4);
	drop->released = true;
	strcpy(drop->note, "nothing was heard of it");
	give(drop, JOB_DISCARD);
	give(new_drop("one"), JOB_DISCARD);
	tree = desk_ask_json(work_drops, NULL, "series=one", NULL);
	drops = cJSON_GetObjectItem(tree, "drops");
	assert_int_equal(cJSON_GetArraySize(drops), 4);
	assert_string_equal(desk_text(cJSON_GetArrayItem(drops, 3), "state"), "interrupted");
	assert_string_equal(desk_text(cJSON_GetArrayItem(drops, 3), "note"), "nothing was heard of it");
	cJSON_Delete(tree);
	refused.payload = new_drop("two");
	assert_null(hand_over(&refused, 404));
}

static void test_the_scene_for_the_tower(void **state)
{
	struct handover_scene *wanted = calloc(1, sizeof(*wanted));
	struct job job = {.run = and_then, .message = JOB_SCENE, .payload = wanted};

	(void)state;
	desk_start_with_drops();
	assert_non_null(wanted);
	strcpy(wanted->series, "one");
	hand_over(&job, 0);
	assert_string_equal(wanted->scene.name, "geometry-2A");
	assert_near(wanted->scene.drop_angle_deg, 27, 0);
	assert_non_null(strstr(wanted->text, "height_m = 0.894"));
	free(wanted->text);
	strcpy(wanted->series, "two");
	job.message = JOB_SCENE;
	assert_null(hand_over(&job, 404));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        AT_THE_DESK(test_a_drop_is_kept_and_analysed),
	        AT_THE_DESK(test_a_drop_goes_first),
	        AT_THE_DESK(test_a_log_that_lacks_frames_is_written_again),
	        AT_THE_DESK(test_what_the_archive_does_not_take_is_not_lost),
	        AT_THE_DESK(test_a_drop_that_did_not_come),
	        AT_THE_DESK(test_the_scene_for_the_tower),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
