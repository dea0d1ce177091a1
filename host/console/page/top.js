/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What is always visible: state, interlocks, heartbeat, bus, losses, disk, who may arm. */
import { byId, el, setData, setText, show, sign } from "./dom.js";
import { STATES, bytes, clock, inputWords, number, plain } from "./words.js";
import { atRest } from "./workflow.js";

const SIGNS = {
	BOOT: "wait",
	SAFE: "hold",
	READY: "good",
	ARMED: "warn",
	FALLING: "down",
	SEPARATED: "down",
	BRAKED: "down",
	CAPTURED: "wait",
	UPLOADED: "wait",
	FAULT_HELD: "bad",
	FAULT_MOVING: "bad",
	KEEP_OUT: "bad",
};

function fact(id, text, level = "good") {
	const node = byId(id);
	if (node.dataset.text === text && node.dataset.level === level) return;
	node.dataset.text = text;
	node.dataset.level = level;
	node.replaceChildren(...(level === "good" ? [] : [sign(level === "bad" ? "bad" : "warn")]), text);
}

function heartbeat({ heartbeat_age_s: age }) {
	if (age === null) return fact("heartbeat", "none", "bad");
	return fact("heartbeat", `${number(age, 1)} s`, age < 0.3 ? "good" : age < 0.5 ? "warn" : "bad");
}

function bus({ load_percent: load, classic }) {
	const level = load < 75 ? "good" : load < 92 ? "warn" : "bad";
	fact("bus", `${number(load, 0)} %${classic ? ", classic" : ""}`, level);
}

/* Losses count from the last ARM: what is long past says nothing of the next drop. All of them are in the details. */
let counted = { base: {}, since: "the start", armed: false };

function lost(losses, tower) {
	const armed = tower.state === "ARMED";
	const { base } = counted;
	if (armed && !counted.armed) counted = { base: losses, since: clock(), armed };
	else if (losses.blocks < base.blocks || losses.link < base.link || losses.errors < base.errors)
		counted = { base: {}, since: "the start", armed };
	else counted.armed = armed;
	const some = Object.entries({ blocks: "blocks", link: "frames", errors: "bus errors" })
		.map(([key, what]) => [losses[key] - (counted.base[key] ?? 0), what])
		.filter(([count]) => count > 0)
		.map(([count, what]) => `${count} ${what}`);
	const text = some.length ? `${some.join(", ")} since ${counted.since}` : "none";
	fact("lost", text, some.length ? "warn" : "good");
	byId("lost").title = `${text}; ${losses.asked_again} blocks were asked for again`;
}

/* In full, below the header: why the tower cannot be used, and what the archive could not take. */
function troubles(state) {
	const all = [state.tower.trouble, state.disk.trouble && `Archive: ${state.disk.trouble}`].filter(Boolean);
	show(byId("trouble"), all.length > 0);
	setText(byId("trouble"), all.join(". "));
}

function disk({ free_bytes: free, drops_left: left }) {
	const many = left > 1000 ? "" : `, ${number(left, 0)} drops`;
	return fact("disk", `${bytes(free)}${many}`, left < 5 ? "bad" : left < 50 ? "warn" : "good");
}

function hold({ mine, taken }) {
	if (mine) return fact("hold", "this console");
	return taken ? fact("hold", "another", "warn") : fact("hold", "nobody");
}

function chips(host, items) {
	const text = JSON.stringify(items);
	if (host.dataset.shown === text) return;
	host.dataset.shown = text;
	host.replaceChildren(
		...items.map(({ words, level }) =>
			el(
				"li",
				{ data: { level } },
				sign(level === "good" ? "good" : level === "plain" ? "hold" : "bad"),
				words,
			),
		),
	);
}

/* In motion nothing is as it is at rest, and that is no fault. */
function interlocks(inputs, resting) {
	const items = inputs.map((input) => {
		const { text, good } = inputWords(input);
		return { words: text, level: good ? "good" : resting ? "bad" : "plain" };
	});
	const good = items.filter(({ level }) => level === "good").length;
	const all = good === items.length;
	const count = { words: all ? `all ${good} inputs as needed` : `${good} of ${items.length} inputs as needed` };
	chips(byId("interlocks"), [...items, { ...count, level: all ? "good" : resting ? "bad" : "plain" }]);
}

function stateWords(tower) {
	if (!tower.open) return ["NO LINK", tower.trouble || "the link to the tower is not open"];
	if (!tower.seen) return ["NO TOWER", tower.trouble || "nothing was heard of the tower yet"];
	if (tower.state === "READY" && tower.blocked) return ["NOT READY", tower.trouble];
	const fault = tower.fault && tower.fault !== "NONE" ? tower.fault_text : "";
	return [tower.state.replace("_", " "), fault || (STATES[tower.state] ?? tower.text)];
}

function stateTile(tower) {
	const known = tower.open && tower.seen;
	const [name, text] = stateWords(tower);
	const shown = tower.blocked && tower.state === "READY" ? "SAFE" : tower.state;
	const changed = byId("state").textContent !== name;
	setText(byId("state"), name);
	setText(byId("state-text"), text);
	byId("state-text").title = text;
	setData(byId("state-tile"), "state", known ? shown : "NONE");
	byId("state-sign").setAttribute("href", `#sign-${(known && SIGNS[shown]) || "unknown"}`);
	if (changed) setText(byId("announce"), `${name}: ${text}`);
	document.title = `${name} – drop tower`;
}

function details(state) {
	setText(byId("version"), `console ${state.version}, ${state.tower.url}`);
	if (!byId("details").open) return;
	chips(
		byId("outputs"),
		state.outputs.map(({ name, on }) => ({
			words: `${plain(name)} ${on ? "on" : "off"}`,
			level: on ? "good" : "plain",
		})),
	);
	byId("counters").replaceChildren(
		...Object.entries({ ...state.counters, blocks_lost: state.lost.blocks, frames_lost: state.lost.link }).map(([name, value]) =>
			el("div", {}, el("dt", {}, plain(name)), el("dd", {}, String(value))),
		),
	);
}

export function showTop(state) {
	stateTile(state.tower);
	heartbeat(state.tower);
	bus(state.bus);
	lost(state.lost, state.tower);
	disk(state.disk);
	troubles(state);
	hold(state.hold);
	fact("kind", state.simulation ? "simulated" : "real");
	show(byId("simulated-strip"), state.simulation !== null);
	interlocks(state.inputs, atRest(state.tower));
	setText(
		byId("live-say"),
		state.bus.classic
			? "The tower is on classic CAN: nothing is live, drops are fetched after they are captured."
			: "Least and largest sample of every millisecond; the newest is at the line.",
	);
	details(state);
}

/* What stood there is old: it must not pass for the tower's state. */
export function showDisconnected(since, why) {
	setText(byId("state"), "UNKNOWN");
	setText(byId("state-text"), "what is shown is old");
	setData(byId("state-tile"), "state", "NONE");
	byId("state-sign").setAttribute("href", "#sign-unknown");
	setText(
		byId("connection"),
		`NOT CONNECTED since ${since}. ${why || "Trying again."} Use the emergency stop at the tower.`,
	);
	setText(byId("announce"), "Not connected");
	document.title = "NOT CONNECTED – drop tower";
	for (const id of ["heartbeat", "bus", "lost", "disk", "hold"]) fact(id, "?", "bad");
	chips(byId("interlocks"), [
		{ words: "inputs unknown", level: "bad" },
		{ words: "", level: "none" },
	]);
}
