/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Requests to the console: who asks, with which token, and what was refused. */

const TOKEN = "droptower.token";
const CONSOLE = "droptower.console";

export class Refused extends Error {
	constructor(status, text) {
		super(text);
		this.status = status;
	}
}

/* From the address, out of which it is taken at once: addresses are logged, shown and copied. */
export function takeToken() {
	const given = new URLSearchParams(location.hash.slice(1)).get("token");
	if (given) {
		sessionStorage.setItem(TOKEN, given);
		history.replaceState(null, "", location.pathname);
	}
	return sessionStorage.getItem(TOKEN) !== null;
}

export function keepToken(token) {
	sessionStorage.setItem(TOKEN, token);
}

function newId() {
	const bytes = crypto.getRandomValues(new Uint8Array(16));
	return Array.from(bytes, (b) => b.toString(16).padStart(2, "0")).join("");
}

/* Whether this page has the name now, among all pages of the console in this browser; it keeps it until it goes. */
export async function keepName(name) {
	if (!navigator.locks) return true;
	return new Promise((resolve) => {
		navigator.locks.request(`droptower.${name}`, { ifAvailable: true }, (lock) => {
			resolve(lock !== null);
			return lock ? new Promise(() => {}) : undefined;
		});
	});
}

let consoleId = "";

export async function takeId() {
	consoleId = sessionStorage.getItem(CONSOLE) ?? newId();
	/* a tab that is duplicated has the other's storage too, and must not pass for it */
	if (!(await keepName(consoleId))) {
		consoleId = newId();
		await keepName(consoleId);
	}
	sessionStorage.setItem(CONSOLE, consoleId);
}

export function request(method, path, options = {}) {
	const headers = {
		Authorization: `Bearer ${sessionStorage.getItem(TOKEN) ?? ""}`,
		"X-Console": consoleId,
	};
	if (typeof options.body === "string") headers["Content-Type"] = "application/json";
	return fetch(path, { cache: "no-store", ...options, method, headers });
}

export async function refusal(answer) {
	let text = `the console answered ${answer.status}`;
	try {
		text = (await answer.json()).error ?? text;
	} catch {
		/* not JSON: the number has to do */
	}
	if (answer.status === 401) document.dispatchEvent(new Event("unauthorised"));
	return new Refused(answer.status, text);
}

const wait = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

async function answered(method, path, options) {
	let answer;
	try {
		answer = await request(method, path, options);
		if (answer.status === 429 && method === "GET") {
			await wait(1000 * Math.min(5, Number(answer.headers.get("Retry-After")) || 1));
			answer = await request(method, path, options);
		}
	} catch {
		throw new Refused(0, "the console does not answer");
	}
	if (!answer.ok) throw await refusal(answer);
	return answer;
}

const last = {};

/* A browser has six connections to one server, for all its pages together. What may take its time goes one by one, so
 * that there is always one left for ABORT. */
function inTurn(name, action) {
	if (navigator.locks) return navigator.locks.request(`droptower.${name}`, action);
	return (last[name] = (last[name] ?? Promise.resolve()).then(action, action));
}

export async function get(path, query = {}, turn = "get") {
	const given = Object.entries(query).filter(([, value]) => value !== "" && value != null);
	const text = new URLSearchParams(given).toString();
	return inTurn(turn, () => answered("GET", text ? `${path}?${text}` : path, {}));
}

export const getJson = async (path, query) => (await get(path, query)).json();

export async function post(path, body = {}) {
	return (await answered("POST", path, { body: JSON.stringify(body) })).json();
}

/* A file's bytes, as they are. */
export async function postBytes(path, query, bytes) {
	return inTurn("file", () => answered("POST", `${path}?${new URLSearchParams(query)}`, { body: bytes }));
}

/* A link cannot send the token, so the file goes through the page. */
export async function download(path, query, name) {
	const url = URL.createObjectURL(await (await get(path, query, "file")).blob());
	const link = document.createElement("a");
	link.href = url;
	link.download = name;
	link.click();
	setTimeout(() => URL.revokeObjectURL(url), 10000);
}
