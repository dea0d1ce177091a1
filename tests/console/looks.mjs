// SPDX-License-Identifier: GPL-3.0-or-later
//
// Whether everybody can use the page as it stands: sideways scrolling on a phone, contrast in both schemes, and the rules
// of axe-core at full size, 200 % and 390 px in turn. Each view is looked at in passing; what was found is judged at the end.

import { readFileSync } from "node:fs";
import { join } from "node:path";
import { build } from "./programs.mjs";

const PHONE = { width: 390, height: 844 };
const DOUBLED = { width: 683, height: 316 }; // a laptop's window at 200 %
const CONTRAST = 4.5; // WCAG 2.1, 1.4.3
export const found = { views: 0, wide: [], faint: [], broken: [] };

/* In the page: what is wider than the window. */
function tooWide() {
	const root = document.scrollingElement;
	if (root.scrollWidth <= root.clientWidth)
		return [];
	const over = [...document.body.querySelectorAll("*")].filter((node) => node.getBoundingClientRect().right > root.clientWidth + 0.5);
	return [`${root.scrollWidth} px, by ${over.slice(-5).map((node) => node.id || node.className || node.tagName).join(", ")}`];
}

/* In the page: cards with something in them that ends beyond them. */
function overflowing() {
	return [...document.querySelectorAll(".card")].filter((card) => card.scrollWidth > card.clientWidth)
		.map((card) => `${card.id || card.className} is ${card.clientWidth} px wide and holds ${card.scrollWidth}`);
}

/* In the page: visible text whose colour is too near to what is behind it, by the formulas of WCAG 2.1. */
function tooFaint(least) {
	const pen = new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true });
	const rgba = (colour) => {
		pen.clearRect(0, 0, 1, 1);
		pen.fillStyle = colour;
		pen.fillRect(0, 0, 1, 1);
		const [r, g, b, a] = pen.getImageData(0, 0, 1, 1).data;
		return [r, g, b, a / 255];
	};
	const over = (top, bottom, alpha) => top.slice(0, 3).map((c, i) => c * alpha + bottom[i] * (1 - alpha));
	const luminance = (colour) => colour.map((c) => c / 255).map((c) => (c <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4))
		.reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0);
	const chain = (node) => (node ? [...chain(node.parentElement), node] : []);
	const faint = new Set();
	const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
	while (walker.nextNode()) {
		const node = walker.currentNode.parentElement;
		const text = walker.currentNode.data.trim();
		if (!text || !node.checkVisibility({ visibilityProperty: true }) || node.closest(":disabled, option, .unseen, .u-off, noscript"))
			continue;
		let backs = [[255, 255, 255]], opacity = 1;
		for (const layer of chain(node)) {
			const style = getComputedStyle(layer);
			const colours = [style.backgroundColor, ...(style.backgroundImage.match(/rgba?\([^)]*\)/g) ?? [])].map(rgba);
			backs = colours.flatMap((colour) => backs.map((back) => over(colour, back, colour[3])));
			if (colours.length > 1) // stripes: each of them, and nothing between
				backs = backs.slice(-colours.length + 1);
			opacity *= Number(style.opacity);
		}
		const colour = rgba(getComputedStyle(node).color);
		const ratio = Math.min(...backs.map((back) => {
			const front = over(colour, back, colour[3] * opacity);
			const [low, high] = [luminance(front), luminance(back)].sort((a, b) => a - b);
			return (high + 0.05) / (low + 0.05);
		}));
		if (ratio < least)
			faint.add(`"${text.slice(0, 30)}" in ${node.closest("[id]")?.id}: ${ratio.toFixed(2)}`);
	}
	return [...faint];
}

/* Names, roles, headings, order, what is hidden and what can be reached: all rules of axe-core but that of contrast,
 * which is worked out above for both schemes and behind stripes, too. */
const axe = readFileSync(join(build, "tests/npm/node_modules/axe-core/axe.min.js"), "utf8");

async function broken(page) {
	await page.evaluate(`window.axe || (() => { ${axe} })()`);
	return page.evaluate(async () => {
		const rules = { "color-contrast": { enabled: false } };
		const { violations } = await window.axe.run(document, { resultTypes: ["violations"], rules });
		return violations.map(({ id, nodes }) => `${id}: ${nodes.map(({ target }) => target).join(", ").slice(0, 200)}`);
	});
}

/* view: its name in what is told. picture: also on the phone and in the dark. */
export async function look(desk, view) {
	const { page } = desk;
	const size = page.viewportSize();
	const tell = (list, items, what = "") => list.push(...items.map((item) => `${view}${what}: ${item}`));

	found.views++;
	await desk.picture(view);
	for (const colorScheme of ["dark", "light"]) {
		await page.emulateMedia({ colorScheme });
		tell(found.faint, await page.evaluate(tooFaint, CONTRAST), ` ${colorScheme}`);
		if (colorScheme === "dark")
			await desk.picture(`${view}-dark`);
	}
	const [width, at] = [[size, ""], [DOUBLED, " 200 %"], [PHONE, " 390 px"]][found.views % 3]; // in turn: it takes a second
	await page.setViewportSize(width);
	tell(found.broken, await broken(page), at);
	tell(found.wide, await page.evaluate(overflowing), at);
	await page.setViewportSize(PHONE);
	tell(found.wide, await page.evaluate(tooWide));
	await desk.picture(`${view}-phone`);
	await page.setViewportSize(size);
}
