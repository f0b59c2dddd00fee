// One live session of a lab, from this page's side: creates it, listens to its stream, and brings
// it back with the same parameters when the connection, the worker or the whole server was lost.
//
// Events: "phase" {phase, text}, "preparing", "hello", "telemetry", "status", "notice", "refused" (a sentence), "remarks" (sentences).
// Phases: worker, robot, live, lost, full, failed, ended.

import { ROOT } from "./root.js";

const BACKOFF = [500, 1000, 2000, 3500, 5000]; // [ms]
const FULL_RETRY = 10000;
const PREPARING_DELAY = 3000; // What takes longer is explained.
const FRAME = 16; // [ms]
const ANSWER_TIMEOUT = 15000; // A worker is given ten seconds.
const SILENCE_TIMEOUT = 8000; // A live stream speaks twice a second; after this it is taken for dead.

export class Session extends EventTarget {
  constructor(lab, frame, link, view) {
    super();
    this.lab = lab;
    this.frame = frame;
    this.view = view; // a function: what the scene should look like now
    this.want = { params: {}, link, seed: 0, speed: 1, running: null, solver: null };
    this.info = null;
    this.socket = null;
    this.tries = 0;
    this.closed = false;
    this.answers = new Map(); // what waits for the server's answer, by its reference
    this.refs = 0;
    this.changed = 0; // [ms] when changes were sent last
    this.fresh = true; // whether the telemetry since then shows them
    this.frame.addEventListener("load", () => {
      this.sceneLoaded = this.info !== null;
      this.goLive();
    });
    addEventListener("online", () => this.retryNow());
    document.addEventListener("visibilitychange", () => this.retryNow());
    addEventListener("pagehide", () => this.leave());
    addEventListener("pageshow", (event) => event.persisted && this.create());
    setInterval(() => this.checkSilence(), 2000);
  }

  // Asks the server for a session. `news` is said once it lives.
  async create(news = "") {
    clearTimeout(this.timer);
    this.drop();
    this.end();
    this.closed = this.ended = false;
    this.sceneLoaded = this.statusReceived = this.live = false;
    this.restore = news !== "" || this.want.running !== null;
    this.news = news;
    this.emit("phase", { phase: "worker", text: news });
    const { params, link, seed } = this.want;
    const waiting = setInterval(() => this.reportPreparing(), PREPARING_DELAY);
    const { status, data } = await request("POST", "api/sessions", {
      lab: this.lab.slug, params, link, seed, view: this.view(),
    });
    clearInterval(waiting);
    if (this.closed) return;
    if (status === 201) return this.begin(data);
    if (status === 503) {
      this.emit("phase", { phase: "full", text: data.error });
      this.timer = setTimeout(() => this.create(this.news), FULL_RETRY);
    } else if (status === 0 || status >= 502) {
      this.emit("phase", { phase: "lost", text: "The server does not answer. Trying again …" });
      this.timer = setTimeout(() => this.create(this.news), this.delay());
    } else if (status === 422 && Object.keys({ ...params, ...link }).length) {
      this.want = { ...this.want, params: {}, link: {} };
      this.emit("refused", data.error);
      this.create(news);
    } else {
      this.emit("phase", { phase: "failed", text: data.error });
    }
  }

  // A server started for the first time has more to do than to start a worker.
  async reportPreparing() {
    const { data } = await request("GET", "healthz");
    if (data.preparing && !this.info && !this.closed) this.emit("preparing");
  }

  begin(info) {
    this.info = info;
    this.worker = null;
    this.tries = 0;
    this.emit("phase", { phase: "robot", text: "" });
    if (info.remarks.length) this.emit("remarks", info.remarks);
    this.showScene();
    this.listen();
  }

  showScene() {
    const address = `${ROOT}${this.info.scene.slice(1)}?hideViserLogo${this.view().dark ? "&darkMode" : ""}`;
    // Replacing leaves no entry behind in the browser's history.
    if (this.frame.src) this.frame.contentWindow.location.replace(address);
    else this.frame.src = address;
  }

  listen() {
    const socket = new WebSocket(location.origin.replace(/^http/, "ws") + ROOT + this.info.stream.slice(1));
    this.socket = socket;
    this.heard = performance.now();
    socket.onmessage = (event) => {
      if (socket !== this.socket) return;
      this.heard = performance.now();
      const message = JSON.parse(event.data);
      if (message.type === "status") this.noteStatus(message);
      if (message.type === "hello") this.noteWorker(message.worker);
      if (message.type === "answer") this.answers.get(message.ref)?.(message.error);
      if (message.type === "telemetry" && this.answers.size === 0) this.fresh = true;
      this.emit(message.type, message);
      if (message.type === "notice" && message.state === "ended") this.noteEnded(message.text);
    };
    socket.onclose = () => {
      if (socket === this.socket) this.reconnect();
    };
  }

  // A worker that took over has a scene of its own; one that says hello again has not.
  noteWorker(worker) {
    if (this.worker && worker !== this.worker) this.showScene();
    this.worker = worker;
  }

  noteStatus(status) {
    const { params, seed, speed } = status;
    if (this.restore) {
      // A session that takes over from a lost one goes on as that one did.
      this.restore = false;
      const { speed: factor, running, solver } = this.want;
      const commands = [];
      if (factor !== speed) commands.push({ command: "speed", factor });
      if (running === false && status.running) commands.push({ command: "pause" });
      if (running && !status.running && !status.trouble) commands.push({ command: "run" });
      if (solver && !solver.running) commands.push({ command: "solver_pause" });
      if (solver?.pace) commands.push({ command: "solver_pace", pace: solver.pace });
      // One that fails is no harm: the page shows what the server does.
      for (const command of commands) this.send(command).catch(() => {});
    } else {
      const running = status.running || status.trouble !== "";
      this.want = { params, link: {}, seed, speed, running, solver: status.solver };
    }
    this.tries = 0;
    this.statusReceived = true;
    this.goLive();
  }

  // Live once both the stream has spoken and the scene has loaded.
  goLive() {
    if (this.live || !this.statusReceived || !this.sceneLoaded) return;
    this.live = true;
    this.emit("phase", { phase: "live", text: this.news });
    this.news = "";
  }

  async reconnect() {
    clearTimeout(this.timer);
    this.drop();
    if (this.closed) return;
    this.statusReceived = this.live = false;
    this.emit("phase", { phase: "lost", text: "The connection was lost. Trying again …" });
    const { status } = await request("GET", `api/sessions/${this.info.id}`);
    if (this.closed || this.socket) return;
    if (status === 200 && this.tries < 1) {
      this.tries += 1;
      this.listen();
    } else if (status === 404 && document.visibilityState === "visible") {
      this.create("The session had ended. A new one goes on with your parameters.");
    } else if (status === 404) {
      this.noteEnded("The session has ended.");
    } else {
      this.timer = setTimeout(() => (status === 200 ? this.listen() : this.reconnect()), this.delay());
    }
  }

  // Nobody uses the session: no new one until somebody does.
  noteEnded(text) {
    this.ended = true;
    this.drop();
    this.emit("phase", { phase: "ended", text });
  }

  delay() {
    return BACKOFF[Math.min(this.tries++, BACKOFF.length - 1)];
  }

  // Somebody looks again, or the network is back: no reason to wait.
  retryNow() {
    if (document.visibilityState !== "visible" || this.closed || !this.info) return;
    if (this.ended) {
      this.create("The session had ended. A new one goes on with your parameters.");
    } else if (!this.socket || performance.now() - this.heard > 3000) {
      this.tries = 0;
      this.reconnect();
    }
  }

  checkSilence() {
    if (this.socket && performance.now() - this.heard > SILENCE_TIMEOUT) this.reconnect();
  }

  drop() {
    const socket = this.socket;
    this.socket = null;
    socket?.close();
    for (const done of this.answers.values()) done("The connection was lost: try again in a moment.");
  }

  leave() {
    this.closed = true;
    clearTimeout(this.timer);
    this.drop();
    this.end();
  }

  end() {
    const { id } = this.info ?? {};
    this.info = null;
    if (id) fetch(`${ROOT}api/sessions/${id}`, { method: "DELETE", keepalive: true }).catch(() => {});
  }

  // Commands and changes. Both throw an Error with the server's sentence.
  send(command) {
    return this.ask({ type: "command", command });
  }

  // What changes within a frame goes as one message: at once, or with the next frame.
  change(changes) {
    if (this.batch) {
      Object.assign(this.batch.changes, changes);
      return this.batch.answer;
    }
    if (performance.now() - this.changed >= FRAME) return this.sendChanges(changes);
    const batch = (this.batch = { changes: { ...changes } });
    batch.answer = new Promise((done) => setTimeout(done, this.changed + FRAME - performance.now())).then(() => {
      this.batch = null;
      return this.sendChanges(batch.changes);
    });
    return batch.answer;
  }

  sendChanges(changes) {
    this.changed = performance.now();
    this.fresh = false;
    return this.ask({ type: "params", changes });
  }

  async ask(message) {
    if (!this.info) throw new Error("The simulation is not ready yet.");
    if (this.socket?.readyState !== WebSocket.OPEN) throw new Error("The server is not connected. Trying again …");
    const ref = (this.refs += 1);
    this.socket.send(JSON.stringify({ ...message, ref }));
    let timer;
    const error = await new Promise((done) => {
      this.answers.set(ref, done);
      timer = setTimeout(done, ANSWER_TIMEOUT, "The server does not answer.");
    });
    clearTimeout(timer);
    this.answers.delete(ref);
    if (error) throw new Error(error);
  }

  // A saved solution, as the file it is: too large for the stream.
  async load(file) {
    if (!this.info) throw new Error("The simulation is not ready yet.");
    const { status, data } = await request("PUT", `api/sessions/${this.info.id}/solution`, file);
    if (status >= 200 && status < 300) return;
    if (status === 404) this.retryNow();
    throw new Error(data.error);
  }

  emit(type, detail) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }
}

// Status 0 stands for a server that could not be reached.
async function request(method, address, body) {
  const asIs = body === undefined || body instanceof Blob;
  try {
    const response = await fetch(ROOT + address, {
      method,
      headers: asIs ? {} : { "Content-Type": "application/json" },
      body: asIs ? body : JSON.stringify(body),
    });
    const data = await response.json().catch(() => ({}));
    return { status: response.status, data: { error: `The server answered ${response.status}.`, ...data } };
  } catch {
    return { status: 0, data: { error: "The server does not answer." } };
  }
}
