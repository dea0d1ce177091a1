/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Keys for what is done in every drop, each written on its button. With shift, so that none is hit by the way; what
 * is hidden or disabled has no key. ABORT's is in abort.js. */
import { byId } from "./dom.js";

const KEYS = { A: "arm", Y: "arm-confirm", R: "release", K: "accept", X: "reject", C: "clear" };
const ALSO = { C: "acknowledge" }; /* never both can be seen */

const isText = (node) => node instanceof Element && node.matches("input, select, textarea");

export function listen() {
	addEventListener("keydown", (event) => {
		const { shiftKey, ctrlKey, altKey, metaKey, repeat, key, target } = event;
		const name = key.toUpperCase();
		if (!shiftKey || ctrlKey || altKey || metaKey || repeat || !KEYS[name] || isText(target)) return;
		const seen = [KEYS[name], ALSO[name]].map((id) => id && byId(id)).find((node) => node && node.offsetParent !== null);
		if (!seen || seen.disabled) return;
		event.preventDefault();
		seen.click();
	});
}
