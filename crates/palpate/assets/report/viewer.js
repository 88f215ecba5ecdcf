// The view into space with its slider over time, both motions side by side under one camera.
"use strict";

palpate.viewer = (() => {
  const FOV = 30;
  const live = [];

  const mount = (figure, number) => {
    const scene = palpate.data.scenes[number];
    const canvas = palpate.element("canvas", { role: "img", tabindex: "0" });
    let renderer;
    try {
      renderer = new THREE.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
    } catch (e) {
      // Without a graphics interface the pictures stay.
      figure.append(palpate.element("p", { class: "small" }, "This browser shows nothing in space (WebGL is off); the pictures above stand for it."));
      return null;
    }
    const there = [0, 1].filter((m) => scene.shown.some((f) => f.motions[m]));
    const state = { frame: scene.worst, show: there.length > 1 ? "both" : String(there[0]), surface: true, points: true, timer: null };
    const camera = new THREE.PerspectiveCamera(FOV, 1, 0.001, 1000);
    const world = new THREE.Scene();
    const light = new THREE.DirectionalLight(0xffffff, 1.9);
    camera.add(light);
    world.add(camera, new THREE.AmbientLight(0xffffff, 1.35));
    const controls = new THREE.OrbitControls(camera, canvas);
    controls.enableDamping = false;

    const [lo, hi] = scene.bounds;
    const middle = new THREE.Vector3(...lo.map((v, a) => 0.5 * (v + hi[a])));
    const radius = 0.5 * Math.hypot(...hi.map((v, a) => v - lo[a]));
    const sides = () => (state.show === "both" ? there : [Number(state.show)]);
    const aspect = () => canvas.clientWidth / sides().length / canvas.clientHeight;
    const reset = () => {
      const narrow = Math.atan(Math.tan((FOV * Math.PI) / 360) * Math.min(1, aspect()));
      camera.up.set(...scene.up);
      camera.position.copy(middle).addScaledVector(new THREE.Vector3(...scene.view), (0.98 * radius) / Math.sin(narrow));
      controls.target.copy(middle);
      camera.near = radius * 0.01;
      camera.far = radius * 100;
      controls.update();
    };

    let stage = null;
    const bodies = [null, null];
    const names = palpate.element("div", { class: "names", "aria-hidden": "true" });
    const told = palpate.element("output", { "aria-live": "polite" });

    const render = () => {
      const ratio = Math.min(2, window.devicePixelRatio || 1);
      const [width, height] = [canvas.clientWidth, canvas.clientHeight];
      if (!width || !height || !stage) return;
      renderer.setPixelRatio(ratio);
      renderer.setSize(width, height, false);
      renderer.setScissorTest(true);
      renderer.setClearColor(palpate.ink("paper"), 1);
      const all = sides();
      camera.aspect = width / all.length / height;
      camera.updateProjectionMatrix();
      // The light comes from over the left shoulder.
      light.position.set(-0.4 * radius, 0.8 * radius, radius);
      light.target.position.copy(controls.target);
      palpate.space.thin(stage, camera, width / all.length, height);
      all.forEach((m, k) => {
        const left = Math.round((k * width) / all.length);
        renderer.setViewport(left, 0, width / all.length, height);
        renderer.setScissor(left, 0, width / all.length - (k + 1 < all.length ? 2 : 0), height);
        bodies.forEach((b, n) => b && (b.visible = n === m));
        renderer.render(world, camera);
      });
    };

    const words = () => {
      const f = scene.shown[state.frame];
      const apart = there.map((m) => `${palpate.data.motions[m]} ${palpate.millimetres(scene.rms[m][f.frame])}`);
      return `t = ${f.time.toFixed(4)} s, frame ${f.frame + 1} of ${scene.times.length}; apart: ${apart.join(", ")}`;
    };

    const build = () => {
      const ratio = Math.min(2, window.devicePixelRatio || 1);
      for (const m of [0, 1]) {
        if (bodies[m]) {
          world.remove(bodies[m]);
          palpate.space.dispose(bodies[m]);
        }
        const motion = scene.shown[state.frame].motions[m];
        bodies[m] = motion ? palpate.space.body(scene, motion, state, ratio) : null;
        if (bodies[m]) world.add(bodies[m]);
      }
      told.textContent = words();
      slider.value = state.frame;
      slider.setAttribute("aria-valuetext", `${scene.shown[state.frame].time.toFixed(4)} s`);
      canvas.setAttribute("aria-label", `The simulated body with what was measured. ${words()}. Arrow keys turn it, plus and minus zoom, Home resets.`);
      names.replaceChildren(...sides().map((m) => palpate.element("span", {}, palpate.data.motions[m])));
      render();
    };

    const dress = () => {
      if (stage) {
        world.remove(stage);
        palpate.space.dispose(stage);
      }
      stage = palpate.space.stage(scene, canvas.clientHeight || 400, FOV);
      world.add(stage);
      build();
    };

    const turn = (around, up) => {
      const offset = camera.position.clone().sub(controls.target);
      const axis = camera.up.clone().normalize();
      offset.applyAxisAngle(axis, around);
      const side = axis.clone().cross(offset).normalize();
      const steep = Math.asin(offset.clone().normalize().dot(axis)) + up;
      if (Math.abs(steep) < 1.5) offset.applyAxisAngle(side, -up);
      camera.position.copy(controls.target).add(offset);
      controls.update();
      render();
    };
    const zoom = (factor) => {
      camera.position.sub(controls.target).multiplyScalar(factor).add(controls.target);
      controls.update();
      render();
    };
    canvas.addEventListener("keydown", (e) => {
      const keys = {
        ArrowLeft: () => turn(-0.15, 0), ArrowRight: () => turn(0.15, 0), ArrowUp: () => turn(0, 0.12), ArrowDown: () => turn(0, -0.12),
        "+": () => zoom(0.88), "=": () => zoom(0.88), "-": () => zoom(1.14), Home: () => { reset(); render(); },
      };
      if (keys[e.key] && !e.ctrlKey && !e.metaKey) {
        keys[e.key]();
        e.preventDefault();
      }
    });
    controls.addEventListener("change", render);

    const go = (frame) => {
      state.frame = Math.max(0, Math.min(scene.shown.length - 1, frame));
      build();
    };
    const slider = palpate.element("input", { type: "range", min: 0, max: scene.shown.length - 1, step: 1, value: state.frame, "aria-label": "Time" });
    slider.addEventListener("input", () => go(Number(slider.value)));
    const play = palpate.element("button", { type: "button", "aria-label": "Play" }, "▶ Play");
    const stop = () => {
      clearInterval(state.timer);
      state.timer = null;
      play.textContent = "▶ Play";
    };
    play.addEventListener("click", () => {
      if (state.timer) return stop();
      play.textContent = "❚❚ Pause";
      state.timer = setInterval(() => go((state.frame + 1) % scene.shown.length), 160);
    });
    const select = palpate.element("select", { "aria-label": "Which motions" },
      ...(there.length > 1 ? [palpate.element("option", { value: "both" }, "side by side")] : []),
      ...there.map((m) => palpate.element("option", { value: m }, palpate.data.motions[m])));
    select.addEventListener("change", () => {
      state.show = select.value;
      reset();
      build();
    });
    const box = (key, text) => {
      const input = palpate.element("input", { type: "checkbox", checked: true });
      input.addEventListener("change", () => {
        state[key] = input.checked;
        build();
      });
      return palpate.element("label", {}, input, " " + text);
    };
    const home = palpate.element("button", { type: "button" }, "Reset view");
    home.addEventListener("click", () => {
      reset();
      render();
    });
    const anyDepth = scene.shown.some((f) => f.motions.some((m) => m && m.points.length));
    const end = palpate.millimetres(scene.scale);
    const bar = palpate.element("div", { class: anyDepth ? "bar" : "bar half", role: "img", "aria-label": anyDepth ? `Colours: blue inside by ${end}, grey on the surface, red outside by ${end}` : `Colours: grey at 0, red at ${end}` },
      palpate.element("span", {}, anyDepth ? `−${end} inside` : "0"), palpate.element("i"), palpate.element("span", {}, anyDepth ? `outside +${end}` : end));
    const single = scene.shown.length < 2;
    figure.prepend(palpate.element("div", { class: "viewer" },
      palpate.element("div", { class: "stage" }, canvas, names),
      bar,
      palpate.element("div", { class: "controls" },
        ...(single ? [] : [play, palpate.element("label", { class: "time" }, "Time ", slider)]), told),
      palpate.element("div", { class: "controls" },
        ...(there.length > 1 ? [palpate.element("label", {}, "Show ", select)] : []), box("points", "measured points"), ...(anyDepth ? [box("surface", "residual on the surface")] : []), home)));
    figure.classList.add("drawn");
    reset();
    dress();
    new ResizeObserver(render).observe(canvas);
    const entry = { go, dress, render, state };
    live.push(entry);
    return entry;
  };

  return { mount, live, redraw: () => live.forEach((v) => v.dress()) };
})();
