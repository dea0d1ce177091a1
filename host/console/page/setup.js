/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Which series is made: a new one, one like an earlier one, or one that is not done. */
import { getJson, post } from "./api.js";
import { attempt, byId, el, setText, show } from "./dom.js";
import { holding, take } from "./hold.js";
import { degrees, number } from "./words.js";

const PRESETS = 4,
	UNFINISHED = 40;

let scenes = [];
let names = new Set();
let nameIsTyped = false;

const scene = () => scenes.find(({ name }) => name === byId("scene").value);

/* The scene and the angle, and a number when that is taken. */
function suggestName() {
	if (nameIsTyped) return;
	const base = `${byId("scene").value}-${byId("angle").value}`;
	let name = base;
	for (let i = 2; names.has(name); i++) name = `${base}-${i}`;
	byId("series-name").value = name;
}

function chosenScene() {
	const chosen = scene();
	if (!chosen) return;
	setText(byId("scene-title"), chosen.title);
	byId("angle").value = chosen.angle_deg;
	byId("height").value = chosen.height_m;
	suggestName();
}

function usePreset(preset) {
	byId("scene").value = preset.scene;
	chosenScene();
	byId("angle").value = preset.angle_deg;
	byId("height").value = preset.height_m;
	byId("planned").value = preset.planned;
	byId("campaign").value = preset.campaign;
	nameIsTyped = false;
	suggestName();
}

function showPresets(presets) {
	const known = presets.filter((preset) => scenes.some(({ name }) => name === preset.scene)).slice(0, PRESETS);
	show(byId("presets-box"), known.length > 0);
	byId("presets").replaceChildren(
		...known.map((preset) =>
			el(
				"button",
				{ type: "button", on: { click: () => usePreset(preset) } },
				`${preset.scene}, ${degrees(preset.angle_deg)}°, ${number(preset.height_m, 3)} m, ${preset.planned} drops`,
			),
		),
	);
}

function showUnfinished(series) {
	const open = series.filter(
		(one) => one.accepted < one.planned && scenes.some(({ name }) => name === one.scene),
	);
	open.sort((a, b) => (b.last || b.created).localeCompare(a.last || a.created));
	show(byId("continue"), open.length > 0);
	byId("continue-series").replaceChildren(
		...open
			.slice(0, UNFINISHED)
			.map((one) =>
				el(
					"option",
					{ value: one.name },
					`${one.name}: ${one.accepted} of ${one.planned} accepted, ${degrees(one.angle_deg)}°`,
				),
			),
	);
}

/* What can be chosen, from the console. */
export async function fill() {
	const [setup, { series }] = await Promise.all([getJson("/api/setup"), getJson("/api/series")]);
	const before = byId("scene").value;
	scenes = setup.scenes;
	names = new Set(series.map(({ name }) => name));
	byId("scene").replaceChildren(...scenes.map(({ name }) => el("option", { value: name }, name)));
	byId("history-scene").replaceChildren(
		el("option", { value: "" }, "all"),
		...[...new Set([...scenes.map(({ name }) => name), ...series.map((one) => one.scene)])].map((name) =>
			el("option", { value: name }, name),
		),
	);
	byId("campaigns").replaceChildren(
		...[...new Set(series.map(({ campaign }) => campaign))].map((value) => el("option", { value })),
	);
	showPresets(setup.presets);
	showUnfinished(series);
	if (before) byId("scene").value = before;
	else chosenScene();
	suggestName();
}

const numeric = (id) => Number(byId(id).value);

async function begin(selected) {
	await take();
	const { series } = await post("/api/series", {
		name: byId("series-name").value,
		campaign: byId("campaign").value,
		scene: byId("scene").value,
		angle_deg: numeric("angle"),
		height_m: numeric("height"),
		planned: numeric("planned"),
	});
	await post("/api/select", { series });
	nameIsTyped = false;
	selected();
}

function stepBy(button) {
	const input = byId(button.dataset.stepOf);
	const to = Number(input.value) + Number(button.dataset.by);
	input.value = String(Math.round(1000 * Math.max(Number(input.min), Math.min(Number(input.max), to))) / 1000);
	suggestName();
}

/* selected(): a series was. */
export function listen(selected) {
	byId("scene").addEventListener("change", chosenScene);
	byId("angle").addEventListener("input", suggestName);
	byId("series-name").addEventListener("input", () => {
		nameIsTyped = byId("series-name").value !== "";
	});
	for (const button of document.querySelectorAll("[data-step-of]"))
		button.addEventListener("click", () => stepBy(button));
	byId("setup-form").addEventListener("submit", (event) => {
		event.preventDefault();
		attempt(() => begin(selected));
	});
	byId("continue").addEventListener("submit", (event) => {
		event.preventDefault();
		attempt(async () => {
			await holding(() => post("/api/select", { series: byId("continue-series").value }));
			selected();
		});
	});
}
