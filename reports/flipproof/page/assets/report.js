"use strict";
/* What survives a reload: in the address, as #place?name=value, and, for what is open, in the entry of the history. */
window.flipproofState = (() => {
  const asked = () => location.hash.slice(1).split("?");
  return {
    place: () => decodeURIComponent(asked()[0]),
    linked: (place) => Object.fromEntries(asked()[0] === place ? new URLSearchParams(asked()[1] ?? "") : []),
    link: (place, values) => {
      const text = new URLSearchParams(values).toString();
      history.replaceState(history.state, "", `#${place}${text && `?${text}`}`);
    },
    kept: (name) => history.state?.[name],
    keep: (name, value) => history.replaceState({ ...history.state, [name]: value }, "", location.hash || undefined),
  };
})();
/* Contents that say where the reader is, a filter for the findings, and no idle stops for the keyboard.
   The page is whole without it. */
(() => {
  const rail = document.querySelector(".rail");
  const button = rail.querySelector("button");
  const links = new Map([...rail.querySelectorAll("a")].map((link) => [link.hash.slice(1), link]));

  const open = (state) => {
    rail.classList.toggle("open", state);
    button.setAttribute("aria-expanded", String(state));
  };
  button.addEventListener("click", () => open(!rail.classList.contains("open")));
  rail.addEventListener("click", (event) => { if (event.target.closest("a")) open(false); });
  rail.addEventListener("keydown", (event) => {
    if (event.key === "Escape" && rail.classList.contains("open")) { open(false); button.focus(); }
  });

  /* The current section is the first, in the order of the page, that crosses a line a third down the window. */
  const sections = [...links.keys()].map((id) => document.getElementById(id));
  const crossing = new Set();
  const mark = () => {
    const current = sections.findLast((section) => crossing.has(section));
    if (!current) return;
    for (const [id, link] of links) {
      if (id === current.id) link.setAttribute("aria-current", "location");
      else link.removeAttribute("aria-current");
    }
    const link = links.get(current.id);
    rail.querySelector(".here").textContent = link.textContent;
    if (rail.scrollHeight > rail.clientHeight) {
      const place = link.offsetTop - rail.clientHeight / 2;
      rail.scrollTo({ top: place, behavior: "instant" });
    }
  };
  const watcher = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      if (entry.isIntersecting) crossing.add(entry.target);
      else crossing.delete(entry.target);
    }
    mark();
  }, { rootMargin: "-30% 0px -69% 0px" });
  sections.forEach((section) => watcher.observe(section));

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
  /* A slider finer than a finger wants has a coarser step for the arrow keys. */
  for (const slider of document.querySelectorAll("input[data-keys]")) {
    slider.addEventListener("keydown", (event) => {
      const way = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 }[event.key];
      if (!way) return;
      event.preventDefault();
      slider.value = String(Number(slider.value) + way * Number(slider.dataset.keys));
      slider.dispatchEvent(new Event("input", { bubbles: true }));
    });
  }
  document.documentElement.classList.add("ready");
  if (location.hash) reveal();

  /* What does not scroll need not be stopped at by those who go from place to place with the keyboard. */
  const scrollers = new ResizeObserver((entries) => {
    for (const { target } of entries) {
      const scroller = target.closest(".scroll");
      if (scroller.scrollWidth > scroller.clientWidth + 1) scroller.tabIndex = 0;
      else scroller.removeAttribute("tabindex");
    }
  });
  for (const scroller of document.querySelectorAll(".scroll")) {
    scrollers.observe(scroller);
    if (scroller.firstElementChild) scrollers.observe(scroller.firstElementChild);
  }
})();
