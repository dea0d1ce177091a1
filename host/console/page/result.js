/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What came out of a drop, on one card. */
import { byId, el, show } from "./dom.js";
import { FLAGS, number, plain, statusWords, withSigma } from "./words.js";

/* The value is what is read from afar. */
function valueAndSigma(text) {
	const [value, sigma] = text.split(" ± ");
	return sigma ? [value, el("span", { class: "sigma" }, ` ± ${sigma}`)] : [value];
}

function cell(key, value, sigma, status, decimals = 1) {
	const ok = !status || status === "ok";
	return el(
		"td",
		{ class: "number", data: { key, value: value ?? "" } },
		...valueAndSigma(withSigma(value, sigma, decimals)),
		ok ? null : el("b", { class: "warn" }, ` ⚠ ${statusWords(status)}`),
	);
}

function peaks(result) {
	const channel = (name) => result.channels.find((c) => c.name === name)?.peak ?? {};
	const resultant = (sensor) => result.resultants.find((r) => r.sensor === sensor) ?? {};
	const rows = ["X", "Y", "Z"].map((axis) =>
		el(
			"tr",
			{},
			el("th", { scope: "row" }, axis),
			...["S1", "S2"].map((sensor) => {
				const peak = channel(sensor + axis);
				return cell(`${sensor}_${axis}`.toLowerCase(), peak.value_g, peak.sigma_g, peak.status);
			}),
		),
	);
	rows.push(
		el(
			"tr",
			{ class: "strong" },
			el("th", { scope: "row" }, "XY"),
			...["S1", "S2"].map((sensor) => {
				const r = resultant(sensor);
				return cell(`${sensor}_r`.toLowerCase(), r.peak_g, r.sigma_g, r.status);
			}),
		),
	);
	return el(
		"table",
		{ class: "peaks" },
		el(
			"thead",
			{},
			el(
				"tr",
				{},
				el("th", { class: "number" }, "peak, g"),
				el("th", { class: "s1", scope: "col" }, "S1"),
				el("th", { class: "s2", scope: "col" }, "S2"),
			),
		),
		el("tbody", {}, ...rows),
	);
}

function fact(head, key, value, text) {
	return el("div", {}, el("dt", {}, head), el("dd", { data: { key, value: value ?? "" } }, text));
}

function withStatus(text, status) {
	return !status || status === "ok" ? text : `${text} (${statusWords(status)})`;
}

/* JSON's null is no number, but times 1000 it is 0. */
const milli = (seconds) => (Number.isFinite(seconds) ? 1000 * seconds : NaN);

const inUnit = (text, unit) => (text === "–" ? text : `${text} ${unit}`);

function velocity(result, sensor) {
	const pulse = result.channels.find((c) => c.name === `${sensor}X`)?.pulse;
	return fact(
		`Velocity change, ${sensor} X`,
		`${sensor.toLowerCase()}_velocity`,
		pulse?.velocity_change_m_s,
		inUnit(withSigma(pulse?.velocity_change_m_s, pulse?.sigma_velocity_m_s, 2), "m/s"),
	);
}

function facts(result) {
	const { lag, plate, model } = result;
	const items = [];
	if (lag)
		items.push(
			fact(
				"S1 after S2",
				"lag_largest_peak",
				lag.largest_peak_s,
				withStatus(inUnit(withSigma(milli(lag.largest_peak_s), milli(lag.sigma_s), 3), "ms"), lag.status),
			),
		);
	if (plate)
		items.push(
			fact(
				"Plate",
				"frequency",
				plate.frequency_hz,
				withStatus(inUnit(withSigma(plate.frequency_hz, plate.sigma_hz, 1), "Hz"), plate.status),
			),
			fact(
				"Damping ratio",
				"damping",
				plate.damping_ratio,
				withSigma(plate.damping_ratio, plate.sigma_damping, 4),
			),
		);
	items.push(velocity(result, "S2"), velocity(result, "S1"));
	if (model?.fidelity) items.push(fact("Model", "model", model.fidelity, difference(model)));
	return el("dl", { class: "facts-list" }, ...items);
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
function flagLines(result) {
	const of = new Map((result.flags ?? []).map((flag) => [flag, []]));
	for (const channel of result.channels)
		for (const flag of channel.flags ?? []) of.set(flag, [...(of.get(flag) ?? []), channel.name]);
	return [...of].map(([flag, names]) =>
		el(
			"li",
			{ data: { flag } },
			el("b", {}, `⚠ ${plain(flag)}`),
			names.length ? ` on ${names.join(", ")}: ` : ": ",
			FLAGS[flag] ?? "",
		),
	);
}

function verdict(result) {
	if (result.lost_samples > 0)
		return el("p", { class: "warn" }, `⚠ ${result.lost_samples} samples are missing.`);
	const whole = result.drop?.crc_agrees === true;
	return el(
		"p",
		{ class: whole ? "fine" : "warn" },
		whole ? "✓ Every sample arrived." : "⚠ Completeness is not proven.",
	);
}

export function showResult(name, result, simulated) {
	const lines = flagLines(result);
	byId("result").replaceChildren(
		el("h2", {}, `Drop ${name}`),
		...(simulated ? [el("p", { class: "soft", data: { key: "simulated" } }, "Simulated tower: no product fell.")] : []),
		verdict(result),
		peaks(result),
		facts(result),
		el("ul", { id: "flags" }, ...(lines.length ? lines : [el("li", { class: "fine" }, "✓ no flags")])),
	);
	show(byId("result"), true);
}

export function hideResult() {
	show(byId("result"), false);
}
