/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Who may arm: one console at a time. Ours takes the hold when its operator first does something, renews it, and
 * gives it back when the page goes. */
import { post, request } from "./api.js";

const RENEW_MS = 2000;
const HELD = "droptower.held"; /* a page that is loaded again goes on with what it had */

let timer = 0;

function stop() {
	clearInterval(timer);
	timer = 0;
	sessionStorage.removeItem(HELD);
}

async function renew() {
	try {
		await post("/api/hold", { take: true });
	} catch (error) {
		if (error.status === 409) stop();
	}
}

export async function take() {
	await post("/api/hold", { take: true });
	if (!timer) timer = setInterval(renew, RENEW_MS);
	sessionStorage.setItem(HELD, "yes");
}

export async function retake() {
	if (sessionStorage.getItem(HELD)) await take().catch(stop);
}

export async function give() {
	stop();
	await post("/api/hold", { take: false });
}

/* What only the holder may do. Taking it again renews it; a console that was started again has forgotten it. */
export async function holding(action) {
	await take();
	return action();
}

/* A browser lets the timers of a tab that is hidden sleep: what is looked at again says so at once. */
document.addEventListener("visibilitychange", () => timer && !document.hidden && renew());

addEventListener("pagehide", () => {
	if (!timer) return;
	clearInterval(timer);
	request("POST", "/api/hold", { body: JSON.stringify({ take: false }), keepalive: true }).catch(() => {});
});
