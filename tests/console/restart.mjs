// SPDX-License-Identifier: GPL-3.0-or-later
//
// A console that is killed in the middle of a drop and started again, at a tower that goes on. Console and tower are
// the sanitized builds.
import assert from "node:assert/strict";
import { join } from "node:path";
import { Desk, browse } from "./desk.mjs";
import { droptower, makeFolder, sanitized, serve, start, stop, stopAll } from "./programs.mjs";
import { note } from "./tap.mjs";

const SERIES = "kept";

let folder, bench, server, port, browser, desk;

const drops = async () => JSON.parse(await droptower("series", "show", SERIES, "--json", "--archive", join(folder, "archive"))).drops;

async function startConsole(at) {
	const console = await serve(join(sanitized, "droptower-console"), ["--port", String(at), "--link", `unix:${folder}/bus`,
		"--control", `${folder}/control`, "--archive", join(folder, "archive"), "--token-file", join(folder, "token")]);
	server = console.child;
	({ port } = new URL(console.address));
	return console.address;
}

async function begin() {
	folder = makeFolder();
	bench = start(join(sanitized, "droptower-bench"), ["--scene", "common/scenes/geometry-2B.ini", "--link", `unix:${folder}/bus`,
		"--control", `${folder}/control`]);
	const address = await startConsole(0);
	browser = await browse();
	desk = await Desk.open(browser);
	await desk.page.goto(address);
	await desk.until({ connected: "yes" });
	await desk.setUp({ name: SERIES, scene: "geometry-2B", angle: 25, planned: 3 });
	await desk.drop(`${SERIES}/1`);
	await desk.click("#accept");
	await desk.page.waitForSelector(`#series-table tr[data-drop="${SERIES}/1"][data-decision="accepted"]`);
}

/* With the answer to RELEASE: the frame has just begun to fall. */
async function killed() {
	desk.allowed.push(/Failed to load resource/, /net::ERR_/);
	assert.equal(await desk.again(async () => {
		await desk.arm();
		return desk.releaseAnd(() => stop(server, "SIGKILL"));
	}), "SIGKILL");
	await desk.until({ connected: "no" });
	assert.match(await desk.text("#connection"), /NOT CONNECTED/);
	assert.ok(await desk.page.locator("#abort").isVisible());
	await desk.picture("14-not-connected");
}

async function startedAgain() {
	await startConsole(port);
	await desk.until({ connected: "yes" });
	assert.ok(!await desk.page.locator("#connection").isVisible());
	desk.allowed.length = 0;
}

/* What was acknowledged before stands; the tower still holds the drop that was interrupted, and asks whose it is. */
async function nothingLost() {
	await desk.until({ step: "setup", state: ["CAPTURED", "SAFE", "READY"] });
	const held = await desk.data("state") === "CAPTURED"; // else it was collected before the signal came
	if (held)
		await desk.untilText("#trouble", /holds a drop/);
	await desk.page.selectOption("#continue-series", SERIES);
	await desk.picture("15-whose-drop");
	await desk.click("#continue-go");
	await desk.until({ phase: "idle", state: ["SAFE", "READY"] });
	await desk.page.waitForSelector('#series-table tr[data-state="recorded"][data-decision="open"]');
	const rows = await drops();
	note(rows.map((drop) => `${drop.number} ${drop.state} ${drop.decision} "${drop.note}" [${drop.flags}]`).join("; "));
	assert.deepEqual([rows[0].state, rows[0].decision], ["recorded", "accepted"]);
	const rescued = rows.findLast((drop) => drop.state === "recorded");
	assert.equal(rescued.note !== "", held, "what was not released from this console says so");
	assert.ok(rescued.s2_x_g > 100 && !rescued.flags.includes("incomplete"), "the whole drop");
	assert.match(await droptower("verify", join(folder, "archive")), /./);
}

/* The page has not been loaded again. */
async function goesOn() {
	const before = (await drops()).length;
	await desk.until({ step: "decide" });
	await desk.click("#accept");
	await desk.drop(`${SERIES}/${before + 1}`);
	await desk.click("#accept");
	await desk.page.waitForSelector(`#series-table tr[data-drop="${SERIES}/${before + 1}"][data-decision="accepted"]`);
	await desk.picture("16-went-on");
}

async function nothingWrong() {
	assert.deepEqual(desk.errors, []);
	assert.equal(await stop(server), 0, server.said);
	assert.equal(await stop(bench), 0, bench.said);
	assert.ok(!/Sanitizer|runtime error/.test(server.said + bench.said), server.said + bench.said);
}

const end = () => stopAll(browser, server, bench);

async function onFailure() {
	await desk?.photograph("failed-restart").catch(() => {});
	note(`the console said: ${server?.said}`);
	note(`the tower said: ${bench?.said}`);
}

export default {
	name: "restart", onFailure, end,
	steps: [
		["a drop at a tower that runs by itself", begin],
		["killed in mid-drop: the page says that it knows nothing", killed],
		["started again: the page is back by itself", startedAgain],
		["nothing is lost", nothingLost],
		["the series goes on", goesOn],
		["no error; console and tower end in order", nothingWrong],
	],
};
