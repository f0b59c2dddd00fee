// The page's knobs: every parameter's present value, the rows that show it, and the way to another.

import { KnobRow } from "./knob_row.js";

const OWN_CHANGE_TIME = 700; // [ms] an own change may take to come back before the stream is believed again

export class Knobs {
  constructor(lab, change) {
    this.change = change; // (changes) => Promise, throws the server's sentence
    this.values = {};
    this.entries = new Map(lab.params.map((tunable) => [tunable.name, { tunable, rows: new Set(), until: 0 }]));
    for (const name of this.entries.keys()) this.add(name, document.getElementById(`param-${name}`));
  }

  // Another row of a parameter.
  add(name, element) {
    const { tunable, rows } = this.entries.get(name);
    const row = new KnobRow(tunable, element, this);
    rows.add(row);
    if (name in this.values) {
      row.write(this.present(name));
      row.compare(this.values[name]);
    }
    return row;
  }

  remove(row) {
    this.entries.get(row.tunable.name).rows.delete(row);
  }

  // The value a hand has just given it, or else the one it has.
  present(name) {
    const { wanted, tunable } = this.entries.get(name);
    return wanted ?? this.values[name] ?? tunable.default;
  }

  // While a hand moves the latest value wins: one change is under way at a time.
  async drag(name, value, by = null) {
    const entry = this.entries.get(name);
    for (const row of entry.rows) row.write(value);
    entry.until = performance.now() + OWN_CHANGE_TIME;
    const underWay = entry.wanted !== undefined;
    entry.wanted = value;
    if (underWay) return;
    while (entry.wanted !== undefined) {
      const next = entry.wanted;
      await this.commit(name, next, by);
      if (entry.wanted === next) entry.wanted = undefined;
    }
  }

  // `by` is the row that a refusal is said in.
  async commit(name, value, by) {
    const entry = this.entries.get(name);
    by?.mark("");
    if (value === this.values[name]) return by?.write(value);
    entry.until = performance.now() + OWN_CHANGE_TIME;
    try {
      await this.change({ [name]: value });
    } catch (error) {
      entry.until = 0;
      // What is wrong stays, to be put right; Escape brings the valid one back.
      by?.mark(error.message);
    }
  }

  // The truth from the server.
  show(params) {
    let changed = false;
    for (const [name, entry] of this.entries) {
      const value = params[name];
      const known = this.values[name];
      if (value === undefined || value === known) continue;
      this.values[name] = value;
      changed = true;
      const own = performance.now() < entry.until;
      for (const row of entry.rows) {
        row.compare(value);
        if (entry.wanted !== undefined) continue; // the hand is still on it
        if (!row.typing || own) row.write(value);
        row.mark("");
        if (known !== undefined && !own) row.flash();
      }
      if (entry.wanted === undefined) entry.until = 0;
    }
    if (!changed) return;
    for (const { rows } of this.entries.values()) for (const row of rows) row.showUnit();
  }
}
