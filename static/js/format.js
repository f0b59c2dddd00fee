// Numbers as people read them.

const SUPERSCRIPTS = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };

// Four significant digits; very small and very large ones as powers of ten.
export function formatNumber(value, digits = 4) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "—";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e5 || size < 1e-3) {
    const [mantissa, exponent] = value.toExponential(Math.min(digits, 3) - 1).split("e");
    return `${withMinus(mantissa)}·10${superscript(exponent)}`;
  }
  const decimals = Math.max(0, digits - 1 - Math.floor(Math.log10(size)));
  return withMinus(value.toFixed(Math.min(decimals, 4)));
}

// The digits of an exponent, "-7" or "+12", as superscripts.
export function superscript(exponent) {
  return [...exponent.replace("+", "")].map((c) => SUPERSCRIPTS[c]).join("");
}

// As short as it goes without loss, for fields one types into.
export function plainNumber(value) {
  const exact = Number(Number(value).toPrecision(12));
  const size = Math.abs(exact);
  return size > 0 && size < 1e-3 ? exact.toExponential() : String(exact);
}

// Four significant digits and no zeros after them, for the midst of a formula.
export function shortNumber(value) {
  const size = Math.abs(value);
  if (size !== 0 && (size >= 1e5 || size < 1e-3)) return formatNumber(value);
  return withMinus(plainNumber(value.toPrecision(4)));
}

function withMinus(text) {
  return text.replace("-", "−");
}
