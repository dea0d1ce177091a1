/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "host/fit/fit.h"
#include "host/model/ensemble.h"
#include "host/report/facts.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "host/record/drop.h"

const struct estimate_channel *report_axis(const struct report *report, const char *which)
{
	const struct channel *channel = record_axis(report->record, which);

	return channel ? &report->analysis->channels[channel - report->record->channels] : NULL;
}

double report_offset(const struct estimate_channel *estimate)
{
	return isfinite(estimate->baseline.offset_g) ? estimate->baseline.offset_g : 0.0;
}

static bool has_pulse(const struct estimate_channel *estimate)
{
	return estimate && isfinite(estimate->pulse.start_s) && estimate->pulse.duration_s > 0.0 &&
	       (estimate->pulse.status == ESTIMATE_OK || estimate->pulse.status == ESTIMATE_CLIPPED ||
	        estimate->pulse.status == ESTIMATE_AMBIGUOUS);
}

/* Times count from S2's X, other recordings from the earliest pulse. */
static bool better_zero(const struct report *report, size_t i, size_t best)
{
	const struct estimate_channel *channels = report->analysis->channels;

	const struct channel *s2x = record_axis(report->record, "S2X");

	if (s2x == &report->record->channels[best])
		return false;
	return s2x == &report->record->channels[i] ||
	       channels[i].pulse.start_s < channels[best].pulse.start_s;
}

struct report_zero report_zero(const struct report *report)
{
	const struct analysis *a = report->analysis;
	struct report_zero zero = {.width_s = (double)NAN};
	size_t best = a->channel_count;

	for (size_t i = 0; i < a->channel_count; i++) {
		if (!has_pulse(&a->channels[i]))
			continue;
		zero.width_s = fmax(zero.width_s, a->channels[i].pulse.duration_s);
		if (best == a->channel_count || better_zero(report, i, best))
			best = i;
	}
	if (best < a->channel_count) {
		zero.time_s = a->channels[best].pulse.start_s;
		if (record_axis(report->record, "S2X") == &report->record->channels[best])
			zero.width_s = a->channels[best].pulse.duration_s;
		snprintf(zero.name, sizeof(zero.name), "%s leaves 10 %% of its peak",
		         report->record->channels[best].name);
	} else if (report->record->is_drop && isfinite(report->record->trigger_s)) {
		zero.time_s = report->record->trigger_s;
		snprintf(zero.name, sizeof(zero.name), "the trigger");
	} else {
		snprintf(zero.name, sizeof(zero.name), "the first sample");
	}
	return zero;
}

/* Each is a millisecond of one sensor. */
static uint64_t missing_ticks(const struct record *record)
{
	uint64_t ticks = 0;

	for (size_t i = 0; i < record->gap_count; i++)
		ticks += (uint64_t)record->gaps[i].last_tick_ms - record->gaps[i].first_tick_ms + 1;
	return ticks;
}

const char *report_plural(uint64_t count)
{
	return count == 1 ? "" : "s";
}

/* "ends at tick 463 (0.464 s) without a capture end"; false when there is one, or none to expect. */
static bool tell_end(const struct record *r, char *line, size_t size)
{
	bool open = r->is_drop && !r->crc_known;

	line[0] = '\0';
	if (open)
		snprintf(line, size, "ends at tick %" PRIu32 " (%.3f s) without a capture end",
		         r->last_tick_ms, ((double)(r->last_tick_ms - r->first_tick_ms) + 1.0) * 1e-3);
	return open;
}

/* "27 samples lost in 1 gap, 1 block" */
static void facts_tell_lost(const struct record *r, char *line, size_t size)
{
	uint64_t blocks = missing_ticks(r);

	if (r->gap_count)
		snprintf(line, size, "%" PRIu64 " sample%s lost in %zu gap%s, %" PRIu64 " block%s",
		         r->lost_samples, report_plural(r->lost_samples), r->gap_count,
		         report_plural(r->gap_count), blocks, report_plural(blocks));
	else
		snprintf(line, size, "%" PRIu64 " sample%s lost", r->lost_samples,
		         report_plural(r->lost_samples));
}

bool report_verdict(const struct report *report, char *line, size_t size)
{
	const struct record *r = report->record;
	char end[96], lost[96];
	bool open = tell_end(r, end, sizeof(end)), altered = (r->flags & RECORD_FLAG_ALTERED) != 0;

	facts_tell_lost(r, lost, sizeof(lost));
	if (r->lost_samples)
		snprintf(line, size, "INCOMPLETE: %s%s%s", end, open ? "; " : "", lost);
	else if (!r->is_drop)
		snprintf(line, size, "no sample lost");
	else if (open)
		snprintf(line, size, "UNPROVEN: %s; nothing says what the tower sent", end);
	else if (!r->crc_agrees)
		snprintf(line, size, "CORRUPT: no sample is missing, yet the CRC-32 does not agree");
	else if (altered)
		snprintf(line, size, "ALTERED: the CRC-32 agrees, yet %s not what was sealed",
		         r->seal_agrees ? "the parameters are" : "the capture end is");
	else
		snprintf(line, size, "complete: every sample arrived, and the CRC-32 agrees");
	return !r->lost_samples && !altered && (!r->is_drop || (r->crc_known && r->crc_agrees));
}

void report_filter(const struct report *report, char *name, size_t size)
{
	const struct estimate_options *done = &report->options;
	char class[16] = "", corner[32] = "";

	if (done->cfc > 0)
		snprintf(class, sizeof(class), "CFC%u", done->cfc);
	if (done->lowpass_hz > 0.0)
		snprintf(corner, sizeof(corner), "lowpass %g Hz", done->lowpass_hz);
	snprintf(name, size, "%s%s%s", class, class[0] && corner[0] ? ", " : "", corner);
}

/* Of sensors of which nothing is known nothing is said. */
static void highpass(const struct report *report, char *words, size_t size)
{
	double undone_s = report->options.iepe_time_constant_s;
	double known_s = report->scene ? report->scene->sensor_iepe_time_constant_s : 0.0;

	words[0] = '\0';
	if (undone_s > 0.0)
		snprintf(words, size, "sensor high-pass of %g s undone", undone_s);
	else if (!drop_has_channel(report->record))
		return;
	else if (known_s > 0.0)
		snprintf(words, size, "sensor high-pass of %g s not undone", known_s);
	else if (!report->scene)
		snprintf(words, size, "sensor high-pass not undone, which takes --scene or --iepe");
}

bool report_processing(const struct report *report, char *line, size_t size)
{
	char filter[48], words[80];

	report_filter(report, filter, sizeof(filter));
	highpass(report, words, sizeof(words));
	snprintf(line, size, "%s%s%s%s", filter[0] ? "filter " : "", filter,
	         filter[0] && words[0] ? "; " : "", words);
	return line[0] != '\0';
}

unsigned report_flags(const struct report *report)
{
	unsigned flags = report->record->flags;

	for (size_t i = 0; i < report->analysis->channel_count; i++)
		flags |= report->analysis->channels[i].flags;
	return flags;
}

const char *report_flag_words(unsigned flag)
{
	switch (flag) {
	case RECORD_FLAG_LOST:
		return "samples never arrived; they are left out, nothing is drawn or fitted across them";
	case RECORD_FLAG_BAD:
		return "samples were not taken, or the file holds no number there";
	case RECORD_FLAG_CLIPPED:
		return "samples are beyond the sensor's range: the true peak may be higher";
	case RECORD_FLAG_INCOMPLETE:
		return "the capture could not be completed";
	case RECORD_FLAG_NO_CRC:
		return "the capture end is missing, so completeness cannot be proven";
	case RECORD_FLAG_SLOW_FRAME:
		return "the frame fell slower than free fall beyond the limit: check rails and bearings";
	case RECORD_FLAG_NO_IMPACT:
		return "no impact was seen: the capture was ended by time";
	case RECORD_FLAG_FAULT:
		return "a fault was latched during the drop";
	case RECORD_FLAG_UNEVEN:
		return "the time column is not evenly spaced; the even grid next to it was used";
	case RECORD_FLAG_FULL_SCALE:
		return "samples are at the converter's limit: the true value is unknown";
	case RECORD_FLAG_OVERRUN:
		return "the controller missed samples; they are marked and left out";
	case RECORD_FLAG_ZERO_SHIFT:
		return "a sensor's offset after the drop is not the one before: it may have been overloaded";
	case RECORD_FLAG_CABLE:
		return "a sensor lost its supply during the drop: check its cable";
	case RECORD_FLAG_STUCK:
		return "a channel held one value where its signal moves: check sensor and converter";
	case RECORD_FLAG_ALTERED:
		return "the capture end or the parameters are not what the tower sealed: trust no number of "
		       "this drop";
	case RECORD_FLAG_SEPARATED_LATE:
		return "the product left the frame later than planned";
	case RECORD_FLAG_DROPOUT_CHANGED:
		return "the magnet let go earlier or later than in the drops before: check it";
	case RECORD_FLAG_FRAME_NOT_DOWN:
		return "the frame was neither down nor latched when the window closed: check rails and "
		       "dampers";
	case RECORD_FLAG_SPIKE:
		return "outliers of one or two samples were left out: look for a loose contact";
	case RECORD_FLAG_ZEROED:
		return "runs of exact zeros in the signal were left out: data were lost on the way";
	case RECORD_FLAG_OFFSET:
		return "zero was far from zero before the pulse; it was taken off";
	case RECORD_FLAG_DRIFT:
		return "zero moved before the pulse; its straight line was taken off";
	case RECORD_FLAG_HUM:
		return "the mains or another hum shows before the pulse; it was taken off: check screen and "
		       "earth";
	case RECORD_FLAG_SHORT:
		return "the record begins or ends inside its pulse, or has hardly a sample";
	case RECORD_FLAG_ZERO_UNSURE:
		return "more than noise before the pulse: zero, and what hangs on it, is unsure";
	case RECORD_FLAG_UNFILTERED:
		return "sampled too slowly for the low-pass asked for; left as it was";
	case RECORD_FLAG_OVERDUE:
		return "a sensor's calibration was due before: nothing of it is under accreditation";
	case RECORD_FLAG_DEFAULT_USED:
		return "a sensor's file lacks an uncertainty: one from the manual's table was used";
	case RECORD_FLAG_SETTLING:
		return "zero decays from the record's beginning on; its exponential was taken off: let the "
		       "supply settle";
	case RECORD_FLAG_NO_LINE_END:
		return "the file ends without a line end: its last row may be cut";
	case RECORD_FLAG_SAME_NAMES:
		return "two columns have one name in the file: check which is which";
	case RECORD_FLAG_ASSUMED:
		return "the file does not tell its unit of time; it was taken by what a shock can be: check "
		       "it";
	default:
		return record_flag_name(flag);
	}
}

const char *report_note_words(unsigned flag)
{
	switch (flag) {
	case ESTIMATE_FLAG_EXTRAPOLATED:
		return "clipped; the value follows from the pulse family, not from samples";
	case ESTIMATE_FLAG_GAPS:
		return "samples it would have used are missing";
	case ESTIMATE_FLAG_SPIKE:
		return "outliers were left out";
	case ESTIMATE_FLAG_HUM:
		return "mains hum was fitted along";
	case ESTIMATE_FLAG_TWO_MODES:
		return "two modes; the value is the stronger one's";
	case ESTIMATE_FLAG_AMPLITUDE:
		return "the frequency follows the swing; the value is fitted, the mean of the first three "
		       "cycles";
	case ESTIMATE_FLAG_TOLERANCE:
		return "less certain than asked for";
	case ESTIMATE_FLAG_MODEL:
		return "the samples refuse the model; its uncertainty is widened";
	case ESTIMATE_FLAG_WEAK:
		return "weak; by the shape of the sensor's strong axis";
	case ESTIMATE_FLAG_NOT_SEPARABLE:
		return "two modes lie too near each other to be told apart";
	case ESTIMATE_FLAG_ZERO:
		return "nothing quiet before the pulse, or more than noise: it hangs on an unsure zero";
	case ESTIMATE_FLAG_RIVAL:
		return "another extreme is as high, as far as noise lets tell";
	case ESTIMATE_FLAG_STEP:
		return "a step within one sample, as no sensor makes: look for a broken cable";
	case ESTIMATE_FLAG_TAIL:
		return "more than noise follows the pulse; the uncertainty holds it";
	case ESTIMATE_FLAG_AXES:
		return "S1 and S2, or X and Y, do not see one shock: an axis is reversed, exchanged, dead, "
		       "late or behind a filter of its own";
	case ESTIMATE_FLAG_FLAT:
		return "its top is flat: a cut one of a range that is not known looks like this; it may have "
		       "gone higher";
	case ESTIMATE_FLAG_ROUGH:
		return "it rings on faster than a plate does: look for a loose sensor";
	case ESTIMATE_FLAG_FIRST:
		return "of the first contact; a later one is larger";
	default:
		return estimate_flag_name(flag);
	}
}

/* Notes still to be written of one flag. */
struct noting {
	struct report_note *notes;
	size_t count;
	unsigned flag;
};

static void facts_note(struct noting *noting, double value, unsigned flags, const char *subject,
                       const char *what)
{
	struct report_note *next = &noting->notes[noting->count];

	if (!(flags & noting->flag) || !isfinite(value) || noting->count == REPORT_NOTES_MAX)
		return;
	next->flag = noting->flag;
	snprintf(next->of, sizeof(next->of), "%.32s %s", subject, what);
	noting->count++;
}

size_t report_notes(const struct report *report, struct report_note notes[REPORT_NOTES_MAX])
{
	const struct analysis *a = report->analysis;
	/* Others are said of the peak. */
	const unsigned of_pulse =
	        ESTIMATE_FLAG_ZERO | ESTIMATE_FLAG_STEP | ESTIMATE_FLAG_TAIL | ESTIMATE_FLAG_TOLERANCE;
	struct noting noting = {.notes = notes, .flag = 1};

	for (; estimate_flag_name(noting.flag)[0]; noting.flag <<= 1) {
		if (noting.flag == ESTIMATE_FLAG_TOLERANCE && !report->tolerance_asked)
			continue;
		for (size_t i = 0; i < a->channel_count; i++) {
			const struct estimate_channel *e = &a->channels[i];
			const char *name = report->record->channels[i].name;

			facts_note(&noting, e->peak.value_g, e->peak.how.flags, name, "peak");
			facts_note(&noting, e->pulse.velocity_change_m_s, e->pulse.flags & of_pulse, name,
			           noting.flag == ESTIMATE_FLAG_TOLERANCE ? "width or velocity change"
			                                                  : "velocity change");
			facts_note(&noting, e->pulse.contact_time_s, e->pulse.contact.flags, name, "contact");
		}
		for (size_t i = 0; i < a->resultant_count; i++)
			facts_note(&noting, a->resultants[i].peak_g, a->resultants[i].how.flags,
			           a->resultants[i].sensor, "resultant");
		if (report_driven(report))
			facts_note(&noting, a->lag.driven_s, a->lag.driven.flags, "S1", "driven lag");
		if (a->has_plate)
			facts_note(&noting, a->plate.frequency_hz, a->plate.how.flags, "plate", "frequency");
	}
	return noting.count;
}

bool report_video_frame(const struct report *report, double time_s, long *frame)
{
	const struct record *r = report->record;

	if (!r->is_drop || !r->crc_known || !isfinite(time_s))
		return false;
	*frame = r->camera_frame + (long)floor(1000.0 * time_s);
	return true;
}

bool report_video(const struct report *report, const struct report_zero *zero, char *line, size_t size)
{
	const struct estimate_channel *s2x = report_axis(report, "S2X");
	long at_zero, at_peak;

	line[0] = '\0';
	if (!report_video_frame(report, zero->time_s, &at_zero))
		return false;
	if (s2x && report_video_frame(report, s2x->peak.time_s, &at_peak))
		snprintf(line, size, "1 000 Hz video: time 0 is in frame %ld, S2 X peaks in %ld", at_zero,
		         at_peak);
	else
		snprintf(line, size, "1 000 Hz video: time 0 is in frame %ld", at_zero);
	return true;
}

const char *report_channel_status(const struct estimate_channel *estimate, char *text, size_t size)
{
	/* Of how a value was got, not of what is wrong with it. */
	const unsigned told = ESTIMATE_FLAG_HUM | ESTIMATE_FLAG_SPIKE;
	const unsigned doubts = (estimate->peak.how.flags | estimate->pulse.flags) & ~told;
	const unsigned late = doubts & ~(unsigned)ESTIMATE_FLAG_TOLERANCE;

	if (estimate->peak.how.status != ESTIMATE_OK)
		snprintf(text, size, "%s", estimate_status_name(estimate->peak.how.status));
	else if (estimate->pulse.status != ESTIMATE_OK)
		snprintf(text, size, "width %s", estimate_status_name(estimate->pulse.status));
	else
		snprintf(text, size, "%s", doubts ? estimate_flag_name(late ? late : doubts) : "ok");
	return text;
}

static void add_row(struct report_row *rows, size_t *count, struct report_row row,
                    enum estimate_status status)
{
	if (status != ESTIMATE_OK)
		row.measured = row.sigma = (double)NAN;
	row.difference_percent = 100.0 * (row.predicted - row.measured) / row.measured;
	if (!isfinite(row.difference_percent))
		row.difference_percent = (double)NAN;
	rows[(*count)++] = row;
}

static void compare_peaks(const struct report *report, struct report_row *rows, size_t *count)
{
	static const char *const names[MODEL_AXES] = {"S1X", "S1Y", "S2X", "S2Y"};
	static const char *const keys[MODEL_AXES] = {"s1x_peak_g", "s1y_peak_g", "s2x_peak_g", "s2y_peak_g"};
	static const char *const labels[MODEL_AXES] = {"S1 X peak", "S1 Y peak", "S2 X peak", "S2 Y peak"};

	for (enum model_axis axis = 0; axis < MODEL_AXES; axis++) {
		const struct estimate_channel *e = report_axis(report, names[axis]);

		add_row(rows, count,
		        (struct report_row){.key = keys[axis],
		                            .label = labels[axis],
		                            .unit = "g",
		                            .scale = 1.0,
		                            .decimals = 1,
		                            .predicted = report->prediction->peak[axis].value_g,
		                            .measured = e ? e->peak.value_g : (double)NAN,
		                            .sigma = e ? e->peak.sigma_g : (double)NAN},
		        e ? e->peak.how.status : ESTIMATE_SHORT);
	}
}

static void compare_resultants(const struct report *report, struct report_row *rows, size_t *count)
{
	static const char *const names[] = {"S1", "S2"};
	static const char *const keys[] = {"s1_resultant_g", "s2_resultant_g"};
	static const char *const labels[] = {"S1 resultant", "S2 resultant"};

	for (size_t sensor = 0; sensor < 2; sensor++) {
		struct report_row row = {.key = keys[sensor],
		                         .label = labels[sensor],
		                         .unit = "g",
		                         .scale = 1.0,
		                         .decimals = 1,
		                         .predicted = report->prediction->resultant[sensor].value_g,
		                         .measured = (double)NAN,
		                         .sigma = (double)NAN};
		enum estimate_status status = ESTIMATE_SHORT;

		for (size_t i = 0; i < report->analysis->resultant_count; i++) {
			const struct estimate_resultant *r = &report->analysis->resultants[i];

			if (strcmp(r->sensor, names[sensor]))
				continue;
			row.measured = r->peak_g;
			row.sigma = r->sigma_g;
			status = r->how.status;
		}
		add_row(rows, count, row, status);
	}
}

bool report_driven(const struct report *report)
{
	const struct estimate_lag *lag = &report->analysis->lag;

	return report->analysis->has_lag && lag->driven.status == ESTIMATE_OK &&
	       !(lag->driven.flags & ESTIMATE_FLAG_MODEL) && isfinite(lag->driven_s);
}

/* The model counts three oscillations between zero crossings: against it stands what was counted likewise.
 * Where too few could be counted, it is the fitted one. A count has no uncertainty of its own. */
static void measured_frequency(const struct estimate_ringdown *plate, struct report_row *row)
{
	bool counted = isfinite(plate->three_cycle_frequency_hz);

	row->label = counted ? "plate, 3 cycles" : "plate frequency";
	row->measured = counted ? plate->three_cycle_frequency_hz : plate->frequency_hz;
	row->sigma = counted ? (double)NAN : plate->sigma_hz;
}

/* Rows of one prediction, with what was measured. */
static size_t facts_compare(const struct report *report, struct report_row rows[REPORT_ROWS_MAX])
{
	const struct analysis *a = report->analysis;
	const struct model_prediction *p = report->prediction;
	struct report_row lag = {
	        .key = "lag_s", .label = "S1 after S2", .unit = "ms", .scale = 1e3, .decimals = 3};
	struct report_row frequency = {
	        .key = "plate_frequency_hz", .unit = "Hz", .scale = 1.0, .decimals = 2};
	struct report_row damping = {.key = "plate_damping_ratio",
	                             .label = "plate damping",
	                             .unit = "",
	                             .scale = 1.0,
	                             .decimals = 4};
	bool driven = report_driven(report);
	size_t count = 0;

	if (!p)
		return 0;
	compare_peaks(report, rows, &count);
	compare_resultants(report, rows, &count);
	lag.predicted = p->lag_s;
	lag.measured = driven ? a->lag.driven_s : a->lag.largest_peak_s;
	lag.sigma = driven ? a->lag.sigma_driven_s : a->lag.sigma_s;
	add_row(rows, &count, lag, driven ? ESTIMATE_OK : a->has_lag ? a->lag.status : ESTIMATE_SHORT);
	if (!p->has_plate) /* the model's lag is 0 then: any measured one would differ by 100 % */
		rows[count - 1].difference_percent = (double)NAN;
	if (p->has_plate) {
		frequency.predicted = p->plate_frequency_hz;
		measured_frequency(&a->plate, &frequency);
		damping.predicted = p->plate_damping_ratio;
		damping.measured = a->plate.damping_ratio;
		damping.sigma = a->plate.sigma_damping;
		add_row(rows, &count, frequency, a->has_plate ? a->plate.how.status : ESTIMATE_SHORT);
		add_row(rows, &count, damping, a->has_plate ? a->plate.how.status : ESTIMATE_SHORT);
	}
	return count;
}

static const char *verdict_of(const struct report_row *row)
{
	double apart = fabs(row->predicted - row->measured) / hypot(row->predicted_u, row->sigma);

	if (!isfinite(apart))
		return "";
	return apart <= 2.0 ? "agrees" : apart <= 4.0 ? "2 sigma" : "not possible";
}

/* What one drop may show of a prediction: [fit] of the scene, angle and speed about what was set, gains. */
static void facts_judge(const struct report *report, struct report_row rows[], size_t count)
{
	struct ensemble e = {.scene = report->scene, .options = model_defaults, .axes = 2};
	struct fit_options usual;
	double u[ENSEMBLE_OUTPUTS];
	bool known = false;

	if (count > 0 && report->scene && ensemble_fitted(report->scene)) {
		usual = fit_options_usual(report->scene);
		e.fidelity = report->prediction->rung;
		e.axis[0].sd = usual.angle_sd_deg;
		e.axis[1].sd = 2.0 * usual.speed_sd * report->scene->drop_height_m;
		known = vary_find("angle", &e.axis[0].key) == 0 && vary_find("height", &e.axis[1].key) == 0 &&
		        ensemble_bars(&e, u);
	}
	for (size_t i = 0; i < count; i++) {
		rows[i].predicted_u = (double)NAN;
		for (int k = 0; k < ENSEMBLE_OUTPUTS && known; k++)
			if (strcmp(rows[i].key, ensemble_outputs[k].key) == 0)
				rows[i].predicted_u = u[k];
		if (known && strcmp(rows[i].unit, "g") == 0)
			rows[i].predicted_u = hypot(rows[i].predicted_u,
			                            usual.gain_sd[rows[i].key[1] - '1'] * rows[i].predicted);
		rows[i].verdict = verdict_of(&rows[i]);
	}
}

size_t report_compare(const struct report *report, struct report_row rows[REPORT_ROWS_MAX])
{
	struct report_row below[REPORT_ROWS_MAX];
	struct report lower = *report;
	size_t count = facts_compare(report, rows);

	facts_judge(report, rows, count);
	lower.prediction = report->prediction ? report->below : NULL;
	for (size_t i = 0; i < count; i++)
		rows[i].rungs_apart = (double)NAN;
	if (facts_compare(&lower, below) == count)
		for (size_t i = 0; i < count; i++)
			rows[i].rungs_apart = fabs(below[i].predicted - rows[i].predicted);
	return count;
}
