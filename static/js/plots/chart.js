// A small chart in SVG with round ticks, for curves and bars that change a few times a second.
// Its colours come from the style sheet, so that a change of theme needs no redrawing.

const SVG = "http://www.w3.org/2000/svg";

export class Chart {
  constructor(body, draw) {
    this.body = body;
    this.svg = svg("svg", { class: "chart", "aria-hidden": "true" });
    body.append(this.svg);
    new ResizeObserver(draw).observe(body);
  }

  // Clears, and draws axes for the ranges; `xNames` are those of the ticks 1, 2, 3. `square` gives both axes the same scale. On a
  // logarithmic axis the range is of logarithms to the base 10, as are all places drawn.
  begin([x0, x1], [y0, y1], { square = false, xTicks = null, xNames = null, xLabel = "", yLabel = "", logX = false, logY = false } = {}) {
    const { clientWidth: width, clientHeight: height } = this.body;
    const em = 0.75 * parseFloat(getComputedStyle(document.documentElement).fontSize);
    // Names that are wider than their bars are slanted.
    const longest = Math.min(12, Math.max(0, ...(xNames ?? []).map((name) => name.length)));
    const slanted = longest * 0.56 * em > (width - 4 * em) / (xTicks?.length || 1);
    const bottom = (slanted ? 1.4 + 0.34 * longest : 2) * em + (xLabel ? 1.4 * em : 0);
    const tall = Math.max(1, height - bottom - 0.7 * em);
    const yTicks = (from, to) => (logY ? decades : ticks)(from, to, tall / (3 * em));
    const yText = logY ? power : label;
    // As wide as the longest number, so that none is cut off: digits are 0.56 em wide or less.
    const digits = Math.max(...yTicks(y0, y1).map((v) => yText(v).length), 3);
    const left = (0.9 + 0.56 * Math.min(digits, 12)) * em + (yLabel ? 1.6 * em : 0);
    this.area = { left, top: 0.7 * em, width: Math.max(1, width - left - em), height: tall };
    if (square) {
      const perPixel = Math.max((x1 - x0) / this.area.width, (y1 - y0) / this.area.height);
      [x0, x1] = about((x0 + x1) / 2, perPixel * this.area.width);
      [y0, y1] = about((y0 + y1) / 2, perPixel * this.area.height);
    }
    this.ranges = [x0, x1, y0, y1];
    this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    this.svg.replaceChildren();
    const { top } = this.area;
    for (const v of yTicks(y0, y1)) {
      this.line([x0, v], [x1, v], v === 0 && !logY ? "zero" : "grid");
      this.text(left - 0.5 * em, this.y(v) + 0.35 * em, yText(v), "end");
    }
    for (const v of xTicks ?? (logX ? decades : ticks)(x0, x1, this.area.width / (6 * em))) {
      if (!xTicks) this.line([v, y0], [v, y1], v === 0 && !logX ? "zero" : "grid");
      const text = xNames?.[v - 1] ?? (logX ? power : label)(v);
      const [x, y] = [this.x(v), top + this.area.height + (slanted ? 1 : 1.5) * em];
      const made = this.text(x, y, text.length > 12 ? `${text.slice(0, 11)}…` : text, slanted ? "end" : "middle");
      if (slanted) made.setAttribute("transform", `rotate(-35 ${x} ${y})`);
    }
    if (xLabel) this.text(left + this.area.width / 2, height - 0.35 * em, xLabel, "middle");
    if (yLabel) {
      const [x, y] = [1.1 * em, top + this.area.height / 2];
      this.text(x, y, yLabel, "middle").setAttribute("transform", `rotate(-90 ${x} ${y})`);
    }
  }

  x(value) {
    return this.area.left + ((value - this.ranges[0]) / (this.ranges[1] - this.ranges[0])) * this.area.width;
  }

  y(value) {
    return this.area.top + (1 - (value - this.ranges[2]) / (this.ranges[3] - this.ranges[2])) * this.area.height;
  }

  line([x0, y0], [x1, y1], className) {
    return this.add("line", { x1: this.x(x0), y1: this.y(y0), x2: this.x(x1), y2: this.y(y1), class: className });
  }

  text(x, y, content, anchor) {
    const made = this.add("text", { x, y, "text-anchor": anchor });
    made.textContent = content;
    return made;
  }

  add(name, attributes) {
    return this.svg.appendChild(svg(name, attributes));
  }
}

// The range of finite values, a little wider, and never empty.
export function around(values, { zero = false } = {}) {
  const finite = values.filter(Number.isFinite);
  let low = Math.min(...finite, ...(zero || !finite.length ? [0] : []));
  let high = Math.max(...finite, ...(zero || !finite.length ? [0] : []));
  // A constant does not fill the frame with its rounding.
  const size = Math.max(Math.abs(low), Math.abs(high));
  if (high - low < 1e-5 * size) [low, high] = [low - 0.5 * size, high + 0.5 * size];
  if (!(high > low)) [low, high] = [low - 1, high + 1];
  const margin = 0.08 * (high - low);
  return [low - margin, high + margin];
}

function about(middle, width) {
  return [middle - width / 2, middle + width / 2];
}

function ticks(low, high, most) {
  const raw = (high - low) / Math.max(1, most);
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw);
  const found = [];
  for (let k = Math.ceil(low / step); k * step <= high; k++) found.push(+(k * step).toPrecision(12));
  return found;
}

// Ticks of a logarithmic axis: whole decades, or 1, 2 and 5 of each, or 1 and 3, where there are few
// decades and the numbers do not touch.
function decades(low, high, most) {
  const stride = Math.max(1, Math.ceil((high - low) / Math.max(1, most)));
  const room = (fewest) => high - low <= 2 && Math.log10(fewest) * most > 0.48 * (high - low);
  const steps = (room(2) ? [1, 2, 5] : room(3) ? [1, 3] : [1]).map(Math.log10);
  const found = [];
  for (let k = Math.floor(low / stride) * stride; k <= high; k += stride) {
    found.push(...steps.map((part) => k + part).filter((v) => v >= low && v <= high));
  }
  return found;
}

// The number whose logarithm this is.
function power(exponent) {
  const value = Number((10 ** exponent).toPrecision(3));
  if (Math.abs(exponent) <= 3) return label(value);
  return "10" + String(Math.round(exponent)).replace(/[-0-9]/g, (c) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(c)]);
}

function label(value) {
  const size = Math.abs(value);
  const text = size >= 1e5 || (size > 0 && size < 1e-4) ? value.toExponential(0) : String(value);
  return text.replace("-", "−");
}

function svg(name, attributes) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
}
