/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Photos of what falls: before the next drop, and after the one that is shown. Any page with the token may take them; on a
 * phone the camera opens. What is sent is the picture alone, drawn anew: no place, no camera, no larger than a report needs. */
import { get, getJson, postBytes } from "./api.js";
import { attempt, byId, el, setText, show } from "./dom.js";
import { pathOf } from "./drops.js";

const SIDE = 2048; /* pixels */
const QUALITY = 0.85;
const STEPS = ["checks", "arm"]; /* before a drop */

/* asked: how often, so that an answer that was overtaken is none. listed: what is drawn. */
const blocks = { next: { name: "", asked: 0, listed: "" }, drop: { name: "", asked: 0, listed: "" } };

async function canvasOf(blob, side) {
	const bitmap = await createImageBitmap(blob).catch(() => {
		throw new Error("The file is no picture that this browser can read.");
	});
	const scale = Math.min(1, side / Math.max(bitmap.width, bitmap.height));
	const canvas = el("canvas", { width: Math.round(bitmap.width * scale), height: Math.round(bitmap.height * scale) });
	const pen = canvas.getContext("2d");
	pen.fillStyle = "#fff";
	pen.fillRect(0, 0, canvas.width, canvas.height);
	pen.drawImage(bitmap, 0, 0, canvas.width, canvas.height);
	bitmap.close();
	return canvas;
}

const asJpeg = (canvas) => new Promise((settle) => canvas.toBlob(settle, "image/jpeg", QUALITY));

/* A press shows it as wide as there is room, another one small again. */
async function figure(name, photo) {
	const blob = await (await get(`/api/photo/${pathOf(name)}`, { sha256: photo.sha256 }, "file")).blob();
	const canvas = await canvasOf(blob, SIDE);
	const press = (event) => event.currentTarget.classList.toggle("wide");
	canvas.setAttribute("role", "img");
	canvas.setAttribute("aria-label", `photo ${photo.when} ${photo.waits ? "the next drop" : name}`);
	return el("figure", {}, el("button", { type: "button", on: { click: press } }, canvas), el("figcaption", {}, photo.when));
}

async function load(which) {
	const block = blocks[which];
	const asked = ++block.asked;
	const { name } = block;
	const photos = name ? (await getJson(`/api/photos/${pathOf(name)}`)).photos : [];
	const listed = JSON.stringify([name, photos]);
	if (asked !== block.asked || listed === block.listed) return;
	const figures = await Promise.all(photos.map((photo) => figure(name, photo)));
	if (asked !== block.asked) return;
	block.listed = listed;
	byId(`photos-${which}`).querySelector(".photos").replaceChildren(...figures);
	show(byId("photos-discard"), byId("photos-next").querySelector("figure") !== null);
}

/* The archive has changed; of a drop that is being recorded nothing is known yet. */
export const reload = () => Promise.all(Object.keys(blocks).map((which) => load(which).catch(() => {})));

/* With every state. series, drop: names, "" for none. */
export function render(step, series, drop) {
	const names = { next: STEPS.includes(step) ? series : "", drop };
	for (const [which, name] of Object.entries(names)) {
		show(byId(`photos-${which}`), name !== "");
		if (blocks[which].name === name) continue;
		Object.assign(blocks[which], { name, listed: "" });
		byId(`photos-${which}`).querySelector(".photos").replaceChildren();
		load(which).catch(() => {});
	}
	show(byId("photos"), Object.values(names).some(Boolean));
	if (drop) setText(byId("photo-after-of"), drop);
}

async function send(input, which, when) {
	const [file] = input.files;
	const { name } = blocks[which];
	if (!file || !name) return;
	const label = input.labels[0].firstChild;
	const words = label.data;
	input.disabled = true;
	setText(label, "Sending…");
	await attempt(async () => {
		const jpeg = await asJpeg(await canvasOf(file, SIDE));
		await postBytes(`/api/photo/${pathOf(name)}`, { when }, jpeg);
	});
	input.value = "";
	input.disabled = false;
	setText(label, words);
	load(which).catch(() => {});
}

export function listen(discard) {
	byId("photo-before").addEventListener("change", (event) => send(event.target, "next", "before"));
	byId("photo-after").addEventListener("change", (event) => send(event.target, "drop", "after"));
	byId("photos-discard").addEventListener("click", async () => {
		await attempt(() => discard(blocks.next.name));
		load("next").catch(() => {});
	});
}
