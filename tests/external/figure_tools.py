"""The tools of a report's figures, as a reader uses them: expressions for `browser.visit` that click, point and turn the wheel."""

import csv
import io
import json

# Keeps what is saved, and says where a place of a picture (pixels of its view box) is on the screen.
PREPARE = """(() => {
  window.saved = []; window.savedNames = [];
  const create = URL.createObjectURL.bind(URL);
  URL.createObjectURL = (blob) => { saved.push(blob); return create(blob); };
  HTMLAnchorElement.prototype.click = function () { savedNames.push(this.download); };
  window.pause = (ms) => new Promise((then) => setTimeout(then, ms));
  window.figureOf = (id) => document.querySelector(`svg[aria-labelledby^="${id}-title"]`).closest('figure');
  window.pictureOf = (id) => document.querySelector(`svg[aria-labelledby^="${id}-title"]`);
  window.press = async (id, text) => {
    const n = saved.length;
    [...figureOf(id).querySelectorAll('.tools button')].find(b => b.textContent === text).click();
    for (let k = 0; k < 100 && saved.length === n; k += 1) await pause(20);
    return saved.at(-1).text();
  };
  window.fire = (id, type, [x, y], how = {}) => {
    const svg = pictureOf(id), frame = svg.getBoundingClientRect(), scale = frame.width / svg.viewBox.baseVal.width;
    const at = { clientX: frame.left + x * scale, clientY: frame.top + y * scale, bubbles: true, cancelable: true };
    const kind = type === 'wheel' ? WheelEvent : type === 'dblclick' ? MouseEvent : PointerEvent;
    svg.dispatchEvent(new kind(type, { ...at, pointerType: 'mouse', pointerId: 1, ...how }));
  };
  window.key = (id, name) => pictureOf(id).dispatchEvent(new KeyboardEvent('keydown', { key: name, bubbles: true, cancelable: true }));
  window.shown = (id) => figureOf(id).querySelector('.values')?.innerText ?? null;
  window.centre = (mark) => [Number(mark.getAttribute('cx')), Number(mark.getAttribute('cy'))];
  return true;
})()"""

# Of every figure with a chart: its buttons, and entries of its legend that are no switches.
BUTTONS = """[...document.querySelectorAll('figure:has(svg[role=img])')].map(figure => ({
  buttons: [...figure.querySelectorAll('figcaption > .tools button:not([hidden])')].map(b => b.textContent),
  dead_keys: [...figure.querySelectorAll('.key > li')].filter(li => !li.querySelector(':scope > button[aria-pressed=true]')).length,
  words: figure.querySelector('figcaption').innerText,
}))"""


def saved(figure, what):
    """What a button of a figure saves. `figure`: the identifier of one of its pictures."""
    return f"press({json.dumps(figure)}, {json.dumps(what)})"


def rows_of(text):
    """The rows of a saved table, by the names of the header. Lines end as RFC 4180 says."""
    assert text.endswith("\r\n") and "\n" not in text.replace("\r\n", "")
    return list(csv.DictReader(io.StringIO(text, newline="")))
