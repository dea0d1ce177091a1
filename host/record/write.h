/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef DT_HOST_RECORD_WRITE_H
#define DT_HOST_RECORD_WRITE_H
/*
 * A record to a file that read_record reads back equal: our CSV, universal files and HDF5 take any record,
 * candump text, pcapng and LCM event logs take drops. MAT and ISO 13499 are for other programs: samples,
 * names, units, rates and times come back, a drop as a recording. README.md describes the CSV and what is
 * ours of a universal file.
 *
 * Times in candump text and LCM logs are the tower's clock, moved to the day where the record knows it. What
 * a record does not keep of its blocks is written as state CAPTURED, inputs and outputs 0.
 */
#include <stdio.h>

#include "common/frame.h"
#include "host/record/log_file.h"
#include "host/record/read.h"
#include "common/base/text.h"

/* Writes file in the format its name ends in: .csv, .lcm, .log or .candump, .unv or .uff,
 * .h5 or .hdf5, .pcapng, .mat, .mme, or in blocks (blocks.h) with .zst behind. 0 or DT_E_* with one line in
 * message. */
DT_MUST_USE int write_record(const struct record *record, const char *file, char message[READ_MESSAGE_MAX]);

/* All that is in a log, byte for byte, in blocks with an index (blocks.h): where the file's name ends in that
 * of the log's format and .zst, as write_blocks_is says. */
bool write_packs(const char *file); /* whether its name ends in .zst */
bool write_blocks_is(struct log_file *log, const char *file);
DT_MUST_USE int write_blocks(struct log_file *log, const char *file, char message[READ_MESSAGE_MAX]);

/* What the last columns of our CSV are called. */
#define CSV_TABLE "marks,droptower_csv_2"

/* As text with a head (version 1), which is what HDF5 is made of and sealed by. 0; DT_E_ARGUMENT if a
 * channel's name cannot be written; DT_E_SYSTEM if out did not take it all. */
DT_MUST_USE int write_csv(const struct record *record, FILE *out);

/* The same with its SHA-256 in the last line (seal.h); bytes are the caller's after 0. */
DT_MUST_USE int write_sealed_csv(const struct record *record, struct text *text);

/* The frames of a drop as pcapng. DT_E_ARGUMENT: not a drop. */
DT_MUST_USE int write_pcapng(const struct record *record, FILE *out);

/* The frames of a drop, each given to send at its turn with time_us as above: every block held,
 * then the capture end if one is known. Ends early with what send returns if that is not 0.
 * DT_E_ARGUMENT: not a drop. */
DT_MUST_USE int write_frames(const struct record *record,
                             int (*send)(void *context, const struct frame *frame), void *context);

#endif
