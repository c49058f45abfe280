// Ground: a grid under everything, planes and shapes that stand on it; the axes of the scene in its corner.
function buildGround(stage, shapes, colour) {
  const group = stage.groundGroup, {up, centre, size} = stage;
  while (group.children.length) group.remove(group.children[0]);
  const turn = normal => new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(0, 1, 0), normal);
  const addGrid = (normal, at, opacity) => {
    const grid = new THREE.GridHelper(size * 2.4, 24, colour, colour);
    grid.material.transparent = true;
    grid.material.opacity = opacity;
    grid.material.depthWrite = false;
    grid.quaternion.copy(turn(normal));
    grid.position.copy(at);
    group.add(grid);
  };
  let planes = 0;
  for (const shape of shapes) {
    if (shape.normal) {
      const normal = new THREE.Vector3(...shape.normal), at = new THREE.Vector3(...shape.point).sub(centre);
      addGrid(normal, normal.clone().multiplyScalar(normal.dot(at)), 0.5);  // its point next to the middle of the scene
      ++planes;
    } else if (shape.points && shape.triangles.length) {
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute('position', new THREE.BufferAttribute(stage.moved(Float32Array.from(shape.points)), 3));
      geometry.setIndex(shape.triangles);
      group.add(new THREE.Mesh(geometry, new THREE.MeshPhongMaterial({color: 0x9aa3ae, flatShading: true, side: THREE.DoubleSide, transparent: true, opacity: 0.75})));
    }
  }
  if (planes === 0) {
    let low = Infinity;
    for (let k = 0; k < 8; ++k) {
      const {min, max} = stage.box;
      low = Math.min(low, up.dot(new THREE.Vector3(k & 1 ? max.x : min.x, k & 2 ? max.y : min.y, k & 4 ? max.z : min.z)));
    }
    addGrid(up, up.clone().multiplyScalar(low - 0.02 * size), 0.3);
  }
  stage.touch();
}

/** x, y, z and gravity as seen now. */
function drawTriad(svg, stage) {
  const toCamera = new THREE.Matrix4().getInverse(stage.camera.matrixWorld);
  const axes = [['x', '#d5453b', [1, 0, 0]], ['y', '#3a9a4b', [0, 1, 0]], ['z', '#3b76d5', [0, 0, 1]]];
  if (stage.gravity.length() > 0) axes.push(['g', '#8a8f98', stage.gravity.clone().normalize().toArray()]);
  const drawn = axes.map(([name, colour, axis]) => ({name, colour, v: new THREE.Vector3(...axis).transformDirection(toCamera)}));
  drawn.sort((a, b) => a.v.z - b.v.z);
  svg.replaceChildren(...drawn.flatMap(({name, colour, v}) => {
    const make = (tag, attributes) => {
      const made = document.createElementNS('http://www.w3.org/2000/svg', tag);
      for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
      return made;
    };
    const length = name === 'g' ? 22 : 32;
    const line = make('line', {x1: 0, y1: 0, x2: length * v.x, y2: -length * v.y, stroke: colour, 'stroke-width': 3, 'stroke-linecap': 'round',
      ...(name === 'g' ? {'stroke-dasharray': '3 4'} : {})});
    const text = make('text', {x: (length + 9) * v.x, y: -(length + 9) * v.y, fill: colour, 'text-anchor': 'middle', 'dominant-baseline': 'central'});
    text.textContent = name;
    return [line, text];
  }));
}
