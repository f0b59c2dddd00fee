// The frame every plot stands in: a title with its unit, a place for a legend, the way to save it,
// and a body.

export function card(title, unit = "", bodyClass = "canvas") {
  const section = element("section", "plot");
  const header = element("header");
  const heading = element("h3", "", title);
  const small = element("small");
  heading.append(small);
  const setUnit = (text) => (small.textContent = text ? ` [${text}]` : "");
  setUnit(unit);
  const legend = element("div", "legend");
  const save = element("button", "save");
  save.type = "button";
  save.title = "Save this plot: picture or data";
  save.setAttribute("aria-label", `Save ${title}`);
  save.setAttribute("popovertarget", "save-menu");
  save.append(document.querySelector("#save-all .icon").cloneNode(true));
  header.append(heading, legend, save);
  const body = element("div", bodyClass);
  section.setAttribute("aria-label", title);
  if (bodyClass.startsWith("canvas") && !bodyClass.endsWith("note")) {
    body.setAttribute("role", "img"); // in words: summary.js
    body.setAttribute("aria-label", title);
  }
  section.append(header, body);
  return { section, setUnit, legend, body, save };
}

export function element(name, className = "", text = "") {
  const made = document.createElement(name);
  if (className) made.className = className;
  if (text) made.textContent = text;
  return made;
}
