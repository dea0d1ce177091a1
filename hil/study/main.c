/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * droptower-study ARCHIVE OUT: the study's tables and figures from the drops of an archive; README.md.
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <gsl/gsl_errno.h>

#include "hil/study/sheet.h"
#include "hil/study/study.h"

enum { AGREES = 0, DISAGREES = 1, USAGE = 2, UNUSABLE = 3 };

static FILE *create(const char *folder, const char *name, const char *ending)
{
	char path[STUDY_PATH_MAX];
	FILE *out;

	snprintf(path, sizeof(path), "%.4000s/%s%s", folder, name, ending);
	out = fopen(path, "w");
	if (out == NULL)
		fprintf(stderr, "droptower-study: %s: %s\n", path, strerror(errno));
	return out;
}

static int main_finish(FILE *out, const char *folder, const char *name)
{
	bool failed = ferror(out) != 0;

	if (fclose(out) == 0 && !failed)
		return 0;
	fprintf(stderr, "droptower-study: %s/%s could not be written\n", folder, name);
	return DT_E_SYSTEM;
}

static int write_figure(const struct study *study, enum study_figure figure, const char *folder,
                        struct sheet *sheet)
{
	char message[STUDY_MESSAGE_MAX], *svg;
	int status = study_draw(study, figure, &svg, message);
	FILE *out;

	if (status != 0) {
		fprintf(stderr, "droptower-study: %s: %s\n", study_figure_name[figure], message);
		return status;
	}
	out = create(folder, study_figure_name[figure], ".svg");
	status = DT_E_SYSTEM;
	if (out != NULL) {
		fputs(svg, out);
		status = main_finish(out, folder, study_figure_name[figure]);
	}
	if (figure != STUDY_FIGURE_ALL)
		sheet_picture(sheet, study_figure_title[figure], study_figure_text[figure], svg);
	free(svg);
	return status;
}

static int main_write_csv(const struct study *study, const char *folder)
{
	FILE *out = create(folder, "study", ".csv");

	if (out == NULL)
		return DT_E_SYSTEM;
	study_write_csv(study, out);
	return main_finish(out, folder, "study.csv");
}

/* Text to stdout, page and pictures into the folder. */
static int main_tell(const struct study *study, const char *folder)
{
	struct sheet sheet = {.text = stdout, .page = create(folder, "study", ".html")};
	int status = sheet.page != NULL ? 0 : DT_E_SYSTEM;
	bool agrees;

	if (status != 0)
		return UNUSABLE;
	sheet_begin(&sheet, "Drop impact of portable products: the study, again, on the simulated tower");
	study_introduce(study, &sheet);
	for (int f = 0; f < STUDY_FIGURES && status == 0; f++)
		status = write_figure(study, (enum study_figure)f, folder, &sheet);
	agrees = study_tell(study, &sheet);
	sheet_end(&sheet);
	if (main_finish(sheet.page, folder, "study.html") != 0 || status != 0 ||
	    main_write_csv(study, folder) != 0)
		return UNUSABLE;
	printf("\npage      %s/study.html\npictures  %s/figure-10.svg and so on\ntable     %s/study.csv\n",
	       folder, folder, folder);
	return agrees ? AGREES : DISAGREES;
}

int main(int argc, char **argv)
{
	static struct study study;
	char message[STUDY_MESSAGE_MAX];
	int status;

	if (argc != 3) {
		fputs("usage: droptower-study ARCHIVE OUT\n", stderr);
		return USAGE;
	}
	gsl_set_error_handler_off();
	status = study_open(&study, message);
	if (status == 0)
		status = study_read(&study, argv[1], message);
	if (status != 0) {
		fprintf(stderr, "droptower-study: %s\n", message);
		return UNUSABLE;
	}
	return main_tell(&study, argv[2]);
}
