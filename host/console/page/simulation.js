/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Faults of a simulated tower. With a real one there is no such panel. */
import { post } from "./api.js";
import { attempt, byId, el, setData, show } from "./dom.js";
import { FAULTS, plain } from "./words.js";

const send = (line) => attempt(() => post("/api/simulate", { line }));

function toggle({ name, on }) {
	return el(
		"button",
		{
			type: "button",
			"aria-pressed": String(on),
			data: { fault: name, on: on ? "yes" : "no" },
			on: {
				click: ({ currentTarget }) =>
					send(`${currentTarget.dataset.on === "yes" ? "repair" : "fault"} ${name}`),
			},
		},
		FAULTS[name] ?? plain(name),
	);
}

export function showSimulation(simulation, connected) {
	show(byId("simulation"), simulation !== null);
	if (!simulation) return;
	const host = byId("sim-faults");
	const names = simulation.faults.map(({ name }) => name).join();
	if (host.dataset.names !== names) {
		host.dataset.names = names;
		host.replaceChildren(...simulation.faults.map(toggle));
	}
	simulation.faults.forEach(({ on }, i) => {
		setData(host.children[i], "on", on ? "yes" : "no");
		host.children[i].setAttribute("aria-pressed", String(on));
	});
	for (const button of byId("simulation").querySelectorAll("button")) button.disabled = !connected;
}

export function listen() {
	byId("sim-burst").addEventListener("click", () => send("bus burst 12"));
	byId("sim-silent").addEventListener("click", () => send("bus silent 0.5"));
}
