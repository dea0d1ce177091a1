/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The few things every part of the page does to the document. No text ever becomes markup. */

export const byId = (id) => document.getElementById(id);

/* el("li", {class: "x", data: {key: 1}, on: {click: f}}, "text", node) */
export function el(tag, attributes = {}, ...children) {
	const node = document.createElement(tag);
	const { on = {}, data = {}, ...rest } = attributes;
	for (const [name, value] of Object.entries(rest)) {
		if (value === true) node.setAttribute(name, "");
		else if (value !== false && value != null) node.setAttribute(name, value);
	}
	Object.assign(node.dataset, data);
	for (const [name, f] of Object.entries(on)) node.addEventListener(name, f);
	node.append(...children.filter((child) => child != null));
	return node;
}

export function button(text, click, attributes = {}) {
	return el("button", { type: "button", on: { click }, ...attributes }, text);
}

/* head: texts, or lists of what stands in a cell. */
export function table(head, rows) {
	const cells = head.map((cell) => el("th", { scope: "col" }, ...[cell].flat()));
	return el("table", { class: "drops" }, el("thead", {}, el("tr", {}, ...cells)), el("tbody", {}, ...rows));
}

/* What did not change is not touched: the page is told four times a second. */
export function setText(node, text) {
	if (node.textContent !== text) node.textContent = text;
}

export function setData(node, key, value) {
	if (node.dataset[key] !== String(value)) node.dataset[key] = value;
}

export function show(node, visible) {
	if (node.hidden === visible) node.hidden = !visible;
}

export function sign(name) {
	const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
	const use = document.createElementNS("http://www.w3.org/2000/svg", "use");
	svg.setAttribute("class", "sign");
	svg.setAttribute("aria-hidden", "true");
	use.setAttribute("href", `#sign-${name}`);
	svg.append(use);
	return svg;
}

export function message(text) {
	setText(byId("message").querySelector("p"), text);
	show(byId("message"), text !== "");
}

/* Runs what a control asks for; what the console refuses is told, and true returned when it was done. */
export async function attempt(action) {
	message("");
	try {
		await action();
		return true;
	} catch (error) {
		message(error.message);
		return false;
	}
}
