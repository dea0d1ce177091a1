/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/console/options.h"

#include <dirent.h>
#include <errno.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>

#include "host/command/archived.h"
#include "host/base/installed.h"
#include "host/command/command.h"

/* One that is not there yet is waited for; one that can never be is not. */
static bool is_link(const char *url)
{
	return strncmp(url, "unix:", 5) == 0 || strncmp(url, "can:", 4) == 0 ||
	       strncmp(url, "slcan:", 6) == 0;
}

/* What does not go together. */
static int options_check(const struct options *options)
{
	const struct tower_options *tower = &options->tower;

	if (tower->link != NULL && options->given.bench.count > 0)
		return command_usage("serve", "--bench is for the simulated tower, --link for another one");
	if (tower->link == NULL && tower->control != NULL)
		return command_usage("serve", "--control goes with --link");
	if (tower->link != NULL && !is_link(tower->link))
		return command_usage("serve", "--link %.80s: expected unix:PATH, can:IF or slcan:DEV",
		                     tower->link);
	if (!http_is_address(options->http.address))
		return command_usage("serve", "--bind %.80s: expected an address in numbers, like 127.0.0.1",
		                     options->http.address);
	return COMMAND_DONE;
}

static int is_scene(const struct dirent *entry)
{
	const char *ending = strrchr(entry->d_name, '.');

	return ending != NULL && ending != entry->d_name && strcmp(ending, ".ini") == 0;
}

/* scandir, as glibc's glob frees twice when it finds no memory. */
static int find_scenes(struct options *options)
{
	struct option_words *scenes = &options->given.scenes;
	char path[PATH_MAX];
	struct dirent **entry = NULL;
	int count;

	if (scenes->count > 0)
		return COMMAND_DONE;
	count = installed_scene("", path) == 0 ? scandir(path, &entry, is_scene, alphasort) : 0;
	for (int i = 0; i < count && i < SERVE_SCENES_MAX; i++) {
		options->found[i] = installed_scene(entry[i]->d_name, path) == 0 ? strdup(path) : NULL;
		if (options->found[i] != NULL)
			scenes->word[scenes->count++] = options->found[i];
	}
	for (int i = 0; i < count; i++)
		free(entry[i]);
	free(entry);
	if (scenes->count > 0 && (int)scenes->count == count)
		return COMMAND_DONE;
	if (count < 0)
		command_error("%.300s: %s", path, strerror(errno));
	else if (count == 0)
		command_error("no scene given and none installed; use --scene FILE");
	else
		command_error("%.300s: %d scenes, expected memory for them and at most %d", path, count,
		              SERVE_SCENES_MAX);
	return COMMAND_INPUT;
}

int options_read(struct options *options, int argc, char **argv)
{
	struct serve_arguments *given = &options->given;
	int code;

	*options = (struct options){.given = {.address = "127.0.0.1", .port = 8731}};
	code = option_read(&serve_options, given, argc, argv);
	if (code != OPTIONS_READ)
		return code;
	options->tower.link = given->link;
	options->tower.control = given->control;
	options->tower.bench_words = given->bench.word;
	options->http.address = given->address;
	options->http.port = given->port;
	options->work.archive = archived_folder(given->archive);
	options->work.operator_name = archived_operator(given->operator_name);
	options->work.scenes = given->scenes.word;
	code = options_check(options);
	if (code == COMMAND_DONE)
		code = find_scenes(options);
	if (code == COMMAND_DONE &&
	    options->work.operator_name[strspn(options->work.operator_name, " ")] == '\0')
		code = command_usage("serve", "who drops is not known, expected --operator NAME");
	options->tower.scene = given->scenes.word[0];
	return code == COMMAND_DONE ? OPTIONS_READ : code;
}

void options_free(struct options *options)
{
	for (int i = 0; i < SERVE_SCENES_MAX; i++)
		free(options->found[i]);
}
