/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The one thing to do now, the checks, and which controls may be used. */
import * as arm from "./arm.js";
import * as decide from "./decide.js";
import { byId, el, setData, setText, show, sign } from "./dom.js";
import { serial } from "./serial.js";
import { isBusy } from "./table.js";
import { GREEN, degrees, number, plain } from "./words.js";
import { atRest, placeOf, stepOf } from "./workflow.js";

const PANELS = ["setup", "checks", "fault", "arm", "release", "moving", "wait", "decide"];

const DEAD_MS = 500; /* what takes another control's place is not pressed by the press that was meant for that one */

let current = "";
let changed = -Infinity; /* performance.now() at which the step began, or what its controls mean changed */
let means = ""; /* what the controls mean */
let shown = null; /* the model drawn last */
let watched = false; /* another console held the arm, and ours has not taken it since */

function mark(step) {
	const place = placeOf(step);
	[...byId("steps").children].forEach((item, i) => {
		setData(item, "when", i < place ? "before" : i > place ? "after" : "now");
		if (i === place) item.setAttribute("aria-current", "step");
		else item.removeAttribute("aria-current");
	});
}

/* What is scrolled to must not end up below what always stays on top, which is not always as high. */
export function listen() {
	const always = [byId("top"), byId("banners")];
	const room = () => {
		const height = always.reduce((sum, node) => sum + node.offsetHeight, 10);
		document.documentElement.style.scrollPaddingTop = `${height}px`;
	};
	const sizes = new ResizeObserver(room);
	for (const node of always) sizes.observe(node);
}

/* What is to do now is at the top; where it all fits, the row of steps above it too. */
function toNow() {
	if (matchMedia("(max-width: 900px)").matches) byId(current === "decide" ? "result" : "now").scrollIntoView({ block: "start" });
	else scrollTo(0, 0);
}

/* Keys must not act on what took the place of the control they were meant for: focus goes to the step's title. */
function change(step) {
	const panel = byId(`step-${current || "setup"}`);
	const hadFocus = panel.contains(document.activeElement) || document.activeElement === document.body;
	for (const name of PANELS) show(byId(`step-${name}`), name === step);
	current = step;
	setData(document.documentElement, "step", step);
	mark(step);
	arm.hold.end();
	if (!byId("drop").hidden && !isBusy(byId("series-table"))) toNow();
	if (!hadFocus) return;
	const title = byId(`step-${step}`).querySelector("h2");
	title.tabIndex = -1;
	title.focus({ preventScroll: true });
}

/* What, once open, must be acknowledged by a person who has looked. */
const GUARDS = ["ESTOP", "DOOR", "LATCH", "PRODUCT"];

function checksWords(red, acknowledge) {
	if (acknowledge) return "A guard was open, or the tower was off. Nobody in it, nothing in its way? Then acknowledge.";
	return red.length
		? "Do what is marked. When all is green, the tower is ready."
		: "All is green. The tower makes itself ready.";
}

function moving({ state }) {
	const stuck = state === "KEEP_OUT";
	setText(byId("moving-head"), stuck ? "Keep out" : "Drop under way");
	setText(
		byId("moving-say"),
		stuck
			? "The frame is neither down nor latched and may still fall. Do not reach in; bring it down from outside."
			: "Stay clear. The tower brakes the frame and records.",
	);
}

function checks(list) {
	const red = list.filter(({ green }) => !green);
	setText(byId("checks-summary"), red.length ? `${red.length} to do` : "all green");
	setData(byId("checks-summary"), "level", red.length ? "bad" : "good");
	setData(byId("checks-card"), "level", red.length ? "bad" : "good");
	const names = new Set(red.map(({ name }) => name));
	const acknowledge = names.has("ACKNOWLEDGE") && !GUARDS.some((name) => names.has(name));
	show(byId("acknowledge"), acknowledge);
	setText(byId("checks-say"), checksWords(red, acknowledge));
	const text = JSON.stringify(list);
	if (byId("checks").dataset.shown === text) return;
	byId("checks").dataset.shown = text;
	const item = ({ name, green, text: what }) =>
		el(
			"li",
			{ data: { check: name, green: green ? "yes" : "no" } },
			sign(green ? "good" : "bad"),
			el("span", {}, green ? (GREEN[name] ?? plain(name)) : what),
		);
	byId("checks").replaceChildren(...red.map(item), ...list.filter(({ green }) => green).map(item));
	byId("todo").replaceChildren(...red.map(item));
}

/* What is about to fall, where the eye is when it is let go. */
function context(series, step) {
	show(byId("context"), series !== null && ["checks", "arm", "release", "moving"].includes(step));
	if (!series) return;
	const { name, scene, angle_deg, height_m } = series;
	setText(byId("context"), `${scene}, ${degrees(angle_deg)}°, ${number(height_m, 3)} m, series ${name}${serial() ? `, serial ${serial()}` : ""}`);
}

function holdNotice({ mine, taken }) {
	if (taken && !mine) watched = true;
	if (mine) watched = false;
	show(byId("hold-notice"), watched);
	setText(
		byId("hold-text"),
		taken
			? "The tower is operated from another console. This one watches; ABORT works here too."
			: "Nobody operates the tower. Take it over to work from here.",
	);
	show(byId("hold-take"), !taken);
	show(byId("hold-give"), mine);
}

function setDisabled(button, disabled) {
	if (button.disabled !== disabled) button.disabled = disabled;
}

function enable(model) {
	const { hold, tower } = model.state;
	const may =
		model.connected && model.known && performance.now() >= changed + DEAD_MS && !(hold.taken && !hold.mine);
	for (const button of document.querySelectorAll("[data-command]"))
		setDisabled(button, !may || (button.id === "release" && arm.warns()));
	if (!decide.isShown(model.pending))
		for (const button of byId("step-decide").querySelectorAll("[data-command]")) setDisabled(button, true);
	byId("hold-give").disabled = !model.connected;
	for (const id of ["change-series", "next-series"]) byId(id).disabled = !model.connected || !atRest(tower);
	for (const id of ["setup-go", "continue-go"]) byId(id).disabled = !may || !atRest(tower) || !tower.open;
	setData(document.documentElement, "hold", hold.mine ? "mine" : hold.taken ? "other" : "free");
}

export function disableAll() {
	for (const button of document.querySelectorAll("[data-command], [data-fault], #simulation button, #hold-give"))
		button.disabled = true;
}

/* model: {state, connected, known, pending, setupOpen}. Returns the step. */
export function render(model) {
	const { state } = model;
	shown = model;
	const step = stepOf({
		tower: state.tower,
		series: state.series,
		pending: model.pending,
		setupOpen: model.setupOpen,
	});
	if (step !== current) change(step);
	decide.render(model.pending);
	const now = [step, model.pending, decide.isShown(model.pending), decide.needsReason()].join(" ");
	if (now !== means) {
		means = now;
		changed = performance.now();
		setTimeout(() => shown.connected && enable(shown), DEAD_MS);
	}
	checks(state.checks);
	show(byId("checks-card"), step !== "decide" && (atRest(state.tower) || state.tower.state === "ARMED"));
	context(state.series, step);
	moving(state.tower);
	holdNotice(state.hold);
	arm.showArm(state);
	arm.follow(state);
	setText(byId("fault-text"), state.tower.fault_text);
	show(byId("todo"), step === "checks" || step === "fault" || step === "setup");
	show(byId("setup-back"), state.series !== null);
	enable(model);
	return step;
}
