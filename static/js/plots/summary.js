// Plots in words, for those who do not see them: what is drawn over what, and in which range.

import { formatNumber } from "../format.js";
import { finiteRange } from "./ticks.js";

// "from −0.1 to 0.3, last 0.2": of numbers among which some may be missing.
export function describeRange(values) {
  const [low, high] = finiteRange(values);
  if (low > high) return "no values";
  if (low === high) return `constant ${formatNumber(low, 3)}`;
  return `from ${formatNumber(low, 3)} to ${formatNumber(high, 3)}, last ${formatNumber(values.findLast(Number.isFinite), 3)}`;
}

// A heading, and a sentence of each of some parts; of many, how many more there are.
export function joinSentences(heading, parts, most = 12) {
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
