/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Which step of a drop it is. Follows from what the tower is and what the operator has left open; the page never goes
 * on by itself. */

export const MOVING = new Set(["FALLING", "SEPARATED", "BRAKED", "FAULT_MOVING", "KEEP_OUT"]);
const FETCHING = new Set(["CAPTURED", "UPLOADED"]);

/* A drop that the tower still holds and nobody is fetching: it is, once the series that it belongs to is selected. */
const isOrphan = (tower) => tower.state === "CAPTURED" && tower.phase === "idle";

/* tower, series: of the last state event. pending: the drop to be decided, or "". setupOpen: the operator asked for it. */
export function stepOf({ tower, series, pending, setupOpen }) {
	if (tower.state === "FAULT_HELD") return "fault";
	if (isOrphan(tower) && !series) return "setup";
	if (MOVING.has(tower.state) || tower.phase === "moving") return "moving";
	if (FETCHING.has(tower.state) || tower.phase === "collecting" || tower.phase === "saving") return "wait";
	if (tower.state === "ARMED" || tower.phase === "arming" || tower.phase === "armed") return "release";
	if (setupOpen || !series) return "setup";
	if (pending) return "decide";
	return tower.state === "READY" ? "arm" : "checks";
}

const ORDER = ["setup", "checks", "arm", "release", "moving", "wait", "decide"];

/* The step's place in the row that is always shown. */
export function placeOf(step) {
	return ORDER.indexOf(step === "fault" ? "checks" : step);
}

/* At rest nothing is under way that another series would disturb. */
export const atRest = (tower) =>
	!MOVING.has(tower.state) &&
	(!FETCHING.has(tower.state) || isOrphan(tower)) &&
	tower.state !== "ARMED" &&
	tower.phase === "idle";
