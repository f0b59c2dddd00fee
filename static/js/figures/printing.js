// On paper the pinned plots stand beneath the article, as figures.

import { renderFigure } from "./figure.js";

export function printFigures(shown, about) {
  const host = document.getElementById("printed");
  addEventListener("beforeprint", () => {
    const plots = shown();
    host.replaceChildren(...(plots.length ? [renderFigure(plots, about(), 1)] : []));
  });
  addEventListener("afterprint", () => host.replaceChildren());
}
