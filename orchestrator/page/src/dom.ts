type Attributes = Record<string, string | number | boolean | ((event: Event) => void)>;

/** Creates an element. Attributes that start with "on" are listeners; `true` sets an attribute without a value, `false` leaves it out. */
export function element<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  attributes: Attributes = {},
  ...children: (Node | string)[]
): HTMLElementTagNameMap[K] {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") made.addEventListener(name.slice(2), value);
    else if (value === true) made.setAttribute(name, "");
    else if (value !== false) made.setAttribute(name, String(value));
  }
  made.append(...children);
  return made;
}

/** A drop-down list with a label. */
export function selection(
  label: string,
  options: readonly (readonly [value: string, text: string])[],
  value: string,
  changed: (value: string) => void,
): { root: HTMLLabelElement; select: HTMLSelectElement } {
  const select = element("select", { onchange: () => changed(select.value) });
  for (const [option, text] of options) select.append(element("option", { value: option }, text));
  select.value = value;
  return { root: element("label", { class: "field" }, element("span", {}, label), select), select };
}

/** A check box with a label. */
export function checkbox(label: string, title: string, changed: (checked: boolean) => void): { root: HTMLLabelElement; input: HTMLInputElement } {
  const input = element("input", { type: "checkbox", onchange: () => changed(input.checked) });
  return { root: element("label", { class: "check", title }, input, label), input };
}

/** Sets text only if it differs, since writing it costs a layout. */
export function setText(target: Element, text: string): void {
  if (target.textContent !== text) target.textContent = text;
}

/** Whether buttons must be large enough for fingers: as in style.css. */
export function isTouch(): boolean {
  return window.matchMedia("(pointer: coarse), (max-width: 600px)").matches;
}
