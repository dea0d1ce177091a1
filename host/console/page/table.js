/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Drops in a table, with what can be decided and noted of each. */
import { post } from "./api.js";
import { COLUMNS } from "./columns.js";
import { attempt, button, el, table } from "./dom.js";
import { holding } from "./hold.js";
import { decimalsOf, number, plain, time } from "./words.js";

export const REASONS = [
	"hit the wrong corner",
	"turned in the air",
	"cable loose",
	"product damaged",
	"wrong set-up",
];

const nameOf = (drop) => `${drop.series}/${drop.number}`;

export const decide = (drop, decision, reason = "") =>
	holding(() => post("/api/decide", { drop, decision, reason }));

export const note = (drop, text) => holding(() => post("/api/note", { drop, text }));

/* Buttons that fill in a frequent reason: typing with gloves is no fun. */
export function reasonButtons(input) {
	const fill = (text) => {
		input.value = text;
		input.focus();
	};
	return REASONS.map((text) => button(text, () => fill(text), { class: "small" }));
}

/* A row below the drop's that asks for one line of text. The table is not drawn anew meanwhile: "written" tells when
 * it may be. */
function ask(row, question, reasons, first, go) {
	const rules = { maxlength: 200, required: true, autocomplete: "off" };
	const input = el("input", { ...rules, "aria-label": question, value: first });
	const close = () => {
		form.closest("tr").remove();
		document.dispatchEvent(new Event("written"));
	};
	const submit = async (event) => {
		event.preventDefault();
		if (await attempt(() => go(input.value.trim()))) close();
	};
	const form = el("form", { on: { submit } }, el("span", {}, question));
	form.append(...(reasons ? reasonButtons(input) : []), input);
	form.append(el("button", { class: "primary", "data-command": true }, "OK"), button("Back", close));
	row.nextElementSibling?.querySelector("form")?.closest("tr").remove();
	row.after(el("tr", { class: "ask" }, el("td", { colspan: 99 }, form)));
	input.focus();
}

function buttons(drop) {
	const name = nameOf(drop);
	const act = (kind, text, f) =>
		button(text, (event) => f(event.target.closest("tr")), {
			class: `small ${kind}`,
			"data-command": true,
			"aria-label": `${text} ${name}`,
		});
	const write = (row) => ask(row, `Note on ${name}`, false, drop.note, (text) => note(name, text));
	const refuse = (row) =>
		ask(row, `Why is ${name} rejected?`, true, "", (text) => decide(name, "rejected", text));
	const all = [act("note", "Note", write)];
	const faulty = Boolean(drop.fault);
	if (drop.state !== "recorded" && !faulty) return all;
	if (drop.decision !== "accepted" && !faulty)
		all.push(act("accept", "Accept", () => attempt(() => decide(name, "accepted"))));
	if (drop.decision !== "rejected") all.push(act("reject", "Reject…", refuse));
	return all;
}

function decisionCell(drop) {
	const partial = drop.state !== "recorded";
	const text = partial ? drop.state : drop.decision === "open" ? "undecided" : drop.decision;
	const sign = partial ? { recording: "… " }[drop.state] ?? "⚠ " : { accepted: "✓ ", rejected: "✗ ", open: "? " }[drop.decision];
	const cell = el("td", { class: "decision", "data-label": "decision" }, el("b", {}, sign + text));
	for (const line of [drop.fault, drop.simulated && "simulated tower", drop.reason, drop.note && `“${drop.note}”`])
		if (line) cell.append(el("div", { class: "soft" }, line));
	return cell;
}

const unitHead = (column) => (column.shown ? `${column.head} ${column.shown}` : column.head);

const scaled = (value, column, decimals = column.decimals) =>
	number(value == null ? NaN : value * column.scale, decimals);

function numberCell(column, value, text) {
	const data = { key: column.mean, value: value ?? "" };
	return el("td", { class: "number", "data-label": unitHead(column), data }, text);
}

function valueCell(drop, column) {
	const value = drop[column.key];
	const bad = drop.not_ok?.includes(column.mean);
	const cell = numberCell(column, value, scaled(value, column) + (bad ? "*" : ""));
	if (bad) cell.title = "its status is not ok: look at the flags";
	return cell;
}

function numberOrChoice(drop, { choose, chosen }) {
	const name = nameOf(drop);
	if (!choose) return String(drop.number);
	const change = (event) => choose(name, event.target.checked);
	const box = el("input", { type: "checkbox", "aria-label": `choose ${name}`, on: { change } });
	box.checked = chosen.has(name);
	return el("label", {}, box, ` ${drop.number}`);
}

function dropRow(drop, options) {
	const name = nameOf(drop);
	const when = time(drop.time);
	const link = { class: "link", "aria-label": `${when}: show ${name}` };
	const flags = drop.flags ? drop.flags.split(" ").map(plain).join(", ") : "–";
	return el(
		"tr",
		{ data: { drop: name, decision: drop.decision, state: drop.state } },
		el("th", { scope: "row", "data-label": "drop" }, numberOrChoice(drop, options)),
		el(
			"td",
			{ "data-label": "time" },
			button(when, () => options.open(name), link),
		),
		...COLUMNS.map((column) => valueCell(drop, column)),
		el("td", { "data-label": "flags", class: "flags" }, flags),
		decisionCell(drop),
		el("td", { class: "actions" }, ...buttons(drop)),
	);
}

function meanRow(kind, head, means) {
	const cell = (column) => {
		const mean = means[column.mean];
		if (kind === "n") return numberCell(column, mean?.n, number(mean?.n, 0));
		const value = mean?.[`${kind}_${column.unit}`];
		const places = decimalsOf(mean?.[`sd_${column.unit}`] * column.scale, column.decimals);
		return numberCell(column, value, scaled(value, column, places));
	};
	const cells = [el("th", { scope: "row", colspan: 2 }, head), ...COLUMNS.map(cell)];
	return el("tr", { data: { row: kind } }, ...cells, el("td", { colspan: 3, class: "pad" }));
}

/* answer: of /api/drops. options: {open(name), choose(name, on), chosen: Set}. */
export function dropTable(answer, options) {
	const columns = COLUMNS.map((column) => [column.head, el("small", {}, column.shown)]);
	const head = ["drop", "time", ...columns, "flags", "decision", "what to do"];
	const drops = table(
		head,
		answer.drops.map((drop) => dropRow(drop, options)),
	);
	const rows = [
		["mean", "mean of accepted"],
		["sd", "SD"],
		["n", "n"],
	];
	if (answer.means?.drops)
		drops.append(el("tfoot", {}, ...rows.map(([kind, text]) => meanRow(kind, text, answer.means))));
	return drops;
}

/* A table in which somebody writes is left alone. */
export const isBusy = (host) => host.querySelector("form") !== null;
