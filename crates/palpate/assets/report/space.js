// What stands in space: the body coloured by its residual, measured points, floor, axes. three.js draws it.
"use strict";

palpate.space = (() => {
  const linear = (rgb) => new THREE.Color().setRGB(rgb[0] / 255, rgb[1] / 255, rgb[2] / 255, THREE.SRGBColorSpace);

  const colours = (values, of) => {
    const out = new Float32Array(values.length * 3);
    values.forEach((v, k) => linear(of(v)).toArray(out, 3 * k));
    return out;
  };

  // A text that always faces whoever looks, so many pixels high in a view of `height` pixels.
  const label = (text, pixels, height, fov) => {
    const size = 48;
    const canvas = document.createElement("canvas");
    const pen = canvas.getContext("2d");
    const font = `${size}px system-ui, sans-serif`;
    pen.font = font;
    canvas.width = Math.ceil(pen.measureText(text).width) + 8;
    canvas.height = Math.ceil(size * 1.3);
    pen.font = font;
    pen.fillStyle = palpate.ink("ink");
    pen.textBaseline = "middle";
    pen.fillText(text, 4, canvas.height / 2);
    const map = new THREE.CanvasTexture(canvas);
    map.colorSpace = THREE.SRGBColorSpace;
    const sprite = new THREE.Sprite(new THREE.SpriteMaterial({ map, sizeAttenuation: false, depthTest: false }));
    const unit = (2 * Math.tan((fov * Math.PI) / 360) * pixels * 1.3) / height;
    sprite.scale.set((unit * canvas.width) / canvas.height, unit, 1);
    sprite.userData.first = false;
    sprite.userData.size = [(pixels * 1.3 * canvas.width) / canvas.height, pixels * 1.3];
    return sprite;
  };

  const segments = (points, colour, opacity) => {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(points), 3));
    return new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: new THREE.Color(colour), transparent: true, opacity }));
  };

  // Floor and axes with marks in millimetres, as the pictures that Rust draws have them.
  const stage = (scene, height, fov) => {
    const group = new THREE.Group();
    const floor = palpate.floats(scene.floor);
    if (floor.length) group.add(segments(floor, palpate.ink("faint"), 0.6));
    const [lo, hi] = scene.bounds;
    const middle = lo.map((v, a) => 0.5 * (v + hi[a]));
    const corner = scene.corner;
    const lines = [];
    for (let a = 0; a < 3; a += 1) {
      const end = [...corner];
      end[a] = corner[a] === lo[a] ? hi[a] : lo[a];
      lines.push(...corner, ...end);
      // Marks and numbers lead away from the body, across the axis.
      const away = new THREE.Vector3(...corner.map((v, b) => (b === a ? 0 : v - middle[b]))).normalize();
      const reach = 0.02 * Math.hypot(...hi.map((v, b) => v - lo[b]));
      const marks = [];
      for (let k = Math.ceil(Math.min(corner[a], end[a]) / scene.tick); k * scene.tick <= Math.max(corner[a], end[a]); k += 1) marks.push(k * scene.tick);
      for (const m of marks) {
        const at = new THREE.Vector3(...corner).setComponent(a, m);
        lines.push(...at.toArray(), ...at.clone().addScaledVector(away, 0.6 * reach).toArray());
        const text = label(palpate.number(Number((m * 1e3).toPrecision(6))), 11, height, fov);
        text.position.copy(at).addScaledVector(away, 1.7 * reach);
        group.add(text);
      }
      const name = label(["x", "y", "z"][a] + " [mm]", 12, height, fov);
      name.userData.first = true;
      // Behind the axis' far end, where no number stands.
      name.position.set(...end);
      name.position.setComponent(a, end[a] + 2.2 * reach * Math.sign(end[a] - corner[a]));
      group.add(name);
    }
    group.add(segments(lines, palpate.ink("ink"), 0.9));
    return group;
  };

  // Points of a few pixels. Each is drawn as if it were nearer by its bias [m]: those inside the body are seen, those behind it are not.
  const points = (places, colour, bias, size) => {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(places, 3));
    geometry.setAttribute("color", new THREE.BufferAttribute(colour, 3));
    geometry.setAttribute("bias", new THREE.BufferAttribute(bias, 1));
    const material = new THREE.PointsMaterial({ size, sizeAttenuation: false, vertexColors: true });
    material.onBeforeCompile = (shader) => {
      shader.vertexShader = shader.vertexShader
        .replace("#include <common>", "#include <common>\nattribute float bias;")
        .replace("#include <project_vertex>", "#include <project_vertex>\nvec4 nearer = mvPosition; nearer.xyz *= max(0.1, 1.0 - bias / length(mvPosition.xyz)); gl_Position = projectionMatrix * nearer;")
      // Round instead of square.
      shader.fragmentShader = shader.fragmentShader.replace("#include <clipping_planes_fragment>", "#include <clipping_planes_fragment>\nif (length(gl_PointCoord - 0.5) > 0.5) discard;");
    };
    return new THREE.Points(geometry, material);
  };

  // Everything else: a white disc in a dark ring where it was measured, a line, and a coloured dot where the model has it.
  const others = (measured, simulated, scale, ratio) => {
    const group = new THREE.Group();
    const count = measured.length / 3;
    const far = new Float32Array(count);
    const ends = new Float32Array(6 * count);
    for (let k = 0; k < count; k += 1) {
      const [a, b] = [measured.subarray(3 * k, 3 * k + 3), simulated.subarray(3 * k, 3 * k + 3)];
      far[k] = Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
      ends.set(a, 6 * k);
      ends.set(b, 6 * k + 3);
    }
    const of = (v) => palpate.residualColour(v / scale);
    const dots = colours(far, of);
    const lines = new THREE.BufferGeometry();
    lines.setAttribute("position", new THREE.BufferAttribute(ends, 3));
    const twice = new Float32Array(6 * count);
    for (let k = 0; k < count; k += 1) twice.set([...dots.subarray(3 * k, 3 * k + 3), ...dots.subarray(3 * k, 3 * k + 3)], 6 * k);
    lines.setAttribute("color", new THREE.BufferAttribute(twice, 3));
    group.add(new THREE.LineSegments(lines, new THREE.LineBasicMaterial({ vertexColors: true, depthTest: false })));
    const size = count > 60 ? 4 : 9;
    const none = new Float32Array(count);
    for (const [colour, pixels, places] of [[[20, 20, 20], size + 4, measured], [[255, 255, 255], size, measured], [null, size * 0.8, simulated]]) {
      const dot = points(places, colour ? colours(far, () => colour) : dots, none, pixels * ratio);
      dot.material.depthTest = false;
      dot.renderOrder = group.children.length;
      group.add(dot);
    }
    return group;
  };

  // One motion at one frame.
  const body = (scene, motion, show, ratio) => {
    const group = new THREE.Group();
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(palpate.floats(motion.vertices), 3));
    geometry.setIndex(new THREE.BufferAttribute(palpate.indices(scene.triangles), 1));
    geometry.computeVertexNormals();
    const residual = palpate.floats(motion.residual);
    const count = geometry.getAttribute("position").count;
    const values = residual.length && show.surface ? residual : new Float32Array(count).fill(NaN);
    const of = (v) => (Number.isFinite(v) ? palpate.residualColour(v / scene.scale) : [196, 196, 190]);
    geometry.setAttribute("color", new THREE.BufferAttribute(colours(values, of), 3));
    const material = new THREE.MeshLambertMaterial({ vertexColors: true, side: THREE.DoubleSide, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 });
    group.add(new THREE.Mesh(geometry, material));
    const places = palpate.floats(motion.points);
    if (places.length && show.points) {
      const distances = palpate.floats(motion.distances);
      // A little darker than the surface, so that they stand out from it.
      const dot = (d) => (Number.isFinite(d) ? palpate.residualColour(d / scene.scale).map((c) => 0.8 * c) : [20, 20, 20]);
      const bias = distances.map((d) => 2 * scene.scale + (Number.isFinite(d) ? Math.abs(d) : 0));
      group.add(points(places, colours(distances, dot), bias, 3 * ratio));
    }
    const measured = palpate.floats(motion.measured);
    if (measured.length && show.points) group.add(others(measured, palpate.floats(motion.simulated), scene.scale, ratio));
    return group;
  };

  // Of texts that would stand in each other's way in a view of this size [pixels] the first stays.
  const thin = (stage, camera, width, height) => {
    const taken = [];
    camera.updateMatrixWorld();
    // Names of axes go before numbers.
    const texts = stage.children.filter((c) => c.isSprite).sort((a, b) => Number(b.userData.first) - Number(a.userData.first));
    for (const text of texts) {
      const at = text.position.clone().project(camera);
      const [x, y] = [(at.x * width) / 2, (at.y * height) / 2];
      const [w, h] = text.userData.size;
      text.visible = taken.every((t) => Math.abs(t[0] - x) > 0.5 * (t[2] + w) + 2 || Math.abs(t[1] - y) > 0.5 * (t[3] + h));
      if (text.visible) taken.push([x, y, w, h]);
    }
  };

  const dispose = (object) => object.traverse((o) => {
    if (o.geometry) o.geometry.dispose();
    if (o.material) {
      if (o.material.map) o.material.map.dispose();
      o.material.dispose();
    }
  });

  return { stage, body, thin, dispose };
})();
