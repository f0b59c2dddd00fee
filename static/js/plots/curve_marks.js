// The marks on time series, which tell them apart besides their colours.

import { drawMark } from "./marks.js";
import { colour } from "./palette.js";

const MARKS = 6; // on a curve, about

// A mark on each curve every so often, at times of its own: they move with the curves.
export function markCurves(plot, u) {
  const [t, ...all] = u.data;
  if (!plot.marked || t.length < 2) return;
  const every = roundStep((u.scales.x.max - u.scales.x.min) / MARKS);
  const rim = colour("surface");
  const { left, top, width, height } = u.bbox;
  plot.curves.forEach(({ series, tone, line }, i) => {
    if (!series || !u.series[i + 1].show || plot.isArea(line)) return;
    u.ctx.fillStyle = colour(tone);
    const last = t[t.length - 1] / every - series / 9;
    for (let k = Math.ceil(t[0] / every - series / 9); k <= last; k++) {
      const at = u.valToIdx(every * (k + series / 9));
      const [x, y] = [u.valToPos(t[at], "x", true), u.valToPos(all[i][at], "y", true)];
      const within = x > left && x < left + width && y > top && y < top + height;
      if (Number.isFinite(all[i][at]) && within) drawMark(u.ctx, series, x, y, rim);
    }
  });
}

// 1, 2 or 5 times a power of ten, no less than this.
function roundStep(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return power * [1, 2, 5, 10].find((m) => m * power >= least * (1 - 1e-9));
}
