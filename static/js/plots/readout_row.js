// The slim row of numbers and of the solver's sentence. What does not fit into it is behind a button,
// which says how many numbers there are, and unfolds the row over the plots.

export class ReadoutRow {
  constructor() {
    this.row = document.querySelector(".numbers .all");
    [this.tiles, this.more, this.says] = ["tiles", "more-numbers", "solver-says"].map((id) => document.getElementById(id));
    this.more.addEventListener("click", () => this.unfold(!this.open));
    this.says?.addEventListener("click", () => this.more.hidden || this.unfold(!this.open));
    this.tiles.addEventListener("scroll", () => this.measure());
    document.addEventListener("keydown", (event) => event.key === "Escape" && this.unfold(false));
    document.addEventListener("pointerdown", ({ target }) => this.row.contains(target) || this.unfold(false));
    const watcher = new ResizeObserver(() => this.measure());
    for (const part of [this.row, this.tiles, ...this.tiles.children]) watcher.observe(part);
    if (this.says) new MutationObserver(() => this.measure()).observe(this.says, { childList: true });
  }

  get open() {
    return this.row.classList.contains("open");
  }

  unfold(yes) {
    if (yes === this.open) return;
    this.row.classList.toggle("open", yes);
    this.measure();
  }

  measure() {
    if (!this.open) {
      const { left, right } = this.tiles.getBoundingClientRect();
      const boxes = [...this.tiles.children].map((tile) => tile.getBoundingClientRect());
      this.beyond = boxes.filter((box) => box.width && (box.left < left - 1 || box.right > right + 1)).length;
      this.tiles.classList.toggle("to-right", boxes.some((box) => box.right > right + 1));
      this.tiles.classList.toggle("to-left", boxes.some((box) => box.width && box.left < left - 1));
      this.more.hidden = !this.beyond && !isTruncated(this.says);
    }
    this.more.textContent = this.open ? "×" : this.beyond ? `+${this.beyond}` : "…";
    const numbers = this.beyond ? `${this.beyond} more numbers` : "The whole sentence";
    this.more.setAttribute("aria-label", this.open ? "Fold the numbers" : numbers);
    this.more.title = this.more.getAttribute("aria-label");
    this.more.setAttribute("aria-expanded", String(this.open));
  }
}

function isTruncated(element) {
  return Boolean(element) && element.scrollWidth > element.clientWidth + 1;
}
