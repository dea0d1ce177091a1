/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Names of the tower, of records and of analyses, in words; and numbers as a technician reads them. */

/* An input in words when it is on and off, and which of them a tower that is ready has. */
const INPUTS = {
	LATCH_CLOSED: ["latch closed", "latch open", true],
	PRODUCT_HELD: ["product held", "no product held", true],
	DAMPERS_ENGAGED: ["dampers engaged", "dampers not engaged", true],
	DOOR_CLOSED: ["door closed", "door open", true],
	ESTOP_CLEAR: ["E-stop clear", "E-stop pressed", true],
	SUPPLY_GOOD: ["supply good", "supply low", true],
	GATE_UPPER: ["upper gate blocked", "upper gate clear", false],
	GATE_LOWER: ["lower gate blocked", "lower gate clear", false],
	FRAME_DOWN: ["frame down", "frame up", false],
	IEPE_S1: ["S1 cables good", "S1 cable bad", true],
	IEPE_S2: ["S2 cables good", "S2 cable bad", true],
};

/* What the tower says of a state, where that is not a technician's word or has no room. */
export const STATES = { SAFE: "at rest: see the checks", ARMED: "ready to drop: horn and lamp warn" };

/* A check that is green, in words; what to do for one that is not comes from the tower. */
export const GREEN = {
	LATCH: "frame latched",
	PRODUCT: "product held",
	DAMPERS: "dampers engaged",
	DOOR: "door closed",
	ESTOP: "E-stop clear",
	SUPPLY: "supply charged",
	GATES: "light gates clear",
	HOST: "host fits the tower",
	SENSOR_S1: "S1 quiet",
	SENSOR_S2: "S2 quiet",
	TRIGGER: "below the trigger",
	OPEN_S1: "S1 plugged in",
	OPEN_S2: "S2 plugged in",
	SHORT_S1: "S1 not shorted",
	SHORT_S2: "S2 not shorted",
	CLOCKS: "sample clocks 7 to 10",
	BROWN_OUT_LEVEL: "brown-out level set",
	ACKNOWLEDGE: "guards acknowledged",
	SETTLE: "green for a second",
};

export const plain = (name) =>
	name
		.toLowerCase()
		.replaceAll("_", " ")
		.replace(/\bs([12])\b/g, "S$1")
		.replace("estop", "E-stop");

export function inputWords({ name, on }) {
	const words = INPUTS[name];
	if (!words) return { text: `${plain(name)} ${on ? "on" : "off"}`, good: true };
	return { text: on ? words[0] : words[1], good: on === words[2] };
}

export const FLAGS = {
	lost_samples: "samples never arrived; they are left out, nothing is drawn or fitted across them",
	bad_samples: "samples were not taken",
	clipped: "beyond the sensor's range: the true peak may be higher",
	incomplete: "the capture could not be completed",
	crc_unknown: "the capture end is missing, so completeness cannot be proven",
	slow_frame: "the frame fell slower than free fall: check rails and bearings",
	no_impact: "no impact was seen: the capture was ended by time",
	fault: "a fault was latched during the drop",
	uneven_sampling: "the time column is not evenly spaced; the even grid next to it was used",
	full_scale: "at the converter's limit: the true value is unknown",
	overrun: "the controller missed samples; they are marked and left out",
	zero_shift: "the offset after the drop is not the one before: the sensor may have been overloaded",
	cable: "a sensor lost its supply during the drop: check its cable",
	stuck: "one value held where the signal moves: check sensor and converter",
	spike: "single outliers were left out: look for a loose contact",
	zeroed: "runs of exact zeros were left out: data were lost on the way",
	offset: "zero was far off before the pulse; it was taken off",
	drift: "zero moved before the pulse; that was taken off",
	hum: "mains or another hum shows before the pulse; it was taken off: check screen and earth",
	too_short: "the record begins or ends inside its pulse",
	zero_unsure: "more than noise before the pulse: zero is unsure",
	altered: "the capture end is not what the tower sealed: trust no number of this drop",
	separated_late: "the product left the frame later than planned",
	dropout_changed: "the magnet let go earlier or later than in the drops before: check it",
	frame_not_down: "the frame did not reach the dampers' end",
	unfiltered: "sampled too slowly for the low-pass asked for: left as it was",
	settling: "zero decays from the record's beginning on; that was taken off: let the supply settle first",
	no_line_end: "the file ends without a line end: its last row may be cut",
	same_names: "two columns have the same name in the file: check which is which",
	assumed: "the file does not tell its unit of time; it was taken by what a shock can be: check it",
};

const STATUS = {
	clipped: "clipped",
	short: "too short",
	no_peak: "no peak",
	ambiguous: "ambiguous",
	not_converged: "no fit",
};

export const statusWords = (status) => STATUS[status] ?? plain(status ?? "");

export const FAULTS = {
	door_open: "Door open",
	estop: "Emergency stop",
	supply_low: "Supply low",
	dampers_out: "Dampers out",
	gate_upper_dead: "Upper gate dead",
	gate_lower_dead: "Lower gate dead",
	gate_upper_wire: "Upper gate wire broken",
	gate_lower_wire: "Lower gate wire broken",
	frame_down_wire: "Frame-down wire broken",
	frame_reads_up: "Frame reads up",
	latch_reads_closed: "Latch reads closed",
	latch_reads_open: "Latch reads open",
	frame_jammed: "Frame jams",
	latch_stuck: "Latch stuck",
	magnet_weak: "Magnet weak",
	magnet_stuck: "Magnet sticks",
	cable_s1: "S1 cable open",
	cable_s2: "S2 cable open",
	short_s1: "S1 cable shorted",
	short_s2: "S2 cable shorted",
};

export function number(value, decimals = 1) {
	if (value === null || value === undefined || !Number.isFinite(value)) return "–";
	const text = value.toFixed(decimals);
	return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "−");
}

/* As it was set: 30, 37.5. */
export const degrees = (value) => (Number.isFinite(value) ? String(Math.round(100 * value) / 100) : "–");

/* Decimals that show two significant digits of an uncertainty; otherwise as many as given. */
export function decimalsOf(sigma, otherwise) {
	if (!(sigma > 0) || !Number.isFinite(sigma)) return otherwise;
	const [, exponent] = sigma.toExponential(1).split("e");
	return Math.max(0, Math.min(9, 1 - Number(exponent)));
}

/* Both to the same place: that of the uncertainty's second digit. */
export function withSigma(value, sigma, otherwise) {
	const decimals = decimalsOf(sigma, otherwise);
	const text = number(value, decimals);
	return text === "–" || !Number.isFinite(sigma) ? text : `${text} ± ${number(sigma, decimals)}`;
}

/* A drop's name where there is little room: its end tells drops apart. */
export const brief = (name) => (name.length > 26 ? `${name.slice(0, 11)}…${name.slice(-13)}` : name);

export function bytes(count) {
	if (!Number.isFinite(count)) return "–";
	const [size, unit] = count >= 1e9 ? [1e9, "GB"] : [1e6, "MB"];
	return `${(count / size).toFixed(count >= 1e10 ? 0 : 1)} ${unit}`;
}

const two = (n) => String(n).padStart(2, "0");

/* UTC in the archive, the laboratory's clock on the page; the date unless it is today. */
export function time(iso) {
	const date = new Date(iso);
	if (Number.isNaN(date.getTime())) return iso ?? "";
	const day = `${date.getFullYear()}-${two(date.getMonth() + 1)}-${two(date.getDate())}`;
	const clock = `${two(date.getHours())}:${two(date.getMinutes())}`;
	return date.toDateString() === new Date().toDateString() ? clock : `${day} ${clock}`;
}

const minuteOfUtc = (date) => date.toISOString().slice(0, 16);

/* A year, a month or a day of the laboratory's clock: its beginning, and that of the next. */
function periodOf(text) {
	const [, year, month, day] = /^(\d{4})(?:-(\d\d)(?:-(\d\d))?)?$/.exec(text.trim()) ?? [];
	if (year === undefined) return null;
	const [y, m, d] = [Number(year), month === undefined ? 0 : month - 1, day === undefined ? 1 : Number(day)];
	const from = new Date(y, m, d);
	if (from.getFullYear() !== y || from.getMonth() !== m || from.getDate() !== d) return null;
	if (month === undefined) return { from, next: new Date(y + 1, 0, 1) };
	return { from, next: day === undefined ? new Date(y, m + 1, 1) : new Date(y, m, d + 1) };
}

/* The minutes of UTC, from the first to the last, of a year, month or day of the laboratory's clock, or of two
 * with .. between. What is none of these stays as it was typed: the archive says what it expects. */
export function utcOf(text) {
	const [first, last = first, ...more] = text.split("..");
	const from = periodOf(first);
	const to = periodOf(last);
	if (!from || !to || more.length) return text;
	return `${minuteOfUtc(from.from)}..${minuteOfUtc(new Date(to.next.getTime() - 60000))}`;
}

export function clock() {
	const now = new Date();
	return [now.getHours(), now.getMinutes(), now.getSeconds()].map(two).join(":");
}
