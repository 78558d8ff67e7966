// The view of both rings as solids, drawn by Meshcat; without WebGL a sentence stands in.
const Solid = (() => {
  const pane = document.getElementById("solid"), THREE = MeshCat.THREE;
  const [inner, outer] = data.radii, BODY = 0.11 * outer;  // length of a ring behind its dogs

  // A ring in its own frame: dogs about multiples of the pitch, the body behind them.
  function ring(shape, colour, mark, dark, opacity) {
    const group = new THREE.Group(), lines = new THREE.LineBasicMaterial({color: dark});
    function solid(geometry, color, angle) {
      const flat = geometry.index ? geometry.toNonIndexed() : geometry;
      flat.computeVertexNormals();
      // Surfaces lie a little behind their edges, so that those are drawn whole.
      const paint = new THREE.MeshLambertMaterial({color, opacity, transparent: opacity < 1,
        side: THREE.DoubleSide, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1});
      const mesh = new THREE.Mesh(flat, paint);
      mesh.add(new THREE.LineSegments(new THREE.EdgesGeometry(flat, angle), lines));
      group.add(mesh);
      return mesh;
    }
    function surface({vertices, cells}) {
      const dog = new THREE.BufferGeometry();
      dog.setAttribute("position", new THREE.Float32BufferAttribute(vertices, 3));
      dog.setIndex(cells);
      return dog;
    }
    const high = surface(shape), low = shape.low && surface(shape.low);
    for (let k = 0; k < data.count; k++) {
      const dog = k % shape.pitches ? low : high;
      if (dog) solid(dog, k ? colour : mark, 10).rotation.z = 2 * Math.PI * k / data.count;
    }
    // The rim of the body, turned about an axis, which then becomes z.
    const root = -shape.root;
    const rim = [[inner, root - BODY], [outer, root - BODY], [outer, root], [inner, root], [inner, root - BODY]];
    const turned = new THREE.LatheGeometry(rim.map(([x, y]) => new THREE.Vector2(x, y)), 12 * data.count);
    solid(turned.rotateX(0.5 * Math.PI), colour, 40);
    group.scale.setScalar(1 / outer);  // the scene has an outer radius of one
    return group;
  }

  function start() {
    const viewer = new MeshCat.Viewer(pane);
    viewer.gui.domElement.style.display = "none";
    for (const name of ["Grid", "Axes", "Background"]) viewer.set_property([name], "visible", false);
    for (const [name, strength, place] of [["Key", 2.4, [4, -3, 6]], ["FillLight", 0.9, [2, 5, 1]]]) {
      const light = new THREE.DirectionalLight(0xffffff, strength);
      light.position.set(...place);
      viewer.set_object(["Lights", name], light);
    }
    viewer.set_property(["Lights", "AmbientLight", "<object>"], "intensity", 1.6);
    viewer.renderer.toneMapping = THREE.NoToneMapping;
    const output = ring(data.output, 0xc8590c, 0xf5b98a, 0x5e2a06, 1);
    const sliding = ring(data.sliding, 0x1f5fa8, 0x9cc3ee, 0x0e2c4e, 0.4);
    const carriage = new THREE.Group();  // turns and slides; inside it the ring lies turned over
    sliding.rotation.x = Math.PI;
    carriage.add(sliding);
    viewer.set_object(["output"], output);
    viewer.set_object(["sliding"], carriage);
    // Camera positions are given with y along the shaft; x points at dog 0 of the output ring.
    viewer.camera.fov = 24;
    viewer.camera.position.set(3.75, 1.45, 0.5);
    viewer.set_camera_target([0, 0, 0]);
    pane.dataset.state = "drawn";
    pane.viewer = viewer;  // for a script that takes pictures
    return {show(now) {
      const turned = -now.relative_angle_deg * Math.PI / 180, height = data.travel - now.displacement_mm;
      carriage.rotation.z = turned; carriage.position.z = height / outer;
      pane.dataset.pose = [turned, height].map(v => v.toFixed(4)).join(" ");
      viewer.set_dirty();
    }};
  }

  // Asked beforehand, because three.js complains on the console where there is none.
  if (document.createElement("canvas").getContext("webgl2")) return start();
  pane.dataset.state = "missing";
  document.getElementById("hint").textContent = "No 3D graphics in this browser (WebGL is off or missing).";
  return {show() {}};
})();
