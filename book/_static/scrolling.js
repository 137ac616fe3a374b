// What is wider than its box scrolls there: the keyboard can reach it, and scrolling.css says so.
(() => {
  const BOXES = [
    "div.math",
    "div.drawing",
    "div.pst-scrollable-table-container",
    "div.readings",
    "div.cell_output .output",
    "div.highlight pre",
  ].map((box) => `.bd-article ${box}`).join(", ");

  // A mark takes place itself, and could end what it says: it stays until the window changes.
  const mark = () => {
    for (const box of document.querySelectorAll(BOXES)) {
      if (box.scrollWidth <= box.clientWidth + 1) continue;
      box.toggleAttribute("data-scrolls", true);
      box.tabIndex = 0;
    }
  };
  const begin = () => {
    document.querySelectorAll("[data-scrolls]").forEach((box) => box.removeAttribute("data-scrolls"));
    mark();
  };

  window.addEventListener("load", mark);
  window.addEventListener("resize", begin);
  document.addEventListener("DOMContentLoaded", () => {
    const changed = new ResizeObserver(mark); // formulas come later
    const parts = `.bd-article, .bd-article table, ${BOXES}`; // a table grows with its formulas
    document.querySelectorAll(parts).forEach((part) => changed.observe(part));
    document.fonts.ready.then(mark);
  });
})();
