// SPDX-License-Identifier: GPL-3.0-or-later
//
// The programs under test, each a child of ours and ended by its own pid, whatever happens to the test.
import { spawn, execFile } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { promisify } from "node:util";

const HANG_MS = 300000; // what takes longer hangs, on a busy machine too

const running = new Set();
const folders = [];

export const build = resolve(process.argv[2] ?? "build");
export const sanitized = resolve(process.argv[3] ?? build);
export const pictures = join(build, "tests/console");

export const { chromium } = createRequire(join(build, "tests/npm/"))("playwright-core");

export function makeFolder() {
	folders.push(mkdtempSync(join(tmpdir(), "droptower-browser-")));
	return folders.at(-1);
}

// A child whose words on stdout and stderr are kept in said.
export function start(program, args) {
	const child = spawn(program, args, { stdio: ["ignore", "pipe", "pipe"] });
	child.said = "";
	child.over = new Promise((settle) => child.once("close", (code, signal) => {
		running.delete(child);
		settle(signal ?? code);
	}));
	for (const stream of [child.stdout, child.stderr])
		stream.setEncoding("utf8").on("data", (text) => { child.said += text; });
	child.once("error", (error) => { child.said += error.message; });
	running.add(child);
	return child;
}

// Waits until the child has said what fits the pattern.
async function said(child, pattern) {
	for (const end = Date.now() + HANG_MS; Date.now() < end;) {
		const match = child.said.match(pattern);
		if (match)
			return match;
		if (!running.has(child))
			break;
		await new Promise((settle) => setTimeout(settle, 20));
	}
	throw new Error(`${child.spawnfile}: expected ${pattern}, said: ${child.said}`);
}

// A console, once it says its address.
export async function serve(program, args) {
	const child = start(program, args);
	const [address] = await said(child, /http:\/\/\S+#token=\S+/);
	return { child, address };
}

// Ends it in order; returns its exit status, or the signal that was needed or killed it.
export async function stop(child, signal = "SIGTERM") {
	const late = setTimeout(() => child.kill("SIGKILL"), HANG_MS);
	child.kill(signal);
	const status = await child.over;
	clearTimeout(late);
	return status;
}

// What a chain of tests leaves, as far as it was begun.
export async function stopAll(browser, ...children) {
	await browser?.close();
	for (const child of children)
		if (child)
			await stop(child);
}

export async function droptower(...args) {
	return (await promisify(execFile)(join(build, "droptower"), args, { maxBuffer: 1 << 26 })).stdout;
}

function cleanUp() {
	for (const child of running)
		child.kill("SIGKILL");
	for (const folder of folders)
		rmSync(folder, { recursive: true, force: true });
}

process.on("exit", cleanUp);
for (const signal of ["SIGINT", "SIGTERM", "SIGHUP"])
	process.on(signal, () => process.exit(1));
