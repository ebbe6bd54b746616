/* What the tests ask of the page as it stands on the screen. Every function returns JSON. */
window.probes = (() => {
  const name = (element) => {
    if (!element || !element.tagName) return "?";
    const own = element.id ? `#${element.id}` : element.className && element.className.baseVal === undefined
      ? `.${String(element.className).trim().replace(/\s+/g, ".")}` : "";
    return `${element.tagName.toLowerCase()}${own}`;
  };
  const where = (element) => {
    const section = element.closest("section[id]");
    return `${section ? `${section.id}: ` : ""}${name(element.parentElement)} > ${name(element)}`;
  };
  const seen = (element) => element.checkVisibility({ opacityProperty: true, visibilityProperty: true })
    && !element.closest(".unseen");
  const scrolls = (element) => ["auto", "scroll"].includes(getComputedStyle(element).overflowX);
  const scroller = (element) => {
    for (let up = element.parentElement; up; up = up.parentElement) if (scrolls(up)) return up;
    return null;
  };

  /* Elements that reach beyond the right or left edge of the window, unless they lie in a box that scrolls by itself. */
  const overflow = () => {
    const wide = document.documentElement.clientWidth;
    const found = [];
    const root = document.documentElement;
    if (root.scrollWidth > wide) found.push(`the page is ${root.scrollWidth} wide in a window of ${wide}`);
    for (const element of document.body.querySelectorAll("*")) {
      if (!seen(element) || element.matches(".skip") || scroller(element)) continue;
      const box = element.getBoundingClientRect();
      if (box.width && (box.right > wide + 0.5 || box.left < -0.5)) found.push(`${where(element)}: ${box.left} to ${box.right}`);
    }
    return found;
  };

  /* Lines of text as boxes of the letters' height, each cut to the boxes that clip it. */
  const lines = () => {
    const found = [];
    const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    for (let node = walker.nextNode(); node; node = walker.nextNode()) {
      const element = node.parentElement;
      if (!node.data.trim() || element.closest("script, style, noscript, title, desc, option, canvas, math, .skip") || !seen(element)) continue;
      const range = document.createRange();
      range.selectNodeContents(node);
      let clip = { left: -Infinity, right: Infinity, top: -Infinity, bottom: Infinity };
      for (let up = element; up && up !== document.documentElement; up = up.parentElement) {
        if (getComputedStyle(up).overflowX === "visible" || up === document.body) continue;
        const box = up.getBoundingClientRect();
        clip = { left: Math.max(clip.left, box.left), right: Math.min(clip.right, box.right),
          top: Math.max(clip.top, box.top), bottom: Math.min(clip.bottom, box.bottom) };
      }
      for (const box of range.getClientRects()) {
        const height = Math.min(box.height, parseFloat(getComputedStyle(element).fontSize));
        const top = box.top + (box.height - height) / 2 + 0.15 * height;
        const line = { left: Math.max(box.left + 1, clip.left), right: Math.min(box.right - 1, clip.right),
          top: Math.max(top, clip.top), bottom: Math.min(top + 0.7 * height, clip.bottom), element, text: node.data.trim() };
        if (line.right > line.left && line.bottom > line.top) found.push(line);
      }
    }
    return found;
  };

  const overlaps = () => {
    const all = lines().sort((a, b) => a.top - b.top);
    const found = [];
    all.forEach((one, k) => {
      for (let j = k + 1; j < all.length && all[j].top < one.bottom; j += 1) {
        const other = all[j];
        const across = Math.min(one.right, other.right) - Math.max(one.left, other.left);
        const down = Math.min(one.bottom, other.bottom) - other.top;
        if (across > 1 && down > 1) {
          found.push(`${where(one.element)} "${one.text.slice(0, 40)}" over ${where(other.element)} "${other.text.slice(0, 40)}"`);
        }
      }
    });
    return found;
  };

  /* Text that a box cuts off which nobody can scroll. */
  const cut = () => {
    const found = [];
    for (const element of document.body.querySelectorAll("*")) {
      const style = getComputedStyle(element);
      if (style.overflowX !== "hidden" || style.textOverflow === "ellipsis" || !seen(element)) continue;
      if (element.closest("svg, canvas")) continue;
      if (element.scrollWidth > element.clientWidth + 1) found.push(where(element));
    }
    return found;
  };

  const interactive = () => [...document.querySelectorAll(
    "a[href], button, input, select, textarea, summary, [tabindex]",
  )].filter((element) => element.tabIndex >= 0 && !element.disabled && element.checkVisibility({ visibilityProperty: true }));

  /* Note every element the focus comes to, and whether the eye can tell. */
  const watchFocus = () => {
    const reached = new Map();
    document.addEventListener("focusin", ({ target }) => {
      const style = getComputedStyle(target);
      const shown = (style.outlineStyle !== "none" && parseFloat(style.outlineWidth) >= 2) || style.boxShadow !== "none";
      reached.set(target, shown && target.matches(":focus-visible") && parseFloat(style.opacity) > 0.5);
    });
    window.probes.reached = reached;
    return interactive().length;
  };
  const focusReport = () => ({
    missed: interactive().filter((element) => !window.probes.reached.has(element)).map(where),
    unseen: [...window.probes.reached].filter(([, shown]) => !shown).map(([element]) => where(element)),
  });

  /* Words of the text that begins above a line so many pixels down; drawings and mathematics have none. */
  const wordsAbove = (line) => {
    const walker = document.createTreeWalker(document.querySelector("main"), NodeFilter.SHOW_TEXT), place = document.createRange();
    let count = 0;
    while (walker.nextNode()) {
      const text = walker.currentNode;
      if (text.parentElement.closest("script, style, noscript, svg, math")) continue;
      place.selectNodeContents(text);
      const box = place.getBoundingClientRect();
      if (box.height && box.top + scrollY < line) count += text.textContent.split(/\s+/).filter(Boolean).length;
    }
    return count;
  };

  return { wordsAbove, overflow, overlaps, cut, watchFocus, focusReport };
})();
