/* A scene in space that the reader turns. The data stand in the page, in the form that the module
   acx4book.typesetting.moving.scene describes. Bundled with three.js into one script. */
import {
  AmbientLight, BufferGeometry, DirectionalLight, Float32BufferAttribute, InstancedMesh, LineBasicMaterial,
  LineSegments, Matrix4, MeshLambertMaterial, PerspectiveCamera, Points, PointsMaterial, Scene, Sphere,
  SphereGeometry, Spherical, Vector3, WebGLRenderer,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

const STEP = Math.PI / 18; // of the buttons and the arrow keys
const NEARER = 0.8;
const FIELD_OF_VIEW_DEG = 35;

function element(name, properties, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

/* The object of a layer; its z is up, as in the data. */
function object({ kind, at, axes, size }) {
  if (kind === "ellipsoids") {
    const sphere = new SphereGeometry(1, 20, 14);
    const drawn = new InstancedMesh(sphere, new MeshLambertMaterial(), at.length / 3);
    for (let i = 0; i < drawn.count; i += 1) {
      const [a, b, c] = [0, 3, 6].map((k) => new Vector3().fromArray(axes, 9 * i + k));
      if (a.clone().cross(b).dot(c) < 0) c.negate(); // else it is turned inside out
      drawn.setMatrixAt(i, new Matrix4().makeBasis(a, b, c).setPosition(...at.slice(3 * i, 3 * i + 3)));
    }
    return drawn;
  }
  const geometry = new BufferGeometry().setAttribute("position", new Float32BufferAttribute(at, 3));
  if (kind === "lines") return new LineSegments(geometry, new LineBasicMaterial());
  return new Points(geometry, new PointsMaterial({ size: size * window.devicePixelRatio, sizeAttenuation: false }));
}

/* Whether two names would overlap. */
const meet = (a, b) =>
  Math.abs(a.x - b.x) < (a.width + b.width) / 2 && Math.abs(a.y - b.y) < (a.height + b.height) / 2;

class View {
  constructor(figure, renderer) {
    const { from, layers } = JSON.parse(figure.querySelector("script").textContent);
    Object.assign(this, { figure, renderer, layers });
    this.scene = new Scene();
    this.objects = layers.map(object);
    this.scene.add(...this.objects, new AmbientLight(0xffffff, 1.6));
    this.sun = new DirectionalLight(0xffffff, 2);
    this.scene.add(this.sun);
    const points = new Float32BufferAttribute(layers.flatMap(({ at }) => at), 3);
    this.radius = new Sphere().setFromPoints(
      Array.from({ length: points.count }, (_, i) => new Vector3().fromBufferAttribute(points, i)),
      new Vector3()).radius;
    this.camera = new PerspectiveCamera(FIELD_OF_VIEW_DEG, 1, this.radius / 100, this.radius * 20);
    this.camera.up.set(0, 0, 1);
    this.start = new Vector3(...from);
    this.place();
    this.controls();
    this.colour();
  }

  /* The view as at the start: from the side that the drawing has. */
  place() {
    const distance = this.radius / Math.sin((FIELD_OF_VIEW_DEG * Math.PI) / 360);
    this.camera.position.copy(this.start).multiplyScalar(0.88 * distance);
    this.orbit?.target.set(0, 0, 0);
  }

  controls() {
    const { figure, renderer } = this;
    const canvas = renderer.domElement;
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", figure.querySelector("svg").getAttribute("aria-label"));
    this.labels = this.layers.flatMap(({ labels, at }, layer) => labels.map((text, i) => ({
      layer, place: new Vector3().fromArray(at, 3 * i), shown: element("span", { textContent: text, ariaHidden: "true" }),
    })));
    figure.querySelector(".view").append(canvas, ...this.labels.map(({ shown }) => shown)); // the drawing is printed
    for (const label of this.labels) {
      label.size = { width: label.shown.offsetWidth, height: label.shown.offsetHeight };
    }
    this.orbit = new OrbitControls(this.camera, canvas);
    this.orbit.addEventListener("change", () => this.draw());
    this.orbit.enableZoom = false; // the wheel scrolls the page until the view has the focus
    canvas.addEventListener("focus", () => { this.orbit.enableZoom = true; });
    canvas.addEventListener("blur", () => { this.orbit.enableZoom = false; });
    canvas.style.touchAction = "pan-y";
    canvas.addEventListener("keydown", (event) => this.key(event));
    const buttons = [
      ["turn left", () => this.turn(-STEP, 0)], ["turn right", () => this.turn(STEP, 0)],
      ["higher", () => this.turn(0, -STEP)], ["lower", () => this.turn(0, STEP)],
      ["nearer", () => this.turn(0, 0, NEARER)], ["farther", () => this.turn(0, 0, 1 / NEARER)],
      ["as at the start", () => { this.place(); this.orbit.update(); this.draw(); }],
    ].map(([textContent, onclick]) => element("button", { type: "button", textContent, onclick }));
    figure.querySelectorAll(".layers li").forEach((item, i) => {
      const show = ({ target }) => { this.objects[i].visible = target.checked; this.draw(); };
      const box = element("input", { type: "checkbox", checked: true, onchange: show });
      item.replaceChildren(element("label", {}, box, " ", ...item.childNodes));
    });
    figure.querySelector(".layers").before(element("div", { className: "turns" }, ...buttons));
    figure.classList.add("moves");
    new ResizeObserver(() => this.resize()).observe(figure.querySelector(".view"));
    new MutationObserver(() => this.colour()).observe(
      document.documentElement, { attributeFilter: ["data-theme"] });
  }

  /* Move the eye around the middle: by angles to the right and down, and a factor of the distance. */
  turn(right, down, factor = 1) {
    const { camera, orbit } = this;
    const eye = camera.position.clone().sub(orbit.target);
    const yUp = new Spherical().setFromCartesianCoords(eye.x, eye.z, -eye.y);
    yUp.theta += right;
    yUp.phi = Math.min(Math.max(yUp.phi + down, 0.02), Math.PI - 0.02);
    yUp.radius *= factor;
    const moved = new Vector3().setFromSpherical(yUp);
    camera.position.set(moved.x, -moved.z, moved.y).add(orbit.target);
    orbit.update();
    this.draw();
  }

  key(event) {
    const { key } = event;
    const turns = {
      ArrowLeft: [-STEP, 0], ArrowRight: [STEP, 0], ArrowUp: [0, -STEP], ArrowDown: [0, STEP],
      "+": [0, 0, NEARER], "-": [0, 0, 1 / NEARER],
    };
    if (!(key in turns)) return;
    event.preventDefault();
    this.turn(...turns[key]);
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.figure.querySelector(".view");
    this.renderer.setPixelRatio(window.devicePixelRatio);
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    // a narrow window sees as much to the sides as a wide one upwards
    this.camera.zoom = Math.min(1, this.camera.aspect / 1.3);
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  /* Colours are those of the page, which may become dark. */
  colour() {
    const style = getComputedStyle(this.figure);
    this.objects.forEach(({ material }, i) =>
      material.color.set(style.getPropertyValue(`--figure-${this.layers[i].colour}`).trim()));
    this.draw();
  }

  draw() {
    const { scene, camera, renderer } = this;
    this.sun.position.copy(camera.position);
    renderer.render(scene, camera);
    const { clientWidth: width, clientHeight: height } = renderer.domElement;
    const named = [];
    const nearestFirst = this.labels.map((label) => ({ ...label, seen: label.place.clone().project(camera) }))
      .sort((a, b) => a.seen.z - b.seen.z);
    for (const { shown, seen, layer, size } of nearestFirst) {
      const box = { x: ((1 + seen.x) * width) / 2, y: ((1 - seen.y) * height) / 2, ...size };
      shown.style.left = `${box.x}px`;
      shown.style.top = `${box.y}px`;
      shown.hidden = !this.objects[layer].visible || Math.max(Math.abs(seen.x), Math.abs(seen.y)) > 1
        || named.some((other) => meet(box, other));
      if (!shown.hidden) named.push(box);
    }
  }
}

/* Begin when a figure comes near; without WebGL the drawing stays. */
const near = new IntersectionObserver((entries) => entries.forEach(({ isIntersecting, target }) => {
  if (!isIntersecting) return;
  near.unobserve(target);
  const canvas = document.createElement("canvas");
  const context = canvas.getContext("webgl2", { alpha: true, antialias: true });
  if (context) new View(target, new WebGLRenderer({ canvas, context, alpha: true }));
}), { rootMargin: "300px" });
document.querySelectorAll("figure.acx4-block").forEach((figure) => near.observe(figure));
