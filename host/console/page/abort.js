/* SPDX-License-Identifier: GPL-3.0-or-later */
/* ABORT: sent at once, without a question, and again until the console answers. */
import { request } from "./api.js";
import { byId, setText } from "./dom.js";
import { clock } from "./words.js";
import { MOVING } from "./workflow.js";

const ANSWER_MS = 1000; /* an attempt may take so long */
const PAUSE_MS = 250;
const SHOWN_MS = 20000; /* what went well is not news for ever */

/* What it ended, as the page knew it. */
const ENDED = { READY: "nothing was armed", SAFE: "nothing was armed", ARMED: "the tower was armed" };
const MOVED = "the tower was in motion";

let round = 0; /* the newest press; older ones end */

function tell(text, level) {
	byId("abort-outcome").dataset.level = level;
	setText(byId("abort-outcome"), text);
}

async function send() {
	const answer = await request("POST", "/api/abort", {
		body: "{}",
		priority: "high",
		signal: AbortSignal.timeout(ANSWER_MS),
	});
	if (answer.ok) return { done: true, text: "" };
	let text = `answer ${answer.status}`;
	try {
		text = (await answer.json()).error ?? text;
	} catch {
		/* the number has to do */
	}
	/* A refusal is an answer; what may pass is tried again. */
	return { done: answer.status < 500 && answer.status !== 429, refused: true, text };
}

export async function abort() {
	const mine = ++round;
	const { state } = document.documentElement.dataset;
	const ended = ENDED[state] ?? (MOVING.has(state) ? MOVED : "the tower has it");
	document.dispatchEvent(new Event("aborted"));
	tell("ABORT: sending …", "warn");
	for (let tries = 1; mine === round; tries++) {
		let outcome;
		try {
			outcome = await send();
		} catch {
			outcome = { done: false, text: "no answer" };
		}
		if (mine !== round) return;
		if (outcome.done) {
			if (outcome.refused) tell(`${clock()} ABORT refused: ${outcome.text}`, "bad");
			else tell(`${clock()} ABORT done: ${ended}`, "good");
			setTimeout(() => mine === round && tell("", "good"), SHOWN_MS);
			return;
		}
		tell(`ABORT: no success yet (${outcome.text}), try ${tries + 1} … Use the emergency stop.`, "bad");
		await new Promise((resolve) => setTimeout(resolve, PAUSE_MS));
	}
}

/* An input method gives the key another name, not another place. */
const isEscape = (event) => event.key === "Escape" || event.code === "Escape";

/* Anywhere on the page, before anything else sees the key. A list that is open keeps the key's press to itself: of that
 * one only the release is heard. */
export function listen() {
	let pressed = false;

	/* what was aborted is over: its outcome does not stand above the next one */
	document.addEventListener("armed", () => {
		round++;
		tell("", "good");
	});

	byId("abort").addEventListener("click", abort);
	addEventListener(
		"keydown",
		(event) => {
			if (!isEscape(event) || event.repeat) return;
			pressed = true;
			abort();
		},
		{ capture: true },
	);
	addEventListener(
		"keyup",
		(event) => {
			if (!isEscape(event)) return;
			if (!pressed) abort();
			pressed = false;
		},
		{ capture: true },
	);
	addEventListener("blur", () => {
		pressed = false;
	});
}
