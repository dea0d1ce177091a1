// SPDX-License-Identifier: GPL-3.0-or-later
//
// pictures.mjs BUILD: a series on the simulated tower, and two pictures of the page into host/console.
import { join } from "node:path";
import { Desk, browse } from "./desk.mjs";
import { build, makeFolder, serve, stop } from "./programs.mjs";

const SERIES = "box-30";

const { child, address } = await serve(join(build, "droptower"), ["serve", "--port", "0", "--archive", makeFolder()]);
const browser = await browse();
const desk = await Desk.open(browser, { width: 1400, height: 900 });
const { page } = desk;
const picture = (name) => page.screenshot({ path: `host/console/${name}.png` });

await page.goto(address);
await desk.setUp({ name: SERIES, scene: "geometry-2B", angle: 30, planned: 5 });
for (let drop = 1; drop <= 5; drop++) {
	await desk.drop(`${SERIES}/${drop}`);
	if (drop === 3) {
		await page.waitForFunction(() => /model/.test(document.querySelector("#chart-x").textContent));
		await desk.until({ state: "READY" });
		await page.mouse.move(0, 0);
		await picture("workflow");
	}
	await desk.click("#accept");
	await page.waitForSelector(`#series-table tr[data-drop="${SERIES}/${drop}"][data-decision="accepted"]`);
}
await desk.until({ state: "READY" });
await desk.click("#tab-overlay");
await page.waitForSelector("#overlay canvas");
await page.getByRole("button", { name: "Pulse" }).locator("visible=true").click();
await page.mouse.move(0, 0);
await picture("overlay");
await browser.close();
process.exit(await stop(child) === 0 ? 0 : 1);
