/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Tones for who looks at the tower: armed, released, a good drop, one to look at. */
import { byId, setData } from "./dom.js";

const KEY = "droptower.tones";
/* Hz and s of each note */
const TONES = {
	armed: [[880, 0.12], [0, 0.08], [880, 0.12]],
	released: [[523, 0.5]],
	good: [[659, 0.12], [880, 0.25]],
	flagged: [[392, 0.25], [262, 0.5]],
};

let context = null; /* a browser lets a page sound once somebody has pressed something */

export function tone(name) {
	if (!TONES[name]) return;
	setData(document.documentElement, "tone", name);
	if (!context || !byId("tones").checked) return;
	let at = context.currentTime;
	for (const [hz, s] of TONES[name]) {
		if (hz) {
			const note = new OscillatorNode(context, { frequency: hz });
			const level = new GainNode(context, { gain: 0.3 });
			note.connect(level).connect(context.destination);
			note.start(at);
			note.stop(at + s);
		}
		at += s;
	}
}

export function listen() {
	byId("tones").checked = localStorage.getItem(KEY) !== "off";
	byId("tones").addEventListener("change", ({ target }) => localStorage.setItem(KEY, target.checked ? "on" : "off"));
	const open = () => (context ??= new AudioContext());
	for (const first of ["pointerdown", "keydown"]) addEventListener(first, open, { once: true, capture: true });
}
