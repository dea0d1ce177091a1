/* SPDX-License-Identifier: GPL-3.0-or-later */
/* uPlot as this page uses it: charts in a group share cursor and zoom, lost samples are gaps, limits are lines. */
import uPlot from "./uplot.js";
import { number } from "./words.js";

export function colour(name) {
	return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

/* Float32 with NaN to what uPlot takes for a gap. */
export function gaps(samples) {
	return Array.from(samples, (value) => (Number.isNaN(value) ? null : value));
}

export function times(channel) {
	const step = 1000 / channel.rate_hz,
		start = channel.start_s * 1000;
	return Array.from({ length: channel.count }, (_, i) => start + i * step);
}

/* One x axis for series of different rates; where a series has no sample of its own stands undefined, and uPlot
 * draws across. Nothing is resampled. */
function align(series) {
	const same = ({ x }) =>
		x.length === series[0].x.length && x[0] === series[0].x[0] && x.at(-1) === series[0].x.at(-1);
	if (series.every(same)) return [series[0].x, ...series.map(({ y }) => y)];
	return uPlot.join(series.map(({ x, y }) => [x, y]));
}

/* No digits beyond what a scale has. */
const plainNumber = (value) => (value == null ? "" : String(Number(value.toPrecision(9))).replace("-", "−"));

function axes(unit, xUnit) {
	const common = {
		stroke: colour("--ink"),
		font: "14px sans-serif",
		grid: { stroke: colour("--line"), width: 1 },
		ticks: { stroke: colour("--line"), width: 1 },
		values: (_, values) => values.map(plainNumber),
		labelSize: 20,
		labelFont: "14px sans-serif",
	};
	return [
		{ ...common, size: 28, label: xUnit },
		{ ...common, size: 58, label: unit },
	];
}

/* The range of a logarithmic scale, its ends to one digit: uPlot would go on to the next power of ten, and its ticks,
 * which go from the lower end by that end's power of ten, meet the next power from such an end only. */
function oneDigit(min, max) {
	const round = (value, way) => {
		const [digits, power] = value.toExponential(9).split("e");
		return Number(`${way(Number(digits))}e${power}`);
	};
	return min > 0 ? [round(min, Math.floor), round(Math.max(max, 1.1 * min), Math.ceil)] : [1, 10];
}

function drawLimit(chart, limit) {
	const { ctx, bbox } = chart;
	ctx.save();
	ctx.strokeStyle = ctx.fillStyle = colour("--bad");
	ctx.font = `${13 * devicePixelRatio}px sans-serif`;
	ctx.textAlign = "left";
	ctx.textBaseline = "bottom";
	ctx.setLineDash([8 * devicePixelRatio, 5 * devicePixelRatio]);
	for (const value of [limit.value, -limit.value]) {
		const y = chart.valToPos(value, "y", true);
		if (y < bbox.top || y > bbox.top + bbox.height) continue;
		ctx.beginPath();
		ctx.moveTo(bbox.left, y);
		ctx.lineTo(bbox.left + bbox.width, y);
		ctx.stroke();
		ctx.fillText(limit.text, bbox.left + 6 * devicePixelRatio, y - 4 * devicePixelRatio);
	}
	ctx.restore();
}

/* What is beyond the limit, in fat dots: a clipped sample must not look like any other. */
function drawBeyond(chart, limit) {
	const { ctx } = chart,
		[from, to] = chart.series[0].idxs ?? [0, -1];
	ctx.save();
	ctx.fillStyle = colour("--bad");
	for (let s = 1; s < chart.data.length; s++) {
		if (!chart.series[s].show || !chart.series[s].measured) continue;
		for (let i = from; i <= to; i++) {
			if (!(Math.abs(chart.data[s][i]) > limit.value)) continue;
			ctx.beginPath();
			ctx.arc(
				chart.valToPos(chart.data[0][i], "x", true),
				chart.valToPos(chart.data[s][i], "y", true),
				3 * devicePixelRatio,
				0,
				2 * Math.PI,
			);
			ctx.fill();
		}
	}
	ctx.restore();
}

/* Line and dash of each series in the legend: colour alone tells too few apart. */
function legendLines(chart) {
	const markers = chart.root.querySelectorAll(".u-legend .u-series");
	chart.series.forEach(({ lineStyle }, i) => {
		const marker = markers[i]?.querySelector(".u-marker");
		if (!lineStyle || !marker) return;
		const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
		const line = document.createElementNS("http://www.w3.org/2000/svg", "path");
		const { stroke, width, dash = [] } = lineStyle;
		const attributes = { d: "M0 6H36", stroke, "stroke-width": width, "stroke-dasharray": dash.join(" ") };
		for (const [name, value] of Object.entries(attributes)) line.setAttribute(name, value);
		svg.setAttribute("class", "line");
		svg.setAttribute("aria-hidden", "true");
		svg.append(line);
		marker.replaceWith(svg);
	});
}

/* The legend switches series with a click; let it do so by key as well. */
function keyLegend(chart) {
	for (const head of chart.root.querySelectorAll(".u-legend .u-series:not(:first-child) th")) {
		head.tabIndex = 0;
		head.setAttribute("role", "button");
		head.addEventListener("keydown", (event) => {
			if (event.key === "Enter" || event.key === " ") {
				event.preventDefault();
				head.click();
			}
		});
	}
}

function keyCursor(chart, event) {
	const way = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
	if (!way) return;
	event.preventDefault();
	const [first, last] = chart.series[0].idxs;
	const from = chart.cursor.idx ?? Math.round((first + last) / 2);
	const to = Math.max(first, Math.min(last, from + way * (event.shiftKey ? 10 : 1)));
	chart.setCursor({ left: chart.valToPos(chart.data[0][to], "x"), top: chart.over.clientHeight / 2 });
}

function toSeries({ label, stroke, dash, width = 2, unit = "g", decimals = 1, measured = false, visible = true }) {
	return {
		label,
		stroke,
		dash,
		width,
		lineStyle: { stroke, dash, width },
		measured,
		show: visible,
		points: { show: false },
		spanGaps: false,
		value: (chart, value) =>
			value === undefined || chart.cursor.idx == null ? "" : value === null ? "–" : `${number(value, decimals)} ${unit}`,
	};
}

export class Group {
	#charts = [];
	#sync = uPlot.sync(`group-${Group.#count++}`);
	#span = null;
	#busy = false;
	static #count = 0;

	/* series: [{label, x, y, stroke, dash, width, unit, measured, visible}]; options: {title, unit, height, limit,
	 * log, xUnit}. Replaces what the host showed. */
	add(host, series, options) {
		const { title, unit = "g", height = 210, limit, log = false, xUnit = "ms", xDecimals = 3 } = options;
		const fit = log ? { range: (_, min, max) => oneDigit(min, max) } : {};
		/* where the page has little room it says how high */
		const size = () => ({
			width: Math.max(280, host.clientWidth),
			height: parseFloat(getComputedStyle(host).getPropertyValue("--chart-height")) || height,
		});
		host.replaceChildren();
		const chart = new uPlot(
			{
				title,
				...size(),
				cursor: {
					sync: { key: this.#sync.key, scales: ["x", null] },
					drag: { x: true, y: false },
					points: { size: 7 },
				},
				scales: { x: { time: false, distr: log ? 3 : 1, ...fit }, y: { distr: log ? 3 : 1, ...fit } },
				axes: axes(unit, xUnit),
				series: [
					{
						label: log ? "frequency" : "time",
						value: (_, value) => (value == null ? "" : `${number(value, xDecimals)} ${xUnit}`),
					},
					...series.map(toSeries),
				],
				hooks: {
					draw: limit ? [(u) => drawLimit(u, limit), (u) => drawBeyond(u, limit)] : [],
					setScale: [(u, key) => key === "x" && this.#follow(u)],
					ready: [legendLines, keyLegend],
				},
			},
			align(series),
			host,
		);
		host.tabIndex = 0;
		host.setAttribute("role", "group");
		host.setAttribute("aria-label", `${title}: arrow keys move the cursor`);
		host.onkeydown = (event) => event.target === host && keyCursor(chart, event);
		const sizes = new ResizeObserver(() => host.clientWidth > 0 && chart.setSize(size()));
		sizes.observe(host);
		this.#charts.push({ chart, host, sizes });
		if (this.#span) chart.setScale("x", this.#span);
		return chart;
	}

	#follow(from) {
		if (this.#busy) return;
		const { min, max } = from.scales.x;
		if (min == null) return;
		this.#busy = true;
		for (const { chart } of this.#charts)
			if (chart !== from && (chart.scales.x.min !== min || chart.scales.x.max !== max))
				chart.setScale("x", { min, max });
		this.#busy = false;
	}

	/* What is seen of x, to be seen again after drawing anew. */
	get span() {
		const { min, max } = this.#charts[0]?.chart.scales.x ?? {};
		return min == null ? null : [min, max];
	}

	zoom(min, max) {
		this.#span = { min, max };
		for (const { chart } of this.#charts) chart.setScale("x", { min, max });
	}

	reset() {
		this.#span = null;
		const whole = this.#charts.map(({ chart }) => chart.data[0]).filter((x) => x.length);
		if (!whole.length) return;
		this.zoom(Math.min(...whole.map((x) => x[0])), Math.max(...whole.map((x) => x.at(-1))));
		this.#span = null;
	}

	/* Those series whose label passes. */
	toggle(passes, visible) {
		for (const { chart } of this.#charts)
			chart.series.forEach(
				(series, i) => i > 0 && passes(series.label) && chart.setSeries(i, { show: visible }),
			);
	}

	clear() {
		for (const { chart, host, sizes } of this.#charts) {
			sizes.disconnect();
			chart.destroy();
			host.replaceChildren();
		}
		this.#charts = [];
	}
}

/* Colours are drawn into the canvas: another scheme means drawing again. */
export function onScheme(draw) {
	matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
}
