/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Presses: which of them count, and keys for what is done in every drop. A press counts when it began on a control that
 * could be used by then; a key that is held down is one press. What a bar-code scanner types presses nothing: its
 * characters come faster than a finger's, and its Enter is no key of a command. ABORT's key is in abort.js. */
import { byId } from "./dom.js";

const KEYS = { A: "arm", R: "release", K: "accept", X: "reject", C: "clear" };
const ALSO = { C: "acknowledge" }; /* never both can be seen */
const FOOT = "droptower.foot"; /* the key of a foot switch, or of any device that sends keys */
const FOOT_DOES = { arm: "arm", release: "release", decide: "accept" };
const QUIET_MS = 120; /* a finger leaves so much between two keys */
const SCAN_LEAST = 3; /* characters */
const MODIFIERS = new Set(["Shift", "Control", "Alt", "Meta", "CapsLock"]);

const isText = (node) => node instanceof Element && node.matches("input, select, textarea");
const isCommand = (node) => node instanceof Element && node.matches("#now button[data-command]");
const usable = (node) => node && node.offsetParent !== null && !node.disabled;

let down = new Set(); /* codes of keys */
let lastKey = -Infinity; /* of any key: performance.now() */
let waiting = 0; /* timer of a press that another key would make void */
let typed = ""; /* what may be a scan */
let learns = false;
let hold = { begin: () => {}, end: () => {} }; /* of ARM */
let scanned = () => {};

export const footKey = () => localStorage.getItem(FOOT) ?? "";

/* What the key is for now: a button, or undefined. */
function meant({ key, shiftKey, ctrlKey, altKey, metaKey, target }) {
	if (ctrlKey || altKey || metaKey) return undefined;
	if (key === footKey()) {
		const foot = byId(FOOT_DOES[document.documentElement.dataset.step] ?? "");
		return foot?.dataset.reason === "yes" ? undefined : (foot ?? undefined);
	}
	if (key === " " && isCommand(target)) return target;
	if (!shiftKey || isText(target)) return undefined;
	return [KEYS, ALSO].map((keys) => byId(keys[key.toUpperCase()] ?? "")).find(usable);
}

function press(button) {
	if (button.id === "arm") return hold.begin(button);
	waiting = setTimeout(() => usable(button) && button.click(), QUIET_MS);
}

function scan({ key, target }, quick) {
	if (key === "Enter") {
		if (typed.length >= SCAN_LEAST && !isText(target)) scanned(typed);
		typed = "";
	} else if (key.length === 1) typed = quick ? typed + key : key;
}

function learn({ key }) {
	learns = false;
	/* what a scanner or a keyboard types, and what has its own meaning, stays what it is */
	const isFree = key.length > 1 && !["Escape", "Enter", "Tab", "Backspace", "Delete"].includes(key);
	if (isFree) localStorage.setItem(FOOT, key);
	document.dispatchEvent(new Event("foot"));
}

function onDown(event) {
	const { key, code, repeat, target } = event;
	if (MODIFIERS.has(key)) return;
	const isNew = !repeat && !down.has(code);
	const quick = performance.now() - lastKey < QUIET_MS;
	if (isCommand(target) && (key === "Enter" || key === " ")) event.preventDefault();
	if (target.id === "reason" && key === "Enter") event.preventDefault();
	if (key === footKey()) event.preventDefault();
	if (!isNew) return;
	down.add(code);
	lastKey = performance.now();
	clearTimeout(waiting);
	hold.end();
	if (learns) {
		event.preventDefault();
		learn(event);
		return;
	}
	scan(event, quick);
	const button = meant(event);
	if (!usable(button) || (quick && key !== footKey())) return;
	event.preventDefault();
	press(button);
}

function onUp(event) {
	const { key, code, target } = event;
	down.delete(code);
	if (isCommand(target) && key === " ") event.preventDefault();
	if (!MODIFIERS.has(key)) hold.end();
}

/* A finger that was down before the control could be used has not pressed it. */
function onlyNewPresses() {
	let began = null;
	const begin = ({ target }) => {
		const button = target.closest?.("button");
		began = usable(button) ? button : null;
	};
	addEventListener("pointerdown", begin, { capture: true });
	addEventListener(
		"click",
		(event) => {
			const button = event.target.closest?.("button[data-command]");
			if (!button || event.detail === 0 || button === began) return;
			event.preventDefault();
			event.stopImmediatePropagation();
		},
		{ capture: true },
	);
}

/* holds: {begin(button), end()} of what must be held; onScan(text). */
export function listen(holds, onScan) {
	hold = holds;
	scanned = onScan;
	onlyNewPresses();
	addEventListener("keydown", onDown);
	addEventListener("keyup", onUp);
	addEventListener("blur", () => {
		down = new Set();
		clearTimeout(waiting);
		hold.end();
	});
	const say = () => {
		byId("foot").textContent = learns ? "Press it now" : `Foot switch: ${footKey() || "none"}`;
		byId("foot-none").hidden = footKey() === "";
	};
	byId("foot").addEventListener("click", () => {
		learns = true;
		say();
	});
	byId("foot-none").addEventListener("click", () => {
		localStorage.removeItem(FOOT);
		say();
	});
	document.addEventListener("foot", say);
	say();
}
