/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The series that is selected: its drops, mean and SD growing, overlay, files. */
import { download, getJson } from "./api.js";
import { attempt, byId, setText, show } from "./dom.js";
import { Overlay } from "./overlay.js";
import { dropTable, isBusy } from "./table.js";
import { degrees, number } from "./words.js";

let overlay = null;
let name = "";
let open = () => {};

/* Those that count and those that may still: what was rejected or broken off is not laid over the others. */
const overlaid = (drops) =>
	drops
		.filter((drop) => drop.state === "recorded" && drop.decision !== "rejected")
		.map((drop) => `${drop.series}/${drop.number}`);

/* underWay: the drop that is recorded now, which is not broken off. */
export function showHead(series, underWay) {
	name = series?.name ?? "";
	show(byId("series"), series !== null);
	if (!series) return;
	const partial = series.partial - (underWay.startsWith(`${series.name}/`) ? 1 : 0);
	const open = series.recorded - series.accepted - series.rejected - series.faulty;
	const counts = [
		`${series.accepted} of ${series.planned} accepted`,
		series.rejected && `${series.rejected} rejected`,
		open > 0 && `${open} undecided`,
		partial > 0 && `${partial} broken off`,
		series.faulty > 0 && `${series.faulty} altered or missing`,
	]
		.filter(Boolean)
		.join(", ");
	setText(byId("series-head"), `Series ${series.name}: ${counts}`);
	setText(
		byId("series-say"),
		[
			series.title || series.scene,
			`${degrees(series.angle_deg)}°`,
			`${number(series.height_m, 3)} m`,
			`campaign ${series.campaign}`,
		].join(", "),
	);
}

/* The drops of the series, newest last; null while somebody writes in the table. */
export async function load() {
	const host = byId("series-table"),
		asked = name;
	if (!asked || isBusy(host)) return null;
	const answer = await getJson("/api/drops", { series: asked });
	if (asked !== name || isBusy(host)) return null;
	host.replaceChildren(dropTable(answer, { open }));
	overlay.set(overlaid(answer.drops));
	return answer.drops;
}

export const drawOverlay = () => overlay.draw();

export function listen(openDrop) {
	open = openDrop;
	overlay = new Overlay(byId("overlay"), "overlay");
	byId("series-csv").addEventListener("click", () =>
		attempt(() => download("/api/csv", { series: name }, `${name}.csv`)),
	);
	byId("series-report").addEventListener("click", () =>
		attempt(() => download(`/api/report/${encodeURIComponent(name)}`, {}, `${name}.html`)),
	);
}
