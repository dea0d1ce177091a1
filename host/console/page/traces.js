/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The drop that was made last, or is looked at: its traces at their own rates, the model, the spectrum. */
import { Group, colour, gaps, onScheme, times } from "./charts.js";
import { modelOf, spectrumOf, traceOf } from "./drops.js";
import { byId, message, setText } from "./dom.js";
import { brief } from "./words.js";

const PULSE_MS = [-5, 60];

const group = new Group();
const spectrumGroup = new Group();
let shown = { drop: "", trace: null, model: null, ranges: {} };

/* Told apart without colour: S1 solid, S2 dashed, Z dotted. */
const DASH = { S1Z: [2, 3], S2Z: [9, 3, 2, 3] };

const line = (name) => ({ stroke: colour(name.startsWith("S1") ? "--s1" : "--s2") });
const label = (name) => (name.endsWith("R") ? `${name.slice(0, 2)} XY` : `${name.slice(0, 2)} ${name[2]}`);

function measured(name) {
	const channel = shown.trace.of(name);
	if (!channel) return [];
	return [
		{
			label: label(name),
			x: times(channel),
			y: gaps(channel.samples),
			measured: true,
			...line(name),
			dash: DASH[name] ?? (name.startsWith("S2") ? [9, 3] : undefined),
		},
	];
}

function modelled(name) {
	const channel = shown.model?.of(name);
	if (!channel) return [];
	return [
		{
			label: `model ${label(name)}`,
			x: times(channel),
			y: gaps(channel.samples),
			stroke: colour("--ink"),
			width: 1.5,
			dash: name.startsWith("S1") ? [8, 4] : [2, 3],
			visible: byId("show-model").checked,
		},
	];
}

function rate(names) {
	const channel = names.map(shown.trace.of).find(Boolean);
	return channel ? `${channel.rate_hz / 1000} kHz` : "";
}

function chart(id, title, names) {
	const series = [...names.flatMap(measured), ...names.flatMap(modelled)];
	const range = Math.min(...names.map((name) => shown.ranges[name] ?? Infinity));
	const limit = Number.isFinite(range) ? { value: range, text: `sensor range ${range} g` } : undefined;
	if (series.length) group.add(byId(id), series, { title: `${title}, ${rate(names)}`, limit });
}

function drawTraces(span = PULSE_MS) {
	if (!shown.trace) return;
	group.clear();
	chart("chart-x", "X", ["S1X", "S2X"]);
	chart("chart-yz", "Y and Z (dotted)", ["S1Y", "S2Y", "S1Z", "S2Z"]);
	chart("chart-r", "Resultant of X and Y", ["S1R", "S2R"]);
	group.zoom(...span);
	setText(byId("traces-say"), `Drop ${shown.drop}. Zero: ${shown.trace.zero}.`);
}

async function drawModel(drop) {
	const model = await modelOf(drop).catch(() => null);
	if (shown.drop !== drop || !model) return;
	shown.model = model;
	drawTraces(group.span ?? PULSE_MS);
}

/* The traces first, the model when it is computed. */
export async function showTraces(drop, result) {
	const trace = await traceOf(drop);
	const ranges = Object.fromEntries((result?.channels ?? []).map((c) => [c.name, c.range_g]));
	shown = { drop, trace, model: null, ranges };
	drawTraces();
	drawModel(drop);
	if (!byId("panel-spectrum").hidden) drawSpectrum();
}

export async function drawSpectrum() {
	const { drop } = shown;
	if (!drop) return;
	const spectrum = await spectrumOf(drop, byId("spectrum-kind").value).catch((error) => message(error.message));
	if (!spectrum || drop !== shown.drop) return;
	const [unit, scale] = spectrum.unit === "m" ? ["mm", 1000] : [spectrum.unit, 1];
	spectrumGroup.clear();
	spectrumGroup.add(
		byId("spectrum"),
		spectrum.channels.map(({ name, value }) => ({
			label: label(name),
			x: spectrum.frequency_hz,
			y: value.map((v) => (v > 0 ? scale * v : null)),
			...line(name),
			unit,
			decimals: unit === "g" ? 1 : 4,
			dash: { Y: [8, 4], Z: [3, 3], R: [1, 2] }[name[2]],
		})),
		{
			title: `Drop ${brief(drop)}, Q ${spectrum.q}`,
			unit,
			height: 420,
			log: true,
			xUnit: "Hz",
			xDecimals: 1,
		},
	);
}

export function listen() {
	for (const button of document.querySelectorAll("[data-zoom]"))
		button.addEventListener("click", () => group.zoom(...button.dataset.zoom.split(" ").map(Number)));
	byId("zoom-reset").addEventListener("click", () => group.reset());
	byId("show-model").addEventListener("change", ({ target }) =>
		group.toggle((text) => text.startsWith("model"), target.checked),
	);
	byId("spectrum-kind").addEventListener("change", drawSpectrum);
	onScheme(() => {
		drawTraces(group.span ?? PULSE_MS);
		drawSpectrum();
	});
}
