// SPDX-License-Identifier: GPL-3.0-or-later
//
// A technician's afternoon at the simulated tower that the console starts for itself: one series of five drops, one
// of them rejected; ABORT wherever it can be needed; a reload and a second console in the middle of it.
import assert from "node:assert/strict";
import { chmodSync, readFileSync, renameSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { Desk, SOON, UNDER_WAY, WAIT_MS, browse } from "./desk.mjs";
import { look } from "./looks.mjs";
import { build, droptower, makeFolder, serve, stop, stopAll } from "./programs.mjs";
import { note } from "./tap.mjs";

const SERIES = "box-30";

let archive, server, address, browser, desk, watcher;
const resultsMs = [];

const drops = async (series) => JSON.parse(await droptower("series", "show", series, "--json", "--archive", archive));

/* What a stranger on this machine could send with the token, past the page. */
async function ask(path, consoleId, body) {
	const { origin, hash } = new URL(address);
	return fetch(origin + path, { method: "POST", body: JSON.stringify(body), headers: {
		Authorization: `Bearer ${hash.replace("#token=", "")}`, "X-Console": consoleId, "Content-Type": "application/json" } });
}

async function begin() {
	archive = join(makeFolder(), "archive");
	({ child: server, address } = await serve(join(build, "droptower"),
		["serve", "--port", "0", "--archive", archive, "--operator", "tester"]));
	browser = await browse();
	desk = await Desk.open(browser);
	await desk.page.goto(address);
	await desk.until({ connected: "yes" });
	assert.ok(!desk.page.url().includes("token"), desk.page.url());
	await desk.until({ state: "SAFE READY".split(" "), step: "setup" });
}

async function alwaysVisible() {
	assert.match(await desk.text("#simulated-strip"), /simulated/i);
	await desk.untilText("#heartbeat", /^\d+\.\d s$/);
	await desk.untilText("#bus", /^[1-9]\d* %$/);
	/* a stall of the machine may cost some, which test_console does not forgive */
	await desk.untilText("#lost", /^(none|[1-9]\d* blocks?.* since .+)$/);
	if (await desk.text("#lost") !== "none")
		note(`lost: ${await desk.text("#lost")}`);
	await desk.untilText("#disk", /GB|MB/);
	assert.ok(await desk.page.locator("#interlocks li").count() >= 11);
	for (const id of ["state", "heartbeat", "bus", "lost", "disk", "hold", "interlocks", "abort"])
		assert.ok(await desk.page.locator(`#${id}`).isVisible(), id);
	const from = Number(await desk.data("live"));
	await desk.page.waitForFunction((n) => Number(document.documentElement.dataset.live) > n + 10, from);
}

/* ---- by keyboard alone ---- */

async function setUpByKey() {
	await look(desk, "1-setup");
	await desk.tabTo("abort"); // Tab comes there too
	await desk.tabTo("scene");
	for (let i = 0; i < 20 && await desk.page.inputValue("#scene") !== "geometry-2B"; i++)
		await desk.key("ArrowDown");
	assert.equal(await desk.page.inputValue("#scene"), "geometry-2B");
	await desk.typeInto("angle", "30");
	await desk.typeInto("planned", "5");
	await desk.typeInto("series-name", SERIES);
	await desk.key("Enter");
	await desk.untilText("#series-head", new RegExp(`${SERIES}.* 0 of 5 accepted`));
	await desk.until({ hold: "mine" });
	const { series } = await drops(SERIES);
	assert.deepEqual([series.scene, series.angle_deg, series.planned], ["geometry-2B", 30, 5]);
}

async function armByKey() {
	await desk.again(async () => {
		await desk.ready();
		await desk.hold(() => desk.shifted("down", "A"), () => desk.shifted("up", "A"));
		await desk.until({ step: "release", state: "ARMED" }, SOON.timeout);
	});
	await desk.untilText("#countdown", /^\d+$/);
}

/* A tower that has just been switched on asks for it; nothing else makes it ready. */
async function acknowledgeByKey() {
	await desk.until({ step: "checks", state: "SAFE" });
	await desk.page.waitForSelector(check("ACKNOWLEDGE", "no"));
	await desk.untilText("#checks-say", /^A guard was open, or the tower was off\..* Then acknowledge\.$/);
	assert.ok(!await desk.page.locator("#arm").isVisible(), "nothing to arm with");
	await desk.states();
	await look(desk, "2-acknowledge");
	assert.ok(!(await desk.states()).includes("READY"), "ready without being acknowledged");
	await desk.command("Shift+C", "acknowledge");
	await desk.page.waitForSelector(check("ACKNOWLEDGE", "yes"));
	await desk.until({ step: "arm", state: "READY" });
}

/* In the page: key and button during the warning, which is over before a program outside could be sure of it. */
function tooEarly() {
	const button = document.querySelector("#release");
	if (button.dataset.warns !== "yes" || button.offsetParent === null)
		return null;
	document.body.dispatchEvent(new KeyboardEvent("keydown", { key: "R", shiftKey: true, bubbles: true, cancelable: true }));
	button.click();
	return { isDisabled: button.disabled, says: document.querySelector("#release-say").textContent };
}

/* Neither key nor button does anything while horn and lamp warn. */
async function warningByKey() {
	const asked = [];
	const listen = (request) => asked.push(request.url());
	desk.page.on("request", listen);
	const early = await desk.again(async () => {
		const found = desk.page.waitForFunction(tooEarly, null, { polling: 20, timeout: 60000 }).catch((error) => ({ error }));
		await armByKey(); // the page looks meanwhile: the warning lasts a second
		const { error, ...pressed } = await found.then((handle) => handle.error ? handle : handle.jsonValue());
		if (error)
			throw error;
		await desk.picture("5-warning");
		return pressed;
	});
	assert.ok(early.isDisabled, "RELEASE during the warning");
	assert.match(early.says, /^Horn and lamp warn: \d+ s\. Nobody near the tower\?$/);
	await desk.page.waitForSelector("#release:enabled");
	desk.page.off("request", listen);
	await desk.untilText("#release-say", /Then release/);
	assert.equal(await desk.data("state"), "ARMED");
	assert.ok(!asked.some((url) => url.endsWith("/api/release")), "nothing was asked of the tower");
}

/* A page that does not know yet whether a drop is undecided lets nobody arm. */
async function unknownDrops() {
	let answer;
	const asked = new Promise((resolve) => { answer = resolve; });
	await desk.page.route(/\/api\/drops\?/, (route) => asked.then(() => route.continue()));
	await desk.page.reload();
	await desk.until({ connected: "yes" });
	for (const key of ["Shift+A", "Shift+C", "Shift+K"])
		await desk.key(key);
	const enabled = await desk.page.locator("#now [data-command]:enabled:visible").evaluateAll((found) => found.map(({ id }) => id));
	assert.deepEqual(enabled, [], "commands before the archive has answered");
	answer();
	await desk.until({ step: "decide" });
	await desk.page.unroute(/\/api\/drops\?/);
	await desk.page.waitForSelector("#accept:enabled");
}

async function dropByKey() {
	await desk.until({ step: "arm", state: "READY" });
	await look(desk, "3-arm");
	await desk.command("Shift+A", "arm"); // not held
	await new Promise((settle) => setTimeout(settle, 1500));
	assert.notEqual(await desk.data("state"), "ARMED", "a key that was not held arms");
	await warningByKey();
	await look(desk, "5-release");
	await desk.key("Escape");
	await desk.again(async () => {
		await armByKey();
		await desk.page.waitForSelector("#release:enabled");
		await desk.states();
		await desk.key("Shift+R");
		await desk.until({ step: UNDER_WAY }, SOON.timeout);
	});
	await desk.picture("6-moving");
	resultsMs.push(await desk.result(`${SERIES}/1`));
	const path = await desk.states();
	for (const state of ["FALLING", "BRAKED", "UPLOADED"])
		assert.ok(path.includes(state), `${state} was not shown: ${path}`);
	await look(desk, "7-decide");
	await unknownDrops();
	await desk.command("Shift+K", "accept");
	await desk.page.waitForSelector(`#series-table tr[data-drop="${SERIES}/1"][data-decision="accepted"]`);
}

/* ---- faults ---- */

const check = (name, green) => `#checks li[data-check="${name}"][data-green="${green}"]`;

async function simulated(fault, isOn) {
	await desk.click(`#simulation [data-fault="${fault}"]`);
	await desk.page.waitForSelector(`#simulation [data-fault="${fault}"][aria-pressed="${isOn}"]`);
}

async function faultPanel() {
	await desk.ready();
	for (const [fault, name, words] of [["estop", "ESTOP", /emergency stop/i], ["door_open", "DOOR", /close the door/i],
		["supply_low", "SUPPLY", /supply/i], ["dampers_out", "DAMPERS", /damper/i], ["cable_s1", "OPEN_S1", /plug/i]]) {
		await desk.page.waitForSelector(check(name, "yes"));
		await simulated(fault, true);
		await desk.page.waitForSelector(check(name, "no"));
		assert.match(await desk.text(check(name, "no")), words);
		await desk.until({ step: "checks", state: "SAFE" });
		assert.ok(!await desk.page.locator("#arm").isVisible(), "nothing to arm with");
		if (fault === "estop")
			await look(desk, "2-checks");
		await simulated(fault, false);
		await desk.page.waitForSelector(check(name, "yes"));
		if (["ESTOP", "DOOR"].includes(name)) { // the others are no guards: their being good is enough
			await desk.page.waitForSelector(check("ACKNOWLEDGE", "no"));
			await desk.click("#acknowledge");
		}
		await desk.until({ step: "arm", state: "READY" });
	}
}

/* ---- ABORT ---- */

/* The list keeps the key's press to itself. */
async function abortFromAList() {
	await desk.click("#scene");
	await desk.page.waitForSelector("#scene:open");
	await desk.abort("a list is open");
	await desk.page.waitForSelector("#scene:not(:open)");
}

async function abortAtRest() {
	await simulated("estop", true);
	await desk.until({ state: "SAFE" });
	await desk.abort("SAFE");
	await simulated("estop", false);
	await desk.ready();
	await desk.abort("READY");
	await desk.until({ step: "arm", state: "READY" });
}

async function abortTheHold() {
	await desk.again(async () => { // where the key comes later than it takes to arm, nothing was held any more
		await desk.ready();
		await desk.page.hover("#arm");
		await desk.states();
		await desk.page.mouse.down();
		try {
			await desk.page.waitForSelector('#arm[data-held="yes"]', SOON);
			await desk.abort("ARM is held");
			await desk.page.waitForSelector('#arm[data-held="no"]');
			await new Promise((settle) => setTimeout(settle, 1500));
		} finally {
			await desk.page.mouse.up();
		}
		assert.ok(!(await desk.states()).includes("ARMED"));
	});
}

async function abortArmed() {
	await desk.arm();
	await desk.abort("ARMED");
	await desk.until({ step: "arm", state: "READY" });
}

async function abortFromAField() {
	await desk.arm();
	await desk.click("#view-history");
	await desk.click("#history-text");
	await desk.page.keyboard.type("a");
	await desk.abort("ARMED, a field has the focus");
	await desk.until({ state: "READY" });
	await desk.click("#view-drop");
	await desk.arm();
	await desk.key("Shift+Tab");
	await desk.click("#abort");
	await desk.until({ state: "READY" });
	await desk.states();
	await new Promise((settle) => setTimeout(settle, 1000));
	const path = await desk.states();
	assert.ok(path.every((state) => ["SAFE", "READY"].includes(state)), `nothing arms itself again: ${path}`);
	assert.equal((await drops(SERIES)).drops.length, 1, "no drop came of it");
}

/* ---- a reload and others who watch ---- */

async function openWatcher() {
	watcher = await Desk.open(browser, { width: 390, height: 844, colorScheme: "dark" });
	await watcher.page.goto(address);
	await watcher.until({ connected: "yes", state: "READY", hold: "other" });
	assert.ok(!await watcher.page.locator("#arm:enabled:visible").count(), "the second console has nothing to arm with");
	await watcher.shifted("down", "A");
	await new Promise((settle) => setTimeout(settle, 1200));
	await watcher.shifted("up", "A");
	const stranger = "0123456789abcdefStranger";
	for (const [path, body] of [["/api/arm", {}], ["/api/release", { token: 1 }], ["/api/select", { series: SERIES }]])
		assert.equal((await ask(path, stranger, body)).status, 423, path);
	assert.equal((await ask("/api/hold", stranger, { take: true })).status, 409);
	assert.equal(await desk.data("state"), "READY");
	assert.equal(await desk.data("hold"), "mine");
}

async function reloadInMidDrop() {
	await desk.arm();
	await watcher.until({ state: "ARMED" });
	await watcher.picture("5-release-watched");
	await desk.release();
	await desk.page.reload();
	await desk.until({ connected: "yes" });
	await desk.result(`${SERIES}/2`);
	await desk.until({ hold: "mine" });
	await desk.click("#accept");
	await desk.page.waitForSelector(`#series-table tr[data-drop="${SERIES}/2"][data-decision="accepted"]`);
}

async function watcherSawIt() {
	const path = await watcher.states();
	assert.ok(path.includes("ARMED") && path.includes("FALLING"), `${path}`);
	await watcher.until({ result: `${SERIES}/2` });
	assert.match(await watcher.text("#result"), /✓ Every sample arrived/);
	await watcher.picture("7-result-watched", { fullPage: true });
	assert.deepEqual(watcher.errors, []);
	await watcher.page.context().close();
}

/* ---- the rest of the series ---- */

async function reject() {
	resultsMs.push(await desk.drop(`${SERIES}/3`));
	await desk.click("#reject");
	await desk.click("#reject-go"); // without a reason
	assert.ok(await desk.page.locator("#reject-form").isVisible());
	assert.equal((await drops(SERIES)).drops[2].decision, "open");
	await desk.page.fill("#reason", "hit the wrong corner");
	await look(desk, "8-reject");
	await desk.click("#reject-go");
	await desk.page.waitForSelector(`#series-table tr[data-drop="${SERIES}/3"][data-decision="rejected"]`);
	const drop = (await drops(SERIES)).drops[2];
	assert.deepEqual([drop.decision, drop.reason, drop.operator], ["rejected", "hit the wrong corner", "tester"]);
}

async function finish() {
	for (const number of [4, 5]) {
		resultsMs.push(await desk.drop(`${SERIES}/${number}`));
		await desk.click("#accept");
		await desk.page.waitForSelector(`#series-table tr[data-drop="${SERIES}/${number}"][data-decision="accepted"]`);
	}
	await desk.untilText("#series-head", /4 of 5 accepted, 1 rejected/);
}

async function howSoon() {
	note(`result on the page after ${resultsMs.map((ms) => ms.toFixed(0)).join(", ")} ms, 1000 are meant`);
	assert.ok(resultsMs.length > 0 && resultsMs.every((ms) => ms > 0), `${resultsMs} ms`);
}

/* ---- the table ---- */

/* A shown number is the true one to half of its last digit. */
function isRounded(shown, value, where) {
	if (value === null || value === undefined)
		return assert.match(shown, /^–/, where);
	const [text] = shown.replace("−", "-").match(/^-?\d+(\.\d+)?/) ?? [""];
	const decimals = text.split(".")[1]?.length ?? 0;
	assert.ok(text && Math.abs(Number(text) - value) <= 0.5000001 * 10 ** -decimals, `${where}: ${shown}, expected ${value}`);
}

const COLUMNS = [...["s1_x", "s1_y", "s1_r", "s1_z", "s2_x", "s2_y", "s2_r", "s2_z"].map((key) => [key, "g", 1]),
	["lag_largest_peak", "s", 1000], ["frequency", "hz", 1], ["damping", "ratio", 1]];

const cells = (row) => desk.page.$$eval(`#series-table ${row} [data-key]`,
	(nodes) => Object.fromEntries(nodes.map((node) => [node.dataset.key, node.textContent])));

async function sameTable() {
	const { drops: rows, means } = await drops(SERIES);
	assert.deepEqual(rows.map((row) => row.decision), ["accepted", "accepted", "rejected", "accepted", "accepted"]);
	await desk.untilText('#series-table tr[data-row="n"]', /4/);
	for (const row of rows) {
		const shown = await cells(`tr[data-drop="${SERIES}/${row.number}"]`);
		for (const [key, unit, scale] of COLUMNS)
			isRounded(shown[key], row[`${key}_${unit}`] && row[`${key}_${unit}`] * scale, `drop ${row.number} ${key}`);
		assert.match(await desk.text(`#series-table tr[data-drop="${SERIES}/${row.number}"]`), new RegExp(row.reason || "accepted"));
	}
	for (const [key, unit, scale] of COLUMNS) {
		isRounded((await cells('tr[data-row="mean"]'))[key], means[key][`mean_${unit}`] * scale, `mean ${key}`);
		isRounded((await cells('tr[data-row="sd"]'))[key], means[key][`sd_${unit}`] * scale, `sd ${key}`);
		isRounded((await cells('tr[data-row="n"]'))[key], means[key].n, `n ${key}`);
	}
}

/* Mean and SD once more, from the accepted drops' own values. */
async function statistics() {
	const { drops: rows } = await drops(SERIES);
	const [mean, sd] = [await cells('tr[data-row="mean"]'), await cells('tr[data-row="sd"]')];
	for (const [key, unit, scale] of COLUMNS) {
		const values = rows.filter((row) => row.decision === "accepted" && !row.not_ok.includes(key)).map((row) => row[`${key}_${unit}`] * scale);
		const m = values.reduce((sum, v) => sum + v, 0) / values.length;
		const s = Math.sqrt(values.reduce((sum, v) => sum + (v - m) ** 2, 0) / (values.length - 1));
		isRounded(mean[key], m, `mean ${key}`);
		isRounded(sd[key], s, `sd ${key}`);
	}
	assert.ok(new Set(rows.map((row) => row.s2_x_g)).size === 5, "five different drops");
}

/* ---- charts ---- */

/* What a chart shows, as a hash, and how many different pixels. */
const drawn = (selector) => desk.page.$eval(selector, (canvas) => {
	const pixels = new Uint32Array(canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data.buffer);
	return { hash: pixels.reduce((sum, pixel) => (Math.imul(sum, 31) + pixel) | 0, 7), colours: new Set(pixels).size };
});

async function traces() {
	await desk.click("#tab-traces");
	const charts = ["#chart-x canvas", "#chart-yz canvas", "#chart-r canvas"];
	await desk.page.waitForFunction(() => /model/.test(document.querySelector("#chart-r").textContent));
	for (const chart of charts)
		assert.ok((await drawn(chart)).colours > 3, `${chart} is empty`);
	await look(desk, "9-traces");
	const before = await Promise.all(charts.map(drawn));
	const box = await desk.page.locator("#chart-x .u-over").boundingBox();
	await desk.page.mouse.move(box.x + 0.1 * box.width, box.y + box.height / 2);
	await desk.page.mouse.down();
	await desk.page.mouse.move(box.x + 0.4 * box.width, box.y + box.height / 2, { steps: 5 });
	await desk.page.mouse.up();
	const after = await Promise.all(charts.map(drawn));
	charts.forEach((chart, i) => assert.notEqual(after[i].hash, before[i].hash, `${chart} zooms with the others`));
	await desk.page.uncheck("#show-model");
	assert.notEqual((await drawn(charts[2])).hash, after[2].hash, "the model can be taken away");
	await desk.click("#zoom-reset");
}

async function spectrum() {
	await desk.click("#tab-spectrum");
	await desk.page.waitForSelector("#spectrum canvas");
	const first = await drawn("#spectrum canvas");
	assert.ok(first.colours > 3);
	await look(desk, "10-spectrum");
	await desk.page.selectOption("#spectrum-kind", "pseudo-velocity");
	for (const end = Date.now() + WAIT_MS; (await drawn("#spectrum canvas")).hash === first.hash;)
		assert.ok(Date.now() < end, "another kind is another picture");
}

/* Of whatever height and from whatever frequency: ticks that do not end have been seen where the range began at 0.0097. */
async function spectraOfAnyHeight() {
	const ranges = await desk.page.evaluate(async () => {
		const { Group } = await import("./charts.js");
		const host = document.body.appendChild(document.createElement("div"));
		const group = new Group(), ranges = [];
		for (let decade = -7; decade < 7; decade++)
			for (const digits of [1, 1.01, 1.06, 1.08, 1.99, 4.44, 9.49, 9.7, 9.99999]) {
				const from = digits * 10 ** decade;
				group.clear();
				const { scales } = group.add(host, [{ label: "a", x: [from, 20 * from], y: [3 * from, from] }],
					{ title: "any", log: true });
				await Promise.resolve();
				ranges.push({ from, x: [scales.x.min, scales.x.max], y: [scales.y.min, scales.y.max] });
			}
		group.clear();
		host.remove();
		return ranges;
	});
	assert.equal(ranges.length, 126);
	const within = ([lower, upper], min, max) =>
		lower <= min * (1 + 1e-9) && lower > min / 2.01 && upper >= max * (1 - 1e-9) && upper < max * 2.01;
	for (const { from, x, y } of ranges) {
		assert.ok(within(x, from, 20 * from), `${from}: ${x}`);
		assert.ok(within(y, from, 3 * from), `${from}: ${y}`);
	}
	assert.deepEqual(desk.errors, []);
}

async function overlay() {
	await desk.click("#tab-overlay");
	await desk.page.waitForSelector("#overlay canvas");
	const legend = await desk.text("#overlay");
	for (const number of [1, 2, 4, 5])
		assert.ok(legend.includes(`${SERIES}/${number}`), legend);
	assert.ok(!legend.includes(`${SERIES}/3`), "what was rejected is not laid over the others");
	assert.match(legend, /model/);
	await look(desk, "11-overlay");
	await desk.click("#tab-live");
}

/* ---- afterwards ---- */

async function fetched(click) {
	const download = desk.page.waitForEvent("download");
	await click();
	return readFileSync(await (await download).path(), "utf8");
}

async function files() {
	const csv = (await fetched(() => desk.click("#series-csv"))).trim().split("\n").filter((line) => line.includes(`${SERIES},`));
	assert.equal(csv.length, 5, csv.join("\n"));
	const report = await fetched(() => desk.click("#series-report"));
	assert.match(report, /<html/);
	assert.ok(report.includes("hit the wrong corner"), "the report tells what was rejected and why");
	assert.ok(!/(src|href)="?https?:/.test(report), "one file, nothing from elsewhere");
}

async function history() {
	await desk.click("#view-history");
	await desk.page.fill("#history-text", "wrong corner");
	await desk.click("#history-go");
	for (const [label, wanted] of [["accepted", "4 of 5"], ["rejected", "1"], ["undecided", "0"]])
		assert.equal(await desk.text(`#history-list tr[data-series="${SERIES}"] td[data-label="${label}"]`), wanted);
	await desk.page.click(`#history-list tr[data-series="${SERIES}"] button`);
	for (const number of [2, 3])
		await desk.page.check(`#history-drops tr[data-drop="${SERIES}/${number}"] input[type="checkbox"]`);
	await desk.page.waitForSelector("#history-overlay canvas");
	const legend = await desk.text("#history-chosen");
	assert.ok(legend.includes(`${SERIES}/2`) && legend.includes(`${SERIES}/3`), legend);
	await look(desk, "12-history");
	await desk.page.fill("#history-text", "nobody ever wrote this");
	await desk.click("#history-go");
	await desk.page.waitForSelector("#history-list tr[data-series]", { state: "detached" });
	await desk.click("#view-drop");
}

/* Somebody changes a byte of a log and takes another away. Both say so by name, offer no Accept and are in no mean. */
async function altered() {
	const rows = (await drops(SERIES)).drops;
	const [bad, gone] = [2, 4].map((number) => join(archive, rows[number - 1].raw));
	const whole = readFileSync(bad, "latin1");
	const at = whole.lastIndexOf("4");
	chmodSync(bad, 0o644);
	writeFileSync(bad, `${whole.slice(0, at)}5${whole.slice(at + 1)}`, "latin1");
	renameSync(gone, `${gone}.away`);
	const row = (table, number) => `${table} tr[data-drop="${SERIES}/${number}"]`;
	for (const [view, table, open] of [
		["#view-history", "#history-drops", async () => {
			await desk.page.fill("#history-text", "");
			await desk.click("#history-go");
			await desk.page.click(`#history-list tr[data-series="${SERIES}"] button`);
		}],
		["#view-drop", "#series-table", async () => {}]]) {
		await desk.click(view);
		await open();
		for (const [number, state, file] of [[2, "altered", rows[1].raw], [4, "missing", rows[3].raw]]) {
			await desk.page.waitForSelector(`${row(table, number)}[data-state="${state}"]`);
			const says = await desk.text(`${row(table, number)} .decision`);
			assert.ok(says.includes(`⚠ ${state}`) && says.includes(file), says);
			assert.equal(await desk.page.locator(`${row(table, number)} .accept`).count(), 0, "nobody may accept it");
			assert.equal(await desk.page.locator(`${row(table, number)} .reject`).count(), 1);
		}
		assert.equal(await desk.page.locator(`${row(table, 5)}[data-state="recorded"][data-decision="accepted"]`).count(), 1);
		await desk.untilText(`${table} tr[data-row="n"]`, /^n2{11}$/);
	}
	await desk.untilText("#series-head", /2 of 5 accepted, 1 rejected, 2 altered or missing/);
	await look(desk, "12-altered");
	await desk.click("#view-history");
	await desk.click("#history-go");
	await desk.untilText(`#history-list tr[data-series="${SERIES}"] td[data-label="partial"]`, /^2 altered or missing$/);
	writeFileSync(bad, whole, "latin1");
	renameSync(`${gone}.away`, gone);
	await desk.page.click(`#history-list tr[data-series="${SERIES}"] button`);
	for (const number of [2, 4])
		await desk.page.waitForSelector(`${row("#history-drops", number)}[data-state="recorded"][data-decision="accepted"]`);
	await desk.click("#view-drop");
}

/* The drop that was kept; none within five seconds when nothing fell. */
async function kept(series) {
	for (let tries = 0; tries < 25; tries++) {
		const found = (await drops(series)).drops.find((drop) => drop.state === "recorded");
		if (found)
			return found;
		await new Promise((resolve) => setTimeout(resolve, 200));
	}
	return null;
}

async function abortOnce(first) {
	await desk.again(async () => {
		await desk.arm();
		await desk.releaseAnd(() => desk.abort("after the release"));
	});
	await desk.until({ phase: "idle", step: "fault" });
	assert.match(await desk.text("#fault-text"), /abort/i);
	if (first)
		await look(desk, "13-aborted");
	await desk.command("Shift+C", "clear");
	await desk.until({ phase: "idle", state: ["SAFE", "READY"] });
	return kept("aborted");
}

/* On a busy machine ABORT may come before the latch has let go: then nothing falls. */
async function abortAfterRelease() {
	await desk.click("#change-series");
	await desk.setUp({ name: "aborted", scene: "geometry-2A", angle: 25, planned: 1 });
	let drop = null;
	for (let tries = 0; !drop && tries < 5; tries++) {
		drop = await abortOnce(tries === 0);
		if (!drop)
			note("aborted before the latch had let go: nothing fell");
	}
	assert.ok(drop, "the latch never let go");
	const row = `#series-table tr[data-drop="aborted/${drop.number}"]`;
	await desk.page.waitForSelector(row);
	assert.match(drop.note, /abort/i);
	assert.match(await desk.text(row), /abort/i);
}

/* Its checks are all green all the same. */
async function tooHigh() {
	await desk.click("#change-series");
	await desk.setUp({ name: "high", scene: "geometry-2A", angle: 25, height: 4, planned: 1 });
	await desk.ready(); // as the tower has it
	await desk.untilText("#state", /^NOT READY$/);
	assert.notEqual(await desk.page.getAttribute("#state-tile", "data-state"), "READY");
	for (const where of ["#trouble", "#arm-say"])
		await desk.untilText(where, /gate_lower_um = 3806000, expected 10000 to 2400000 um/);
	const [full, shown] = await desk.page.$eval("#trouble", (node) => [node.scrollHeight, node.clientHeight]);
	assert.ok(shown >= full, `the reason is cut off: ${shown} of ${full} px`);
}

async function nothingWrong() {
	assert.deepEqual(desk.errors, []);
	assert.equal(await stop(server), 0, server.said);
}

const end = () => stopAll(browser, server);

async function onFailure() {
	await desk?.photograph("failed").catch(() => {});
	note(`the console said: ${server?.said}`);
	if (desk?.errors.length)
		note(`the page said: ${desk.errors.join("\n")}`);
}

export default {
	name: "workflow", onFailure, end,
	steps: [
		["the address opens the page, and the token leaves it", begin],
		["what must always be seen is", alwaysVisible],
		["ABORT by key while a list is open", abortFromAList],
		["set-up by keyboard", setUpByKey],
		["a tower that was switched on is acknowledged by keyboard", acknowledgeByKey],
		["a drop by keyboard", dropByKey],
		["each fault of the panel turns its check red, with words, and green again", faultPanel],
		["ABORT by key in SAFE and READY", abortAtRest],
		["ABORT by key while ARM is held", abortTheHold],
		["ABORT by key in ARMED", abortArmed],
		["ABORT by key from a text field, and by its button; nothing arms itself again", abortFromAField],
		["a second console watches and cannot arm", openWatcher],
		["a reload in mid-drop ends with the result and the arm in hand", reloadInMidDrop],
		["the second console saw state and result", watcherSawIt],
		["a drop is rejected, with a reason", reject],
		["the series is completed", finish],
		["how soon each result came is known", howSoon],
		["the table is what droptower series says", sameTable],
		["means and SDs are those of the accepted drops", statistics],
		["traces at native rates zoom together; the model can be taken away", traces],
		["spectra", spectrum],
		["a spectrum of any height has its ticks", spectraOfAnyHeight],
		["the accepted drops over each other, with the model", overlay],
		["table as CSV, report as one file", files],
		["history: search, any drops over each other", history],
		["a log that was altered and one that is gone: said by name, in no mean, not to be accepted", altered],
		["ABORT after the release brakes, and the drop is kept with a note", abortAfterRelease],
		["a tower that cannot be set up is not called ready, and why is shown in full", tooHigh],
		["no error on the page; the console ends in order", nothingWrong],
	],
};
