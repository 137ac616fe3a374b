// Names and roles for screen readers, where the theme has none or others than those that are seen.
document.addEventListener("DOMContentLoaded", () => {
  const each = (selector, change) => document.querySelectorAll(selector).forEach(change);
  each("button.search-button-field, summary[aria-label='Toggle hidden content']", (element) =>
    element.removeAttribute("aria-label"));
  each("button.theme-switch-button", (button) =>
    button.setAttribute("aria-label", "Color mode: Light, Dark, System Settings"));
  each("li.has-children > details > summary", (summary) => {
    const above = summary.closest("li").querySelector("a").textContent.trim();
    summary.setAttribute("aria-label", `Pages below ${above}`);
  });
  each(".citation-list[role='list']", (list) => list.removeAttribute("role"));
});
