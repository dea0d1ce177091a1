/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What was dropped before: search, decide, lay any drops over each other, take tables and reports home. */
import { download, getJson } from "./api.js";
import { COLUMNS } from "./columns.js";
import { attempt, button, byId, el, setText, show, table } from "./dom.js";
import { Overlay } from "./overlay.js";
import { dropTable, isBusy } from "./table.js";
import { degrees, number, time, utcOf, withSigma } from "./words.js";

const ROWS = 100; /* of series, the newest, then a button for more */
const PLATE = COLUMNS.filter(({ unit }) => unit !== "g"); /* what is not of one sensor */

const chosen = new Set();
let overlay = null;
let openSeries = "";
let openDrop = () => {};

const query = () => ({
	campaign: byId("history-campaign").value.trim(),
	scene: byId("history-scene").value,
	angle_deg: byId("history-angle").value,
	date: utcOf(byId("history-date").value.trim()),
	text: byId("history-text").value.trim(),
});

const HEAD = [
	"series",
	"campaign",
	"geometry",
	"angle °",
	"height m",
	"accepted",
	"rejected",
	"undecided",
	"partial",
	"last drop",
];

function seriesRow(one) {
	const texts = [
		one.campaign,
		one.scene,
		degrees(one.angle_deg),
		number(one.height_m, 3),
		`${one.accepted} of ${one.planned}`,
		String(one.rejected),
		String(one.recorded - one.accepted - one.rejected - one.faulty),
		[one.partial, one.faulty && `${one.faulty} altered or missing`].filter((text) => text !== 0).join(", ") || "0",
		one.last ? time(one.last) : "–",
	];
	const name = button(one.name, () => unfold(one.name), { class: "link" });
	const cells = texts.map((text, i) => el("td", { "data-label": HEAD[i + 1] }, text));
	return el(
		"tr",
		{ data: { series: one.name } },
		el("th", { scope: "row", "data-label": HEAD[0] }, name),
		...cells,
	);
}

export async function search(most = ROWS) {
	await attempt(async () => {
		const { series, more } = await getJson("/api/series", { ...query(), limit: most });
		const host = byId("history-list");
		host.replaceChildren(table(HEAD, series.map(seriesRow)));
		if (more) host.append(button("Show more", () => search(most + ROWS)));
		setText(byId("history-count"), more ? `the newest ${series.length} series` : `${series.length} series`);
		if (!byId("tables").hidden) await tables();
	});
}

function choose(name, on) {
	if (on) chosen.add(name);
	else chosen.delete(name);
	show(byId("history-chosen"), chosen.size > 0);
	overlay.set([...chosen]);
}

async function unfold(name) {
	openSeries = name;
	await load();
	byId("history-drops").scrollIntoView({ block: "nearest" });
}

function unfoldedHead(name, drops) {
	const recorded = drops.filter((drop) => drop.state === "recorded");
	const all = async () => {
		for (const drop of recorded) choose(`${drop.series}/${drop.number}`, true);
		await load();
	};
	const file = (what, path, query, ending) =>
		button(what, () => attempt(() => download(path, query, `${name}.${ending}`)));
	return el(
		"div",
		{ class: "row" },
		el("h2", {}, `Series ${name}`),
		button("Overlay all", all),
		file("Table as CSV", "/api/csv", { series: name }, "csv"),
		file("Report", `/api/report/${encodeURIComponent(name)}`, {}, "html"),
	);
}

/* The drops of the series that is unfolded, again when something changed. */
export async function load() {
	const host = byId("history-drops");
	const asked = openSeries;
	if (!asked || isBusy(host)) return;
	await attempt(async () => {
		const answer = await getJson("/api/drops", { series: asked });
		if (asked !== openSeries || isBusy(host)) return;
		const drops = dropTable(answer, { open: openDrop, choose, chosen });
		host.replaceChildren(unfoldedHead(asked, answer.drops), drops);
		show(host, true);
	});
}

/* ---- means and ratios ---- */

function meanText(mean, unit, scale, decimals) {
	if (!mean?.n) return "–";
	const sd = mean[`sd_${unit}`];
	return withSigma(mean[`mean_${unit}`] * scale, sd === null ? NaN : sd * scale, decimals);
}

const ratio = (of) => (of ? ["x", "y", "r"].map((axis) => number(of[axis], 2)).join(" / ") : "–");

const place = (one) => [one.scene, one.campaign, `${degrees(one.angle_deg)}°`];

function textTable(head, rows) {
	const cell = (text, i) => el(i ? "td" : "th", { "data-label": head[i] }, text);
	return table(
		head,
		rows.map((texts) => el("tr", {}, ...texts.map(cell))),
	);
}

const SENSOR_HEAD = ["geometry", "campaign", "angle", "sensor", "n", "X", "Y", "XY", "Z"];

function sensorRow(one) {
	const means = ["x", "y", "r", "z"].map((axis) => meanText(one[axis], "g", 1, 1));
	return [
		...place(one),
		one.sensor,
		String(one.drops),
		...means,
		one.sensor === "S1" ? ratio(one.s1_over_s2) : "–",
		one.reference ? `${ratio(one.over_reference)} (${one.reference})` : "–",
	];
}

function plateRow(one) {
	const means = PLATE.map((column) => meanText(one[column.mean], column.unit, column.scale, column.decimals));
	return [...place(one), String(one.drops), ...means];
}

async function tables() {
	const answer = await getJson("/api/tables", { campaign: query().campaign });
	const sensors = [...SENSOR_HEAD, "S1 / S2: X / Y / XY", "over reference"];
	const plates = ["geometry", "campaign", "angle", "n", ...PLATE.map(({ head, shown }) => `${head} ${shown}`)];
	byId("tables").replaceChildren(
		el("h2", {}, "Means ± SD of accepted drops, g"),
		textTable(sensors, answer.tables.map(sensorRow)),
		el("h2", {}, "Lag and plate"),
		textTable(plates, answer.plates.map(plateRow)),
	);
}

export const drawOverlay = () => overlay.draw();

export function listen(open) {
	openDrop = open;
	overlay = new Overlay(byId("history-overlay"), "history-overlay");
	byId("history-form").addEventListener("submit", (event) => {
		event.preventDefault();
		search();
	});
	byId("history-csv").addEventListener("click", () => attempt(() => download("/api/csv", query(), "drops.csv")));
	byId("history-clear").addEventListener("click", () => {
		chosen.clear();
		choose("", false);
		load();
	});
	byId("tables-show").addEventListener("click", () =>
		attempt(async () => {
			const shown = byId("tables").hidden;
			if (shown) await tables();
			show(byId("tables"), shown);
		}),
	);
}
