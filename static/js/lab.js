// The lab page: joins the session with everything that shows it or changes it.

import { describeScene } from "./describe.js";
import { Experiments } from "./experiments.js";
import { FigureExport } from "./figures/figure_export.js";
import { printFigures } from "./figures/printing.js";
import { wireKeyboard } from "./keyboard.js";
import { KnobColumn } from "./knob_column.js";
import { Knobs } from "./knobs.js";
import { buildLink, readLink, writeLink } from "./link.js";
import { wireMenus } from "./menus.js";
import { PlotBoard } from "./plots/board.js";
import { onViewChange, view, wirePreferences } from "./preferences.js";
import { ROOT } from "./root.js";
import { Session } from "./session.js";
import { Sheets } from "./sheet.js";
import { SolverRow } from "./solver.js";
import { wireSplitters } from "./splitters.js";
import { Stage } from "./stage.js";
import { Symbols } from "./symbols.js";
import { toast } from "./toast.js";
import { Transport } from "./transport.js";
import { noteVisit } from "./visits.js";

const lab = JSON.parse(document.getElementById("lab-data").textContent);
const session = new Session(lab, document.getElementById("robot"), readLink(), view);
const stage = new Stage();
const board = new PlotBoard(lab, () => session.fresh);
const transport = new Transport(send);
const solver = new SolverRow(send, loadSolution);
const knobs = new Knobs(lab, (changes) => session.change(changes));
const column = new KnobColumn(lab, knobs);
const symbols = new Symbols(lab, knobs);
const experiments = new Experiments(lab, apply, board, (names) => column.highlight(names));
let link = location.href;
let omittedTexts = {}; // by name: what is too long for it
new FigureExport(board, figureContext, () => session.info?.id);
printFigures(() => board.plotTabs.shown, figureContext);

// A command whose refusal is said at the bottom of the page. Tells whether it was done.
async function send(command) {
  try {
    await session.send(command);
    return true;
  } catch (error) {
    toast(error.message);
    return false;
  }
}

function apply(params, how = {}) {
  return send({ command: "apply", params, restart: true, ...how });
}

const actions = {
  // A solver without a world has the keys of the world's clock.
  toggle: () => (lab.has_world ? transport : solver).toggle(),
  step: () => (lab.has_world ? send({ command: "step", count: 1 }) : solver.step()),
  solve: () => solver.toggle(),
  iterate: () => solver.step(),
  loadSolution: () => solver.choose(),
  reset: () => send({ command: "reset" }),
  defaults: () => apply({}),
  faster: () => transport.changeSpeed(1),
  slower: () => transport.changeSpeed(-1),
  clear: () => board.clear(),
  share: () => copy(address(), "Link copied: it opens this lab with these parameters.", omissionNote()),
  command: copyCommand,
  full: () => stage.fullScreen(),
  view: () => send({ command: "reset_view" }),
  help: () => document.getElementById("help").showModal(),
  experiment: (i) => experiments.start(i),
};

// Where the page opens as it is now.
function address() {
  return new URL(link, location.href).href;
}

// A sentence on what the link lacks, if anything.
function omissionNote() {
  const names = lab.params.filter(({ name }) => name in omittedTexts).map(({ label }) => label);
  return names.length ? ` Without ${names.join(", ")}, too long for a link: pass that text on beside it.` : "";
}

// What a figure says beneath its plots.
function figureContext() {
  const iteration = solver.status?.iteration;
  return { lab, params: knobs.values, seed: session.want.seed, t: board.time, iteration, link: address() };
}

async function copyCommand() {
  const response = await fetch(`${ROOT}api/sessions/${session.info?.id}/command`).catch(() => null);
  const data = await response?.json().catch(() => null);
  if (data?.command) copy(data.command, `Copied: ${data.command}`);
  else toast(data?.error ?? "The server does not answer.");
}

async function copy(text, done, note = "") {
  try {
    await navigator.clipboard.writeText(text);
    toast(done + note);
  } catch {
    // The clipboard needs a secure page; the text is then shown to be copied by hand.
    toast(text + note, 30);
  }
}

function download(what) {
  if (!session.info) return;
  const anchor = document.createElement("a");
  anchor.href = `${ROOT}api/sessions/${session.info.id}/${what}`;
  anchor.download = "";
  anchor.click();
}

function saveSolution(form) {
  if (solver.status?.kept) download(`solution.${form}`);
  else toast("The solver has found nothing yet that could be saved.");
}

async function loadSolution(file) {
  try {
    await session.load(file);
    toast("Solution loaded, with its parameters. The solver waits: run it to go on from there.");
  } catch (error) {
    toast(`${file.name} was not loaded: ${error.message.replace(/\.?$/, ".")}`, 15);
  }
}

// What the session tells ----------------------------------------------------------------------

session.addEventListener("phase", ({ detail: { phase, text } }) => {
  const retry = { "Try now": () => session.create(session.news) };
  const live = phase === "live";
  transport.enable(live);
  solver.enable(live);
  for (const button of document.querySelectorAll(".try, .predict button")) button.disabled = !live;
  if (["worker", "robot", "live"].includes(phase)) {
    stage.progress(phase);
    stage.say("");
    if (live && text) toast(text);
  } else {
    stage.hold(true);
    const buttons = phase === "lost" ? {} : phase === "ended" ? { Continue: () => session.retryNow() } : retry;
    const more = phase === "full" ? " This page asks again every ten seconds." : "";
    stage.say(text + more, { warn: true, buttons });
  }
});

session.addEventListener("preparing", () => stage.prepare());

session.addEventListener("refused", ({ detail }) => {
  const sentence = detail.replace(/\.?$/, ".");
  toast(`The link was not taken: ${sentence} The lab starts with its defaults.`, 15);
});

session.addEventListener("remarks", ({ detail }) => {
  toast(`Of the link: ${detail.slice(0, 4).join(". ")}. All else of it holds.`, 15);
});

session.addEventListener("compared", ({ detail }) => board.compare(detail));

session.addEventListener("hello", ({ detail }) => board.hello(detail));

session.addEventListener("telemetry", ({ detail }) => {
  board.telemetry(detail);
  if (detail.rows.length) transport.showTime(detail.rows.at(-1)[0]);
});

session.addEventListener("status", ({ detail: status }) => {
  transport.show(status);
  solver.show(status.solver);
  experiments.show(status);
  knobs.show(status.params);
  column.show();
  symbols.show();
  board.choose(status.params);
  ({ link, left: omittedTexts } = buildLink(lab.params, status.params, status.seed));
  writeLink(link, omittedTexts);
  if (status.trouble) {
    stage.say(status.trouble, { warn: true, buttons: { Reset: actions.reset, Defaults: actions.defaults } });
  } else if (!recovering) {
    stage.say("");
  }
});

let recovering = false;
session.addEventListener("notice", ({ detail: { state, text } }) => {
  recovering = state === "recovering" || state === "failed";
  if (state === "ended") return; // the phase says it
  if (state === "live") {
    stage.say("");
    if (text) toast(text);
  } else {
    const again = { "Start again": () => session.create("A new session goes on with your parameters.") };
    stage.say(text, { warn: true, buttons: state === "recovering" ? {} : again });
  }
});

// What the reader does ------------------------------------------------------------------------

for (const button of document.querySelectorAll("[data-do]")) {
  button.addEventListener("click", () => actions[button.dataset.do]());
}
for (const button of document.querySelectorAll("[data-preset]")) {
  button.addEventListener("click", () => apply(lab.presets[button.dataset.preset]));
}
for (const button of document.querySelectorAll("[data-export]")) {
  button.addEventListener("click", () => download(`export.${button.dataset.export}`));
}
for (const button of document.querySelectorAll("[data-solution]")) {
  button.addEventListener("click", () => saveSolution(button.dataset.solution));
}
onViewChange((wanted) => {
  board.retheme();
  if (session.info) send({ command: "view", view: wanted });
});
document.getElementById("help").addEventListener("click", (event) => {
  if (event.target === event.currentTarget) event.currentTarget.close();
});

new Sheets();
wireSplitters();
describeScene(document.getElementById("scene-words"));
wirePreferences();
wireMenus();
wireKeyboard(actions);
noteVisit(lab.slug);
session.create();
