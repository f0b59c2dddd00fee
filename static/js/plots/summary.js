// Plots in words, for those who do not see them: what is drawn over what, and in which range.

import { number } from "../format.js";
import { bounds } from "./ticks.js";

// "from −0.1 to 0.3, last 0.2": of numbers among which some may be missing.
export function extent(values) {
  const [low, high] = bounds(values);
  if (low > high) return "no values";
  if (low === high) return `constant ${number(low, 3)}`;
  return `from ${number(low, 3)} to ${number(high, 3)}, last ${number(values.findLast(Number.isFinite), 3)}`;
}

// A heading, and a sentence of each of some parts; of many, how many more there are.
export function sentences(heading, parts, most = 12) {
  const more = parts.length > most ? [`and ${parts.length - most} more`] : [];
  return `${heading}. ${[...parts.slice(0, most), ...more].join("; ")}.`;
}

// Says what each plot shows now; for a screen reader, which reads it when asked and not before.
export function summarise(plots) {
  for (const plot of plots) {
    const summary = plot.summary?.();
    if (summary && plot.body.getAttribute("aria-label") !== summary) plot.body.setAttribute("aria-label", summary);
  }
}
