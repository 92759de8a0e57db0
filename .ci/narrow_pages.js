// What a reader of a screen of this width would miss in the page, as pairs of kind and text.
(width => {
  const found = new Map();
  const add = (kind, text) => found.set(`${kind} ${text}`, [kind, text]);
  const named = e => {
    const classes = typeof e.className === "string" && e.className.trim();
    const text = e.textContent.trim().replace(/\s+/g, " ").slice(0, 40);
    return `${e.tagName.toLowerCase()}${classes ? "." + classes.split(/\s+/).join(".") : ""} '${text}'`;
  };

  const words = (text, e) => {
    const range = document.createRange();
    for (const word of text.data.matchAll(/[\p{L}\p{N}_]{2,}/gu)) {
      range.setStart(text, word.index);
      range.setEnd(text, word.index + word[0].length);
      const tops = [...range.getClientRects()].filter(box => box.width).map(box => box.top);
      if (Math.max(...tops) - Math.min(...tops) > 4) add("broken", `${word[0]} in ${named(e)}`);
    }
  };

  const walk = (e, inside) => {
    const style = getComputedStyle(e), box = e.getBoundingClientRect();
    const hidden = style.display === "none" || style.visibility === "hidden";
    const apart = style.position === "fixed";  // menus outside of the screen
    const unseen = style.clipPath !== "none" || style.clip !== "auto";  // texts for screen readers
    if (hidden || apart || unseen || ["SCRIPT", "STYLE", "OPTION"].includes(e.tagName)) return;
    if (!inside && box.width && (box.right > width + 1 || box.left < -1)) return add("beyond", named(e));
    if (!e.namespaceURI.endsWith("xhtml")) return;  // drawings and formulas hold together
    if (e !== document.body && e.scrollWidth > e.clientWidth + 1) {
      if (["auto", "scroll"].includes(style.overflowX)) {
        inside = true;
        if (!style.backgroundImage.includes("gradient")) add("no cue", named(e));
      } else if (e.clientWidth && style.overflowX === "hidden") add("cut", named(e));
    }
    for (const child of e.childNodes) {
      if (child.nodeType === Node.ELEMENT_NODE) walk(child, inside);
      if (child.nodeType === Node.TEXT_NODE) words(child, e);
    }
  };

  for (const each of document.querySelectorAll("details")) each.open = true;
  const whole = document.documentElement.scrollWidth;
  if (whole > width) add("beyond", `the page is ${whole} px wide`);
  walk(document.body, false);
  return [...found.values()];
})
