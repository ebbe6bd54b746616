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
/* Contents that say where the reader is, and no idle stops for the keyboard. The page is whole without it. */
(() => {
  const rail = document.querySelector(".rail");
  const button = rail.querySelector("button");
  const links = new Map([...rail.querySelectorAll("a[href^='#']")].map((link) => [link.hash.slice(1), link]));

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

  /* What does not scroll need not be stopped at by those who go from place to place with the keyboard. */
  const scrollers = new ResizeObserver((entries) => {
    for (const { target } of entries) {
      const scroller = target.closest(".scroll");
      if (scroller.scrollWidth > scroller.clientWidth + 1) scroller.tabIndex = 0;
      else scroller.removeAttribute("tabindex");
    }
  });
  window.addEventListener("load", () => {
    for (const scroller of document.querySelectorAll(".scroll")) {
      scrollers.observe(scroller);
      if (scroller.firstElementChild) scrollers.observe(scroller.firstElementChild);
    }
  });
})();
