// The samples of one run, column by column, bounded in memory.

const CAPACITY = 24000; // rows
const SECONDS = 120;

export class SampleBuffer {
  constructor(columns) {
    this.columns = columns;
    this.index = new Map(columns.map((name, i) => [name, i]));
    // Twice the capacity: old rows are dropped by a rare copy, and a view never wraps around.
    this.data = columns.map(() => new Float64Array(2048));
    this.start = 0;
    this.end = 0;
  }

  get length() {
    return this.end - this.start;
  }

  get first() {
    return this.length ? this.data[0][this.start] : 0;
  }

  get last() {
    return this.length ? this.data[0][this.end - 1] : 0;
  }

  push(row) {
    if (this.end === this.data[0].length) this.compact();
    for (let i = 0; i < this.data.length; i++) this.data[i][this.end] = row[i] ?? NaN;
    this.end += 1;
    if (this.length > CAPACITY) this.start += 1;
    while (this.data[0][this.start] < this.last - SECONDS) this.start += 1;
  }

  // The samples of a channel's column as a view on memory, or null if there is none.
  column(name) {
    const i = this.index.get(name);
    return i === undefined ? null : this.data[i].subarray(this.start, this.end);
  }

  // The index range, within `column`'s views, of times in [from, to], one beyond on each side.
  span(from, to) {
    const t = this.column("t");
    return [Math.max(0, lowerBound(t, from) - 1), Math.min(t.length, lowerBound(t, to) + 1)];
  }

  latest(name) {
    const i = this.index.get(name);
    return i === undefined || !this.length ? null : this.data[i][this.end - 1];
  }

  // How many components a channel has: 0 for a scalar, null where there is no such channel.
  components(channel) {
    if (this.index.has(channel)) return 0;
    let n = 0;
    while (this.index.has(`${channel}[${n}]`)) n += 1;
    return n || null;
  }

  compact() {
    const grow = this.length > this.data[0].length / 2;
    this.data = this.data.map((old) => {
      const fresh = grow ? new Float64Array(2 * old.length) : old;
      fresh.set(old.subarray(this.start, this.end));
      return fresh;
    });
    this.end -= this.start;
    this.start = 0;
  }
}

// Every stride-th sample of [a, b), and the last.
export function decimate(samples, a, b, stride) {
  if (stride === 1) return samples.subarray(a, b);
  const first = a - (a % stride) + (a % stride ? stride : 0); // the same samples frame by frame
  const kept = [];
  for (let i = first; i < b; i += stride) kept.push(samples[i]);
  if (b > a) kept.push(samples[b - 1]);
  return kept;
}

// The first index with t[i] >= value, in an ascending array.
function lowerBound(t, value) {
  let a = 0;
  let b = t.length;
  while (a < b) {
    const middle = (a + b) >> 1;
    if (t[middle] < value) a = middle + 1;
    else b = middle;
  }
  return a;
}
