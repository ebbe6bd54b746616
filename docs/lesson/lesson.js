// Starts Python and runs the boxes, one at a time; names made in one box are there for the next.
import { loadPyodide } from "./pyodide/pyodide.mjs";

const status = document.getElementById("python"), all = document.getElementById("all");
const boxes = [...document.querySelectorAll(".box")];
status.textContent = "Python is starting …";
const python = await loadPyodide({ indexURL: new URL("./pyodide/", location.href).href });
python.runPython(JSON.parse(document.getElementById("drawing").textContent));
const figures = python.globals.get("figures");

function show(answer, tag, text, look = "") {
  const element = document.createElement(tag);
  element.className = look;
  if (tag === "div") element.innerHTML = text;
  else element.textContent = text;
  answer.append(element);
}

// Runs one box; returns whether it ran to its end.
async function run(box) {
  const answer = box.querySelector(".answer"), lines = [];
  answer.replaceChildren();
  status.textContent = "Python is running …";
  await new Promise((done) => setTimeout(done, 20)); // so that the line above is seen
  python.setStdout({ batched: (line) => lines.push(line) });
  let failure = "";
  try { python.runPython(box.querySelector("textarea").value); } catch (error) { failure = error.message; }
  while (figures.length) show(answer, "div", figures.pop(0));
  if (lines.length) show(answer, "pre", lines.join("\n"));
  // Of a traceback only what the pupil wrote.
  if (failure) show(answer, "pre", failure.slice(Math.max(0, failure.indexOf('File "<exec>"'))), "error");
  status.textContent = "Python is ready.";
  return !failure;
}

for (const box of boxes) box.querySelector("button").addEventListener("click", () => run(box));
all.addEventListener("click", async () => {
  for (const box of boxes) if (!(await run(box))) break;
});
for (const button of document.querySelectorAll("button")) button.disabled = false;
status.textContent = "Python is ready.";
