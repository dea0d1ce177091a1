/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Traces and model of drops, as the console keeps them: fetched once, decoded from its binary form. */
import { get, getJson } from "./api.js";

const KEPT = 60;
const cache = new Map();

/* u32 length, JSON header, float32 samples: little endian, as is every machine with a browser. */
export function decode(buffer) {
	const size = new DataView(buffer).getUint32(0, true);
	const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, size)));
	let at = 4 + size;
	for (const channel of header.channels) {
		channel.samples = new Float32Array(buffer, at, channel.count);
		at += 4 * channel.count;
	}
	header.of = (name) => header.channels.find((channel) => channel.name === name);
	return header;
}

function keep(key, make) {
	if (!cache.has(key)) {
		const promise = make();
		cache.set(key, promise);
		promise.catch(() => cache.delete(key));
		if (cache.size > KEPT) cache.delete(cache.keys().next().value);
	}
	return cache.get(key);
}

export const pathOf = (drop) => drop.split("/").map(encodeURIComponent).join("/");

export const traceOf = (drop) =>
	keep(`trace ${drop}`, async () => decode(await (await get(`/api/trace/${pathOf(drop)}`)).arrayBuffer()));

/* null when the scene has no model for it. */
export const modelOf = (drop) =>
	keep(`model ${drop}`, async () => {
		try {
			return decode(await (await get(`/api/model/${pathOf(drop)}`)).arrayBuffer());
		} catch (error) {
			if (error.status === 404) return null;
			throw error;
		}
	});

export const resultOf = async (drop) => (await get(`/api/drop/${pathOf(drop)}`)).json();

/* What the archive says of its series' drops. */
export const rowsOf = async (drop) => (await getJson("/api/drops", { series: drop.split("/")[0] })).drops;

export const spectrumOf = (drop, kind) =>
	keep(`spectrum ${kind} ${drop}`, async () => (await get(`/api/spectrum/${pathOf(drop)}`, { kind })).json());
