/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A record of ours in HDF5, changed through the library, as somebody's program would: the bytes are what is
 * changed, 11 for each change. Read in the helper's own source: a record whose samples are counts if it is
 * a drop's, and which can be written, or a refusal. Bytes of a file as they come are left to
 * tests/damage: the library dies of some, for which reason it has a process of its own.
 */
#define main hdf5_main
int hdf5_main(int argc, char **argv);
#include "host/hdf5/main.c"
#undef main

#include "tests/fuzz/fuzz.h"

enum { CHANGES_MAX = 8, CHANGE_BYTES = 11, SAMPLES = 6 };

static hid_t make_file(bool is_drop)
{
	static const double value_g[SAMPLES] = {0, 1, -2.5, 400, 0.03125, 3};
	hid_t access = H5Pcreate(H5P_FILE_ACCESS), file;
	struct channel *channel;
	struct record record;

	record_init(&record);
	record.is_drop = is_drop;
	channel = record_add_channel(&record, "S1X", 7000, SAMPLES);
	if (channel == NULL)
		fuzz_fail("no memory");
	memcpy(channel->value_g, value_g, sizeof(value_g));
	channel->range_g = 500;
	record_finish(&record);
	H5Pset_fapl_core(access, 4096, false);
	file = H5Fcreate("fuzz", H5F_ACC_TRUNC, H5P_DEFAULT, access);
	if (file < 0 || put_record(file, &record) != 0)
		fuzz_fail("no file");
	H5Pclose(access);
	record_free(&record);
	return file;
}

/* The attribute that a byte names, of the file or of its channel. */
static const char *name_of(uint8_t which)
{
	static const char *const ours[] = {"format",  "version", "sha256", "name", "rate_hz", "start_s",
	                                   "range_g", "uneven",  "units",  "bits", "other"};
	const size_t count = sizeof(ours) / sizeof(ours[0]);
	const struct metadata_entry *entry;

	if (which < count)
		return ours[which];
	entry = metadata_entry(which - count);
	return entry != NULL ? entry->name : "";
}

static void put_changed(hid_t at, const char *name, uint8_t kind, const uint8_t value[8])
{
	char text[9] = "";
	int64_t whole;
	double real;

	memcpy(text, value, 8);
	memcpy(&whole, value, 8);
	memcpy(&real, value, 8);
	if (kind % 4 == 0)
		(void)put_real(at, name, real);
	else if (kind % 4 == 1)
		(void)put_whole(at, name, whole);
	else if (kind % 4 == 2 && text[0] != '\0')
		(void)put_text(at, name, text);
}

/* Its arrays with other samples, of another length, or none. */
static void change_array(hid_t group, uint8_t kind, const uint8_t value[8])
{
	bool mask = kind % 2 != 0;
	double values[4];
	uint8_t bits[4];

	memcpy(bits, value, 4);
	for (unsigned i = 0; i < 4; i++)
		memcpy(&values[i], value, 8);
	if (H5Ldelete(group, mask ? "mask" : "acceleration", H5P_DEFAULT) < 0)
		return;
	if (mask)
		(void)put_array(group, "mask", H5T_NATIVE_UINT8, bits, value[7] % 5, "bits", BITS);
	else
		(void)put_array(group, "acceleration", H5T_NATIVE_DOUBLE, values, value[7] % 5, "units",
		                UNITS);
}

static void change(hid_t file, const uint8_t *bytes)
{
	hid_t group = H5Gopen2(file, "S1X", H5P_DEFAULT), at = bytes[0] % 2 != 0 ? group : file;
	const char *name = name_of(bytes[0] / 2);

	if (bytes[0] > 250) {
		change_array(group, bytes[1], bytes + 3);
	} else if (at >= 0 && name[0] != '\0') {
		if (H5Aexists(at, name) > 0)
			H5Adelete(at, name);
		put_changed(at, name, bytes[1], bytes + 3);
	}
	if (group >= 0)
		H5Gclose(group);
}

static void check_read(const struct record *record, const char *seal)
{
	struct text csv;

	for (size_t c = 0; c < record->channel_count; c++)
		for (size_t k = 0; record->is_drop && k < record->channels[c].count; k++)
			if (record->channels[c].sample[k] == 0 &&
			    !drop_is_count(record->channels[c].value_g[k]))
				fuzz_fail("sample %zu is no count", k);
	if (memchr(seal, '\0', DIGEST_CHARS) == NULL)
		fuzz_fail("a seal without an end");
	if (write_sealed_csv(record, &csv) == 0)
		free(csv.bytes);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
	char seal[DIGEST_CHARS];
	struct record record;
	hid_t file;

	H5Eset_auto2(H5E_DEFAULT, NULL, NULL);
	if (size < 1 || size > 1 + CHANGES_MAX * CHANGE_BYTES)
		return 0;
	file = make_file(bytes[0] % 2 != 0);
	for (size_t at = 1; at + CHANGE_BYTES <= size; at += CHANGE_BYTES)
		change(file, bytes + at);
	record_init(&record);
	if (get_record(&record, file, seal) == 0)
		check_read(&record, seal);
	record_free(&record);
	H5Fclose(file);
	return 0;
}
