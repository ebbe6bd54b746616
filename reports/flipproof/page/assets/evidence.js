"use strict";
/* Figures that are drawn when they are near, folds that links open, and a filter for the findings. */
(() => {
  /* Figures: their places at once, their pictures when the page stands; those near the window first. */
  const pictures = new Map();
  for (const still of document.querySelectorAll(".plate noscript")) {
    const parsed = document.createElement("template");
    parsed.innerHTML = still.textContent;
    const image = parsed.content.querySelector("img");
    const source = image.getAttribute("src");
    image.removeAttribute("src");
    still.replaceWith(image);
    pictures.set(image, source);
  }
  const show = (image) => {
    if (pictures.has(image)) image.src = pictures.get(image);
    pictures.delete(image);
  };
  const showAll = () => [...pictures.keys()].forEach(show);
  const showNext = () => {
    const [image] = pictures.keys();
    if (!image) return;
    show(image);
    setTimeout(showNext, 0);
  };
  const near = new IntersectionObserver((entries) => {
    entries.filter((entry) => entry.isIntersecting).forEach((entry) => show(entry.target));
  }, { rootMargin: "100% 0px" });
  window.addEventListener("beforeprint", showAll);
  window.addEventListener("load", () => {
    [...pictures.keys()].forEach((image) => near.observe(image));
    setTimeout(showNext, 50);
  });

  /* Folds: closed but for those that were open, opened by a link into them, all of them on paper. */
  const state = window.flipproofState;
  const folds = [...document.querySelectorAll(".fold > details")];
  const id = (fold) => fold.parentElement.id;
  const wereOpen = new Set(state.kept("open") ?? []);
  const all = document.querySelector(".unfold");
  const keep = () => {
    state.keep("open", folds.filter((fold) => fold.open).map(id));
    all.textContent = folds.every((fold) => fold.open) ? "Close all" : "Open all";
  };
  for (const fold of folds) {
    fold.open = wereOpen.has(id(fold));
    fold.addEventListener("toggle", keep);
    const figure = fold.querySelector(".fold-thumb");
    const original = figure.dataset.figure && fold.querySelector(`#figure-${CSS.escape(figure.dataset.figure)} img`);
    if (original) {
      const small = document.createElement("img");
      small.alt = "";
      pictures.set(small, pictures.get(original));
      figure.append(small);
    }
  }
  /* Folds within the story and within sections, closed ones but for paper and without this script; kept by number. */
  const inner = [...document.querySelectorAll("details")].filter((fold) => !folds.includes(fold));
  const usual = inner.map((fold) => !("closed" in fold.dataset)), asLeft = state.kept("inner") ?? {};
  inner.forEach((fold, k) => {
    fold.open = asLeft[k] ?? usual[k];
    fold.addEventListener("toggle", () => {
      state.keep("inner", Object.fromEntries(inner.map(({ open }, j) => [j, open]).filter(([j, open]) => open !== usual[j])));
    });
  });
  all.hidden = false;
  all.addEventListener("click", () => {
    const open = !folds.every((fold) => fold.open);
    for (const fold of folds) fold.open = open;
  });
  const reveal = () => {
    const target = document.getElementById(state.place());
    if (!target) return;
    for (let fold = target.closest("details"); fold; fold = fold.parentElement.closest("details")) fold.open = true;
    const own = target.querySelector(":scope > details");
    if (own && target.matches(".fold")) own.open = true;
    target.scrollIntoView({ behavior: "instant" });
  };
  let closed = [];
  window.addEventListener("beforeprint", () => {
    closed = inner.filter((fold) => !fold.open && !fold.matches("[data-closed], .fold:not(:has(> [open])) *"));
    for (const fold of closed) fold.open = true;
  });
  window.addEventListener("afterprint", () => closed.forEach((fold) => { fold.open = false; }));

  const box = document.querySelector(".filter");
  const field = box.querySelector("input");
  const choices = [...box.querySelectorAll("select")];
  const rows = [...document.querySelectorAll(".findings tbody tr")];
  const chapters = rows.map((row) => row.closest(".group").dataset.chapter);
  const words = rows.map((row) => `${row.id} ${row.textContent}`.toLowerCase());
  const title = (row) => [...row.querySelector("th").childNodes].filter((node) => !node.classList?.contains("soft"));
  const names = rows.map((row) => `${row.id} ${title(row).map((node) => node.textContent).join("")}`.toLowerCase());
  const filter = () => {
    const wanted = field.value.toLowerCase().split(/\s+/).filter(Boolean);
    const [chapter, verdict, solver] = choices.map((choice) => choice.value);
    let shown = 0;
    rows.forEach((row, k) => {
      row.hidden = !(wanted.every((word) => words[k].includes(word)) && (!chapter || chapters[k] === chapter)
        && (!verdict || row.dataset.verdict === verdict) && (!solver || names[k].includes(solver.toLowerCase())));
      shown += row.hidden ? 0 : 1;
    });
    for (const group of document.querySelectorAll(".group")) group.hidden = !group.querySelector("tbody tr:not([hidden])");
    box.querySelector("[role=status]").textContent = `${shown} of ${rows.length} findings`;
  };
  const asFilter = () => Object.fromEntries([["text", field.value], ...choices.map((choice) => [choice.dataset.filter, choice.value])].filter(([, value]) => value));
  const setFilter = (values) => {
    field.value = values.text ?? "";
    for (const choice of choices) choice.value = values[choice.dataset.filter] ?? "";
    filter();
  };
  for (const control of [field, ...choices]) {
    control.addEventListener("input", () => { filter(); state.link("findings", asFilter()); });
  }
  box.hidden = false;
  setFilter(state.linked("findings"));
  /* Whoever follows a link to a finding that is filtered away wants to see it. */
  window.addEventListener("hashchange", () => {
    const row = document.getElementById(state.place());
    if (row && row.closest(".findings") && (row.hidden || row.closest(".group").hidden)) setFilter({});
    else if (location.hash.startsWith("#findings?")) setFilter(state.linked("findings"));
    reveal();
  });
  document.documentElement.classList.add("ready");
  if (location.hash) reveal();
})();
