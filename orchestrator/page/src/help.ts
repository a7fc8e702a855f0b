import { element } from "./dom.ts";

const KEYS: [string, string][] = [
  ["Space", "play or pause"],
  ["← →", "one step back or forward"],
  ["Shift + ← →", "previous or next event"],
  [", .", "one TSCH slot back or forward"],
  ["[ ]", "previous or next hop of the followed packet"],
  ["Home, End", "beginning or end of the run"],
  ["+ −", "zoom"],
  ["F", "fit everything into the view"],
  ["O", "follow the selected robot"],
  ["Esc", "show all measured rows; follow no packet; select nothing"],
  ["1 2 3 …", "the views at the top, in their order"],
  ["/", "find a robot or an event"],
  ["L", "go to the latest step of a running simulation"],
  ["?", "this list"],
];

/** The dialog that lists the keys. */
export function helpDialog(): HTMLDialogElement {
  const table = element("table", {});
  for (const [key, meaning] of KEYS) table.append(element("tr", {}, element("td", {}, element("kbd", {}, key)), element("td", {}, meaning)));
  const dialog: HTMLDialogElement = element("dialog", { "aria-label": "Keys" },
    element("h2", {}, "Keys"), table,
    element("p", { class: "note" }, "Drag to move the picture, turn the wheel to zoom, click a robot to select it. The address of the page captures what you see."),
    element("button", { type: "button", onclick: () => dialog.close() }, "Close"));
  return dialog;
}
