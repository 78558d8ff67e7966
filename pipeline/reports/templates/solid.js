// The view of both rings as solids, drawn by Meshcat; without WebGL a sentence stands in.
"use strict";

const Solid = (() => {
  const pane = document.getElementById("solid"), THREE = MeshCat.THREE, solids = data.solids;
  const RED = 0xd1242f, KINDS = ["traction", "face", "braking"];
  const unit = 1 / solids.outer;  // the scene is drawn with an outer radius of one
  const BODY = 0.11 * solids.outer;  // length of a ring behind its dogs

  function missing() {
    pane.replaceChildren();
    document.getElementById("hint").hidden = true;
    const sentence = document.createElement("p");
    sentence.className = "missing";
    sentence.textContent = "This browser shows no 3D graphics (WebGL is off or missing); " +
      "the section and the curves tell the same shift.";
    pane.parentElement.append(sentence);
    pane.dataset.state = "missing";
    return {draw() {}};
  }

  // A normal for each triangle: flat faces.
  function flat(geometry) {
    const own = geometry.index ? geometry.toNonIndexed() : geometry;
    own.computeVertexNormals();
    return own;
  }

  function dogGeometry() {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(solids.vertices, 3));
    geometry.setIndex(solids.cells);
    const dog = flat(geometry);
    KINDS.forEach((_, i) => dog.addGroup(6 * i, 6, i));
    dog.addGroup(18, Infinity, 3);
    return dog;
  }

  // The body of a ring behind its dogs: its rim turned about the axis, which then becomes z.
  function bodyGeometry() {
    const root = -0.5 * data.height, [inner, outer] = [solids.inner, solids.outer];
    const rim = [[inner, root - BODY], [outer, root - BODY], [outer, root], [inner, root], [inner, root - BODY]];
    const turned = new THREE.LatheGeometry(rim.map(([x, y]) => new THREE.Vector2(x, y)), 12 * solids.count);
    return flat(turned.rotateX(0.5 * Math.PI));
  }

  // A ring in its own frame: dogs about multiples of the pitch, the body behind them.
  function ring(look, mark, dark) {
    const group = new THREE.Group(), line = new THREE.LineBasicMaterial({color: dark});
    // Surfaces lie a little behind their edges, so that those are drawn whole.
    const paint = color => new THREE.MeshLambertMaterial({polygonOffset: true, polygonOffsetFactor: 1,
      polygonOffsetUnits: 1, side: THREE.DoubleSide, ...look, color});
    const solid = (geometry, material, angle) => {
      const mesh = new THREE.Mesh(geometry, material);
      mesh.add(new THREE.LineSegments(new THREE.EdgesGeometry(geometry, angle), line));
      group.add(mesh);
      return mesh;
    };
    const dog = dogGeometry(), rest = paint(look.color);
    const faces = KINDS.map(() => paint(look.color)), marked = KINDS.map(() => paint(mark));
    for (let k = 0; k < solids.count; k++)
      solid(dog, k ? [...faces, rest] : [...marked, paint(mark)], 10)
        .rotation.z = 2 * Math.PI * k / solids.count;
    solid(bodyGeometry(), rest, 40);
    group.scale.setScalar(unit);
    return {group, touch: names => KINDS.forEach((kind, i) => {
      const on = names.includes(kind);
      for (const [material, colour] of [[faces[i], look.color], [marked[i], mark]]) {
        material.color.set(on ? RED : colour);
        material.emissive.set(on ? 0x8a0d16 : 0x000000);
        material.opacity = on ? 1 : look.opacity ?? 1;
      }
    })};
  }

  function start() {
    let viewer;
    try { viewer = new MeshCat.Viewer(pane); } catch (error) { return missing(); }
    viewer.gui.domElement.style.display = "none";
    for (const name of ["Grid", "Axes", "Background"]) viewer.set_property([name], "visible", false);
    for (const [name, strength, place] of [["Key", 2.4, [4, -3, 6]], ["FillLight", 0.9, [2, 5, 1]]]) {
      const light = new THREE.DirectionalLight(0xffffff, strength);
      light.position.set(...place);
      viewer.set_object(["Lights", name], light);
    }
    viewer.set_property(["Lights", "AmbientLight", "<object>"], "intensity", 1.6);
    viewer.renderer.toneMapping = THREE.NoToneMapping;
    const output = ring({color: 0xc8590c}, 0xf5b98a, 0x5e2a06);
    const sliding = ring({color: 0x1f5fa8, transparent: true, opacity: 0.4}, 0x9cc3ee, 0x0e2c4e);
    const carriage = new THREE.Group();  // turns and slides; inside it the ring lies turned over
    sliding.group.rotation.x = Math.PI;
    carriage.add(sliding.group);
    viewer.set_object(["output"], output.group);
    viewer.set_object(["sliding"], carriage);
    // Camera positions are given with y along the shaft; x points at dog 0 of the output ring.
    viewer.camera.fov = 24;
    viewer.camera.position.set(3.75, 1.45, 0.5);
    viewer.set_camera_target([0, 0, 0]);
    pane.dataset.state = "drawn";
    return {viewer, draw(now, touching) {
      carriage.rotation.z = -now.relative_angle;
      carriage.position.z = (data.height + data.gap - now.displacement) * unit;
      for (const one of [output, sliding]) one.touch(touching);
      pane.dataset.pose = [carriage.rotation.z, carriage.position.z / unit].map(v => v.toFixed(4)).join(" ");
      viewer.set_dirty();
    }};
  }

  // Asked beforehand, because three.js complains on the console where there is none.
  return document.createElement("canvas").getContext("webgl2") ? start() : missing();
})();
