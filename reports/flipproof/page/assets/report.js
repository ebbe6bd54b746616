"use strict";
/* Contents that say where the reader is, a filter for the findings, and no idle stops for the keyboard.
   The page is whole without it. */
(() => {
  document.documentElement.classList.add("scripted");
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

  const box = document.querySelector(".filter");
  const field = box.querySelector("input");
  const rows = [...document.querySelectorAll(".findings tbody tr")];
  const folds = [...document.querySelectorAll("#findings details")];
  const words = rows.map((row) => `${row.id} ${row.textContent}`.toLowerCase());
  const filter = () => {
    const wanted = field.value.toLowerCase().split(/\s+/).filter(Boolean);
    let shown = 0;
    rows.forEach((row, k) => {
      row.hidden = !wanted.every((word) => words[k].includes(word));
      shown += row.hidden ? 0 : 1;
    });
    folds.forEach((fold) => { fold.open = fold.open || wanted.length > 0; });
    box.querySelector("[role=status]").textContent = `${shown} of ${rows.length} findings`;
  };
  field.addEventListener("input", filter);
  box.hidden = false;
  filter();
  /* Whoever follows a link to a finding that is filtered away wants to see it. */
  window.addEventListener("hashchange", () => {
    const row = document.getElementById(decodeURIComponent(location.hash.slice(1)));
    if (row && row.hidden) { field.value = ""; filter(); row.scrollIntoView(); }
  });

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
