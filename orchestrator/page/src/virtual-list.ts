import { element, isTouch } from "./dom.ts";

/** Least height of a row that a finger presses (px). */
const TOUCH_ROW = 40;

/** A list of rows of equal height, of which only those in sight are in the document. */
export class VirtualList<Item> {
  readonly root: HTMLElement;
  private readonly inner: HTMLElement;
  private readonly rowHeight: number;
  private items: readonly Item[] = [];
  private first = -1;
  private last = -1;

  constructor(
    label: string,
    rowHeight: number,
    private readonly row: (item: Item, index: number) => HTMLElement,
  ) {
    this.rowHeight = isTouch() ? Math.max(TOUCH_ROW, rowHeight) : rowHeight;
    this.inner = element("div", { class: "rows", role: "list" });
    this.root = element("div", { class: "virtual", "aria-label": label, tabindex: 0, onscroll: () => this.render() }, this.inner);
    new ResizeObserver(() => this.render()).observe(this.root);
  }

  /** How many items there are, in sight or not. */
  get length(): number {
    return this.items.length;
  }

  show(items: readonly Item[]): void {
    this.items = items;
    this.first = -1;
    this.inner.style.height = `${items.length * this.rowHeight}px`;
    this.render();
  }

  /** Draws the rows in sight again, since what they show has changed. */
  refresh(): void {
    this.first = -1;
    this.render();
  }

  /** Scrolls an item into sight. */
  reveal(index: number): void {
    const top = index * this.rowHeight;
    const { scrollTop, clientHeight } = this.root;
    if (top < scrollTop || top + this.rowHeight > scrollTop + clientHeight) this.root.scrollTop = Math.max(0, top - clientHeight / 2);
  }

  private render(): void {
    const { scrollTop, clientHeight } = this.root;
    const first = Math.max(0, Math.floor(scrollTop / this.rowHeight) - 4);
    const last = Math.min(this.items.length, Math.ceil((scrollTop + clientHeight) / this.rowHeight) + 4);
    if (first === this.first && last === this.last) return;
    this.first = first;
    this.last = last;
    const rows: HTMLElement[] = [];
    for (let i = first; i < last; i++) {
      const made = this.row(this.items[i], i);
      made.style.top = `${i * this.rowHeight}px`;
      made.style.height = `${this.rowHeight}px`;
      rows.push(made);
    }
    this.inner.replaceChildren(...rows);
  }
}
