// SPDX-License-Identifier: GPL-3.0-or-later
//
// pictures.mjs BUILD: a series on the simulated tower, and two pictures of the page into host/console.
import { join } from "node:path";
import { Desk, browse } from "./desk.mjs";
import { build, makeFolder, serve, stop } from "./programs.mjs";

const SERIES = "box-30";

const { child, address } = await serve(join(build, "droptower"), ["serve", "--port", "0", "--archive", makeFolder()]);
const browser = await browse();
const desk = await Desk.open(browser, { width: 1280, height: 720 });
const { page } = desk;

await page.goto(address);
await desk.setUp({ name: SERIES, scene: "geometry-2B", angle: 30, planned: 5 });
for (let drop = 1; drop <= 5; drop++) {
	await desk.drop(`${SERIES}/${drop}`);
	if (drop === 3) {
		await page.waitForFunction(() => /model/.test(document.querySelector("#chart-x").textContent));
		await page.waitForSelector('#interlocks:not(:has([data-level="bad"]))');
		await page.mouse.move(0, 0);
		await page.screenshot({ path: "host/console/workflow.png" });
	}
	await desk.click("#accept");
	await page.waitForSelector(`#series-table tr[data-drop="${SERIES}/${drop}"][data-decision="accepted"]`);
}
await desk.ready();
await desk.click("#tab-overlay");
await page.waitForSelector("#overlay canvas");
await page.getByRole("button", { name: "Pulse" }).locator("visible=true").click();
await page.mouse.move(0, 0);
await page.setViewportSize({ width: 1280, height: 1200 });
await page.locator("section.charts").screenshot({ path: "host/console/overlay.png" });
await browser.close();
process.exit(await stop(child) === 0 ? 0 : 1);
