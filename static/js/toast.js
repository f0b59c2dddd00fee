// Short messages at the bottom of the page that go away by themselves.

const SECONDS = 7;

export function toast(text, seconds = SECONDS) {
  const box = document.createElement("div");
  box.className = "toast";
  box.append(text);
  const close = document.createElement("button");
  close.type = "button";
  close.setAttribute("aria-label", "Dismiss");
  close.textContent = "✕";
  close.addEventListener("click", () => box.remove());
  box.append(close);
  const all = document.getElementById("toasts");
  for (const other of [...all.children]) {
    if (other.firstChild.textContent === text || all.children.length > 2) other.remove();
  }
  all.append(box);
  setTimeout(() => box.remove(), seconds * 1000);
}
