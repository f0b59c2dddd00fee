// Plots that leave the page: one from its card, all from the row of tabs. Pictures are made here,
// data come from the server, with all their digits.

import { ROOT } from "../root.js";
import { toast } from "../toast.js";
import { renderFigure } from "./figure.js";
import { serialise } from "./svg_styles.js";

const SCALE = 2; // pixels of a PNG for each of the picture's
const DATA = ["csv", "json"];

export class FigureExport {
  // `about` and `session` are functions: what a figure says, the session's id.
  constructor(board, about, session) {
    Object.assign(this, { board, about, session });
    const menu = document.getElementById("save-menu");
    if (!menu) return;
    const hint = menu.querySelector(".hint");
    const csv = menu.querySelector("[data-save=csv]").firstChild;
    const target = (button, plot, words) => button.addEventListener("click", () => {
      this.plot = plot;
      hint.textContent = words;
      csv.textContent = plot ? "CSV" : "ZIP of CSV";
    });
    for (const plot of board.plots) target(plot.save, plot, `Save “${plot.plot.title}” as`);
    target(document.getElementById("save-all"), null, "Save all plots as");
    for (const button of menu.querySelectorAll("[data-save]")) {
      button.addEventListener("click", () => this.save(button.dataset.save));
    }
  }

  async save(form) {
    try {
      const name = [this.about().lab.slug, this.plot ? fileName(this.plot.plot.title) : "plots"].join("-");
      const packed = form === "csv" && !this.plot ? "zip" : form;
      download(DATA.includes(form) ? await this.data(packed) : await this.picture(form), `${name}.${packed}`);
    } catch (error) {
      toast(`The plot was not saved: ${error.message.replace(/\.?$/, ".")}`);
    }
  }

  async data(form) {
    const query = this.plot ? `?${new URLSearchParams({ title: this.plot.plot.title })}` : "";
    const response = await fetch(`${ROOT}api/sessions/${this.session()}/plots.${form}${query}`).catch(() => null);
    if (response?.ok) return response.blob();
    const said = await response?.json().catch(() => null);
    throw new Error(said?.error ?? "the server does not answer");
  }

  async picture(form) {
    const drawn = renderFigure(this.plot ? [this.plot] : this.board.plotTabs.present, this.about());
    const text = serialise(drawn);
    if (form === "svg") return new Blob([text], { type: "image/svg+xml" });
    const image = new Image();
    image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(text)}`;
    await image.decode();
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [SCALE * image.width, SCALE * image.height];
    canvas.getContext("2d").drawImage(image, 0, 0, canvas.width, canvas.height);
    const blob = await new Promise((done) => canvas.toBlob(done, "image/png"));
    if (!blob) throw new Error("this browser cannot draw a picture so large");
    return blob;
  }
}

// The same as `file_name` of labs/engine/plot_data.py.
function fileName(title) {
  return title.toLowerCase().replace(/[^\w]+/g, "-").replace(/^-+|-+$/g, "") || "plot";
}

function download(blob, name) {
  const anchor = document.createElement("a");
  anchor.href = URL.createObjectURL(blob);
  anchor.download = name;
  anchor.click();
  setTimeout(() => URL.revokeObjectURL(anchor.href), 60000);
}
