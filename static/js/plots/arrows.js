// The arrows over a map, such as a policy: white with a dark rim, so that they stand out on every
// colour. Each is as long as its neighbours leave room for; what leads nowhere is a dot.

const HEAD = "M0 0L-6-3.2L-4.6 0L-6 3.2z"; // its tip at the origin, to the right
const DOT = "M-2 0a2 2 0 1 0 4 0a2 2 0 1 0-4 0z";

// `arrows` are [x, y, right, up] on the axes, the way on the screen.
export function paintArrows(chart, arrows) {
  if (!arrows.length) return;
  const step = (values, at) => spacing(values) * Math.abs(at(1) - at(0));
  const room = Math.min(step(arrows.map(([a]) => a), (v) => chart.x(v)), step(arrows.map(([, b]) => b), (v) => chart.y(v)));
  const size = Math.min(1.4, Math.max(0.75, room / 22));
  const lines = [];
  const heads = [];
  for (const [a, b, right, up] of arrows) {
    const [cx, cy] = [chart.x(a), chart.y(b)];
    const [dx, dy] = [0.38 * room * right, -0.38 * room * up];
    if (!dx && !dy) heads.push([DOT, `translate(${cx.toFixed(1)} ${cy.toFixed(1)})`]);
    else {
      const angle = (180 / Math.PI) * Math.atan2(dy, dx);
      heads.push([HEAD, `translate(${(cx + dx).toFixed(1)} ${(cy + dy).toFixed(1)}) rotate(${angle.toFixed(1)}) scale(${size.toFixed(2)})`]);
      const short = Math.max(0, 1 - (3 * size) / Math.hypot(dx, dy)); // the line ends within its head
      lines.push(`M${(cx - dx).toFixed(1)} ${(cy - dy).toFixed(1)}L${(cx + short * dx).toFixed(1)} ${(cy + short * dy).toFixed(1)}`);
    }
  }
  for (const part of ["rim", "core"]) chart.add("path", { d: lines.join(""), class: `arrow ${part}` });
  for (const [d, transform] of heads) chart.add("path", { d, transform, class: "arrow head" });
}

// The least distance of two places that differ.
function spacing(places) {
  const sorted = [...new Set(places)].sort((a, b) => a - b);
  return sorted.length > 1 ? Math.min(...sorted.slice(1).map((place, i) => place - sorted[i])) : 1;
}
