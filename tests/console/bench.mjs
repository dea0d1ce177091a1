// SPDX-License-Identifier: GPL-3.0-or-later
//
// A series of five in gloves: what decides each drop is in view with the buttons, presses are counted, one drop is
// rejected and one has flags. Then a foot switch, a bar-code scanner, and a display across the hall.
import assert from "node:assert/strict";
import { createHash } from "node:crypto";
import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { crc32, deflateSync } from "node:zlib";
import { Desk, SOON, UNDER_WAY, browse } from "./desk.mjs";
import { look } from "./looks.mjs";
import { build, droptower, makeFolder, serve, stop, stopAll } from "./programs.mjs";
import { note } from "./tap.mjs";

const SERIES = "gloves";
const PRESSES = 15;
const SCREENS = [{ width: 1366, height: 633 }, { width: 1920, height: 940 }];
const DECIDES = ["#verdict", "#flags", ".peaks", "#accept", "#reject", "#reject-reasons", "#chart-x", "#chart-r"];
const FOOT = "PageDown";

let archive, server, address, browser, desk;
let acknowledged = 0; // a step of its own, whenever a guard was open

const drops = async () => JSON.parse(await droptower("series", "show", SERIES, "--json", "--archive", archive)).drops;
const wait = (ms) => new Promise((settle) => setTimeout(settle, ms));

/* In the page, before its own code: presses, and whether ARM could ever be pressed while a drop was undecided. */
function count() {
	window.presses = 0;
	window.armedUndecided = 0;
	addEventListener("pointerdown", () => window.presses++, { capture: true });
	setInterval(() => {
		const [arm, row] = [document.querySelector("#arm"), document.querySelector('#series-table tr[data-state="recorded"][data-decision="open"]')];
		if (arm && row && arm.offsetParent && !arm.disabled)
			window.armedUndecided++;
	}, 20);
}

/* The scene with the example sensors, whose calibration holds. */
function withSensors(folder) {
	for (const name of ["S1", "S2"])
		writeFileSync(join(folder, `${name}.ini`), readFileSync(`common/scenes/sensors/example-${name}.ini`, "utf8")
			.replace(/^date = .*$/m, "date = 2026-01-15").replace(/^due = .*$/m, "due = 2199-01-14"));
	writeFileSync(join(folder, "geometry-2B.ini"), "chain = S1.ini, S2.ini\n" + readFileSync("common/scenes/geometry-2B.ini", "utf8"));
	return join(folder, "geometry-2B.ini");
}

async function begin() {
	const folder = makeFolder();
	archive = join(folder, "archive");
	({ child: server, address } = await serve(join(build, "droptower"),
		["serve", "--port", "0", "--archive", archive, "--scene", withSensors(folder)]));
	browser = await browse();
	desk = await Desk.open(browser, SCREENS[0]);
	await desk.page.addInitScript(count);
	await desk.page.goto(address);
	await desk.until({ connected: "yes" });
	await desk.setUp({ name: SERIES, scene: "geometry-2B", angle: 30, planned: 5 });
	await desk.ready();
	await desk.page.evaluate(() => { window.presses = 0; });
	desk.page.on("request", (request) => { acknowledged += request.url().endsWith("/api/clear"); });
}

/* What is not wholly in the window, or below something else. */
function hidden(selectors) {
	return selectors.filter((selector) => {
		const node = document.querySelector(selector);
		const { left, right, top, bottom, width, height } = node.getBoundingClientRect();
		const [x, y] = [left + width / 2, top + height / 2];
		const seen = width > 0 && left >= 0 && right <= innerWidth && top >= 0 && bottom <= innerHeight;
		return !seen || !node.contains(document.elementFromPoint(x, y));
	});
}

/* In the page: buttons of the step that a glove would miss. */
const small = () => [...document.querySelectorAll("#now [data-command]")].filter((node) => node.offsetParent && node.offsetHeight < 72)
	.map((node) => node.id || node.textContent);

async function inView(flagged) {
	const wanted = flagged ? [...DECIDES, "#accept-reasons"] : DECIDES;
	for (const screen of SCREENS) {
		await desk.page.setViewportSize(screen);
		await desk.page.waitForFunction(() => document.querySelector("#chart-x canvas"));
		for (let looks = 0; looks < 100 && (await desk.page.evaluate(hidden, wanted)).length; looks++)
			await wait(100); // until the charts are drawn anew
		assert.equal(await desk.page.evaluate(() => scrollY), 0);
		assert.deepEqual(await desk.page.evaluate(hidden, wanted), [], `at ${screen.width} x ${screen.height}`);
		assert.deepEqual(await desk.page.evaluate(small), [], "targets below 72 px");
		await desk.picture(`20-card-${screen.width}${flagged ? "-flagged" : ""}`);
	}
	await desk.page.setViewportSize(SCREENS[0]);
}

/* The presses of a drop are at most three; what the tower refused and is asked for again is no press of the page's. */
async function drop(number, decide, decision) {
	const pressed = await desk.page.evaluate(() => window.presses);
	await desk.arm();
	const armed = await desk.page.evaluate(() => window.presses);
	assert.match(await desk.text("#context"), /geometry-2B, 30°, 0\.894 m, series gloves/);
	await desk.release();
	await desk.result(`${SERIES}/${number}`);
	const refused = await desk.page.evaluate(() => window.presses) - armed - 1 + armed - pressed - 1;
	if (refused)
		note(`${refused} presses were refused by a tower that lagged behind`);
	await desk.page.evaluate((n) => { window.presses -= n; }, refused);
	await desk.page.locator("#accept:enabled").waitFor();
	await decide();
	await desk.page.waitForSelector(`#series-table tr[data-drop="${SERIES}/${number}"][data-decision="${decision}"]`);
	assert.ok(await desk.page.evaluate(() => window.presses) - pressed <= 3, `drop ${number}`);
}

/* Each number of a sensor has U of its budget, to the same place, in the table of the card. */
async function expanded() {
	const { budget } = JSON.parse(await droptower("series", "result", `${SERIES}/1`, "--archive", archive));
	const rows = { s2_x: ["S2X.peak.value_g", 1], s1_r: ["S1.peak_g", 1], s2_duration: ["S2X.pulse.duration_s", 1000],
		s1_velocity: ["S1X.pulse.velocity_change_m_s", 1] };
	for (const [key, [what, scale]] of Object.entries(rows)) {
		const text = await desk.text(`.peaks [data-key="${key}"] .sigma`);
		const wanted = scale * budget.find((item) => item.what === what).expanded;
		assert.match(text, /^ ?± [0-9.]+ U$/, `${key}: ${text}`);
		assert.ok(Math.abs(parseFloat(text.split("±")[1]) - wanted) <= 0.051 * wanted, `${key}: ${text} for ${wanted}`);
	}
	assert.equal(await desk.page.locator(".peaks tbody .sigma").count(), await desk.page.locator(".peaks tbody .sigma", { hasText: "U" }).count());
}

/* A photo as a phone has it: 1200 x 3000 points, and where it was taken. */
function photo() {
	const part = (name, data) => {
		const [body, size, sum] = [Buffer.concat([Buffer.from(name), data]), Buffer.alloc(4), Buffer.alloc(4)];
		size.writeUInt32BE(data.length);
		sum.writeUInt32BE(crc32(body));
		return Buffer.concat([size, body, sum]);
	};
	const [head, rows] = [Buffer.alloc(13), Buffer.alloc(3000 * 3601)];
	head.writeUInt32BE(1200, 0);
	head.writeUInt32BE(3000, 4);
	head.set([8, 2], 8);
	for (let i = 0; i < rows.length; i++)
		rows[i] = i % 3601 === 0 ? 0 : (i >> 8) & 0xFF;
	return Buffer.concat([Buffer.from("\x89PNG\r\n\x1a\n", "latin1"), part("IHDR", head), part("tEXt", Buffer.from("Comment\0WHERE-IT-WAS")),
		part("IDAT", deflateSync(rows)), part("IEND", Buffer.alloc(0))]);
}

let phone; // another console, which only watches

async function photoBefore() {
	phone = await Desk.open(browser, { width: 390, height: 844 });
	await phone.page.goto(address);
	await phone.until({ connected: "yes", hold: "other" });
	await phone.page.locator("#photo-before").setInputFiles({ name: "IMG_1.png", mimeType: "image/png", buffer: photo() });
	await phone.page.locator("#photos-next canvas").waitFor();
	await look(phone, "19-phone");
	await phone.page.locator("#photo-before").setInputFiles({ name: "x.txt", mimeType: "text/plain", buffer: Buffer.from("no picture") });
	await phone.untilText("#message", /no picture/);
	await phone.click("#message-close");
}

/* The files are JPEGs of at most 2048 points a side without the comment; both are of the drop, here and there. */
async function photoAfter() {
	await phone.page.locator("#photos-drop canvas").waitFor();
	await phone.page.locator("#photo-after").setInputFiles({ name: "IMG_2.png", mimeType: "image/png", buffer: photo() });
	for (const { page } of [phone, desk])
		await page.waitForFunction(() => document.querySelectorAll("#photos-drop canvas").length === 2);
	const size = await phone.page.locator("#photos-drop canvas").first().evaluate(({ width, height }) => [width, height]);
	assert.deepEqual(size, [819, 2048]);
	await look(phone, "19-phone-after");
	const events = (await drops())[0].events.filter(({ what }) => what === "photo");
	assert.deepEqual(events.map(({ text }) => text.split(" ")[0]), ["before", "after"]);
	for (const { text } of events) {
		const bytes = readFileSync(join(archive, text.split(" ")[1]));
		assert.equal(createHash("sha256").update(bytes).digest("hex"), text.split(" ")[3]);
		assert.deepEqual([...bytes.subarray(0, 3)], [0xFF, 0xD8, 0xFF]);
		assert.equal(bytes.indexOf("WHERE"), -1);
	}
	assert.deepEqual(phone.errors, []);
	await phone.page.context().close();
}

async function plain() {
	await look(desk, "20-ready");
	await photoBefore();
	await drop(1, async () => {
		assert.match(await desk.text("#verdict"), /NO FLAGS/);
		assert.equal(await desk.data("tone"), "good");
		await expanded();
		await inView(false);
		await photoAfter();
		await desk.click("#accept");
	}, "accepted");
}

async function rejected() {
	await drop(2, () => desk.click("#reject-reasons button >> nth=2"), "rejected");
	assert.equal((await drops())[1].reason, "cable loose");
}

async function flagged() {
	await desk.page.evaluate(async () => (await import("/api.js")).post("/api/simulate", { line: "dropout 0.014" }));
	await drop(3, async () => {
		assert.match(await desk.text("#verdict"), /LOOK FIRST/);
		assert.equal(await desk.data("tone"), "flagged");
		assert.match(await desk.text("#flags"), /the product left the frame later than planned/);
		assert.equal(await desk.page.getAttribute("#accept", "data-reason"), "yes");
		assert.ok(!await desk.page.locator("#accept.good").count(), "ACCEPT is the default in spite of a flag");
		await inView(true);
		await desk.key("Shift+K"); // asks, and decides nothing
		await desk.page.waitForSelector("#reject-form:visible");
		await desk.page.keyboard.type("1234");
		await desk.key("Enter"); // as a scanner would
		await wait(500);
		assert.equal((await drops())[2].decision, "open");
		await desk.page.focus("#reject-cancel");
		await desk.key("Space");
		await look(desk, "21-flagged");
		await desk.page.locator("#accept-reasons button:enabled").first().waitFor();
		await desk.click("#accept-reasons button >> nth=1");
	}, "accepted");
	assert.equal((await drops())[2].reason, "traces checked, sound");
	await desk.page.evaluate(async () => (await import("/api.js")).post("/api/simulate", { line: "dropout 0.008" }));
}

async function rest() {
	for (const number of [4, 5])
		await drop(number, async () => {
			if (await desk.page.getAttribute("#accept", "data-reason") === "yes") // the magnet is as it was: that is a change too
				await desk.click("#accept-reasons button >> nth=0");
			else
				await desk.click("#accept");
		}, "accepted");
	const { presses, armedUndecided } = await desk.page.evaluate(() => ({ presses: window.presses, armedUndecided: window.armedUndecided }));
	note(`${presses} presses for five drops, one rejected, one with flags; and ${acknowledged} of ACKNOWLEDGE or CLEAR`);
	assert.ok(presses > 10 && presses <= PRESSES, `${presses} presses`);
	assert.equal(armedUndecided, 0, "ARM could be pressed while a drop was undecided");
}

/* ---- foot switch and scanner ---- */

/* As fast as a scanner, with capitals: each of these letters has a command. */
async function scan(text) {
	await desk.page.evaluate((all) => {
		for (const key of [...all, "Enter"]) {
			const code = `Key${key}`;
			for (const type of ["keydown", "keyup"])
				document.activeElement.dispatchEvent(new KeyboardEvent(type, { key, code, shiftKey: key !== "Enter", bubbles: true, cancelable: true }));
		}
	}, text);
	await wait(400);
}

async function footLearnt() {
	await desk.click("#details summary");
	await desk.click("#foot");
	await desk.key("k"); // a scanner could send it
	await desk.untilText("#foot", /^Foot switch: none$/);
	await desk.click("#foot");
	await desk.key(FOOT);
	await desk.untilText("#foot", /^Foot switch: PageDown$/);
}

async function byFoot() {
	const { page } = desk;
	await desk.again(async () => {
		await page.keyboard.up(FOOT); // of an earlier try
		await desk.ready();
		await page.focus("body");
		await scan("ARK-007");
		assert.equal(await page.inputValue("#serial"), "ARK-007");
		assert.notEqual(await desk.data("state"), "ARMED");
		await page.keyboard.down(FOOT);
		await desk.until({ step: "release", state: "ARMED" }, SOON.timeout);
		for (let i = 0; i < 5; i++)
			await page.keyboard.down(FOOT); // the switch is still down, and repeats itself
		await page.waitForSelector("#release:enabled");
		await page.keyboard.down(FOOT);
		await scan("RRR");
		await page.focus("#release");
		await desk.key("Enter");
		await wait(300);
		assert.equal(await desk.data("state"), "ARMED", "a foot that never left the switch, or a scanner, released");
		await page.keyboard.up(FOOT);
		for (let presses = 0; presses < 8 && await desk.data("step") === "release"; presses++) {
			await desk.key(FOOT);
			await wait(600);
			desk.forgive("release");
		}
		await desk.until({ step: UNDER_WAY }, SOON.timeout);
	});
	await desk.result(`${SERIES}/6`);
	await page.locator("#accept:enabled").waitFor();
	await scan("KKX");
	assert.equal((await drops())[5].decision, "open", "a scanner decided");
	await desk.page.waitForSelector(`#series-table tr[data-drop="${SERIES}/6"]:has-text("serial ARK-007")`);
	assert.equal((await drops())[5].note, "serial ARK-007");
	if (await page.getAttribute("#accept", "data-reason") === "no")
		await desk.key(FOOT);
	else
		await desk.click("#accept-reasons button >> nth=0");
	await page.waitForSelector(`#series-table tr[data-drop="${SERIES}/6"][data-decision="accepted"]`);
}

/* ---- others ---- */

async function zoomed() {
	for (const [name, size] of [["200", { width: 683, height: 316 }], ["390", { width: 390, height: 844 }]]) {
		await desk.page.setViewportSize(size);
		for (const button of ["#view-drop", "#view-history", "#abort"]) {
			await desk.page.locator(button).scrollIntoViewIfNeeded();
			assert.deepEqual(await desk.page.evaluate(hidden, [button]), [], `${button} at ${name}`);
		}
		await desk.picture(`22-${name}`, { fullPage: true });
	}
	await desk.page.setViewportSize(SCREENS[0]);
}

async function wall() {
	const hall = await Desk.open(browser, SCREENS[1]);
	const { origin, hash } = new URL(address);
	await hall.page.goto(`${origin}/wall${hash}`);
	await hall.until({ connected: "yes", view: "wall" });
	await hall.page.locator("#state").waitFor();
	assert.deepEqual(await hall.page.locator("button:visible, input:visible, select:visible").evaluateAll((all) => all.map(({ id }) => id)), ["abort"]);
	await look(hall, "23-wall");
	await hall.page.setViewportSize(SCREENS[1]);
	await hall.picture("23-wall");
	assert.deepEqual(hall.errors, []);
	await hall.page.context().close();
}

/* Paper has what was found, and no controls; in grey the sensors are told apart by their lines. */
async function printed() {
	await desk.page.emulateMedia({ media: "print" });
	assert.equal(await desk.page.locator("button:not(.link):visible").count(), 0);
	assert.match(await desk.text(`#series-table tr[data-drop="${SERIES}/1"] [data-label="time"]`), /\d\d:\d\d/);
	assert.ok(await desk.page.locator("#verdict").isVisible() && await desk.page.locator("#series-table").isVisible());
	await desk.picture("24-print", { fullPage: true });
	await desk.page.emulateMedia({ media: "screen" });
}

async function nothingWrong() {
	assert.deepEqual(desk.errors, []);
	assert.equal(await stop(server), 0, server.said);
}

const end = () => stopAll(browser, server);

async function onFailure() {
	await desk?.photograph("failed-bench").catch(() => {});
	note(`the console said: ${server?.said}`);
}

export default {
	name: "bench", onFailure, end,
	steps: [
		["a series is begun on a laptop's screen", begin],
		["what decides a drop is in view with the buttons", plain],
		["a drop is rejected with one press", rejected],
		["a drop with flags is accepted with a reason only", flagged],
		["five drops take 15 presses at most, and none is armed while one is undecided", rest],
		["a foot switch is a key that no scanner sends", footLearnt],
		["a drop by foot; its serial number is scanned, and neither scanner nor a foot that stays down presses anything", byFoot],
		["nothing covers anything at 200 % and 390 px", zoomed],
		["a display across the hall has nothing to press but ABORT", wall],
		["paper has the result and no controls", printed],
		["no error on the page; the console ends in order", nothingWrong],
	],
};
