/* A scene in space that the reader turns, drawn on a canvas. The data stand in the page, in the form
   that the module acx4book.typesetting.moving describes. */
"use strict";

(() => {
  const STEP = Math.PI / 18, NEARER = 0.8; // of the buttons and the keys
  const HALF_FIELD = (17.5 * Math.PI) / 180; // of view
  const DRAG = 0.008; // radians for a px

  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

  function element(name, properties, ...children) {
    const made = Object.assign(document.createElement(name), properties);
    made.append(...children);
    return made;
  }

  /* Whether two names would overlap. */
  const meet = (a, b) =>
    Math.abs(a.x - b.x) < (a.width + b.width) / 2 && Math.abs(a.y - b.y) < (a.height + b.height) / 2;

  function turning(figure) {
    const data = JSON.parse(figure.querySelector("script").textContent);
    const layers = data.layers.map((one) => ({ ...one, visible: true }));
    const radius = Math.max(...layers.flatMap(({ at }) => at.map((p) => Math.hypot(...p))));
    const start = {
      around: Math.atan2(data.from[1], data.from[0]), above: Math.asin(data.from[2]),
      away: (0.82 * radius) / Math.sin(HALF_FIELD),
    };
    let view = { ...start }; // of the eye: azimuth, elevation, distance from the middle
    const canvas = element("canvas", { tabIndex: 0 });
    const pen = canvas.getContext("2d");
    const box = figure.querySelector(".view");
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", box.querySelector("svg").getAttribute("aria-label"));
    const labels = layers.flatMap((layer) => layer.labels.map((text, i) => (
      { layer, at: layer.at[i], shown: element("span", { textContent: text, ariaHidden: "true" }) })));
    box.append(canvas, ...labels.map(({ shown }) => shown)); // the drawing is printed
    labels.forEach((label) => {
      label.size = { width: label.shown.offsetWidth, height: label.shown.offsetHeight };
    });

    /* Where the eye has a point on the canvas, px, how far it is away, and px in a metre there. */
    function eye() {
      const [ca, sa, ce, se] = [Math.cos(view.around), Math.sin(view.around), Math.cos(view.above), Math.sin(view.above)];
      const right = [-sa, ca, 0], up = [-se * ca, -se * sa, ce], back = [ce * ca, ce * sa, se];
      const { clientWidth: width, clientHeight: height } = box;
      const focal = Math.min(height, width / 1.3) / 2 / Math.tan(HALF_FIELD);
      return {
        seen(point) {
          const far = view.away - dot(back, point), scale = focal / far;
          return { x: width / 2 + scale * dot(right, point), y: height / 2 - scale * dot(up, point), far, scale };
        },
      };
    }

    const draws = {
      lines: ({ at }, { seen }) => at.flatMap((point, i) => {
        if (i % 2) return [];
        const [a, b] = [seen(point), seen(at[i + 1])];
        return [{ far: Math.max(a.far, b.far), near: Math.min(a.far, b.far), draw() {
          pen.beginPath();
          pen.moveTo(a.x, a.y);
          pen.lineTo(b.x, b.y);
          pen.stroke();
        } }];
      }),
      points: ({ at, size }, { seen }) => at.map((point) => {
        const { x, y, far } = seen(point);
        const corner = (z) => Math.round(z - size / 2);
        return { far, near: far, draw: () => pen.fillRect(corner(x), corner(y), size, size) };
      }),
    };

    /* What is far is drawn first; what is behind the eye is not. */
    function draw() {
      const style = getComputedStyle(figure), ratio = window.devicePixelRatio, from = eye();
      const { clientWidth: width, clientHeight: height } = box;
      if (canvas.width !== Math.round(ratio * width)) canvas.width = Math.round(ratio * width);
      if (canvas.height !== Math.round(ratio * height)) canvas.height = Math.round(ratio * height);
      pen.setTransform(ratio, 0, 0, ratio, 0, 0);
      pen.clearRect(0, 0, width, height);
      layers.filter(({ visible }) => visible)
        .flatMap((layer) => {
          const colour = style.getPropertyValue(`--figure-${layer.colour}`).trim();
          return draws[layer.kind](layer, from).map((one) => ({ ...one, colour }));
        })
        .filter(({ near }) => near > radius / 100)
        .sort((a, b) => b.far - a.far)
        .forEach((one) => {
          pen.strokeStyle = pen.fillStyle = one.colour;
          one.draw();
        });
      name(from, width, height);
    }

    /* Of names that would overlap, the nearest is shown. */
    function name({ seen }, width, height) {
      const named = [];
      labels.map((label) => ({ ...label, place: seen(label.at) })).sort((a, b) => a.place.far - b.place.far)
        .forEach(({ shown, layer, size, place: { x, y, far } }) => {
          const area = { x, y, ...size };
          shown.style.left = `${x}px`;
          shown.style.top = `${y}px`;
          shown.hidden = !layer.visible || far <= 0 || x < 0 || y < 0 || x > width || y > height
            || named.some((other) => meet(area, other));
          if (!shown.hidden) named.push(area);
        });
    }

    /* Move the eye around the middle: to its right, up, and by a factor of the distance. */
    function turn(right, up, factor = 1) {
      const above = Math.min(Math.max(view.above + up, -1.55), 1.55);
      view = { around: view.around + right, above, away: view.away * factor };
      draw();
    }

    const turns = {
      ArrowLeft: ["turn left", -STEP, 0], ArrowRight: ["turn right", STEP, 0], ArrowUp: ["higher", 0, STEP],
      ArrowDown: ["lower", 0, -STEP], "+": ["nearer", 0, 0, NEARER], "-": ["farther", 0, 0, 1 / NEARER],
    };
    const button = (textContent, onclick) => element("button", { type: "button", textContent, onclick });
    const buttons = Object.values(turns).map(([text, ...by]) => button(text, () => turn(...by)));
    const again = button("as at the start", () => { view = { ...start }; draw(); });
    figure.querySelector(".layers").before(element("div", { className: "turns" }, ...buttons, again));
    canvas.addEventListener("keydown", (event) => {
      if (!(event.key in turns)) return;
      event.preventDefault();
      turn(...turns[event.key].slice(1));
    });

    let held = null; // the pointer that turns it
    canvas.addEventListener("pointerdown", (event) => {
      held = event;
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (held?.pointerId !== event.pointerId) return;
      turn(DRAG * (held.clientX - event.clientX), DRAG * (event.clientY - held.clientY));
      held = event;
    });
    ["pointerup", "pointercancel"].forEach((kind) => canvas.addEventListener(kind, () => { held = null; }));

    figure.querySelectorAll(".layers li").forEach((item, i) => {
      const onchange = ({ target }) => { layers[i].visible = target.checked; draw(); };
      const switched = element("input", { type: "checkbox", checked: true, onchange });
      item.replaceChildren(element("label", {}, switched, " ", ...item.childNodes));
    });
    figure.classList.add("moves");
    new ResizeObserver(draw).observe(box);
    new MutationObserver(draw).observe(document.documentElement, { attributeFilter: ["data-theme"] });
  }

  document.querySelectorAll("figure.acx4-block").forEach(turning);
})();
