// The scene in words, for who does not see it: the clock and the numbers beneath, as a description
// of its frame. Nobody is interrupted: it is renewed now and then, and read on reaching the scene.

const EVERY = 2000; // [ms]

export function describeScene(host) {
  setInterval(() => {
    const words = sceneDescription();
    if (host.textContent !== words) host.textContent = words;
  }, EVERY);
}

function sceneDescription() {
  const clock = text(document.querySelector("#clock"));
  const numbers = [...document.querySelectorAll("#tiles .tile")].map(
    (tile) => `${text(tile.querySelector("span"))}: ${text(tile.querySelector("div"))}`,
  );
  return [clock, ...numbers].filter(Boolean).join("; ").replace(/;?$/, ".");
}

function text(element) {
  return element?.textContent.replace(/\s+/g, " ").trim() ?? "";
}
