// A file whose words become the text of a knob: dropped on its field, or chosen with its button.

const LARGEST = 2 ** 20; // [bytes] more is no table, and is not even read

// `take` is given the text, `refuse` a sentence.
export function wireTextFile(element, field, take, refuse) {
  const button = element.querySelector(".open-file");
  const chooser = element.querySelector("input[type=file]");
  if (!button) return;
  const load = async (file) => {
    if (field.disabled) return;
    if (file.size > LARGEST) {
      refuse(`${file.name} has ${(file.size / LARGEST).toFixed(1)} MiB: a text of at most 1 MiB is read`);
      return;
    }
    take(await file.text());
  };
  button.addEventListener("click", () => chooser.click());
  chooser.addEventListener("change", () => {
    const [file] = chooser.files;
    if (file) load(file);
    chooser.value = ""; // the same file may be chosen again
  });
  const mark = (over) => element.classList.toggle("over", over);
  const holds = (event) => event.dataTransfer?.types.includes("Files");
  element.addEventListener("dragover", (event) => {
    if (!holds(event)) return;
    event.preventDefault();
    mark(true);
  });
  element.addEventListener("dragleave", () => mark(false));
  element.addEventListener("drop", (event) => {
    mark(false);
    if (!holds(event)) return;
    event.preventDefault();
    load(event.dataTransfer.files[0]);
  });
}
