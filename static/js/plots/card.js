// The frame every plot stands in: a title with its unit, a place for a legend, and a body.

export function card(title, unit = "", bodyClass = "canvas") {
  const section = element("section", "plot");
  const header = element("header");
  const heading = element("h3", "", title);
  const small = element("small");
  heading.append(small);
  const setUnit = (text) => (small.textContent = text ? ` [${text}]` : "");
  setUnit(unit);
  const legend = element("div", "legend");
  header.append(heading, legend);
  const body = element("div", bodyClass);
  section.setAttribute("aria-label", title);
  if (bodyClass.startsWith("canvas") && !bodyClass.endsWith("note")) {
    body.setAttribute("role", "img"); // in words: summary.js
    body.setAttribute("aria-label", title);
  }
  section.append(header, body);
  return { section, setUnit, legend, body };
}

export function element(name, className = "", text = "") {
  const made = document.createElement(name);
  if (className) made.className = className;
  if (text) made.textContent = text;
  return made;
}
