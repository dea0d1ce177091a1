/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The serial number of what is dropped: typed or scanned before a drop, and noted with it. A scanner is a keyboard that
 * ends with Enter. It stays until another one comes, also over a reload. */
import { byId } from "./dom.js";
import { note } from "./table.js";

const KEY = "droptower.serial";
const STEPS = ["checks", "arm"]; /* while a drop is decided on, another number would be taken for its own */

const noted = (serial) => `serial ${serial}`;

function keep(serial) {
	sessionStorage.setItem(KEY, serial);
	byId("serial").value = serial;
}

export const serial = () => sessionStorage.getItem(KEY) ?? "";

export function scanned(text) {
	if (STEPS.includes(document.documentElement.dataset.step)) keep(text);
}

/* row: of a drop that is to be decided. What the tower noted stays. */
export async function bind(name, row) {
	if (!serial() || !row || row.note.includes("serial ")) return;
	await note(name, [row.note, noted(serial())].filter(Boolean).join("; "));
}

export function listen() {
	const field = byId("serial");
	field.value = serial();
	field.addEventListener("change", () => keep(field.value.trim()));
	/* Enter ends the number; the next key is not meant for it */
	field.addEventListener("keydown", (event) => event.key === "Enter" && field.blur());
}
