// Text in vectors, which breaks no lines and knows no mathematics by itself.

const FONT = "12px system-ui, sans-serif";
const ACCENTS = { "^": "\u0302", "ˆ": "\u0302", "~": "\u0303", "˜": "\u0303", "¯": "\u0304", "‾": "\u0304", "˙": "\u0307", "¨": "\u0308", "→": "\u20d7" };
const SPACED = /^[=<>≤≥≈∈→+−±·×]$/;

let measuring = null;

export function textWidth(text, font = FONT) {
  measuring ??= document.createElement("canvas").getContext("2d");
  measuring.font = font;
  return measuring.measureText(text).width;
}

// The lines of a text, none wider than this [px], broken between words.
export function wrapText(text, width) {
  return text.split("\n").flatMap((paragraph) => {
    const lines = [""];
    for (const word of paragraph.split(" ")) {
      const longer = lines.at(-1) ? `${lines.at(-1)} ${word}` : word;
      if (textWidth(longer) <= width || !lines.at(-1)) lines[lines.length - 1] = longer;
      else lines.push(word);
    }
    return lines;
  });
}

// A label in one line or in two, none wider than this [px]: words that have no room end in "…", the
// unit stays.
export function fitLabel(text, width) {
  const lines = textWidth(text) <= width ? [text] : wrapText(text, width);
  if (lines.length <= 2 && lines.every((line) => textWidth(line) <= width)) return lines;
  const [, name, unit] = text.match(/^(.*?)( \[[^\]]*\])?$/);
  let letters = name.length - 1;
  while (letters > 1 && textWidth(`${name.slice(0, letters)}…`) > width) letters -= 1;
  const short = `${name.slice(0, letters).trimEnd()}…`;
  return unit ? [short, unit.trim()] : [short];
}

// A formula in MathML as pieces of text on one line: {text, italic, level}, level 1 a superscript
// and −1 a subscript.
export function mathPieces(node, level = 0) {
  const parts = [...node.children];
  const inner = () => parts.flatMap((part) => mathPieces(part, level));
  const script = (part, sign) => mathPieces(part, level || sign);
  const plain = (text) => ({ text, italic: false, level });
  switch (node.localName) {
    case "mi":
      return [{ ...plain(node.textContent), italic: [...node.textContent].length === 1 && node.getAttribute("mathvariant") !== "normal" }];
    case "mo": {
      const text = node.textContent.replace(/[\u2061-\u2064]/g, "");
      return text ? [plain(SPACED.test(text) && node.previousElementSibling ? ` ${text} ` : text)] : [];
    }
    case "mn":
    case "mtext":
      return [plain(node.textContent)];
    case "mspace":
      return [plain(" ")];
    case "msub":
    case "munder":
      return [...mathPieces(parts[0], level), ...script(parts[1], -1)];
    case "msup":
      return [...mathPieces(parts[0], level), ...script(parts[1], 1)];
    case "msubsup":
      return [...mathPieces(parts[0], level), ...script(parts[1], -1), ...script(parts[2], 1)];
    case "mover": {
      const [base, ...more] = mathPieces(parts[0], level);
      const accent = ACCENTS[parts[1].textContent.trim()];
      return accent ? [{ ...base, text: base.text + accent }, ...more] : [base, ...more, ...script(parts[1], 1)];
    }
    case "mfrac":
      return [...mathPieces(parts[0], level), plain("/"), ...mathPieces(parts[1], level)];
    case "msqrt":
      return [plain("√("), ...inner(), plain(")")];
    case "annotation":
      return [];
    default:
      return inner();
  }
}

// A formula as one says it: scripts stand apart, "q ref".
export function speechText(math) {
  const pieces = mathPieces(math);
  const text = pieces.map((piece, i) => (piece.level && piece.level !== pieces[i - 1]?.level ? ` ${piece.text}` : piece.text));
  return text.join("").replace(/\s+/g, " ").trim();
}
