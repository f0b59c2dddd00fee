// Words and swatches one after the other, in as many lines as they need.

import { svg } from "../plots/chart.js";

const SPACE = 14; // [px] between entries
const MATH = "'Times New Roman', Times, serif"; // not the page's: a picture has none but the system's

// A piece of an entry in words; those of a formula are {text, italic, level}.
export function textPiece(text) {
  return { text, plain: true };
}

export function legendEntry(pieces, swatch = null, tone = "") {
  return { pieces, swatch, tone };
}

// Draws the entries from a place on, the first line after an indent; `right` sets them flush right.
// Tells how high they are.
export function layoutEntries(root, entries, [x, y], width, { size, indent = 0, right = false }) {
  const line = Math.round(1.5 * size);
  const made = entries.map((one) => draw(root, one, size));
  let row = [];
  let at = indent;
  let top = y;
  const place = () => {
    const all = row.reduce((sum, { wide }) => sum + wide + SPACE, -SPACE);
    let left = right ? x + Math.max(top === y ? indent : 0, width - all) : x + (top === y ? indent : 0);
    for (const { group, wide } of row) {
      group.setAttribute("transform", `translate(${left.toFixed(2)} ${(top + 0.92 * size).toFixed(2)})`);
      left += wide + SPACE;
    }
  };
  for (const one of made) {
    if (at + one.wide > width && (row.length || at > 0)) {
      place();
      [row, at, top] = [[], 0, top + line];
    }
    row.push(one);
    at += one.wide + SPACE;
  }
  place();
  return top - y + line;
}

function draw(root, { pieces, swatch, tone }, size) {
  const group = root.appendChild(svg("g", {}));
  const text = svg("text", { class: `entry ${tone}` });
  text.style.fontSize = `${size}px`;
  let wide = 0;
  if (swatch) {
    const mark = svg("g", { class: "swatch", transform: `translate(10 ${-0.35 * size})`, style: swatch.getAttribute("style") });
    mark.append(...[...swatch.childNodes].map((node) => node.cloneNode(true)));
    group.append(mark);
    wide = 26;
    text.setAttribute("x", wide);
  }
  let level = 0;
  for (const piece of pieces) {
    const span = svg("tspan", {});
    span.textContent = piece.text;
    const raised = piece.level ?? 0;
    if (raised !== level) span.setAttribute("dy", `${(0.3 * size * (level - raised)).toFixed(2)}`);
    level = raised;
    if (raised) span.setAttribute("font-size", (0.72 * size).toFixed(1));
    if (!piece.plain) {
      span.setAttribute("font-family", MATH);
      if (!raised) span.setAttribute("font-size", (1.08 * size).toFixed(1));
    }
    if (piece.italic) span.setAttribute("font-style", "italic");
    text.append(span);
  }
  group.append(text);
  return { group, wide: wide + text.getComputedTextLength() };
}
