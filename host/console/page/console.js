/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The page: what the console tells goes to the parts that show it. */
import * as abort from "./abort.js";
import { keepToken, post, takeId, takeToken } from "./api.js";
import * as arm from "./arm.js";
import { resultOf, rowsOf, traceOf } from "./drops.js";
import * as decide from "./decide.js";
import { attempt, byId, message, setData, show } from "./dom.js";
import * as history from "./history.js";
import { give, holding, retake, take } from "./hold.js";
import * as keys from "./keys.js";
import { Live } from "./live.js";
import { hideResult, showResult, shownResult } from "./result.js";
import * as photos from "./photos.js";
import * as series from "./series.js";
import * as serial from "./serial.js";
import * as setup from "./setup.js";
import * as simulation from "./simulation.js";
import * as steps from "./steps.js";
import { follow } from "./stream.js";
import { showDisconnected, showTop } from "./top.js";
import * as tones from "./tones.js";
import * as traces from "./traces.js";
import { clock } from "./words.js";
import { MOVING } from "./workflow.js";

const root = document.documentElement;
const isWall = location.pathname === "/wall"; /* read only, and big */
/* known: the archive has told the drops of the series, so that it is known whether one is undecided */
const model = { state: null, connected: false, known: false, pending: "", setupOpen: false };
const AGAIN_MS = 1000; /* until an archive that did not answer is asked again */
const seen = { revision: -1, series: "", result: "", captureEnd: NaN, step: "" };
let live = null;
let drops = [];

/* ---- tabs and views ---- */

const TABS = ["live", "traces", "spectrum", "overlay"];

function openTab(name) {
	for (const tab of TABS) {
		byId(`tab-${tab}`).setAttribute("aria-selected", String(tab === name));
		byId(`tab-${tab}`).tabIndex = tab === name ? 0 : -1;
		show(byId(`panel-${tab}`), tab === name);
	}
	if (name === "live") live?.drawAll();
	if (name === "spectrum") traces.drawSpectrum();
	if (name === "overlay") series.drawOverlay();
}

function openView(name) {
	for (const view of ["drop", "history"]) {
		byId(`view-${view}`).setAttribute("aria-pressed", String(view === name));
		show(byId(view), view === name);
	}
	show(byId("steps"), name === "drop");
	live?.drawAll();
	if (name !== "history") return;
	setup.fill().catch((error) => message(error.message));
	history.search();
	history.drawOverlay();
}

function tabKeys(event) {
	const way = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
	const at = TABS.findIndex((tab) => event.target.id === `tab-${tab}`);
	if (!way || at < 0) return;
	const to = TABS[(at + way + TABS.length) % TABS.length];
	openTab(to);
	byId(`tab-${to}`).focus();
}

function renderSteps() {
	const step = steps.render(model);
	photos.render(step, model.state.series?.name ?? "", byId("result").hidden ? "" : shownResult().name);
	return step;
}

/* ---- the drop that is shown ---- */

async function openDrop(name) {
	await attempt(async () => {
		/* asked for in the order in which it is shown; what fails is told below, where it is used */
		const found = resultOf(name).catch((error) => {
			if (error.status !== 404) throw error;
			return null;
		});
		const trace = traceOf(name),
			rows = rowsOf(name);
		for (const asked of [trace, rows]) asked.catch(() => {});
		const result = await found;
		if (result) showResult(name, result);
		else hideResult(name);
		openView("drop");
		openTab("traces");
		await traces.showTraces(name, result);
		if (result) showResult(name, result, await rows);
		setData(root, "result", name);
		renderSteps();
	});
}

/* Who reads old drops at a console that only watches is left there. */
const follows = () => model.state.hold.mine || byId("history").hidden;

/* A result that came while the page was open: how long it took is kept for who wants to know. */
async function newResult(name) {
	const { captureEnd } = seen;
	if (!follows() || MOVING.has(model.state.tower.state)) return;
	seen.captureEnd = NaN;
	await openDrop(name);
	if (!Number.isNaN(captureEnd)) setData(root, "resultMs", Math.round(performance.now() - captureEnd));
	tones.tone(shownResult().doubts.length ? "flagged" : "good");
}

const isOpen = (drop) =>
	drop.series === model.state?.series?.name && drop.state === "recorded" && drop.decision === "open";

/* The oldest drop of the series that nobody has decided on. */
function findPending() {
	const drop = drops.find(isOpen);
	model.pending = drop ? `${drop.series}/${drop.number}` : "";
}

async function reload() {
	const asked = model.state?.series?.name;
	const loaded = await series.load().catch((error) => message(error.message));
	if (loaded) {
		drops = loaded;
		model.known = true;
	} else if (asked && !model.known) setTimeout(reload, AGAIN_MS);
	if (!byId("history").hidden) history.load();
	findPending();
	photos.reload();
	if (!model.state || !model.connected) return;
	renderSteps();
	if (model.pending && model.state.hold.mine)
		serial.bind(model.pending, drops.find(isOpen)).catch((error) => message(error.message));
	/* Nobody is asked about a drop without seeing it; one that has just come is on its way already. */
	const { pending } = model;
	if (pending && pending !== root.dataset.result && pending !== seen.result && follows()) openDrop(pending);
}

/* ---- what the console tells ---- */

function followDrop(before, state) {
	if (before && MOVING.has(before.tower.state) && !MOVING.has(state.tower.state))
		seen.captureEnd = performance.now();
	if (MOVING.has(state.tower.state) && !(before && MOVING.has(before.tower.state)) && follows()) {
		openView("drop");
		openTab("live");
	}
}

/* Returns whether the drops have to be read again. */
function followArchive(state) {
	const { revision, result } = state.archive;
	const name = state.series?.name ?? "";
	const changed = revision !== seen.revision || name !== seen.series;
	if (!name) model.known = true;
	else if (name !== seen.series) model.known = false;
	if (name !== seen.series) {
		drops = [];
		if (!(root.dataset.result ?? "").startsWith(`${name}/`)) hideResult();
	}
	Object.assign(seen, { revision, series: name });
	if ((result ?? "") !== seen.result) {
		seen.result = result ?? "";
		if (result) newResult(result);
	}
	return changed;
}

function onState(state) {
	const before = model.state;
	model.state = state;
	setData(root, "state", state.tower.seen ? state.tower.state : "");
	setData(root, "phase", state.tower.phase);
	showTop(state);
	series.showHead(state.series, state.tower.drop);
	simulation.showSimulation(state.simulation, model.connected);
	followDrop(before, state);
	const changed = followArchive(state);
	findPending();
	if (before && state.tower.state !== before.tower.state)
		tones.tone({ ARMED: "armed", FALLING: "released" }[state.tower.state] ?? "");
	const step = renderSteps();
	if (step === "release" && seen.step !== "release" && follows()) openTab("live");
	if (step === "setup" && seen.step !== "setup") setup.fill().catch((error) => message(error.message));
	seen.step = step;
	if (changed) reload();
}

function onEvent(name, data) {
	if (name === "state") onState(data);
	else if (name === "live") {
		live.feed(data);
		setData(root, "live", Number(root.dataset.live) + 1);
	}
}

function onConnected(is, why) {
	model.connected = is;
	setData(root, "connected", is ? "yes" : "no");
	show(byId("connection"), !is);
	if (is) {
		seen.revision = -1; /* what came meanwhile is read again */
		model.known = false;
		seen.step = "";
		return;
	}
	showDisconnected(clock(), why);
	steps.disableAll();
}

/* ---- what the operator does ---- */

function openSetup(open) {
	model.setupOpen = open;
	steps.render(model);
	seen.step = open ? "setup" : "";
	if (open) setup.fill().catch((error) => message(error.message));
}

function listen() {
	abort.listen();
	arm.listen();
	keys.listen(arm.hold, serial.scanned);
	serial.listen();
	tones.listen();
	steps.listen();
	traces.listen();
	series.listen(openDrop);
	history.listen(openDrop);
	simulation.listen();
	setup.listen(() => openSetup(false));
	decide.listen(() => model.pending, openDrop);
	photos.listen((name) => post("/api/photos/discard", { series: name }));
	for (const tab of TABS) byId(`tab-${tab}`).addEventListener("click", () => openTab(tab));
	byId("tab-live").parentElement.addEventListener("keydown", tabKeys);
	for (const view of ["drop", "history"]) byId(`view-${view}`).addEventListener("click", () => openView(view));
	for (const id of ["change-series", "next-series"]) byId(id).addEventListener("click", () => openSetup(true));
	byId("setup-back").addEventListener("click", () => openSetup(false));
	for (const id of ["clear", "acknowledge"])
		byId(id).addEventListener("click", () => attempt(() => holding(() => post("/api/clear"))));
	byId("hold-take").addEventListener("click", () => attempt(take));
	byId("hold-give").addEventListener("click", () => attempt(give));
	document.addEventListener("written", reload);
	byId("message-close").addEventListener("click", () => message(""));
}

/* ---- start ---- */

function askToken() {
	show(byId("token-form"), true);
	show(byId("main"), false);
	byId("token").focus();
}

async function start() {
	listen();
	setData(root, "view", isWall ? "wall" : "desk");
	addEventListener("hashchange", () => takeToken() && location.reload());
	addEventListener("pageshow", (event) => event.persisted && location.reload());
	document.addEventListener("unauthorised", askToken);
	byId("token-form").addEventListener("submit", (event) => {
		event.preventDefault();
		keepToken(byId("token").value.trim());
		location.reload();
	});
	if (!takeToken()) return askToken();
	await takeId();
	show(byId("main"), true);
	openTab("live");
	live = new Live(byId("live"));
	if (!isWall) retake();
	follow(onEvent, onConnected);
}

start();
