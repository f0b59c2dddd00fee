// SVG that stands alone: what the style sheet says of each element is written to the element, so
// that any program shows it as the page does.

const DEFAULTS = {
  "fill": "rgb(0, 0, 0)", "stroke": "none", "stroke-width": "1px", "stroke-dasharray": "none", "stroke-linejoin": "miter",
  "opacity": "1", "paint-order": "normal",
};
const TEXT = { "font-size": "", "font-weight": "400", "font-style": "normal", "font-family": "" };
const DRAWN = ["rect", "line", "polyline", "polygon", "path", "circle"];
const COLOURS = ["fill", "stroke"];

// Changes the element, which must be part of the page, and all within.
export function inlineStyles(svg) {
  for (const element of [svg, ...svg.querySelectorAll("*")]) {
    if (element.localName === "text") write(element, { ...DEFAULTS, ...TEXT });
    else if (element.localName === "tspan") write(element, inherited(element.parentElement));
    else if (DRAWN.includes(element.localName)) write(element, DEFAULTS);
  }
  for (const element of [svg, ...svg.querySelectorAll("*")]) {
    element.removeAttribute("class");
    element.removeAttribute("style");
  }
}

function inherited(text) {
  const style = getComputedStyle(text);
  return Object.fromEntries(["fill", "font-weight"].map((name) => [name, style.getPropertyValue(name)]));
}

function write(element, wanted) {
  const style = getComputedStyle(element);
  const drawn = style.stroke !== "none";
  for (const [name, standard] of Object.entries(wanted)) {
    const value = style.getPropertyValue(name);
    if (value === standard || value === "" || (!drawn && name.startsWith("stroke-"))) continue;
    if (!COLOURS.includes(name)) element.setAttribute(name, value);
    else {
      const [colour, opacity] = resolveColour(value);
      element.setAttribute(name, colour);
      if (opacity < 1) element.setAttribute(`${name}-opacity`, String(+opacity.toFixed(3)));
    }
  }
}

const known = new Map();
let pixel = null;

// Any colour of CSS as #rrggbb and its opacity.
function resolveColour(text) {
  if (text === "none") return ["none", 1];
  if (!known.has(text)) {
    pixel ??= new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true });
    pixel.clearRect(0, 0, 1, 1);
    pixel.fillStyle = text;
    pixel.fillRect(0, 0, 1, 1);
    const [r, g, b, a] = pixel.getImageData(0, 0, 1, 1).data;
    known.set(text, [`#${[r, g, b].map((v) => v.toString(16).padStart(2, "0")).join("")}`, a / 255]);
  }
  return known.get(text);
}

// The text of a file.
export function serialise(svg) {
  return `<?xml version="1.0" encoding="UTF-8"?>\n${new XMLSerializer().serializeToString(svg)}`;
}
