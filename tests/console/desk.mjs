// SPDX-License-Identifier: GPL-3.0-or-later
//
// Somebody at a browser tab: what the page says, and what goes wrong in it. The ids are those that the head of
// host/console/page/index.html promises.
import assert from "node:assert/strict";
import { mkdirSync } from "node:fs";
import { join } from "node:path";
import { chromium, pictures } from "./programs.mjs";
import { note } from "./tap.mjs";

export const WAIT_MS = 300000; // what takes longer hangs, on a busy machine too
export const SOON = { timeout: 15000 };
export const UNDER_WAY = ["moving", "wait", "decide"]; // the steps behind a RELEASE
const PROMISED = "droptower-test";

const CRASHED = 3; // exit status

export function browse() {
	return chromium.launch({
		executablePath: "/usr/bin/chromium",
		args: ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
			"--disable-component-update", "--disable-sync"],
	});
}

/* In the page, before its own code: what it must not do, and every state it shows. */
function watch(word) {
	document.addEventListener("securitypolicyviolation", (event) =>
		console.error(`${word}: against the content security policy: ${event.violatedDirective} ${event.blockedURI}`));
	window.shownStates = [];
	window.shownSteps = [];
	new MutationObserver(() => {
		const { state, step, phase, hold } = document.documentElement.dataset;
		const all = [state, step, phase, hold].join(" ");
		if (state !== undefined && state !== window.shownStates.at(-1))
			window.shownStates.push(state);
		if (all !== window.shownSteps.at(-1))
			window.shownSteps.push(all);
	}).observe(document, { attributes: true, subtree: true, attributeFilter: ["data-state", "data-step", "data-phase", "data-hold"] });
}

export class Desk {
	static async open(browser, { width = 1400, height = 900, colorScheme = "light" } = {}) {
		const context = await browser.newContext({ viewport: { width, height }, colorScheme, acceptDownloads: true });
		return new Desk(await context.newPage());
	}

	constructor(page) {
		this.page = page;
		this.errors = [];
		this.allowed = []; // patterns of errors that a test makes on purpose or forgives
		page.setDefaultTimeout(WAIT_MS);
		page.addInitScript(watch, PROMISED);
		page.on("crash", () => {
			note("a tab of Chromium crashed");
			process.exit(CRASHED); // nothing that is asked of such a tab is ever answered
		});
		page.on("console", (message) => message.type() === "error" && this.wrong(`${message.text()} ${message.location().url}`));
		page.on("pageerror", (error) => this.wrong(error.stack));
	}

	wrong(text) {
		if (!this.allowed.some((pattern) => pattern.test(text)))
			this.errors.push(text);
	}

	/* data-NAME of the page, in JavaScript's spelling */
	data(name) {
		return this.page.evaluate((n) => document.documentElement.dataset[n], name);
	}

	/* {name: value or list of values}: until all agree */
	async until(wanted, timeout = WAIT_MS) {
		const agrees = (want) => Object.entries(want).every(([name, value]) =>
			[].concat(value).includes(document.documentElement.dataset[name]));
		await this.page.waitForFunction(agrees, wanted, { timeout, polling: 20 }).catch(async (error) => {
			const is = await this.page.evaluate(() => JSON.stringify(document.documentElement.dataset));
			const said = await this.page.evaluate(() => [...document.querySelectorAll("#message, #abort-outcome, #connection")]
				.map((node) => node.textContent.trim()).filter(Boolean).join(" | "));
			const path = await this.page.evaluate(() => window.shownSteps.slice(-12).join(", "));
			throw new Error(`waited for ${JSON.stringify(wanted)}, the page has ${is} after ${path}, says "${said}"`, { cause: error });
		});
	}

	/* every state that was shown since, and forgets them */
	states() {
		return this.page.evaluate(() => window.shownStates.splice(0));
	}

	text(selector) {
		return this.page.locator(selector).first().innerText();
	}

	async untilText(selector, pattern) {
		const fits = ([where, source, flags]) => new RegExp(source, flags).test(document.querySelector(where)?.textContent ?? "");
		await this.page.waitForFunction(fits, [selector, pattern.source, pattern.flags], { polling: 20 }).catch(async (error) => {
			const is = await this.page.locator(selector).first().textContent({ timeout: 100 }).catch(() => "nothing");
			throw new Error(`waited for ${pattern} in ${selector}, which has "${is}"`, { cause: error });
		});
	}

	/* for the eye: only when PICTURES is set */
	async picture(name, options) {
		if (process.env.PICTURES)
			await this.photograph(name, options);
	}

	async photograph(name, options = {}) {
		mkdirSync(pictures, { recursive: true });
		await this.page.screenshot({ path: join(pictures, `${name}.png`), ...options });
	}

	click(selector, options) {
		return this.page.click(selector, options);
	}

	key(name) {
		return this.page.keyboard.press(name);
	}

	/* A key that stands on a button, once the button may be pressed. */
	async command(name, button) {
		await this.page.locator(`#${button}:enabled:visible`).waitFor();
		await this.key(name);
	}

	/* The focus goes there by the Tab key alone. */
	async tabTo(id) {
		const reached = [];
		for (let i = 0; i < 150; i++) {
			const at = await this.page.evaluate(() => document.activeElement.id);
			if (at === id)
				return;
			reached.push(at);
			await this.key("Tab");
		}
		assert.fail(`Tab never came to #${id}, but to: ${[...new Set(reached)].join(" ")}`);
	}

	/* What is in a field is replaced, by keys. */
	async typeInto(id, text) {
		await this.tabTo(id);
		await this.key("Control+a");
		await this.page.keyboard.type(text);
	}

	/* Escape, and the console's answer */
	async abort(where) {
		const answer = this.page.waitForResponse((response) => response.url().endsWith("/api/abort"));
		await this.key("Escape");
		assert.equal((await answer).status(), 200, where);
		await this.untilText("#abort-outcome", /ABORT done/);
	}

	/* ---- the workflow, by mouse ---- */

	async setUp({ name, scene, angle, planned, height }) {
		await this.until({ step: "setup" });
		await this.page.selectOption("#scene", scene);
		await this.page.fill("#angle", String(angle));
		if (height !== undefined)
			await this.page.fill("#height", String(height));
		await this.page.fill("#planned", String(planned));
		await this.page.fill("#series-name", name);
		await this.click("#setup-go");
		await this.untilText("#series-head", new RegExp(name));
	}

	/* Whatever opened a guard is acknowledged, each drop does. A machine that is too busy loses heartbeats, and then the
	 * tower holds a fault, as it must. */
	async ready() {
		const asked = this.page.locator("#acknowledge:enabled:visible, #clear:enabled:visible");
		const armable = this.page.locator('html[data-step="arm"][data-state="READY"] #arm:enabled:visible');
		for (let asks = 0; asks < 10; asks++) {
			await asked.or(armable).waitFor();
			if (await armable.count())
				return;
			await this.key("Shift+C");
			await asked.waitFor({ state: "hidden", ...SOON }).catch(() => note("a CLEAR did nothing yet"));
			this.forgive("clear"); // a guard may have opened in between
		}
		throw new Error("the tower asks again and again to be acknowledged or cleared");
	}

	/* ARM is held down, until something comes of it. */
	async hold(down, up) {
		await this.page.hover("#arm", SOON);
		await down();
		try {
			await this.page.waitForSelector('#arm[data-held="yes"]', SOON);
			await this.page.waitForSelector('#arm[data-held="no"]', { state: "attached", ...SOON });
		} finally {
			await up();
		}
	}

	async shifted(way, key) {
		const keys = way === "down" ? ["Shift", key] : [key, "Shift"];
		for (const name of keys)
			await this.page.keyboard[way](name);
	}

	async arm() {
		await this.again(async () => {
			await this.ready();
			await this.hold(() => this.page.mouse.down(), () => this.page.mouse.up());
			await this.until({ step: "release", state: "ARMED" }, SOON.timeout);
		});
	}

	/* Once it can be: not while horn and lamp warn. A tower that lags behind refuses a press, which is then made again. */
	async pressRelease() {
		for (let presses = 0; presses < 8; presses++) {
			await this.click("#release", SOON);
			await this.until({ step: [...UNDER_WAY, "arm", "checks"] }, 1000).catch(() => {});
			if (await this.data("step") !== "release")
				break;
			this.forgive("release");
		}
		await this.until({ step: UNDER_WAY }, SOON.timeout);
	}

	async release() {
		await this.again(async (tries) => {
			if (tries > 1 && UNDER_WAY.includes(await this.data("step")))
				return; // it was only slow to show
			await this.arm();
			await this.pressRelease();
		});
	}

	/* What the tower may take back for the reason above is tried six times; what is tried ends with its effect. */
	async again(action) {
		for (let tries = 1; ; tries++) {
			try {
				return await action(tries);
			} catch (error) {
				if (tries === 6)
					throw error;
				note(`tried again: ${error.message.split("\n")[0]}`);
				this.forgive("arm");
				this.forgive("release");
			}
		}
	}

	/* A request that the tower refused, as it may, is no error of the page: nor if the browser tells of it only later. */
	forgive(request) {
		const refused = new RegExp(`status of 4\\d\\d .*/api/${request}$`);
		this.allowed.push(refused);
		this.errors = this.errors.filter((text) => !refused.test(text));
	}

	/* Released, and something else at once: with the console's answer, before the page hears of it. What goes wrong meanwhile
	 * is kept until the press is over: a rejection that nobody waits for yet would end the program. */
	async releaseAnd(action) {
		const answered = async (route) => {
			const response = await route.fetch();
			try {
				assert.ok(response.ok(), `RELEASE was refused with ${response.status()}`);
				return { value: await action() };
			} finally {
				await route.fulfill({ response });
			}
		};
		const done = new Promise((settle) => {
			this.page.route("**/api/release", (route) => answered(route).catch((error) => ({ error })).then(settle), { times: 1 });
		});
		await this.click("#release", SOON).catch((error) => this.page.unroute("**/api/release").then(() => { throw error; }));
		const { value, error } = await done;
		if (error)
			throw error;
		return value;
	}

	/* until its result is on the page; returns the ms that the page measured from the capture's end */
	async result(drop) {
		await this.until({ step: ["decide", "fault"], result: drop });
		if (await this.data("step") === "fault")
			await this.click("#clear");
		await this.until({ step: "decide" });
		return Number(await this.data("resultMs"));
	}

	async drop(drop) {
		await this.release();
		return this.result(drop);
	}
}
