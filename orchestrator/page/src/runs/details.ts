import { element } from "../dom.ts";
import { figure } from "../format.ts";
import type { Calls, Row } from "./calls.ts";
import { countText, firstText } from "./columns.ts";

/** Copies a text; if the browser refuses, the text stays selected for the keyboard. */
async function copy(text: string, from: HTMLElement, button: HTMLButtonElement): Promise<void> {
  try {
    await navigator.clipboard.writeText(text);
    button.textContent = "Copied";
  } catch {
    window.getSelection()?.selectAllChildren(from);
  }
}

/** A dialog with all that the table has of a result, which columns cut off. */
export class Details {
  readonly root = element("dialog", { class: "details", "aria-labelledby": "details-name" });

  constructor(private readonly calls: Calls) {
    this.root.addEventListener("click", (event) => {
      if (event.target === this.root) this.root.close();
    });
  }

  show(row: Row): void {
    const close = element("button", { type: "button", class: "close", "aria-label": "Close", onclick: () => this.root.close() }, "×");
    const head = element("div", { class: `details-head status-${row.status}` }, element("h2", { id: "details-name" }, row.name), element("span", { class: "badge" }, row.status), element("span", { class: "spring" }), close);
    const links = element("p", { class: "details-links" });
    if (row.report !== null) links.append(element("a", { href: row.report, target: "_blank", rel: "noopener" }, "Report"));
    if (row.has_recording) links.append(element("a", { href: this.calls.player(row), target: "_blank", rel: "noopener" }, "Play"));
    this.root.replaceChildren(head, element("div", { class: "details-body" }, ...this.words(row), links, ...listOf(factsOf(row)), ...section(row)));
    this.root.showModal();
  }

  private words(row: Row): Node[] {
    const nodes: Node[] = row.words === null ? [] : [element("p", { class: "details-words" }, row.words)];
    if (row.command === null) return nodes;
    const { command } = row;
    const code = element("code", {}, command);
    const button = element("button", { type: "button", onclick: () => void copy(command, code, button) }, "Copy");
    return [...nodes, element("p", { class: "command" }, code, button)];
  }
}

function factsOf(row: Row): [string, string][] {
  const facts: [string, string][] = [["kind", row.kind], ["path", row.path]];
  if (row.when_unix_s !== null) facts.push([row.status === "running" ? "since" : "when", new Date(row.when_unix_s * 1000).toLocaleString()]);
  if (row.progress !== null) facts.push(["progress", countText(row)]);
  if (row.simulated_s !== null) facts.push(["simulated time", `${figure(row.simulated_s)} s`]);
  if (row.seed !== null) facts.push(["seed", String(row.seed)]);
  if (row.first !== null) facts.push([row.first.words, firstText(row.first)]);
  if (row.n_warnings > 0) facts.push(["warnings", String(row.n_warnings)]);
  return facts;
}

function listOf(facts: [string, string][]): Node[] {
  return facts.length === 0 ? [] : [element("dl", {}, ...facts.flatMap(([name, value]) => [element("dt", {}, name), element("dd", {}, value)]))];
}

/** What is in the result: scores of an answer, medians of a sweep; and the keys that differ. */
function section(row: Row): Node[] {
  const settings = Object.entries(row.settings).map(([key, value]): [string, string] => [key, typeof value === "number" ? figure(value) : String(value)]);
  const nodes: Node[] = [];
  if (row.details.length > 0) nodes.push(element("h3", {}, row.spark_words ?? "Scores"), ...listOf(row.details));
  if (settings.length > 0) nodes.push(element("h3", {}, "Configuration: keys that differ between runs"), ...listOf(settings));
  return nodes;
}
