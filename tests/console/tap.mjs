// SPDX-License-Identifier: GPL-3.0-or-later
//
// Results as TAP. A chain is steps that build on each other: after one that fails the rest of its chain counts
// as failed and is not tried, unless the chain says that its steps stand for themselves.

let count = 0;
let failed = 0;

export function note(text) {
	for (const line of String(text).split("\n"))
		console.log(`# ${line}`);
}

function tell(good, title) {
	count++;
	failed += good ? 0 : 1;
	console.log(`${good ? "ok" : "not ok"} ${count} - ${title}`);
}

// chains: [{name, steps: [[title, function], ...], apart, onFailure, end}]. Returns the exit status.
export async function run(chains) {
	console.log(`1..${chains.reduce((sum, chain) => sum + chain.steps.length, 0)}`);
	for (const chain of chains) {
		let why = "";
		for (const [title, step] of chain.steps) {
			const begin = Date.now();
			try {
				if (why)
					throw new Error(why);
				await step();
				tell(true, `${chain.name}: ${title}`);
			} catch (error) {
				tell(false, `${chain.name}: ${title}`);
				note(why ? why : error.stack);
				if (!why)
					await chain.onFailure?.();
				why = chain.apart ? "" : "not reached";
			}
			if (process.env.V)
				note(`${((Date.now() - begin) / 1000).toFixed(1)} s`);
		}
		await chain.end?.();
	}
	return failed ? 1 : 0;
}
