/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Photos: which bytes are a whole picture, what is taken out of them, and whose photo it is. Pictures are put
 * together here from parts, by the standards; a PNG's checksums are zlib's.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <cmocka.h>

#include "host/base/durable.h"
#include "host/base/image.h"
#include "host/record/digest.h"
#include "tests/unit/archive_trial.h"

struct bytes {
	uint8_t at[512];
	size_t size;
};

#define ADD(to, ...) add(to, (const uint8_t[]){__VA_ARGS__}, sizeof((const uint8_t[]){__VA_ARGS__}))

static void add(struct bytes *to, const uint8_t *bytes, size_t size)
{
	memcpy(to->at + to->size, bytes, size);
	to->size += size;
}

static void add_text(struct bytes *to, const char *text)
{
	add(to, (const uint8_t *)text, strlen(text));
}

/* ---- JPEG ---- */

/* Exif, little endian: the turn and, behind it, a place. */
static void add_exif(struct bytes *to, uint8_t turn)
{
	ADD(to, 0xFF, 0xE1, 0, 8 + 8 + 2 + 24 + 4, 'E', 'x', 'i', 'f', 0, 0, 'I', 'I', 42, 0, 8, 0, 0, 0);
	ADD(to, 2, 0, 0x12, 0x01, 3, 0, 1, 0, 0, 0, turn, 0, 0, 0);            /* orientation */
	ADD(to, 0x25, 0x88, 4, 0, 1, 0, 0, 0, 'G', 'P', 'S', '!', 0, 0, 0, 0); /* GPS */
}

/* What stays of it, by Exif's big endian. */
static void add_turn(struct bytes *to, uint8_t turn)
{
	ADD(to, 0xFF, 0xE1, 0, 34, 'E', 'x', 'i', 'f', 0, 0, 'M', 'M', 0, 42, 0, 0, 0, 8);
	ADD(to, 0, 1, 0x01, 0x12, 0, 3, 0, 0, 0, 1, 0, turn, 0, 0, 0, 0, 0, 0);
}

static void add_jfif(struct bytes *to)
{
	ADD(to, 0xFF, 0xE0, 0, 16, 'J', 'F', 'I', 'F', 0, 1, 1, 0, 0, 1, 0, 1, 0, 0);
}

/* 3 wide, 5 high; two scans, with a stuffed and a restart marker between them, and filled up before the end.
 */
static void add_picture(struct bytes *to, uint8_t kind)
{
	ADD(to, 0xFF, 0xDB, 0, 5, 0, 1, 2);
	ADD(to, 0xFF, kind, 0, 11, 8, 0, 5, 0, 3, 1, 1, 0x11, 0);
	ADD(to, 0xFF, 0xC4, 0, 4, 0, 7);
	ADD(to, 0xFF, 0xDA, 0, 8, 1, 1, 0, 0, 63, 0, 0x12, 0xFF, 0, 0x34, 0xFF, 0xD0, 0x56);
	ADD(to, 0xFF, 0xDA, 0, 8, 1, 1, 0, 0, 63, 0, 0x78);
	ADD(to, 0xFF, 0xD9);
}

static struct bytes phone_jpeg(uint8_t kind, uint8_t turn)
{
	struct bytes b = {.size = 0};

	ADD(&b, 0xFF, 0xD8);
	add_jfif(&b);
	ADD(&b, 0xFF, 0xE0, 0, 10, 'J', 'F', 'X', 'X', 0, 1, 2, 3); /* a small picture of before it was cut */
	add_exif(&b, turn);
	ADD(&b, 0xFF, 0xE1, 0, 6, 'h', 't', 't', 'p'); /* XMP */
	ADD(&b, 0xFF, 0xE2, 0, 6, 'M', 'P', 'F', 0);
	ADD(&b, 0xFF, 0xED, 0, 5, '8', 'B', 'I');
	ADD(&b, 0xFF, 0xEE, 0, 14, 'A', 'd', 'o', 'b', 'e', 0, 100, 0, 0, 0, 0, 1);
	ADD(&b, 0xFF, 0xFE, 0, 5, 'A', 'n', 'n');
	add_picture(&b, kind);
	return b;
}

static struct bytes plain_jpeg(uint8_t kind, uint8_t turn)
{
	struct bytes b = {.size = 0};

	ADD(&b, 0xFF, 0xD8);
	add_jfif(&b);
	if (turn > 1)
		add_turn(&b, turn);
	ADD(&b, 0xFF, 0xEE, 0, 14, 'A', 'd', 'o', 'b', 'e', 0, 100, 0, 0, 0, 0, 1);
	add_picture(&b, kind);
	return b;
}

/* Of a copy whose end is the memory's, so that a sanitizer sees who reads behind it. */
static int strip(struct bytes *b, struct image *image, const char **why)
{
	uint8_t *copy = malloc(b->size > 0 ? b->size : 1);
	int result;

	memcpy(copy, b->at, b->size);
	result = image_strip(copy, &b->size, image, why);
	if (result == 0)
		memcpy(b->at, copy, b->size);
	free(copy);
	return result;
}

static void becomes(struct bytes from, struct bytes wanted)
{
	struct image image;
	const char *why;

	assert_int_equal(strip(&from, &image, &why), 0);
	assert_int_equal(from.size, wanted.size);
	assert_memory_equal(from.at, wanted.at, wanted.size);
}

static void refused(struct bytes b, const char *wanted)
{
	struct image image;
	const char *why;

	assert_int_equal(strip(&b, &image, &why), DT_E_FORMAT);
	if (wanted != NULL)
		assert_string_equal(why, wanted);
}

static void test_a_phones_jpeg_tells_the_picture_alone(void **state)
{
	struct bytes behind = phone_jpeg(0xC0, 6);
	struct image image;
	const char *why;

	(void)state;
	becomes(phone_jpeg(0xC0, 6), plain_jpeg(0xC0, 6));
	becomes(phone_jpeg(0xC2, 8), plain_jpeg(0xC2, 8));
	becomes(phone_jpeg(0xC0, 1), plain_jpeg(0xC0, 1));
	becomes(phone_jpeg(0xC0, 9), plain_jpeg(0xC0, 1)); /* no such turn */
	becomes(plain_jpeg(0xC1, 3), plain_jpeg(0xC1, 3));
	add_text(&behind, "ftyp a film");
	becomes(behind, plain_jpeg(0xC0, 6));
	assert_int_equal(strip(&behind, &image, &why), 0);
	assert_int_equal(image.width, 3);
	assert_int_equal(image.height, 5);
	assert_string_equal(image.ending, ".jpg");
	assert_string_equal(image.type, "image/jpeg");
}

/* ---- PNG ---- */

static const uint8_t signature[] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'};
static const uint8_t head[] = {0, 0, 0, 0x0d, 'I', 'H', 'D', 'R', 0,    0,    0,    2,   0,
                               0, 0, 1, 8,    2,   0,   0,   0,   0x7b, 0x40, 0xe8, 0xdd};
static const uint8_t author[] = {0,   0,   0,   0x0a, 't', 'E', 'X', 't',  'A',  'u',  't',
                                 'h', 'o', 'r', 0,    'A', 'n', 'n', 0xf7, 0xc5, 0xfe, 0xef};
static const uint8_t place[] = {0, 0, 0, 4, 'e', 'X', 'I', 'f', 'M', 'M', 0, '*', 0x19, 0xb1, 0x58, 0x8a};
static const uint8_t scale[] = {0,    0, 0, 9,    'p',  'H', 'Y', 's',  0,    0,   0x0b,
                                0x13, 0, 0, 0x0b, 0x13, 1,   0,   0x9a, 0x9c, 0x18};
static const uint8_t data[] = {0,    0,    0,    0x0d, 'I',  'D',  'A',  'T',  0x78, 0x9c, 0x63, 0xf8, 0xcf,
                               0x00, 0x04, 0xff, 0x01, 0x07, 0x00, 0x01, 0xff, 0xe2, 0x23, 0x9e, 0x59};
static const uint8_t end[] = {0, 0, 0, 0, 'I', 'E', 'N', 'D', 0xae, 0x42, 0x60, 0x82};

static struct bytes phone_png(bool told)
{
	struct bytes b = {.size = 0};

	add(&b, signature, sizeof(signature));
	add(&b, head, sizeof(head));
	if (told) {
		add(&b, author, sizeof(author));
		add(&b, place, sizeof(place));
	}
	add(&b, scale, sizeof(scale));
	add(&b, data, sizeof(data));
	add(&b, end, sizeof(end));
	if (told)
		add_text(&b, "more");
	return b;
}

static void test_a_png_tells_the_picture_alone(void **state)
{
	struct bytes b = phone_png(true), damaged = phone_png(false), empty = {.size = 0};

	(void)state;
	becomes(b, phone_png(false));
	damaged.at[45] ^= 1;
	refused(damaged, "damaged");
	add(&empty, signature, sizeof(signature));
	add(&empty, head, sizeof(head));
	add(&empty, end, sizeof(end));
	refused(empty, "no picture in it");
}

static void test_what_is_no_whole_picture_is_refused(void **state)
{
	static const char *const others[] = {"", "GIF89a", "<svg>", "\xFF\xD8", "%PDF-1.7", "RIFF....WEBP"};
	struct bytes whole[] = {phone_jpeg(0xC0, 6), phone_png(false)}, large = plain_jpeg(0xC0, 1);

	(void)state;
	for (size_t i = 0; i < sizeof(others) / sizeof(others[0]); i++) {
		struct bytes b = {.size = 0};

		add_text(&b, others[i]);
		refused(b, "neither JPEG nor PNG");
	}
	for (size_t i = 0; i < 2; i++)
		for (size_t size = 0; size < whole[i].size; size++) {
			struct bytes cut = whole[i];

			cut.size = size;
			refused(cut, size > 8 ? "cut off" : NULL);
		}
	refused(plain_jpeg(0xC3, 1), "a kind of JPEG that browsers do not show");
	memset(large.at + 2 + 18 + 16 + 7 + 5, 0xFF, 4); /* 65535 x 65535 */
	refused(large, "over 100 megapixels");
}

/* ---- whose it is ---- */

struct list {
	char text[1000];
};

static int list_photo(void *context, const struct archive_photo *photo)
{
	struct list *list = context;
	size_t at = strlen(list->text);

	snprintf(list->text + at, sizeof(list->text) - at, "%s%s %s %lld;", photo->waits ? "waits " : "",
	         photo->after ? "after" : "before", strrchr(photo->file, '/') + 1, (long long)photo->bytes);
	return 0;
}

static void has(struct archive *archive, const char *drop, const char *wanted)
{
	struct list list = {""};

	assert_int_equal(archive_each_photo(archive, drop, list_photo, &list), 0);
	assert_string_equal(list.text, wanted);
}

static int take(struct archive *archive, const char *drop, bool after, struct bytes b)
{
	return archive_photo(archive, drop, after, "Ann", b.at, b.size);
}

/* 2 + 18 + 36 + 16 + 7 + 13 + 6 + 17 + 11 + 2 bytes of the JPEG stay, 8 + 25 + 21 + 25 + 12 of the PNG. */

/* A drop that fell just now. */
static void fall(struct archive *archive, const char *series)
{
	struct archive_recording r;

	assert_int_equal(archive_begin(archive, series, "Bea", ".log", false, &r), 0);
	trial_write_log(&r, "it fell");
	assert_int_equal(archive_finish(archive, &r, 0, ""), 0);
}

static void test_a_photo_waits_for_its_drop(void **state)
{
	struct bytes b = phone_jpeg(0xC0, 6), p = phone_png(true);
	struct archive *archive = trial_with_series("box");
	struct archive_recording r;

	(void)state;
	assert_int_equal(take(archive, "box", true, b), DT_E_STATE);
	assert_int_equal(take(archive, "box", false, b), 0);
	has(archive, "box", "waits before 0001.before-1.jpg 128;");
	/* disarmed: it goes on waiting */
	assert_int_equal(archive_begin(archive, "box", "Bea", ".log", false, &r), 0);
	assert_int_equal(take(archive, "box", false, p), 0);
	archive_discard(archive, &r);
	has(archive, "box/1", "waits before 0001.before-1.jpg 128;waits before 0001.before-2.png 91;");
	fall(archive, "box");
	has(archive, "box/1", "before 0001.before-1.jpg 128;before 0001.before-2.png 91;");
	has(archive, "box", "");
	assert_int_equal(take(archive, "box/1", true, p), 0);
	has(archive, "box/1",
	    "before 0001.before-1.jpg 128;before 0001.before-2.png 91;after 0001.after-1.png 91;");
	/* what is added from a log of earlier was not what waited */
	assert_int_equal(take(archive, "box", false, b), 0);
	assert_int_equal(archive_begin(archive, "box", "Bea", ".log", false, &r), 0);
	trial_write_log(&r, "it fell yesterday");
	assert_int_equal(archive_finish(archive, &r, 1700000000, ""), 0);
	has(archive, "box/2", "");
	archive_close(archive);
}

static void test_photos_have_bounds(void **state)
{
	struct bytes b = phone_png(false), none = {.size = 0};
	struct archive *archive = trial_with_series("box");
	uint8_t *large = calloc(1, ARCHIVE_PHOTO_BYTES + 1);

	(void)state;
	fall(archive, "box");
	for (int i = 0; i < ARCHIVE_PHOTOS_MAX; i++)
		assert_int_equal(take(archive, "box/1", true, b), 0);
	assert_int_equal(take(archive, "box/1", true, b), DT_E_FULL);
	assert_int_equal(take(archive, "box/1", false, none), DT_E_RANGE);
	assert_int_equal(archive_photo(archive, "box/1", false, "Ann", large, ARCHIVE_PHOTO_BYTES + 1),
	                 DT_E_RANGE);
	assert_string_equal(archive_message(archive), "a photo of 8388609 bytes, expected 1 to 8388608");
	assert_int_equal(archive_photo(archive, "box/1", false, "Ann", large, ARCHIVE_PHOTO_BYTES),
	                 DT_E_FORMAT);
	assert_int_equal(take(archive, "box/9", false, b), DT_E_UNKNOWN);
	assert_int_equal(take(archive, "crate", false, b), DT_E_UNKNOWN);
	assert_int_equal(take(archive, "../box", false, b), DT_E_ARGUMENT);
	assert_int_equal(archive_photo(archive, "box/1", false, " ", b.at, b.size), DT_E_ARGUMENT);
	assert_int_equal(take(archive, "box", false, b), 0);
	assert_int_equal(archive_discard_photos(archive, "box"), 0);
	has(archive, "box", "");
	assert_int_equal(archive_discard_photos(archive, "box/1"), DT_E_STATE);
	free(large);
	archive_close(archive);
}

static char told[2000];

static void tell(void *context, const char *text)
{
	(void)context;
	strncat(told, text, sizeof(told) - strlen(told) - 1);
}

static int verified(struct archive *archive)
{
	told[0] = '\0';
	return archive_verify(archive, NULL, 0, tell, NULL);
}

/* The only file that begins so, in the folder of the series. */
static void path_of(const char *name, char path[200])
{
	char command[300];
	FILE *found;

	snprintf(command, sizeof(command), "find %s/raw -name '%s'", trial_folder, name);
	found = popen(command, "r");
	assert_non_null(found);
	assert_non_null(fgets(path, 200, found));
	assert_int_equal(pclose(found), 0);
	path[strcspn(path, "\n")] = '\0';
}

static void test_a_changed_byte_is_named(void **state)
{
	struct archive *archive = trial_with_series("box");
	char path[200], message[ARCHIVE_MESSAGE_MAX], *text;
	struct trial_seen seen;
	struct archive_log log;
	int wrong = 0;
	size_t size;

	(void)state;
	assert_int_equal(take(archive, "box", false, phone_jpeg(0xC0, 6)), 0);
	fall(archive, "box");
	assert_int_equal(take(archive, "box/1", true, phone_png(false)), 0);
	assert_int_equal(verified(archive), 0);
	path_of("0001.before-1.jpg", path);
	text = durable_read(path, &size);
	assert_non_null(text);
	text[size / 2] ^= 1;
	assert_int_equal(durable_write(path, text, size), 0);
	assert_int_equal(verified(archive), 1);
	assert_non_null(strstr(told, "/box/0001.before-1.jpg: altered: its SHA-256 is "));
	assert_int_equal(archive_decide(archive, "box/1", ARCHIVE_ACCEPTED, "Ann", ""), DT_E_CORRUPT);
	assert_int_equal(archive_open_log(archive, "box/1", &log), 0); /* the log is what it was */
	archive_close_log(&log);
	seen = trial_look(archive, "box", 1, NULL);
	assert_string_equal(seen.state, "altered");
	text[size / 2] ^= 1;
	assert_int_equal(durable_write(path, text, size), 0);
	assert_int_equal(verified(archive), 0);
	assert_int_equal(archive_decide(archive, "box/1", ARCHIVE_ACCEPTED, "Ann", ""), 0);
	path_of("0001.after-1.png", path);
	assert_int_equal(unlink(path), 0);
	assert_int_equal(verified(archive), 1);
	assert_non_null(strstr(told, "/box/0001.after-1.png: missing"));
	archive_close(archive);
	free(text);
	/* the index made again has them, from the sidecar */
	assert_int_equal(archive_rebuild(trial_folder, false, trial_count, &wrong, message), 0);
	assert_int_equal(wrong, 1);
	archive = trial_open(ARCHIVE_READ);
	has(archive, "box/1", "before 0001.before-1.jpg 128;after 0001.after-1.png 91;");
	archive_close(archive);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	        cmocka_unit_test(test_a_phones_jpeg_tells_the_picture_alone),
	        cmocka_unit_test(test_a_png_tells_the_picture_alone),
	        cmocka_unit_test(test_what_is_no_whole_picture_is_refused),
	        IN_A_TRIAL(test_a_photo_waits_for_its_drop),
	        IN_A_TRIAL(test_photos_have_bounds),
	        IN_A_TRIAL(test_a_changed_byte_is_named),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
