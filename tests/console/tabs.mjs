// SPDX-License-Identifier: GPL-3.0-or-later
//
// More tabs of one browser than it has connections for: it opens six to one server, for all of them together, and
// ABORT must find one of them. A relay between browser and console keeps back answers, so that tabs are busy for as
// long as the test wants.
import assert from "node:assert/strict";
import { createServer, request } from "node:http";
import { join } from "node:path";
import { Desk, browse } from "./desk.mjs";
import { build, makeFolder, serve, stop, stopAll } from "./programs.mjs";
import { note } from "./tap.mjs";

const SERIES = "tabs";
const BUSY = 4; // requests of each tab
const ARMED_MS = 9000; // after which the tower may have ended it by itself

let server, relay, browser, desks, last, armedMs;
let held = null; // what is kept back, once something is

/* What is asked for; the stream, the page itself and what is done go through. */
const isSlow = ({ method, url }) => method === "GET" && url.startsWith("/api/") && url !== "/api/stream";

/* The console answers to its own name only. */
function pass(asked, answer, origin) {
	const headers = { ...asked.headers, host: new URL(origin).host };
	if (headers.origin)
		headers.origin = origin;
	const onward = request(origin + asked.url, { method: asked.method, headers }, (response) => {
		answer.writeHead(response.statusCode, response.headers);
		response.pipe(answer);
	});
	onward.on("error", () => answer.destroy());
	answer.on("close", () => onward.destroy());
	asked.pipe(onward);
}

/* Returns the address at which the relay stands for the console. */
async function relayTo(address) {
	const { origin, hash } = new URL(address);
	relay = createServer((asked, answer) => {
		if (held && isSlow(asked))
			held.push(() => pass(asked, answer, origin));
		else
			pass(asked, answer, origin);
	});
	await new Promise((settle) => relay.listen(0, "127.0.0.1", settle));
	return `http://127.0.0.1:${relay.address().port}/${hash}`;
}

function letGo() {
	const all = held ?? [];
	held = null;
	for (const one of all)
		one();
}

async function fourTabs() {
	const console = await serve(join(build, "droptower"), ["serve", "--port", "0", "--archive", join(makeFolder(), "archive")]);
	server = console.child;
	const address = await relayTo(console.address);
	browser = await browse();
	const context = await browser.newContext();
	desks = [];
	for (const connected of ["yes", "yes", "yes", "no"]) {
		const desk = new Desk(await context.newPage());
		desks.push(desk);
		await desk.page.goto(address);
		if (connected === "yes")
			await desk.until({ connected });
	}
	last = desks[3];
	await last.untilText("#connection", /3 other pages/);
	assert.equal(await last.data("connected"), "no");
	await last.picture("17-fourth-tab");
	for (const desk of desks.slice(0, 3))
		assert.equal(await desk.data("connected"), "yes");
}

async function abortArmed() {
	await desks[0].page.bringToFront();
	await desks[0].setUp({ name: SERIES, scene: "geometry-2B", angle: 25, planned: 1 });
	await desks[0].arm();
	await last.page.bringToFront();
	await last.abort("ARMED by the first tab");
	await desks[0].until({ step: "arm", state: "READY" });
}

async function busyAndArmed() {
	await desks[0].page.bringToFront();
	await desks[0].arm();
	armedMs = Date.now();
	held ??= [];
	for (const desk of desks.slice(0, 3)) {
		await desk.page.bringToFront();
		await desk.click("#view-history");
		for (let i = 1; i < BUSY; i++)
			await desk.click("#history-go");
		await desk.click("#view-drop");
	}
	assert.ok(held.length > 0, "nobody is busy");
	await last.page.bringToFront();
	assert.equal(await desks[0].data("state"), "ARMED");
}

async function abortBusy() {
	await desks[0].again(busyAndArmed);
	await last.abort("the others are busy");
	await desks[0].until({ step: "arm", state: "READY" });
	assert.ok(Date.now() - armedMs < ARMED_MS, "the arming may have ended by itself");
	letGo();
}

async function makesRoom() {
	await desks[1].page.close();
	await last.until({ connected: "yes", state: "READY", hold: "other" });
}

async function nothingWrong() {
	for (const desk of desks)
		assert.deepEqual(desk.errors, []);
	await browser.close();
	assert.equal(await stop(server), 0, server.said);
}

async function end() {
	letGo();
	relay?.close();
	await stopAll(browser, server);
}

async function onFailure() {
	await last?.photograph("failed-tabs").catch(() => {});
	note(`the console said: ${server?.said}`);
	note(`kept back: ${held?.length ?? "nothing"}`);
}

export default {
	name: "tabs", onFailure, end,
	steps: [
		["three tabs of one browser follow the tower, the fourth says why it does not", fourTabs],
		["ABORT from the fourth while the first is ARMED", abortArmed],
		["ABORT from the fourth while the others are busy, too", abortBusy],
		["a tab that is closed makes room", makesRoom],
		["no error on the pages; the console ends in order", nothingWrong],
	],
};
