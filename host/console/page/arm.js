/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Arming, the countdown, releasing. ARM is held, so that no slip arms; the token that releases lives in this page only,
 * is used once, and is gone when the page is loaded again. */
import { post } from "./api.js";
import { attempt, byId, message, setData, setText, show } from "./dom.js";
import { holding } from "./hold.js";
import { atRest } from "./workflow.js";

const EARLY = 425;
let token = null; /* of our own arming, while it can be used */
let wasArmed = false;
let aborted = false; /* since it was armed */
let until = 0; /* performance.now() at which the tower disarms by itself */
let whole = 10;
let warned = 0; /* performance.now() at which horn and lamp have warned for long enough */

export const warns = () => performance.now() < warned;

const HOLD_MS = 800;
let held = 0; /* timer of an ARM that is held down */

async function arm() {
	await attempt(async () => {
		const answer = await holding(() => post("/api/arm"));
		aborted = false;
		document.dispatchEvent(new Event("armed"));
		token = answer.token;
		wasArmed = false;
		whole = answer.expires_s;
		until = performance.now() + 1000 * answer.expires_s;
		warned = performance.now() + 1000 * answer.warning_s;
	});
}

/* What is let go, left or taken away before the time is over has armed nothing. */
function endHold() {
	clearTimeout(held);
	setData(byId("arm"), "held", "no");
}

function beginHold(button) {
	if (button.disabled) return;
	endHold();
	setData(button, "held", "yes");
	held = setTimeout(() => {
		endHold();
		if (!button.disabled && button.offsetParent !== null && !document.hidden) arm();
	}, HOLD_MS);
}

export const hold = { begin: beginHold, end: endHold };

async function release() {
	const used = token;
	token = null;
	if (used === null) return;
	await attempt(async () => {
		try {
			await post("/api/release", { token: used });
		} catch (error) {
			if (error.status === EARLY) token = used; /* still armed */
			throw error;
		}
	});
}

function releaseWords() {
	if (byId("release").hidden)
		return "Armed from another page, or before this one was loaded again. It disarms by itself; ABORT disarms now.";
	return warns()
		? `Horn and lamp warn: ${Math.ceil((warned - performance.now()) / 1000)} s. Nobody near the tower?`
		: "Nobody near the tower? Then release. Without a release the tower disarms by itself.";
}

function tick() {
	if (byId("step-release").hidden) return;
	const left = Math.max(0, (until - performance.now()) / 1000);
	const release = byId("release");
	/* the state that enables it comes four times a second */
	if (release.dataset.warns === "yes" && !warns()) release.disabled = !document.documentElement.matches("[data-connected=yes]");
	setData(release, "warns", warns() ? "yes" : "no");
	if (!byId("release-say").hidden) setText(byId("release-say"), releaseWords());
	setText(byId("countdown"), String(Math.ceil(left)));
	byId("countdown-bar").style.width = `${Math.min(100, (100 * left) / whole)}%`;
}

/* With every state: the tower's own clock is the one that counts. */
export function follow(state) {
	const armed = state.tower.state === "ARMED";
	if (armed) {
		until = performance.now() + 1000 * state.tower.armed_s;
		warned = performance.now() + 1000 * state.tower.warning_s;
		wasArmed = true;
	} else if (wasArmed) {
		wasArmed = false;
		if (token !== null && !aborted && atRest(state.tower) && state.tower.state !== "FAULT_HELD")
			message(
				performance.now() > until - 500
					? `ARM ran out after ${whole} s. Nothing was released.`
					: "The tower is no longer armed. Nothing was released.",
			);
		token = null;
	}
	show(byId("release"), armed && token !== null && state.hold.mine);
	show(byId("release-say"), armed);
	tick();
}

export function showArm(state) {
	const { series, tower } = state;
	if (!series) return;
	const done = series.accepted >= series.planned;
	setText(
		byId("arm-say"),
		done
			? `All ${series.planned} drops are accepted. Go on with the next series, or make one more drop of this one.`
			: `Drop ${series.accepted + 1} of ${series.planned}. ${tower.blocked ? `Not now: ${tower.trouble}.` : "Nobody in the tower? Hold ARM for a second."}`,
	);
	setText(byId("arm-head"), done ? "Series complete" : "Arm");
	show(byId("next-series"), done);
	byId("arm").classList.toggle("primary", !done);
}

export function listen() {
	const button = byId("arm");
	button.addEventListener("pointerdown", (event) => event.button === 0 && beginHold(button));
	for (const end of ["pointerup", "pointerleave", "pointercancel"]) button.addEventListener(end, endHold);
	button.addEventListener("contextmenu", (event) => event.preventDefault());
	/* an ABORT takes that back as well */
	document.addEventListener("aborted", () => {
		aborted = true;
		endHold();
	});
	byId("release").addEventListener("click", release);
	setInterval(tick, 100);
}
