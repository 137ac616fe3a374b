/* Figures that follow sliders. The data stand in the page, in the form that the module
   acx4book.typesetting.moving describes; here they are only multiplied and drawn. */
"use strict";

(() => {
  const HEAD = 6, BAR = 12; // px, as in the module plane

  /* What depends on the sliders: a matrix times their values, the row of their stops, or at a stop
     of the first the roots of sums of squares, in which the first counts as one. */
  function respond({ constant, matrix, stops, roots }, values, sliders) {
    const at = (rows, { min, step }, i) => rows[rows.length > 1 ? Math.round((values[i] - min) / step) : 0];
    if (stops) return sliders.reduce(at, stops);
    if (roots) return at(roots, sliders[0], 0).map((row) => Math.hypot(...row.map((x, j) => x * (j ? values[j] : 1))));
    return matrix.map((row, i) => row.reduce((sum, x, j) => sum + x * values[j], constant[i]));
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

  const bar = ([x, y], [toX]) => {
    const width = [x, y - BAR / 2].map((v) => v.toFixed(2)).join(" ");
    return `M${width}H${toX.toFixed(2)}v${BAR.toFixed(2)}H${x.toFixed(2)}z`;
  };

  const dot = (_, [x, y]) => {
    const r = BAR / 2, half = `a${r.toFixed(2)} ${r.toFixed(2)} 0 1 0`;
    return `M${point([x - r, y])}${half} ${BAR.toFixed(2)} 0${half} ${(-BAR).toFixed(2)} 0z`;
  };

  const shapes = { arrows: arrow, bars: bar, dots: dot };

  /* The path of a mark, as SVG writes it. */
  function path({ kind, at, scale, response }, values, sliders) {
    const moved = respond(response, values, sliders);
    const places = at.map(([x, y], i) => [x + scale[0] * moved[2 * i], y + scale[1] * moved[2 * i + 1]]);
    if (kind === "curve") return `M${places.map(point).join("L")}`;
    return places.map((place, i) => shapes[kind](at[i], place)).join("");
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
    const { name, after, min, max, step, digits } = slider;
    const input = element("input", { type: "range", id, min, max, step, oninput: changed });
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
