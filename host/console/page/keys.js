/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Keys for what is done in every drop, each written on its button. With shift, so that none is hit by the way; what
 * is hidden or disabled has no key. ABORT's is in abort.js. */
import { byId } from "./dom.js";

const KEYS = { A: "arm", Y: "arm-confirm", R: "release", K: "accept", X: "reject", C: "clear" };

const isText = (node) => node instanceof Element && node.matches("input, select, textarea");

export function listen() {
	addEventListener("keydown", (event) => {
		const id =
			event.shiftKey &&
			!event.ctrlKey &&
			!event.altKey &&
			!event.metaKey &&
			!event.repeat &&
			KEYS[event.key.toUpperCase()];
		if (!id || isText(event.target)) return;
		const button = byId(id);
		if (button.disabled || button.offsetParent === null) return;
		event.preventDefault();
		button.click();
	});
}
