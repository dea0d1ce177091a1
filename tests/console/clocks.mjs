// SPDX-License-Identifier: GPL-3.0-or-later
//
// The laboratory's clock on the page, UTC in the archive: what the history's filter asks for, and what its rows
// show, in zones whose offsets are known.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";

const source = readFileSync(new URL("../../host/console/page/words.js", import.meta.url), "utf8");
const { time, utcOf } = await import(`data:text/javascript,${encodeURIComponent(source)}`);

function at(zone, check) {
	const before = process.env.TZ;
	process.env.TZ = zone;
	try {
		check();
	} finally {
		if (before === undefined)
			delete process.env.TZ;
		else
			process.env.TZ = before;
	}
}

const PERIODS = [
	["UTC", "2026-11-02", "2026-11-02T00:00..2026-11-02T23:59"],
	["Europe/Berlin", "2026-11-02", "2026-11-01T23:00..2026-11-02T22:59"],
	["Europe/Berlin", " 2026-03-29 ", "2026-03-28T23:00..2026-03-29T21:59"], // has 23 hours
	["Europe/Berlin", "2026-10-25", "2026-10-24T22:00..2026-10-25T22:59"], // has 25
	["Europe/Berlin", "2026", "2025-12-31T23:00..2026-12-31T22:59"],
	["America/New_York", "2026-11", "2026-11-01T04:00..2026-12-01T04:59"],
	["America/New_York", "2026-10..2026-11-02", "2026-10-01T04:00..2026-11-03T04:59"],
	["Asia/Kathmandu", "2028-02-29", "2028-02-28T18:15..2028-02-29T18:14"],
];

function periods() {
	for (const [zone, text, wanted] of PERIODS)
		at(zone, () => assert.equal(utcOf(text), wanted, `${text} in ${zone}`));
}

function others() {
	for (const text of ["", "2026-13", "2026-02-30", "2026-00", "11/02/2026", "2026-11..", "2026..2027..2028", "2026-11-02T08:00"])
		assert.equal(utcOf(text), text);
}

function shown() {
	at("Europe/Berlin", () => assert.equal(time("2020-10-31T23:30:00Z"), "2020-11-01 00:30"));
	at("America/New_York", () => assert.equal(time("2020-11-01T03:30:00Z"), "2020-10-31 23:30"));
}

export default {
	name: "clocks", apart: true,
	steps: [
		["a day, month or year of the laboratory's clock is asked for as minutes of UTC", periods],
		["what is none of these goes to the archive as it was typed", others],
		["a drop is shown on the day the filter finds it", shown],
	],
};
