/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/console/options.h"

#include <getopt.h>
#include <string.h>

#include "host/command/archived.h"
#include "host/command/beside.h"
#include "host/command/command.h"

enum {
	OPTION_LINK = 256,
	OPTION_CONTROL,
	OPTION_ARCHIVE,
	OPTION_SERIES,
	OPTION_OPERATOR,
	OPTION_SCENE,
	OPTION_BIND,
	OPTION_PORT,
	OPTION_TOKEN_FILE,
	OPTION_BENCH,
};

static const struct option long_options[] = {
        {"link", required_argument, NULL, OPTION_LINK},
        {"control", required_argument, NULL, OPTION_CONTROL},
        {"archive", required_argument, NULL, OPTION_ARCHIVE},
        {"series", required_argument, NULL, OPTION_SERIES},
        {"operator", required_argument, NULL, OPTION_OPERATOR},
        {"scene", required_argument, NULL, OPTION_SCENE},
        {"bind", required_argument, NULL, OPTION_BIND},
        {"port", required_argument, NULL, OPTION_PORT},
        {"token-file", required_argument, NULL, OPTION_TOKEN_FILE},
        {"bench", required_argument, NULL, OPTION_BENCH},
        {0},
};

static int add_word(const char *option, const char **words, int *count, int max)
{
	if (*count == max)
		return command_usage("serve", "more than %d %s", max, option);
	words[(*count)++] = optarg;
	return COMMAND_DONE;
}

static int take_port(struct options *options)
{
	double port;
	int code = command_number("serve", "port", optarg, 0, 65535, &port);

	if (code == COMMAND_DONE)
		options->http.port = (unsigned)port;
	return code;
}

static int take(struct options *options, int option, const char *word)
{
	switch (option) {
	case OPTION_LINK:
		options->tower.link = optarg;
		return COMMAND_DONE;
	case OPTION_CONTROL:
		options->tower.control = optarg;
		return COMMAND_DONE;
	case OPTION_ARCHIVE:
		options->work.archive = optarg;
		return COMMAND_DONE;
	case OPTION_SERIES:
		options->series = optarg;
		return COMMAND_DONE;
	case OPTION_OPERATOR:
		options->work.operator_name = optarg;
		return COMMAND_DONE;
	case OPTION_BIND:
		options->http.address = optarg;
		return COMMAND_DONE;
	case OPTION_TOKEN_FILE:
		options->token_file = optarg;
		return COMMAND_DONE;
	case OPTION_PORT:
		return take_port(options);
	case OPTION_SCENE:
		return add_word("--scene", options->scenes, &options->scene_count, OPTIONS_SCENES_MAX);
	case OPTION_BENCH:
		return add_word("--bench", options->bench_words, &options->bench_word_count,
		                OPTIONS_BENCH_WORDS_MAX);
	default:
		return command_option("serve", word);
	}
}

/* One that is not there yet is waited for; one that can never be is not. */
static bool is_link(const char *url)
{
	return strncmp(url, "unix:", 5) == 0 || strncmp(url, "can:", 4) == 0 ||
	       strncmp(url, "slcan:", 6) == 0;
}

/* What does not go together. */
static int check(const struct options *options)
{
	const struct tower_options *tower = &options->tower;

	if (tower->link != NULL && options->bench_word_count > 0)
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

static int find_scenes(struct options *options)
{
	char pattern[PATH_MAX];

	if (options->scene_count > 0)
		return COMMAND_DONE;
	if (beside_scene("*.ini", pattern) != 0 || glob(pattern, 0, NULL, &options->found) != 0) {
		command_error("no scenes came along; --scene FILE names them");
		return COMMAND_INPUT;
	}
	for (size_t i = 0; i < options->found.gl_pathc && options->scene_count < OPTIONS_SCENES_MAX; i++)
		options->scenes[options->scene_count++] = options->found.gl_pathv[i];
	return COMMAND_DONE;
}

int options_read(struct options *options, int argc, char **argv)
{
	int option, code = COMMAND_DONE;

	*options = (struct options){.http = {.address = "127.0.0.1", .port = 8731}};
	opterr = 0;
	while (code == COMMAND_DONE && (option = getopt_long(argc, argv, "", long_options, NULL)) != -1)
		code = take(options, option, argv[optind - 1]);
	if (code == COMMAND_DONE && optind != argc)
		code = command_usage("serve", "'%s' is too much", argv[optind]);
	if (code == COMMAND_DONE)
		code = check(options);
	if (code == COMMAND_DONE)
		code = find_scenes(options);
	options->work.archive = archived_folder(options->work.archive);
	options->work.operator_name = archived_operator(options->work.operator_name);
	if (code == COMMAND_DONE &&
	    options->work.operator_name[strspn(options->work.operator_name, " ")] == '\0')
		code = command_usage("serve", "who drops is not known, expected --operator NAME");
	options->work.scenes = options->scenes;
	options->tower.scene = options->scenes[0];
	options->tower.bench_words = options->bench_words;
	return code;
}

void options_free(struct options *options)
{
	globfree(&options->found);
}
