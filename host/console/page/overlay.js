/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Several drops over each other: one axis at a time, S1 above S2, a colour and a dash for each drop. */
import { Group, colour, gaps, onScheme, times } from "./charts.js";
import { modelOf, traceOf } from "./drops.js";
import { el, setText } from "./dom.js";
import { brief } from "./words.js";

const AXES = [
	["R", "XY, resultant"],
	["X", "X"],
	["Y", "Y"],
	["Z", "Z"],
];
const DASHES = [undefined, [10, 4], [3, 3], [12, 3, 3, 3]];
const COLOURS = 7; /* --drop-0 ... */
const MOST = 20;

export class Overlay {
	#group = new Group();
	#drops = [];
	#given = 0;
	#round = 0;

	constructor(host, id) {
		this.axis = el(
			"select",
			{ id: `${id}-axis` },
			...AXES.map(([value, text]) => el("option", { value }, text)),
		);
		this.model = el("input", { type: "checkbox", id: `${id}-model` });
		this.model.checked = true;
		this.say = el("p", { class: "soft", role: "status" });
		this.hosts = ["S1", "S2"].map((sensor) =>
			el("div", { class: "chart", id: `${id}-${sensor.toLowerCase()}` }),
		);
		host.append(this.tools(id), this.say, ...this.hosts);
		this.axis.addEventListener("change", () => this.draw());
		this.model.addEventListener("change", () => this.draw());
		onScheme(() => this.draw());
	}

	tools(id) {
		const button = (text, f) => el("button", { type: "button", on: { click: f } }, text);
		return el(
			"div",
			{ class: "row tools" },
			el("label", { for: `${id}-axis` }, "Axis"),
			this.axis,
			button("Pulse", () => this.#group.zoom(-2, 10)),
			button("Ringing", () => this.#group.zoom(-5, 60)),
			button("Whole drop", () => this.#group.reset()),
			el("label", { class: "tick" }, this.model, " Model"),
		);
	}

	/* drops: ["box-30/1", ...]; drawn when it can be seen. */
	set(drops) {
		const newest = drops.slice(-MOST);
		if (newest.join() === this.#drops.join()) return;
		this.#drops = newest;
		this.#given = drops.length;
		this.draw();
	}

	visible() {
		return this.hosts[0].offsetParent !== null;
	}

	async draw() {
		const round = ++this.#round;
		if (!this.visible()) return;
		const traces = await Promise.all(this.#drops.map((drop) => traceOf(drop).catch(() => null)));
		const first = this.#drops.find((_, i) => traces[i]);
		const model = this.model.checked && first ? await modelOf(first).catch(() => null) : null;
		if (round !== this.#round) return;
		this.#group.clear();
		const missing = this.#drops.filter((_, i) => !traces[i]);
		const say = [
			!this.#drops.length && "No drop yet.",
			this.#given > MOST && `The last ${MOST} of ${this.#given} drops.`,
			missing.length > 0 && `No traces of ${missing.join(", ")}.`,
		];
		setText(this.say, say.filter(Boolean).join(" "));
		["S1", "S2"].forEach((sensor, i) => this.chart(this.hosts[i], sensor, traces, model));
		this.#group.zoom(-5, 60);
	}

	chart(host, sensor, traces, model) {
		const name = sensor + this.axis.value,
			text = AXES.find(([value]) => value === this.axis.value)[1];
		const series = traces.flatMap((trace, i) => {
			const channel = trace?.of(name);
			return channel
				? [
						{
							label: brief(this.#drops[i]),
							x: times(channel),
							y: gaps(channel.samples),
							measured: true,
							stroke: colour(`--drop-${i % COLOURS}`),
							dash: DASHES[Math.floor(i / COLOURS) % DASHES.length],
						},
					]
				: [];
		});
		const channel = model?.of(name);
		if (channel)
			series.push({
				label: "model",
				x: times(channel),
				y: gaps(channel.samples),
				stroke: colour("--ink"),
				dash: [2, 3],
				width: 2.5,
			});
		if (series.length) this.#group.add(host, series, { title: `${sensor} ${text}`, height: 250 });
	}
}
