/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Accepting and rejecting the drop that is on the card. What speaks against it wants a reason. */
import { attempt, button, byId, setData, setText, show } from "./dom.js";
import { shownResult } from "./result.js";
import { REASONS, decide } from "./table.js";

const ACCEPT_REASONS = ["flag does not affect the result", "traces checked, sound"];
const REJECT_REASONS = REASONS.slice(0, 4);

const WORDS = {
	accepted: ["Reason (what speaks against the drop stays noted)", "Accept the drop"],
	rejected: ["Reason (the drop is kept but excluded from the results)", "Reject the drop"],
};

let asks = ""; /* the decision that is being given a reason */
let of = ""; /* the drop for which it is */

function form(decision) {
	asks = decision;
	show(byId("reject-form"), decision !== "");
	show(byId("decide"), decision === "");
	if (!decision) return;
	const [question, go] = WORDS[decision];
	setText(byId("reason-ask"), question);
	setText(byId("reject-go"), go);
	byId("reason").value = "";
	byId("reason").focus({ preventScroll: true });
	byId("reject-form").scrollIntoView({ block: "nearest" });
}

export const needsReason = () => shownResult().doubts.length > 0;

/* Nobody decides on a drop that is not on the card. */
export const isShown = (pending) => shownResult().name === pending;

/* With every state. */
export function render(pending) {
	if (pending !== of) form("");
	of = pending;
	const doubted = needsReason();
	setText(byId("decide-drop"), pending);
	show(byId("decide-show"), pending !== "" && !isShown(pending));
	byId("accept").classList.toggle("good", !doubted);
	setData(byId("accept"), "reason", doubted ? "yes" : "no");
	setText(byId("accept").firstChild, doubted ? "ACCEPT… " : "ACCEPT ");
	show(byId("accept-reasons"), doubted);
}

export function listen(pending, openDrop) {
	const go = (decision, reason) => attempt(() => decide(pending(), decision, reason));
	const buttons = (decision, reasons) =>
		reasons.map((text) => button(text, () => go(decision, text), { "data-command": true }));
	byId("accept-reasons").replaceChildren(...buttons("accepted", ACCEPT_REASONS));
	byId("reject-reasons").replaceChildren(...buttons("rejected", REJECT_REASONS));
	byId("accept").addEventListener("click", () => (needsReason() ? form("accepted") : go("accepted", "")));
	byId("reject").addEventListener("click", () => form("rejected"));
	byId("reject-cancel").addEventListener("click", () => form(""));
	byId("decide-show").addEventListener("click", () => openDrop(pending()));
	byId("reject-form").addEventListener("submit", async (event) => {
		event.preventDefault();
		if (await go(asks, byId("reason").value.trim())) form("");
	});
}
