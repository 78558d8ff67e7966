// The view of both rings as solids, drawn by Meshcat; without WebGL a sentence stands in.
"use strict";

const Solid = (() => {
  const pane = document.getElementById("solid"), THREE = MeshCat.THREE;
  const RED = 0xd1242f, KINDS = ["traction", "face", "braking"];
  const unit = 1 / data.solids.radius;  // the scene is drawn with an outer radius of one

  function missing() {
    pane.replaceChildren(); pane.style.cursor = "auto";
    for (const id of ["hint", "home"]) document.getElementById(id).hidden = true;
    const sentence = document.createElement("p");
    sentence.className = "missing";
    sentence.textContent = "This browser shows no 3D graphics (WebGL is off or missing); " +
      "the section and the curves tell the same shift.";
    pane.parentElement.append(sentence);
    pane.dataset.state = "missing";
    return {draw() {}};
  }

  function geometryOf(mesh) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(mesh.vertices, 3));
    geometry.setIndex(mesh.cells);
    const flat = geometry.toNonIndexed();  // a normal for each triangle: flat faces
    flat.computeVertexNormals();
    return flat;
  }

  // Surfaces lie a little behind their edges, so that those are drawn whole.
  const paint = look => new THREE.MeshLambertMaterial(
    {polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1, ...look});

  // A ring in its own frame: dogs about multiples of the pitch, the body behind them.
  function ring(look, mark, dark) {
    const group = new THREE.Group(), line = new THREE.LineBasicMaterial({color: dark});
    const one = geometryOf(data.solids.dog), edges = new THREE.EdgesGeometry(one, 10);
    KINDS.forEach((_, i) => one.addGroup(6 * i, 6, i));
    one.addGroup(18, Infinity, 3);
    const faces = KINDS.map(() => paint(look));
    // One dog of each ring is marked, as in the section.
    const marked = KINDS.map(() => paint({...look, color: mark}));
    const [rest, markedRest] = [paint(look), paint({...look, color: mark})];
    for (let k = 0; k < data.solids.count; k++) {
      const dog = new THREE.Mesh(one, k ? [...faces, rest] : [...marked, markedRest]);
      dog.add(new THREE.LineSegments(edges, line));
      dog.rotation.z = 2 * Math.PI * k / data.solids.count;
      group.add(dog);
    }
    const shape = geometryOf(data.solids.body);
    const body = new THREE.Mesh(shape, rest);
    body.add(new THREE.LineSegments(new THREE.EdgesGeometry(shape, 40), line));
    group.add(body);
    group.scale.setScalar(unit);
    const glow = (material, on, colour) => {
      material.color.set(on ? RED : colour);
      material.emissive.set(on ? 0x8a0d16 : 0x000000);
      material.opacity = on ? 1 : look.opacity ?? 1;
    };
    return {group, touch: names => KINDS.forEach((kind, i) => {
      glow(faces[i], names.includes(kind), look.color);
      glow(marked[i], names.includes(kind), mark);
    })};
  }

  function light(viewer) {
    for (const name of ["PointLightNegativeX", "PointLightPositiveX", "SpotLight"])
      viewer.set_property(["Lights", name], "visible", false);
    const key = new THREE.DirectionalLight(0xffffff, 2.4), fill = new THREE.DirectionalLight(0xffffff, 0.9);
    key.position.set(4, -3, 6); fill.position.set(2, 5, 1);
    viewer.set_object(["Lights", "Key"], key);
    viewer.set_object(["Lights", "FillLight"], fill);
    viewer.set_property(["Lights", "AmbientLight", "<object>"], "intensity", 1.6);
    viewer.renderer.toneMapping = THREE.NoToneMapping;
  }

  function start() {
    let viewer;
    try { viewer = new MeshCat.Viewer(pane); } catch (error) { return missing(); }
    viewer.gui.domElement.style.display = "none";
    for (const name of ["Grid", "Axes", "Background"]) viewer.set_property([name], "visible", false);
    light(viewer);
    const output = ring({color: 0xc8590c}, 0xf5b98a, 0x5e2a06);
    const sliding = ring({color: 0x1f5fa8, transparent: true, opacity: 0.4}, 0x9cc3ee, 0x0e2c4e);
    const carriage = new THREE.Group();  // turns and slides; inside it the ring lies turned over
    sliding.group.rotation.x = Math.PI;
    carriage.add(sliding.group);
    viewer.set_object(["output"], output.group);
    viewer.set_object(["sliding"], carriage);
    const home = () => {
      // Camera positions are given with y along the shaft; x points at dog 0 of the output ring.
      viewer.camera.fov = 24;
      viewer.camera.position.set(3.75, 1.45, 0.5);
      viewer.set_camera_target([0, 0.0, 0]);
      viewer.set_dirty();
    };
    home();
    document.getElementById("home").onclick = home;
    pane.dataset.state = "drawn";
    return {viewer, draw(now, touching) {
      output.group.rotation.z = now.output_place;
      carriage.rotation.z = now.sliding_place;
      carriage.position.z = (data.height + data.gap - now.displacement) * unit;
      for (const one of [output, sliding]) one.touch(touching);
      pane.dataset.pose = [now.output_place, now.sliding_place, carriage.position.z / unit]
        .map(v => v.toFixed(4)).join(" ");
      viewer.set_dirty();
    }};
  }

  // Asked beforehand, because three.js complains on the console where there is none.
  return document.createElement("canvas").getContext("webgl2") ? start() : missing();
})();
