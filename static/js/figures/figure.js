// Plots as one picture in vectors, on white: each with its title, unit and legend, beneath them the
// lab, its parameters, the seed and the time. It is drawn out of sight, at a size of its own.

import { shortNumber } from "../format.js";
import { acts } from "../knob_column.js";
import { unitUnder } from "../knob_row.js";
import { element } from "../plots/card.js";
import { Chart, svg } from "../plots/chart.js";
import { symbol } from "../plots/symbol.js";
import { layoutEntries, legendEntry, textPiece } from "./flow.js";
import { inlineStyles } from "./svg_styles.js";
import { mathPieces } from "./text_layout.js";

const MARGIN = 18;
const GAP = 20;
const SIZES = [[760, 340], [560, 250]]; // [px] of a plot without its title, in one column or two
const MAX_TEXT_LENGTH = 40; // letters of a text in the caption

// `about` is {lab, params, seed, t, iteration, link}. The element is a picture of its own.
export function renderFigure(plots, about, columns = Math.min(2, plots.length)) {
  const host = document.body.appendChild(element("div", "figure-host"));
  try {
    const [width, height] = SIZES[columns - 1];
    const whole = 2 * MARGIN + columns * width + (columns - 1) * GAP;
    const root = host.appendChild(svg("svg", { xmlns: "http://www.w3.org/2000/svg", class: "figure" }));
    root.append(svg("rect", { class: "paper", width: whole, height: 1 }));
    const ends = Array(columns).fill(MARGIN); // of the columns so far: the next plot goes where most room is
    for (const plot of plots) {
      const k = ends.indexOf(Math.min(...ends));
      ends[k] += drawPlot(root, host, plot, [MARGIN + k * (width + GAP), ends[k]], [width, height]) + GAP;
    }
    let top = Math.max(...ends);
    top += drawCaption(root, about, [MARGIN, top - 0.5 * GAP], whole - 2 * MARGIN) - 0.5 * GAP + MARGIN;
    const title = svg("title", {});
    title.textContent = [about.lab.title, ...plots.map(({ plot }) => plot.title)].join(": ");
    const link = svg("desc", {});
    link.textContent = about.link;
    root.prepend(title, link);
    root.querySelector(".paper").setAttribute("height", top);
    for (const [name, value] of Object.entries({ width: whole, height: top, viewBox: `0 0 ${whole} ${top}` })) root.setAttribute(name, value);
    inlineStyles(root);
    return root;
  } finally {
    host.remove();
  }
}

// One plot with its title and legend; tells how high it is.
function drawPlot(root, host, plot, [x, y], [width, standard]) {
  const height = plot.figureHeight?.(width) ?? standard;
  const body = host.appendChild(element("div"));
  Object.assign(body.style, { width: `${width}px`, height: `${height}px` });
  const chart = new Chart(body);
  plot.paint(chart);
  const heading = svg("text", { x, y: y + 12, class: "heading" });
  heading.textContent = plot.plot.title;
  const unit = plot.section.querySelector("h3 small").textContent;
  const small = svg("tspan", { class: "unit" });
  small.textContent = unit;
  if (unit) heading.append(small);
  root.append(heading);
  const indent = heading.getComputedTextLength() + 24;
  const used = layoutEntries(root, legendEntries(plot), [x, y], width, { indent, size: 12, right: true });
  const inner = svg("g", { class: "chart", transform: `translate(${x} ${y + used + 6})` });
  inner.append(...chart.svg.childNodes);
  root.append(inner);
  return used + 6 + height;
}

// What the legend shows: each a swatch, if it has one, and words.
function legendEntries({ legend }) {
  const said = [...legend.children].filter((one) => one.getAttribute("aria-pressed") !== "false");
  return said.map((one) => {
    if (one.localName === "math") return legendEntry(mathPieces(one));
    const nodes = [...one.childNodes].filter((node) => !["svg", "output"].includes(node.localName));
    const pieces = nodes.flatMap((node) => (node.localName === "math" ? mathPieces(node) : [textPiece(` ${node.textContent}`)]));
    if (pieces[0]?.plain) pieces[0].text = pieces[0].text.trimStart();
    return legendEntry(pieces, one.querySelector("svg"));
  });
}

// The lab, what its parameters are, and when; tells how high that is.
function drawCaption(root, { lab, params, seed, t, iteration }, [x, y], width) {
  const where = [`${lab.title}, notes ${lab.section}`, lab.has_world ? `t = ${+t.toFixed(4)} s` : "", iteration ? `iteration ${iteration}` : "", `seed ${seed}`, `orclab ${lab.version}`];
  const set = lab.params.filter((tunable) => tunable.name in params && acts(tunable, params));
  const values = set.map((tunable) => {
    const name = tunable.mathml ? mathPieces(symbol(tunable.mathml)) : [textPiece(tunable.label || tunable.name)];
    const value = params[tunable.name];
    const unit = tunable.kind === "knob" ? unitUnder(tunable, params) : "";
    const text = ` = ${valueText(tunable, value)} ${unit}`.trimEnd();
    return legendEntry([...name, textPiece(text)], null, value === tunable.default ? "muted" : "");
  });
  const first = layoutEntries(root, where.filter(Boolean).map((text) => legendEntry([textPiece(text)])), [x, y], width, { size: 11 });
  return first + layoutEntries(root, values, [x, y + first], width, { size: 11 });
}

function valueText({ kind, options }, value) {
  if (kind === "knob") return shortNumber(value);
  if (kind === "choice") return options.find((option) => option.value === value)?.label ?? value;
  if (kind === "toggle") return value ? "on" : "off";
  const text = value.replaceAll("\n", " / ");
  return `“${text.length > MAX_TEXT_LENGTH ? `${text.slice(0, MAX_TEXT_LENGTH)}…` : text}”`;
}
