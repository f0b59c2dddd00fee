// Symbols as MathML, and a vector's component as its subscript: q becomes q₂, qʳᵉᶠ becomes q₂ʳᵉᶠ,
// and of "e = r − q" what stands left of the equals sign.

const MATHML = "http://www.w3.org/1998/Math/MathML";

export function symbol(mathml, component = null) {
  const math = new DOMParser().parseFromString(mathml, "text/html").querySelector("math");
  if (component === null) return math;
  const parts = [...math.children];
  const equals = parts.findIndex((part) => part.localName === "mo" && part.textContent === "=");
  if (equals > 0) parts.splice(equals).forEach((part) => part.remove());
  const sign = parts[0].localName === "mo" && /^[-−+]$/.test(parts[0].textContent) ? parts[0] : null;
  sign?.remove();
  addSubscript(math, component);
  if (sign) math.prepend(sign);
  return math;
}

function addSubscript(math, component) {
  const number = mathElement("mn", String(component + 1));
  const only = math.childElementCount === 1 ? math.firstElementChild : null;
  const kind = only?.localName;
  if (kind === "msub" || kind === "msubsup") {
    const old = only.children[1];
    const both = mathElement("mrow");
    old.replaceWith(both);
    both.append(old, mathElement("mo", ","), number);
  } else if (kind === "msup") {
    const joined = mathElement("msubsup");
    const [base, above] = only.children;
    joined.append(base, number, above);
    only.replaceWith(joined);
  } else {
    const base = mathElement("mrow");
    base.append(...math.childNodes);
    if (!only) {
      base.prepend(mathElement("mo", "("));
      base.append(mathElement("mo", ")"));
    }
    const indexed = mathElement("msub");
    indexed.append(base, number);
    math.append(indexed);
  }
}

function mathElement(name, text = "") {
  const element = document.createElementNS(MATHML, name);
  element.textContent = text;
  return element;
}
