/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * droptower-hdf5 read|write: HDF5 of ours on standard input to our CSV on standard output, of others to a
 * tree (host/record/tree.h), or CSV to HDF5. Started by droptower (host/record/hdf5.h); works by itself, too.
 * README.md tells the layout.
 */
#include <hdf5.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/hdf5/foreign.h"
#include "host/record/drop.h"
#include "host/record/metadata.h"
#include "host/record/helper.h"
#include "host/record/digest.h"
#include "host/record/seal.h"
#include "host/record/write.h"

enum {
	LAYOUT = 1,            /* what a reader of another version must refuse */
	IMAGE_STEP = 1 << 20,  /* bytes by which a file in memory grows */
	SAMPLES_MAX = 1 << 27, /* of a channel: a gigabyte */
	MASK = SAMPLE_LOST | SAMPLE_BAD | SAMPLE_CLIPPED,
	CHANNEL_NAME = sizeof(((struct channel *)NULL)->name),
};

/* Every failing call comes through here: says what of the file is not as expected. */
static int refuse_written(const char *what, const char *expected)
{
	fprintf(stderr, "HDF5: %s, expected %s\n", what, expected);
	return -1;
}

/* ---- attributes ---- */

static int put_attribute(hid_t at, const char *name, hid_t type, const void *value)
{
	hid_t space = H5Screate(H5S_SCALAR);
	hid_t attribute = H5Acreate2(at, name, type, space, H5P_DEFAULT, H5P_DEFAULT);
	int result = attribute >= 0 && H5Awrite(attribute, type, value) >= 0 ? 0 : -1;

	if (attribute >= 0)
		H5Aclose(attribute);
	H5Sclose(space);
	return result == 0 ? 0 : refuse_written(name, "room for the attribute");
}

static int put_real(hid_t at, const char *name, double value)
{
	return put_attribute(at, name, H5T_NATIVE_DOUBLE, &value);
}

static int put_whole(hid_t at, const char *name, int64_t value)
{
	return put_attribute(at, name, H5T_NATIVE_INT64, &value);
}

static int put_text(hid_t at, const char *name, const char *text)
{
	hid_t type = H5Tcopy(H5T_C_S1);
	int result;

	H5Tset_size(type, strlen(text) + 1);
	H5Tset_cset(type, H5T_CSET_UTF8);
	result = put_attribute(at, name, type, text);
	H5Tclose(type);
	return result;
}

static int get_real(hid_t at, const char *name, double *value)
{
	hid_t attribute = H5Aopen(at, name, H5P_DEFAULT);
	hid_t space = attribute >= 0 ? H5Aget_space(attribute) : -1;
	int result = space >= 0 && H5Sget_simple_extent_npoints(space) == 1 &&
	                             H5Aread(attribute, H5T_NATIVE_DOUBLE, value) >= 0
	                     ? 0
	                     : -1;

	if (space >= 0)
		H5Sclose(space);
	if (attribute >= 0)
		H5Aclose(attribute);
	return result;
}

/* A string of fixed length that fits into text. */
static int get_text(hid_t at, const char *name, char *text, size_t size)
{
	hid_t attribute = H5Aopen(at, name, H5P_DEFAULT);
	hid_t type = attribute >= 0 ? H5Aget_type(attribute) : -1;
	hid_t space = attribute >= 0 ? H5Aget_space(attribute) : -1;
	int result = -1;

	memset(text, 0, size);
	if (type >= 0 && space >= 0 && H5Tget_class(type) == H5T_STRING && H5Tis_variable_str(type) == 0 &&
	    H5Tget_size(type) <= size && H5Sget_simple_extent_npoints(space) == 1 &&
	    H5Aread(attribute, type, text) >= 0)
		result = 0;
	text[size - 1] = '\0';
	if (space >= 0)
		H5Sclose(space);
	if (type >= 0)
		H5Tclose(type);
	if (attribute >= 0)
		H5Aclose(attribute);
	return result;
}

/* The seal is of what we write: whatever else stands beside it was put there later. */
static int hold_count(hid_t at, const char *path, int attributes)
{
	hid_t object = H5Oopen(at, path, H5P_DEFAULT);
	bool same = object >= 0 && H5Aget_num_attrs(object) == attributes;
	char told[96];

	if (object >= 0)
		H5Oclose(object);
	if (same)
		return 0;
	snprintf(told, sizeof(told), "altered: attributes of %.40s added or taken away", path);
	return refuse_written(told, "those that it was sealed with");
}

static int hold_text(hid_t at, const char *name, const char *expected)
{
	char text[64], told[128];

	if (get_text(at, name, text, sizeof(text)) == 0 && strcmp(text, expected) == 0)
		return 0;
	snprintf(told, sizeof(told), "altered: %s is \"%.48s\"", name, text);
	return refuse_written(told, expected);
}

/* ---- writing ---- */

#define UNITS "g"
#define BITS "1 lost, 2 not taken, 4 beyond the range"

static int put_array(hid_t group, const char *name, hid_t type, const void *values, size_t count,
                     const char *key, const char *text)
{
	hsize_t size = count;
	hid_t space = H5Screate_simple(1, &size, NULL), plan = H5Pcreate(H5P_DATASET_CREATE);
	hid_t array;
	int result = -1;

	H5Pset_obj_track_times(plan, false); /* the same record is the same file */
	array = H5Dcreate2(group, name, type, space, H5P_DEFAULT, plan, H5P_DEFAULT);
	if (array >= 0 && H5Dwrite(array, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) >= 0)
		result = put_text(array, key, text);
	if (array >= 0)
		H5Dclose(array);
	H5Pclose(plan);
	H5Sclose(space);
	return result;
}

static int put_samples(hid_t group, const struct channel *channel)
{
	uint8_t *mask = malloc(channel->count + 1);
	int result;

	if (!mask)
		return refuse_written("no memory", "some");
	for (size_t k = 0; k < channel->count; k++)
		mask[k] = channel->sample[k] & MASK;
	result = put_array(group, "acceleration", H5T_NATIVE_DOUBLE, channel->value_g, channel->count,
	                   "units", UNITS);
	if (result == 0)
		result = put_array(group, "mask", H5T_NATIVE_UINT8, mask, channel->count, "bits", BITS);
	free(mask);
	return result;
}

/* A stroke would make a group of its own. */
static void name_link(const char *name, char link[CHANNEL_NAME])
{
	snprintf(link, CHANNEL_NAME, "%s", name);
	for (char *p = link; *p; p++)
		if (*p == '/')
			*p = '_';
}

static int put_channel(hid_t file, const struct channel *channel)
{
	char link[CHANNEL_NAME];
	hid_t group;
	int result = 0;

	name_link(channel->name, link);
	group = H5Gcreate2(file, link, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
	if (group < 0)
		return refuse_written(channel->name, "names of channels that differ in more than a stroke");
	result |= put_text(group, "name", channel->name);
	result |= put_real(group, "rate_hz", channel->rate_hz);
	result |= put_real(group, "start_s", channel->start_s);
	result |= put_real(group, "range_g", channel->range_g);
	result |= put_whole(group, "uneven", (channel->flags & RECORD_FLAG_UNEVEN) != 0);
	result |= put_samples(group, channel);
	H5Gclose(group);
	return result;
}

/* The digits of the record's sealed CSV, which stands for all that the file holds: a program that copies the
 * file keeps what is in it and not its bytes. */
static const char *seal_of(const struct text *csv)
{
	return csv->bytes + csv->size - 1 - (DIGEST_CHARS - 1);
}

static int put_seal(hid_t file, const struct record *record)
{
	char seal[DIGEST_CHARS];
	struct text csv;

	if (write_sealed_csv(record, &csv) != 0)
		return refuse_written("a channel's name is impossible or there is no memory", "neither");
	snprintf(seal, sizeof(seal), "%.64s", seal_of(&csv));
	free(csv.bytes);
	return put_text(file, "sha256", seal);
}

static int put_record(hid_t file, const struct record *record)
{
	const struct metadata_entry *entry;
	char text[METADATA_TEXT_MAX];
	int result = put_text(file, "format", "droptower") | put_whole(file, "version", LAYOUT) |
	             put_seal(file, record);

	for (size_t i = 0; (entry = metadata_entry(i)) != NULL && result == 0; i++) {
		if (!metadata_known(record, entry))
			continue;
		metadata_format(record, entry, text);
		if (entry->kind >= METADATA_TIME)
			result = put_text(file, entry->name, text);
		else if (entry->kind == METADATA_REAL)
			result = put_real(file, entry->name, metadata_real(record, entry));
		else
			result = put_whole(file, entry->name, metadata_whole(record, entry));
	}
	for (size_t i = 0; i < record->channel_count && result == 0; i++)
		result = put_channel(file, &record->channels[i]);
	return result;
}

static int put_image(hid_t file)
{
	ssize_t size = H5Fflush(file, H5F_SCOPE_GLOBAL) >= 0 ? H5Fget_file_image(file, NULL, 0) : -1;
	char *image = size > 0 ? malloc((size_t)size) : NULL;
	bool done = image && H5Fget_file_image(file, image, (size_t)size) == size &&
	            fwrite(image, 1, (size_t)size, stdout) == (size_t)size && fflush(stdout) == 0;

	free(image);
	return done ? 0 : refuse_written("cannot be written", "room for it");
}

static int write_image(const struct record *record)
{
	hid_t access = H5Pcreate(H5P_FILE_ACCESS), plan = H5Pcreate(H5P_FILE_CREATE), file;
	int result;

	H5Pset_fapl_core(access, IMAGE_STEP, false);
	H5Pset_link_creation_order(plan, H5P_CRT_ORDER_TRACKED | H5P_CRT_ORDER_INDEXED);
	file = H5Fcreate("record", H5F_ACC_TRUNC, plan, access);
	result =
	        file >= 0 ? put_record(file, record) : refuse_written("cannot be made", "a library that can");
	if (result == 0)
		result = put_image(file);
	if (file >= 0)
		H5Fclose(file);
	H5Pclose(plan);
	H5Pclose(access);
	return result;
}

/* ---- reading ---- */

static int64_t count_of(hid_t array)
{
	hid_t space = array >= 0 ? H5Dget_space(array) : -1;
	int64_t count = -1;

	if (space >= 0 && H5Sget_simple_extent_ndims(space) == 1)
		count = (int64_t)H5Sget_simple_extent_npoints(space);
	if (space >= 0)
		H5Sclose(space);
	return count;
}

static int get_samples(struct channel *channel, hid_t values, hid_t mask)
{
	if (H5Dread(values, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, channel->value_g) < 0 ||
	    H5Dread(mask, H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, channel->sample) < 0)
		return refuse_written("samples cannot be read", "numbers");
	for (size_t k = 0; k < channel->count; k++)
		if (channel->sample[k] & ~MASK)
			return refuse_written("a mask has unknown bits", "1, 2 and 4");
	return 0;
}

static int get_arrays(struct record *record, hid_t group, const char *name, double rate_hz, bool sealed)
{
	hid_t values = H5Dopen2(group, "acceleration", H5P_DEFAULT),
	      mask = H5Dopen2(group, "mask", H5P_DEFAULT);
	int64_t count = count_of(values);
	struct channel *channel;
	int result = -1;

	if (count < 0 || count > SAMPLES_MAX || count_of(mask) != count)
		refuse_written(name, "arrays acceleration and mask of one length");
	else if ((channel = record_add_channel(record, name, rate_hz, (size_t)count)) == NULL)
		refuse_written("no memory", "some");
	else
		result = get_samples(channel, values, mask);
	if (result == 0 && sealed)
		result = hold_count(group, "acceleration", 1) | hold_text(values, "units", UNITS) |
		         hold_count(group, "mask", 1) | hold_text(mask, "bits", BITS);
	if (values >= 0)
		H5Dclose(values);
	if (mask >= 0)
		H5Dclose(mask);
	return result;
}

static int hold_channel(hid_t group, const char *link, const char *name)
{
	char expected[CHANNEL_NAME], told[128];
	H5G_info_t info;

	name_link(name, expected);
	if (strcmp(link, expected) == 0 && H5Gget_info(group, &info) >= 0 && info.nlinks == 2)
		return hold_count(group, ".", 5);
	snprintf(told, sizeof(told), "altered: group %.40s", link);
	return refuse_written(told, "each named as its channel, with acceleration and mask in it");
}

static int get_channel(struct record *record, hid_t file, const char *link, bool sealed)
{
	hid_t group = H5Gopen2(file, link, H5P_DEFAULT);
	double rate_hz, start_s, range_g, uneven;
	struct channel *channel;
	char name[CHANNEL_NAME];
	int result;

	if (group < 0)
		return refuse_written(link, "groups, one for each channel");
	if (get_text(group, "name", name, sizeof(name)) != 0 || get_real(group, "rate_hz", &rate_hz) != 0 ||
	    get_real(group, "start_s", &start_s) != 0 || get_real(group, "range_g", &range_g) != 0 ||
	    get_real(group, "uneven", &uneven) != 0)
		result = refuse_written(link, "attributes name, rate_hz, start_s, range_g and uneven");
	else
		result = sealed ? hold_channel(group, link, name) : 0;
	if (result == 0)
		result = get_arrays(record, group, name, rate_hz, sealed);
	if (result == 0) {
		channel = &record->channels[record->channel_count - 1];
		channel->start_s = start_s;
		channel->range_g = range_g;
		channel->flags = uneven != 0 ? RECORD_FLAG_UNEVEN : 0;
	}
	H5Gclose(group);
	return result;
}

/* In the order they were written; by name where a program that copied the file did not keep it. */
static int get_channels(struct record *record, hid_t file, bool sealed)
{
	H5_index_t index = H5_INDEX_CRT_ORDER;
	H5G_info_t info;
	char link[64];
	int result = 0;

	if (H5Gget_info(file, &info) < 0)
		return refuse_written("no root", "a group for each channel");
	if (info.nlinks > 0 && H5Lget_name_by_idx(file, ".", index, H5_ITER_INC, 0, NULL, 0, H5P_DEFAULT) < 0)
		index = H5_INDEX_NAME;
	for (hsize_t i = 0; i < info.nlinks && result == 0; i++) {
		ssize_t length =
		        H5Lget_name_by_idx(file, ".", index, H5_ITER_INC, i, link, sizeof(link), H5P_DEFAULT);

		if (length <= 0 || length >= (ssize_t)sizeof(link))
			result = refuse_written("a group's name is too long", "one for each channel");
		else
			result = get_channel(record, file, link, sealed);
	}
	return result;
}

static int get_fields(struct record *record, hid_t file)
{
	const struct metadata_entry *entry;

	for (size_t i = 0; (entry = metadata_entry(i)) != NULL; i++) {
		char text[METADATA_TEXT_MAX];
		double value;
		int result;

		if (H5Aexists(file, entry->name) <= 0)
			continue;
		if (entry->kind >= METADATA_TIME)
			result = get_text(file, entry->name, text, sizeof(text)) != 0 ||
			         metadata_parse(record, entry, text) != 0;
		else
			result = get_real(file, entry->name, &value) != 0 ||
			         metadata_set(record, entry, value) != 0;
		if (result != 0)
			return refuse_written(entry->name, "a value that fits");
	}
	return 0;
}

static int hold_file(const struct record *record, hid_t file)
{
	const struct metadata_entry *entry;
	int count = 3; /* format, version, sha256 */

	for (size_t i = 0; (entry = metadata_entry(i)) != NULL; i++)
		count += metadata_known(record, entry);
	return hold_count(file, "/", count);
}

/* The samples of a drop are counts, marked where they are beyond the range. */
static int check_sample(const struct channel *channel, size_t k)
{
	bool good = !(channel->sample[k] & (SAMPLE_LOST | SAMPLE_BAD));
	char what[128];

	if (good && !drop_is_count(channel->value_g[k])) {
		snprintf(what, sizeof(what), "acceleration[%zu] of %s is %.15g g", k, channel->name,
		         channel->value_g[k]);
		return refuse_written(what, "a whole count of 1/32 g within full scale");
	}
	if ((channel->sample[k] & SAMPLE_CLIPPED) != (good ? drop_mark(channel, channel->value_g[k]) : 0)) {
		snprintf(what, sizeof(what), "mask[%zu] of %s at %.15g g is %u", k, channel->name,
		         channel->value_g[k], channel->sample[k]);
		return refuse_written(what, "4 beyond the range and nowhere else");
	}
	return 0;
}

static int check_samples(const struct record *record)
{
	int result = 0;

	for (size_t i = 0; i < record->channel_count; i++)
		for (size_t k = 0; k < record->channels[i].count && result == 0; k++)
			result = check_sample(&record->channels[i], k);
	return result;
}

static int get_record(struct record *record, hid_t file, char seal[DIGEST_CHARS])
{
	char format[16];
	double version;
	bool sealed;
	int result;

	if (get_text(file, "format", format, sizeof(format)) != 0 || strcmp(format, "droptower") != 0 ||
	    get_real(file, "version", &version) != 0 || version != LAYOUT)
		return refuse_written("not by droptower",
		                      "attributes format = \"droptower\" and version = 1");
	seal[0] = '\0';
	if (H5Aexists(file, "sha256") > 0 && get_text(file, "sha256", seal, DIGEST_CHARS) != 0)
		return refuse_written("sha256 is no text", "64 digits");
	sealed = seal[0] != '\0';
	result = get_fields(record, file);
	if (result == 0)
		result = get_channels(record, file, sealed);
	if (result == 0 && sealed)
		result = hold_file(record, file);
	return result == 0 && record->is_drop ? check_samples(record) : result;
}

/* By the mark or, where that was altered, by the seal. */
static bool is_ours(hid_t file)
{
	char format[16];

	return H5Aexists(file, "sha256") > 0 ||
	       (get_text(file, "format", format, sizeof(format)) == 0 && strcmp(format, "droptower") == 0);
}

static hid_t open_image(const struct source *source)
{
	hid_t access = H5Pcreate(H5P_FILE_ACCESS), file = -1;

	if (source->mapped != NULL) { /* too large for an image */
		setenv("HDF5_USE_FILE_LOCKING", "FALSE", 1);
		file = H5Fopen("/dev/stdin", H5F_ACC_RDONLY, access); /* which fails for one without a name */
	}
	H5Pset_fapl_core(access, IMAGE_STEP, false);
	if (file < 0 && H5Pset_file_image(access, source->bytes, source->size) >= 0)
		file = H5Fopen("record", H5F_ACC_RDONLY, access);
	H5Pclose(access);
	return file;
}

/* The CSV with its seal when the file has that seal, too; without one when it has none. */
static int put_out(const struct record *record, const char *seal)
{
	char what[160];
	struct text csv;
	size_t size;
	int result;

	if (write_sealed_csv(record, &csv) != 0)
		return refuse_written("a channel's name is impossible or there is no memory", "neither");
	size = csv.size - (seal[0] == '\0' ? strlen("# " SEAL_BLANK "\n") : 0);
	if (seal[0] != '\0' && strncmp(seal_of(&csv), seal, DIGEST_CHARS - 1) != 0) {
		snprintf(what, sizeof(what), "altered: the SHA-256 of what it holds is %.64s", seal_of(&csv));
		result = refuse_written(what, seal);
	} else {
		result = fwrite(csv.bytes, 1, size, stdout) == size && fflush(stdout) == 0 ? 0 : -1;
	}
	free(csv.bytes);
	return result;
}

static int record_to_csv(hid_t file)
{
	char seal[DIGEST_CHARS]; /* the digits that the file says; "" in one of a version before it */
	struct record record;
	int result;

	record_init(&record);
	result = get_record(&record, file, seal);
	if (result == 0)
		result = put_out(&record, seal);
	record_free(&record);
	return result;
}

static int read_image(const struct source *source)
{
	hid_t file = open_image(source);
	int result;

	if (file < 0)
		return refuse_written("damaged", "a whole file");
	if (H5Aexists(file, "sha256") < 0 ||
	    H5Aexists(file, "format") < 0) /* of ours it would pass for another's */
		result = refuse_written("damaged: the attributes of its root cannot be read", "a whole file");
	else
		result = is_ours(file) ? record_to_csv(file) : foreign_put(file);
	H5Fclose(file);
	return result;
}

int main(int argc, char **argv)
{
	int code;

	H5Eset_auto2(H5E_DEFAULT, NULL, NULL); /* one line of our own instead */
	code = helper_serve(argc, argv, "droptower-hdf5", read_image, write_image);
	H5close();
	return code;
}
