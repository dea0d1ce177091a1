/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The console's events. EventSource cannot send the token, so the stream is read by hand. */
import { keepName, refusal, request } from "./api.js";

const SILENT_MS = 1500; /* then what the page shows is old */
const GIVE_UP_MS = 4000; /* then the connection is made anew */
const BACKOFF_MS = [250, 500, 1000, 2000];
const PAGES = 3; /* of one browser: each takes one of its six connections, and ABORT must find one */
const PLACE_MS = 500;

function parse(text, on) {
	let name = "message",
		data = "";
	for (const line of text.split("\n")) {
		if (line.startsWith("event:")) name = line.slice(6).trim();
		else if (line.startsWith("data:")) data += line.slice(5);
	}
	if (data) on(name, JSON.parse(data));
}

async function read(answer, on) {
	const reader = answer.body.getReader();
	const decoder = new TextDecoder();
	let rest = "";
	for (;;) {
		const { value, done } = await reader.read();
		if (done) return;
		rest += decoder.decode(value, { stream: true });
		const whole = rest.split("\n\n");
		rest = whole.pop();
		for (const text of whole) parse(text, on);
	}
}

const wait = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

/* crowded() as long as there is no place. */
async function takePlace(crowded) {
	for (;;) {
		for (let i = 0; i < PAGES; i++) if (await keepName(`stream.${i}`)) return;
		crowded();
		await wait(PLACE_MS);
	}
}

/* on(name, data) for each event; connected(bool, why not) whenever one of these changes. */
export function follow(on, connected) {
	let heard = -Infinity,
		begun = 0,
		failures = 0,
		is = null,
		why = "",
		told = "",
		attempt = null,
		stopped = false;

	const tell = (value) => {
		if (value !== is || why !== told) connected((is = value), (told = why));
	};
	const event = (name, data) => {
		heard = performance.now();
		failures = 0;
		tell(true);
		on(name, data);
	};
	async function once() {
		attempt = new AbortController();
		begun = performance.now();
		const answer = await request("GET", "/api/stream", { signal: attempt.signal });
		if (!answer.ok) throw await refusal(answer);
		await read(answer, event);
	}
	async function forever() {
		await takePlace(() => {
			why = `${PAGES} other pages of this browser show the tower. Close one.`;
			tell(false);
		});
		why = "";
		while (!stopped) {
			try {
				await once();
			} catch (error) {
				if (error.status === 401) return;
			}
			attempt = null;
			const pause = BACKOFF_MS[Math.min(failures++, BACKOFF_MS.length - 1)];
			await wait(pause);
		}
	}
	setInterval(() => {
		const now = performance.now();
		if (now - heard > SILENT_MS) tell(false);
		if (now - Math.max(heard, begun) > GIVE_UP_MS) attempt?.abort();
	}, 200);
	addEventListener("pagehide", () => {
		stopped = true;
		attempt?.abort();
	});
	forever();
}
