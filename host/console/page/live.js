/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The last two seconds of six channels, as an oscilloscope sweeps: only what is new is drawn. */

const TICKS = 2000; /* milliseconds across */
const GAP = 40; /* ticks wiped ahead of the newest */
const LANES = ["S1 X", "S1 Y", "S1 Z", "S2 X", "S2 Y", "S2 Z"];
const COUNTS_PER_G = 32;
const OVER = 4; /* ticks drawn again: they share their pixels with what is wiped, and with the line */
const LOST = -32768;
const RANGES_G = [5, 10, 20, 50, 100, 200, 500, 1024];
const LABEL_PX = 84;
const EMPTY = 0,
	HERE = 1,
	MISSING = 2;

function decode(envelope) {
	const text = atob(envelope);
	const bytes = new Uint8Array(text.length);
	for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
	return new Int16Array(bytes.buffer, 0, bytes.length >> 1);
}

function colours() {
	const style = getComputedStyle(document.documentElement);
	const of = (name) => style.getPropertyValue(name).trim();
	return {
		page: of("--panel"),
		ink: of("--ink"),
		soft: of("--soft"),
		line: of("--line"),
		lost: of("--clip"),
		lanes: [of("--s1"), of("--s2")],
	};
}

export class Live {
	constructor(canvas) {
		this.canvas = canvas;
		this.pen = canvas.getContext("2d", { alpha: false });
		this.low = LANES.map(() => new Int16Array(TICKS));
		this.high = LANES.map(() => new Int16Array(TICKS));
		this.what = LANES.map(() => new Uint8Array(TICKS));
		this.range = LANES.map(() => RANGES_G[0]);
		this.next = 0;
		this.drawn = 0;
		this.missing = 0;
		this.colours = colours();
		matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
			this.colours = colours();
			this.drawAll();
		});
		new ResizeObserver(() => this.resize()).observe(canvas);
		setInterval(() => this.visible() && this.rescale(true) && this.drawAll(), 1000);
	}

	visible() {
		return this.canvas.clientWidth > 0;
	}

	resize() {
		const scale = devicePixelRatio || 1;
		const width = Math.round(this.canvas.clientWidth * scale);
		const height = Math.round(this.canvas.clientHeight * scale);
		if (width === 0 || (width === this.canvas.width && height === this.canvas.height)) return;
		this.canvas.width = width;
		this.canvas.height = height;
		this.drawAll();
	}

	put(channel, at, low, high) {
		const lost = low === LOST;
		this.low[channel][at] = low;
		this.high[channel][at] = high;
		this.what[channel][at] = lost ? MISSING : HERE;
		if (lost) this.missing++;
	}

	feed({ first, ticks, envelope }) {
		const values = decode(envelope);
		if (first < this.next || first > this.next + TICKS) this.restart(first);
		for (let t = this.next; t < first; t++) this.wipe(t % TICKS);
		for (let t = 0; t < ticks; t++)
			for (let c = 0; c < LANES.length; c++) {
				const i = 2 * (t * LANES.length + c);
				this.put(c, (first + t) % TICKS, values[i], values[i + 1]);
			}
		const from = this.next;
		this.next = first + ticks;
		for (let t = 0; t < GAP; t++) this.wipe((this.next + t) % TICKS);
		if (!this.visible()) return;
		if (this.rescale(false)) this.drawAll();
		else this.draw(Math.max(from - OVER, this.next - TICKS + GAP), this.next + GAP);
	}

	wipe(at) {
		for (const what of this.what) what[at] = EMPTY;
	}

	restart(first) {
		this.next = first;
		for (const what of this.what) what.fill(EMPTY);
		this.drawAll();
	}

	largest(channel) {
		const {
			low: { [channel]: low },
			high: { [channel]: high },
			what: { [channel]: what },
		} = this;
		let most = 0;
		for (let i = 0; i < TICKS; i++) if (what[i] === HERE) most = Math.max(most, high[i], -low[i]);
		return most / COUNTS_PER_G;
	}

	/* Grows at once; shrinks only when asked, so that the picture stands still. */
	rescale(shrink) {
		let changed = false;
		for (let c = 0; c < LANES.length; c++) {
			const most = this.largest(c);
			const wanted = RANGES_G.find((range) => range >= most) ?? RANGES_G.at(-1);
			if (wanted > this.range[c] || (shrink && wanted < this.range[c])) {
				this.range[c] = wanted;
				changed = true;
			}
		}
		return changed;
	}

	/* Also when it is seen again: while hidden nothing was drawn. */
	drawAll() {
		if (!this.visible() || this.canvas.width === 0) return;
		const { pen, canvas } = this;
		const scale = devicePixelRatio || 1,
			lane = Math.floor(canvas.height / LANES.length);
		pen.fillStyle = this.colours.page;
		pen.fillRect(0, 0, canvas.width, canvas.height);
		LANES.forEach((name, c) => {
			pen.fillStyle = this.colours.lanes[c < 3 ? 0 : 1];
			pen.font = `bold ${17 * scale}px sans-serif`;
			pen.fillText(name, 4 * scale, c * lane + lane / 2);
			pen.fillStyle = this.colours.soft;
			pen.font = `${13 * scale}px sans-serif`;
			pen.fillText(`±${this.range[c]} g`, 4 * scale, c * lane + lane / 2 + 17 * scale);
		});
		this.draw(this.next - TICKS + GAP, this.next + GAP);
	}

	/* Ticks from, to, which may go round the edge. */
	draw(from, to) {
		const left = Math.round(LABEL_PX * (devicePixelRatio || 1));
		const wide = (this.canvas.width - left) / TICKS;
		for (let c = 0; c < LANES.length; c++) this.drawLane(c, from, to, left, wide);
		this.pen.fillStyle = this.colours.ink;
		this.pen.fillRect(left + Math.floor((this.next % TICKS) * wide), 0, 2, this.canvas.height);
	}

	background(from, to, left, wide, top, lane) {
		const { pen } = this;
		const a = ((from % TICKS) + TICKS) % TICKS,
			count = Math.min(TICKS, to - from);
		const spans = [
			[a, Math.min(TICKS, a + count)],
			[0, a + count - TICKS],
		];
		for (const [begin, end] of spans) {
			if (end <= begin) continue;
			const x = left + Math.floor(begin * wide),
				w = left + Math.ceil(end * wide) - x;
			pen.fillStyle = this.colours.page;
			pen.fillRect(x, top, w, lane);
			pen.fillStyle = this.colours.line;
			pen.fillRect(x, top + (lane >> 1), w, 1);
			pen.fillRect(x, top, w, 1);
		}
	}

	drawLane(c, from, to, left, wide) {
		const {
			pen,
			low,
			high,
			what,
			colours: { lanes, lost },
		} = this;
		const lane = Math.floor(this.canvas.height / LANES.length),
			top = c * lane,
			middle = top + lane / 2;
		const perCount = (lane / 2 - 2) / (this.range[c] * COUNTS_PER_G);
		this.background(from, to, left, wide, top, lane);
		pen.fillStyle = lanes[c < 3 ? 0 : 1];
		for (let t = from; t < to; t++) {
			const at = ((t % TICKS) + TICKS) % TICKS;
			if (what[c][at] === EMPTY) continue;
			const x = left + Math.floor(at * wide),
				w = Math.max(1, Math.ceil(wide));
			if (what[c][at] === MISSING) {
				pen.fillStyle = lost;
				pen.fillRect(x, top + 1, w, lane - 2);
				pen.fillStyle = lanes[c < 3 ? 0 : 1];
				continue;
			}
			const a = middle - high[c][at] * perCount,
				b = middle - low[c][at] * perCount;
			pen.fillRect(x, a, w, Math.max(1.5, b - a));
		}
	}
}
