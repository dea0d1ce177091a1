// SPDX-License-Identifier: GPL-3.0-or-later
//
// main.mjs BUILD SANITIZED: the browser tests, as TAP; with PICTURES=1 pictures of every step
// go into BUILD/tests/console. Ends at once, with 3, when a tab of Chromium crashes.
import assert from "node:assert/strict";
import bench from "./bench.mjs";
import clocks from "./clocks.mjs";
import { found } from "./looks.mjs";
import restart from "./restart.mjs";
import tabs from "./tabs.mjs";
import { run } from "./tap.mjs";
import workflow from "./workflow.mjs";

const VIEWS = 18; // so many were looked at

const looks = {
	name: "looks", apart: true,
	steps: [
		["nothing scrolls sideways at 390 px, nothing ends beyond its card", async () => assert.deepEqual([found.views === VIEWS, ...found.wide], [true])],
		["every text has a contrast of 4.5, light and dark", async () => assert.deepEqual([found.views === VIEWS, ...found.faint], [true])],
		["axe-core finds nothing, at full size, 200 % and 390 px", async () => assert.deepEqual([found.views === VIEWS, ...found.broken], [true])],
	],
};

process.exit(await run([clocks, workflow, bench, tabs, restart, looks]));
