// What is wider than its box scrolls there: the keyboard can reach it, and scrolling.css says so.
(() => {
  const BOXES = [
    "div.math",
    "div.drawing",
    "div.pst-scrollable-table-container",
    "div.cell_output .output",
    "div.highlight pre",
  ].map((box) => `.bd-article ${box}`).join(", ");

  const mark = () => {
    for (const box of document.querySelectorAll(BOXES)) {
      const scrolls = box.scrollWidth > box.clientWidth + 1;
      box.toggleAttribute("data-scrolls", scrolls);
      if (scrolls) box.tabIndex = 0;
    }
  };

  window.addEventListener("load", mark);
  document.addEventListener("DOMContentLoaded", () => {
    const article = document.querySelector(".bd-article");
    if (article) new ResizeObserver(mark).observe(article); // formulas come later, windows change
    document.fonts.ready.then(mark);
  });
})();
