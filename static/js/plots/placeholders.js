// The words of a plot that depend on the parameters: `{name}` stands for what the lab says under
// this name, one word or one for each curve k, and `{}` for the curve's number.

export function fillPlaceholders(text, labels, k = null) {
  return text.replace(/\{(\w*)\}/g, (all, name) => {
    if (!name) return k === null ? all : String(k + 1);
    const said = labels?.[name] ?? "";
    if (!Array.isArray(said)) return said;
    return k === null ? [...new Set(said)].join(", ") : (said[k] ?? "");
  });
}

// Whether a plot is there under these parameters.
export function isShown(plot, params) {
  return Object.entries(plot.when ?? {}).every(([name, values]) => values.includes(params[name]));
}
