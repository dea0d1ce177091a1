/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What came out of a drop, on one card, with all that is needed to decide on it first. */
import { byId, el, show } from "./dom.js";
import { FLAGS, number, plain, statusWords, withSigma } from "./words.js";

const OUTLIER_SD = 3;
const LEAST = 3; /* drops: of fewer the SD says little */

let shown = { name: "", doubts: [] };

/* The value is what is read from afar. Behind it U by the sensor's file, else the standard uncertainty of noise alone. */
function cell(key, value, { sigma, status, budget, scale = 1, decimals = 1 }) {
	const [read, unsure] = withSigma(value, budget ? scale * budget.expanded : sigma, decimals).split(" ± ");
	const title = budget ? `U, k = ${number(budget.k, 2)}: ${budget.largest}` : "one standard uncertainty, noise alone";
	return el(
		"td",
		{ class: "number", data: { key, value: value ?? "" } },
		read,
		unsure ? el("span", { class: "sigma", title }, ` ± ${unsure}${budget ? " U" : ""}`) : null,
		!status || status === "ok" ? null : el("b", { class: "warn" }, ` ⚠ ${statusWords(status)}`),
	);
}

const budgetOf = (result, what) => result.budget?.find((item) => item.what === what);

/* How many SDs the value is from the mean of the other accepted drops of its series; NaN of fewer than three. */
function deviation(key, value, others) {
	const values = others.filter((drop) => !drop.not_ok?.includes(key)).map((drop) => drop[`${key}_g`]);
	const known = values.filter(Number.isFinite);
	if (known.length < LEAST || !Number.isFinite(value)) return NaN;
	const mean = known.reduce((sum, v) => sum + v, 0) / known.length;
	return (value - mean) / Math.sqrt(known.reduce((sum, v) => sum + (v - mean) ** 2, 0) / (known.length - 1));
}

function deviationCell(key, value, others) {
	const sds = deviation(key, value, others);
	const level = Math.abs(sds) >= OUTLIER_SD ? "warn" : "soft";
	const text = Number.isFinite(sds) ? `${sds > 0 ? "+" : ""}${number(sds, 1)}` : "–";
	return el("td", { class: `number ${level}`, data: { key: `${key}_sd`, value: sds } }, text);
}

function row(head, cells) {
	return el("tr", {}, el("th", { scope: "row" }, head), ...cells.flat());
}

/* JSON's null is no number, but times 1000 it is 0. */
const milli = (seconds) => (Number.isFinite(seconds) ? 1000 * seconds : NaN);

const SENSORS = ["S1", "S2"];

function peakRow(axis, result, others) {
	return row(
		axis,
		SENSORS.map((sensor) => {
			const key = `${sensor}_${axis === "XY" ? "r" : axis}`.toLowerCase();
			const of =
				axis === "XY"
					? result.resultants.find((r) => r.sensor === sensor)
					: result.channels.find((c) => c.name === sensor + axis)?.peak;
			const value = of?.peak_g ?? of?.value_g;
			const budget = budgetOf(result, axis === "XY" ? `${sensor}.peak_g` : `${sensor}${axis}.peak.value_g`);
			return [cell(key, value, { sigma: of?.sigma_g, status: of?.status, budget }), deviationCell(key, value, others)];
		}),
	);
}

function pulseRow(head, result, what) {
	return row(
		head,
		SENSORS.map((sensor) => {
			const pulse = result.channels.find((c) => c.name === `${sensor}X`)?.pulse ?? {};
			return [what(sensor.toLowerCase(), pulse, (key) => budgetOf(result, `${sensor}X.pulse.${key}`)), el("td", {})];
		}),
	);
}

function numbers(result, others) {
	const head = SENSORS.flatMap((sensor) => [
		el("th", { class: sensor.toLowerCase(), scope: "col" }, sensor),
		el("th", { class: "soft", scope: "col" }, el("abbr", { title: "from the mean of the other accepted drops" }, "SDs")),
	]);
	return el(
		"table",
		{ class: "peaks" },
		el("thead", {}, el("tr", {}, el("th", { scope: "col" }, "peak, g"), ...head)),
		el(
			"tbody",
			{},
			...["X", "Y", "Z", "XY"].map((axis) => peakRow(axis, result, others)),
			pulseRow("pulse X, ms", result, (sensor, { duration_s, sigma_duration_s, status }, by) =>
				cell(`${sensor}_duration`, milli(duration_s), {
					sigma: milli(sigma_duration_s),
					status,
					budget: by("duration_s"),
					scale: 1000,
					decimals: 2,
				}),
			),
			pulseRow("ΔV X, m/s", result, (sensor, { velocity_change_m_s, sigma_velocity_m_s }, by) =>
				cell(`${sensor}_velocity`, velocity_change_m_s, {
					sigma: sigma_velocity_m_s,
					budget: by("velocity_change_m_s"),
					decimals: 2,
				}),
			),
		),
	);
}

function fact(head, key, value, text) {
	return el("div", {}, el("dt", {}, head), el("dd", { data: { key, value: value ?? "" } }, text));
}

function withStatus(text, status) {
	return !status || status === "ok" ? text : `${text} (${statusWords(status)})`;
}

const inUnit = (text, unit) => (text === "–" ? text : `${text} ${unit}`);

function plateFacts({ frequency_hz: hz, sigma_hz, damping_ratio: damping, sigma_damping, status }) {
	return [
		fact("Plate", "frequency", hz, withStatus(inUnit(withSigma(hz, sigma_hz, 1), "Hz"), status)),
		fact("Damping ratio", "damping", damping, withSigma(damping, sigma_damping, 4)),
	];
}

function lagFact({ largest_peak_s: lag, sigma_s, status }) {
	const text = withStatus(inUnit(withSigma(milli(lag), milli(sigma_s), 3), "ms"), status);
	return fact("S1 after S2", "lag_largest_peak", lag, text);
}

function processing({ filter, cutoff_hz: cutoff, highpass_undone_s: undone }) {
	const done = [
		filter && `${plain(filter)}${cutoff ? ` ${number(cutoff, 0)} Hz` : ""}`,
		undone && `high-pass of ${number(undone, 2)} s undone`,
	].filter(Boolean);
	return fact("Processing", "processing", done.length, done.join(", ") || "none");
}

function facts({ lag, plate, model, processing: done }) {
	return el(
		"dl",
		{ class: "facts-list" },
		lag ? lagFact(lag) : null,
		...(plate ? plateFacts(plate) : []),
		model?.fidelity ? fact("Model", "model", model.fidelity, difference(model)) : null,
		done ? processing(done) : null,
	);
}

function difference(model) {
	const percent = model.difference_percent ?? {};
	const parts = [
		["S1 XY", percent.s1_resultant_g],
		["S2 XY", percent.s2_resultant_g],
	]
		.filter(([, value]) => Number.isFinite(value))
		.map(([name, value]) => `${name} ${value > 0 ? "+" : ""}${number(value, 1)} %`);
	return [model.fidelity, ...parts].join(", ");
}

/* Each flag once, with the channels that have it. */
function flagsOf(result) {
	const of = new Map((result.flags ?? []).map((flag) => [flag, []]));
	for (const channel of result.channels)
		for (const flag of channel.flags ?? []) of.set(flag, [...(of.get(flag) ?? []), channel.name]);
	return of;
}

const flagLine = ([flag, names]) =>
	el(
		"li",
		{ data: { flag } },
		el("b", {}, `⚠ ${plain(flag)}`),
		names.length ? ` on ${names.join(", ")}: ` : ": ",
		FLAGS[flag] ?? "",
	);

function completeness(result) {
	if (result.lost_samples > 0) return `⚠ ${result.lost_samples} samples are missing.`;
	return result.drop?.crc_agrees === true ? "✓ Every sample arrived." : "⚠ Completeness is not proven.";
}

const MET = new Set(["pass", "conditional pass"]);

/* What speaks against taking the drop as it is, in words. */
function doubtsOf(result, verdict) {
	const complete = completeness(result);
	return [
		...flagsOf(result).keys(),
		complete.startsWith("⚠") && complete.slice(2),
		verdict && !MET.has(verdict) && `limits: ${verdict}`,
	].filter(Boolean);
}

const SIGN = { good: "✓", warn: "⚠", bad: "✗" };

/* Of the limits when there are some; else of what was found in the record. */
function verdictWords(verdict, doubts) {
	const level = verdict.includes("fail") ? "bad" : verdict === "pass" && !doubts.length ? "good" : "warn";
	if (verdict) return [level, verdict.toUpperCase()];
	return doubts.length ? ["warn", "LOOK FIRST"] : ["good", "NO FLAGS"];
}

/* drops: the archive's of its series, which may not be known yet. */
export function showResult(name, result, drops = []) {
	const rowOf = (drop) => `${drop.series}/${drop.number}` === name;
	const row = drops.find(rowOf);
	const others = drops.filter((drop) => drop.decision === "accepted" && drop.state === "recorded" && !rowOf(drop));
	const decided = result.verdict?.decision ?? "";
	const verdict = decided === "none" ? "" : decided;
	const doubts = doubtsOf(result, verdict);
	const [level, words] = verdictWords(verdict, doubts);
	const lines = [...flagsOf(result)].map(flagLine);
	const complete = completeness(result);
	shown = { name, doubts };
	byId("result").replaceChildren(
		el("div", { class: "title" }, el("h2", {}, name), el("p", { id: "verdict", data: { level } }, `${SIGN[level]} ${words}`)),
		el(
			"p",
			{},
			el("span", { class: complete.startsWith("✓") ? "fine" : "warn" }, complete),
			row?.simulated ? el("span", { class: "soft", data: { key: "simulated" } }, " Simulated tower: no product fell.") : null,
		),
		row?.note ? el("p", {}, `Note: ${row.note}`) : "",
		el("ul", { id: "flags" }, ...(lines.length ? lines : [el("li", { class: "fine" }, "✓ no flags")])),
		numbers(result, others),
		facts(result),
	);
	show(byId("result"), true);
}

export function hideResult(name = "") {
	shown = { name, doubts: ["no result"] };
	show(byId("result"), false);
}

/* {name, doubts}: the drop on the card, and what speaks against it. */
export const shownResult = () => shown;
