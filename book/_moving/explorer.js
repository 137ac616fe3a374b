/* Figures that follow sliders. The data stand in the page, in the form that the module
   acx4book.typesetting.moving describes; here they are only multiplied and drawn. */
"use strict";

(() => {
  const HEAD = 6; // px, as in the module

  /* What depends on the sliders: a matrix times their values, or the row of their stops. */
  function respond({ matrix, stops }, values, sliders) {
    const at = (rows, { low, step }, i) => rows[rows.length > 1 ? Math.round((values[i] - low) / step) : 0];
    return stops ? sliders.reduce(at, stops) : matrix.map((row) => row.reduce((sum, x, j) => sum + x * values[j], 0));
  }

  const point = ([x, y]) => `${x.toFixed(2)} ${y.toFixed(2)}`;

  function arrow([x, y], [toX, toY]) {
    const dx = toX - x, dy = toY - y, length = Math.hypot(dx, dy);
    if (length === 0) return "";
    const back = Math.min(HEAD, length / 2) / length;
    const ax = 0.9 * back * dx, ay = 0.9 * back * dy, bx = -0.42 * back * dy, by = 0.42 * back * dx;
    const ends = [[toX - ax + bx, toY - ay + by], [toX, toY], [toX - ax - bx, toY - ay - by]];
    return `M${point([x, y])}L${point([toX, toY])}M${ends.map(point).join("L")}`;
  }

  /* The path of a mark, as SVG writes it. */
  function path({ kind, at, scale, response }, values, sliders) {
    const moved = respond(response, values, sliders);
    const starts = Array.from({ length: moved.length / 2 }, (_, i) => at[at.length > 1 ? i : 0]);
    const places = starts.map(([x, y], i) => [x + scale[0] * moved[2 * i], y + scale[1] * moved[2 * i + 1]]);
    if (kind === "curve") return `M${places.map(point).join("L")}`;
    return places.map((place, i) => arrow(starts[i], place)).join("");
  }

  /* A number as it is shown: zero has no sign, and a minus is one. */
  function written(number, digits) {
    const text = number.toFixed(digits);
    return (Number(text) ? text : text.replace("-", "")).replace("-", "\u2212");
  }

  const reading = (response) => (response.length === 1 ? response[0] : Math.hypot(...response));

  function element(name, properties, ...children) {
    const made = Object.assign(document.createElement(name), properties);
    made.append(...children);
    return made;
  }

  /* A slider with its name and its value. */
  function row(slider, id, changed) {
    const { name, after, low, high, step, digits } = slider;
    const input = element("input", { type: "range", id, min: low, max: high, step, oninput: changed });
    const output = element("output", {});
    output.htmlFor.add(id);
    output.setAttribute("aria-live", "off"); // the slider says its value itself
    const show = () => {
      output.textContent = `${written(input.valueAsNumber, digits)}${after}`;
      input.setAttribute("aria-valuetext", output.textContent);
    };
    return { input, show, shown: [element("label", { htmlFor: id }, name), input, output] };
  }

  /* Put sliders under a figure, and let it follow them. */
  function connect(figure) {
    const data = JSON.parse(figure.querySelector("script").textContent);
    const marks = [...figure.querySelectorAll(".panel")].map((p) => [...p.querySelectorAll(".marks path")]);
    const cells = [...figure.querySelectorAll("tbody tr")].map((r) => [...r.querySelectorAll("td")]);
    const { sliders } = data;

    function draw() {
      const values = rows.map(({ input }) => input.valueAsNumber);
      rows.forEach(({ show }) => show());
      data.panels.forEach((panel, i) =>
        panel.forEach((mark, j) => marks[i][j].setAttribute("d", path(mark, values, sliders))));
      data.rows.forEach((responses, i) => responses.forEach((response, j) => {
        const text = written(reading(respond(response, values, sliders)), data.digits[j]);
        if (cells[i][j].textContent !== text) cells[i][j].textContent = text;
      }));
    }

    const rows = data.sliders.map((slider, i) => row(slider, `${figure.id}-${i}`, draw));
    const set = (values) => {
      rows.forEach(({ input }, i) => { input.value = values[i]; });
      draw();
    };
    const buttons = data.presets.map(({ name, values }) =>
      element("button", { type: "button", onclick: () => set(values) }, name));
    figure.querySelector(".sliders").replaceChildren(
      ...rows.flatMap(({ shown }) => shown), element("div", { className: "presets" }, ...buttons));
    figure.classList.add("moves");
    set(data.presets[0].values);
  }

  document.querySelectorAll("figure.acx4-explorer").forEach(connect);
})();
