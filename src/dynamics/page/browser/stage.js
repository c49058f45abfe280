// The scene on the canvas: camera, lights, bodies, ground.
class Stage {
  constructor(canvas, film, gravity) {
    this.film = film;
    this.hidden = new Set();
    this.renderer = new THREE.WebGLRenderer({canvas, antialias: true, alpha: true, preserveDrawingBuffer: true});
    this.renderer.localClippingEnabled = true;
    this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio || 1));
    this.world = new THREE.Scene();
    this.clip = [];
    const g = new THREE.Vector3(...gravity);
    this.up = g.length() > 0 ? g.clone().normalize().negate() : new THREE.Vector3(0, 0, 1);
    this.gravity = g;
  }

  /** Looks at a box of the places that the bodies take in the run. */
  async measure() {
    const box = new THREE.Box3(), {film} = this, point = new THREE.Vector3();
    const stride = Math.max(1, Math.ceil(film.frames.length / 16));
    const add = points => { for (let k = 0; k < points.length; k += 3) if (Number.isFinite(points[k] + points[k + 1] + points[k + 2])) box.expandByPoint(point.set(points[k], points[k + 1], points[k + 2])); };
    if (film.frames.length === 0) add(film.rest);
    for (let k = 0; k < film.frames.length; k += stride) add(film.place(await film.frame(k)));
    if (box.isEmpty()) box.set(new THREE.Vector3(-1, -1, -1), new THREE.Vector3(1, 1, 1));
    this.centre = box.getCenter(new THREE.Vector3());
    this.extent = box.getSize(new THREE.Vector3());
    this.size = Math.max(this.extent.x, this.extent.y, this.extent.z) || 1;
    this.box = box.translate(this.centre.clone().negate());
  }

  build() {
    const {film, world} = this;
    const camera = this.camera = new THREE.PerspectiveCamera(24, 1, this.size / 100, this.size * 100);
    camera.up.copy(this.up);
    const light = new THREE.DirectionalLight(0xffffff, 0.62);
    light.position.set(0.4, 0.7, 1);
    camera.add(light);
    world.add(camera, new THREE.HemisphereLight(0xffffff, 0x8a8f98, 0.56));
    this.surface = dividedAtCreases(film);
    const {pointOf} = this.surface;
    this.geometry = new THREE.BufferGeometry();
    this.geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array(3 * pointOf.length), 3));
    this.geometry.setAttribute('normal', new THREE.BufferAttribute(new Float32Array(3 * pointOf.length), 3));
    this.geometry.setAttribute('uv', new THREE.BufferAttribute(new Float32Array(2 * pointOf.length), 2));
    this.material = new THREE.MeshPhongMaterial({map: colourTexture(), specular: 0x1c1c1c, shininess: 24, side: THREE.DoubleSide,
      polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1});
    this.mesh = new THREE.Mesh(this.geometry, this.material);
    this.places = new THREE.BufferAttribute(new Float32Array(3 * film.points), 3);  // of points: lines, dots
    this.lineGeometry = new THREE.BufferGeometry().setAttribute('position', this.places);
    this.lines = new THREE.LineSegments(this.lineGeometry, new THREE.LineBasicMaterial({transparent: true, opacity: 0.28}));
    this.bareGeometry = new THREE.BufferGeometry().setAttribute('position', this.places);
    this.bare = new THREE.LineSegments(this.bareGeometry, new THREE.LineBasicMaterial({color: 0x5b83b5}));
    this.dotGeometry = new THREE.BufferGeometry().setAttribute('position', this.places);
    this.dots = new THREE.Points(this.dotGeometry, new THREE.PointsMaterial({size: 9, sizeAttenuation: false, color: 0xd2691e}));
    this.ghostGeometry = new THREE.BufferGeometry().setAttribute('position', new THREE.BufferAttribute(this.moved(film.rest), 3));
    this.ghost = new THREE.Mesh(this.ghostGeometry, new THREE.MeshBasicMaterial({color: 0x7f8b99, transparent: true, opacity: 0.2, depthWrite: false, side: THREE.DoubleSide}));
    this.ghost.visible = false;
    for (const object of [this.mesh, this.lines, this.bare, this.dots, this.ghost]) { object.frustumCulled = false; world.add(object); }
    this.groundGroup = new THREE.Group();
    world.add(this.groundGroup);
    this.controls = new THREE.OrbitControls(camera, this.renderer.domElement);
    this.controls.enableKeys = false;
    this.controls.addEventListener('change', () => this.touch());
    this.time = film.times.length ? film.times[0] : 0;
    this.indexBodies();
    this.viewFrom(this.bestSide());
  }

  /** Coordinates about the middle of the scene. */
  moved(points) {
    const out = new Float32Array(points.length), c = [this.centre.x, this.centre.y, this.centre.z];
    for (let k = 0; k < points.length; ++k) out[k] = Number.isFinite(points[k]) ? points[k] - c[k % 3] : 0;  // states that are no numbers have a page, too
    return out;
  }

  /** Triangles, lines and dots of the bodies that are not hidden. */
  indexBodies() {
    const {film, hidden} = this, shown = k => !hidden.has(film.bodyOf[k]);
    const faces = [], flat = [], lines = [], bare = [], inFace = new Uint8Array(film.points), joined = new Uint8Array(film.points);
    for (let c = 0; c < film.triangles.length; ++c) inFace[film.triangles[c]] = 1;
    for (let c = 0; c < film.triangles.length; c += 3) {
      if (!film.isSeen(c / 3, this.time)) continue;
      if (!shown(film.triangles[c])) continue;
      for (let i = c; i < c + 3; ++i) { faces.push(this.surface.vertex[i]); flat.push(film.triangles[i]); }
    }
    for (let k = 0; k < film.edges.length; k += 2) {
      const [a, b] = [film.edges[k], film.edges[k + 1]];
      joined[a] = joined[b] = 1;
      if (!film.isEdgeSeen(k / 2, this.time)) continue;
      if (shown(a)) (inFace[a] && inFace[b] ? lines : bare).push(a, b);
    }
    const dots = [];
    for (let k = 0; k < film.points; ++k) if (!inFace[k] && !joined[k] && shown(k)) dots.push(k);
    this.geometry.setIndex(faces);
    this.ghostGeometry.setIndex(flat);
    this.lineGeometry.setIndex(lines);
    this.bareGeometry.setIndex(bare);
    this.dotGeometry.setIndex(dots);
    this.mesh.visible = faces.length > 0;
    this.bare.visible = bare.length > 0;
    this.dots.visible = dots.length > 0;
    this.touch();
  }

  /** The time that is shown: of bodies whose elements fail, other faces may be seen then. */
  setTime(t) {
    if (!this.film.seen || this.time === t) return;
    this.time = t;
    this.indexBodies();
  }

  /** @param points global coordinates @param colours {row, share of each point} or null: those of the bodies */
  show(points, colours) {
    const moved = this.moved(points), {pointOf, vertex} = this.surface, {position, normal, uv} = this.geometry.attributes;
    this.places.array.set(moved);
    this.places.needsUpdate = true;
    for (let k = 0; k < pointOf.length; ++k) {
      const point = pointOf[k];
      for (let i = 0; i < 3; ++i) position.array[3 * k + i] = moved[3 * point + i];
      const share = colours ? colours.share[point] : NaN;
      if (Number.isFinite(share)) {
        uv.array[2 * k] = (0.5 + 255 * Math.min(1, Math.max(0, share))) / 256;
        uv.array[2 * k + 1] = kRows[colours.row];
      } else {
        uv.array[2 * k] = colours ? (kNoValue + 0.5) / 256 : ofBody(this.film.bodyOf[point]);
        uv.array[2 * k + 1] = kRows.bodies;
      }
    }
    renewNormals(vertex, position.array, normal.array);
    for (const attribute of [position, normal, uv]) attribute.needsUpdate = true;
    this.geometry.boundingSphere = null;
    this.touch();
  }

  bestSide() {
    const extent = ['x', 'y', 'z'].map(axis => this.extent[axis]), most = Math.max(...extent);
    const thin = extent.indexOf(Math.min(...extent)), upright = [this.up.x, this.up.y, this.up.z].map(Math.abs);
    return extent[thin] < 0.25 * most && upright[thin] < 0.5 ? ['x', 'y', 'z'][thin] : 'corner';
  }

  /** From a side: x, y, z, -x, -y, -z, or a corner. */
  viewFrom(side) {
    const sign = side.startsWith('-') ? -1 : 1, axis = side.replace('-', '');
    let from = new THREE.Vector3(1, -1.6, 0.9);
    if (axis !== 'corner') from = new THREE.Vector3(axis === 'x' ? sign : 0, axis === 'y' ? -sign : 0, axis === 'z' ? sign : 0);
    else from.applyQuaternion(new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(0, 0, 1), this.up));
    if (Math.abs(from.clone().normalize().dot(this.up)) > 0.999) {  // from above: a little aside, so that up is known
      const aside = Math.abs(this.up.y) < 0.9 ? new THREE.Vector3(0, 1, 0) : new THREE.Vector3(0, 0, 1);
      from.addScaledVector(aside, -1e-3 * Math.sign(from.dot(this.up)));
    }
    this.camera.position.copy(from.normalize().multiplyScalar(this.size * 4));
    this.controls.target.set(0, 0, 0);
    this.fit();
  }

  /** Moves the camera along its view until the whole box is seen. */
  fit() {
    const {camera, controls} = this;
    this.resize();
    const back = camera.position.clone().sub(controls.target).normalize();
    controls.target.set(0, 0, 0);
    camera.position.copy(back.clone().multiplyScalar(this.size));
    camera.lookAt(controls.target);
    camera.updateMatrix();
    const right = new THREE.Vector3().setFromMatrixColumn(camera.matrix, 0), top = new THREE.Vector3().setFromMatrixColumn(camera.matrix, 1);
    const tall = Math.tan(camera.fov * Math.PI / 360), wide = tall * camera.aspect;
    let distance = 1e-3 * this.size;
    for (let k = 0; k < 8; ++k) {
      const {min, max} = this.box;
      const corner = new THREE.Vector3(k & 1 ? max.x : min.x, k & 2 ? max.y : min.y, k & 4 ? max.z : min.z);
      const near = corner.dot(back);
      distance = Math.max(distance, near + Math.abs(corner.dot(right)) / wide, near + Math.abs(corner.dot(top)) / tall);
    }
    camera.position.copy(back.multiplyScalar(1.1 * distance));
    controls.update();
    this.touch();
  }

  resize() {
    const {clientWidth, clientHeight} = this.renderer.domElement;
    if (clientWidth === 0 || clientHeight === 0) return;
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.camera.aspect = clientWidth / clientHeight;
    this.camera.updateProjectionMatrix();
    this.touch();
  }

  setClip(axis, share, turned) {
    this.clip = [];
    if (axis !== '') {
      const name = ['x', 'y', 'z'][axis], {min, max} = this.box, at = min[name] + share * (max[name] - min[name]), sign = turned ? -1 : 1;
      const normal = new THREE.Vector3();
      normal[name] = -sign;
      this.clip = [new THREE.Plane(normal, sign * at)];
    }
    for (const object of [this.mesh, this.lines, this.ghost, this.bare]) object.material.clippingPlanes = this.clip;
    this.touch();
  }

  touch() {
    if (this.due) return;
    this.due = true;
    requestAnimationFrame(() => this.draw());
  }

  draw() {
    this.due = false;
    const distance = this.camera.position.distanceTo(this.controls.target);
    this.camera.near = Math.max(1e-3 * this.size, distance - 3 * this.size);
    this.camera.far = distance + 8 * this.size;
    this.camera.updateProjectionMatrix();
    this.renderer.render(this.world, this.camera);
    if (this.ondraw) this.ondraw();
  }

  /** Place on the canvas of a global point, and whether it is before the camera. */
  project(x, y, z) {
    const v = new THREE.Vector3(x, y, z).sub(this.centre).project(this.camera), canvas = this.renderer.domElement;
    return {x: (v.x + 1) / 2 * canvas.clientWidth, y: (1 - v.y) / 2 * canvas.clientHeight, seen: v.z < 1};
  }

  /** The point of a body under a place of the canvas; -1: there is none. */
  pointUnder(x, y) {
    const canvas = this.renderer.domElement, ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2(2 * x / canvas.clientWidth - 1, 1 - 2 * y / canvas.clientHeight), this.camera);
    const hits = this.mesh.visible ? ray.intersectObject(this.mesh) : [];
    const hit = hits.find(h => this.clip.every(plane => plane.distanceToPoint(h.point) >= 0));
    let best = -1, least = 12;
    if (hit) {
      const position = this.geometry.attributes.position.array;
      least = Infinity;
      for (const vertex of [hit.face.a, hit.face.b, hit.face.c]) {
        const far = Math.hypot(position[3 * vertex] - hit.point.x, position[3 * vertex + 1] - hit.point.y, position[3 * vertex + 2] - hit.point.z);
        if (far < least) { least = far; best = this.surface.pointOf[vertex]; }
      }
      return best;
    }
    const loose = [...(this.dotGeometry.index ? this.dotGeometry.index.array : []), ...(this.bareGeometry.index ? this.bareGeometry.index.array : [])];
    for (const k of loose) {
      const p = this.places.array, at = this.project(p[3 * k] + this.centre.x, p[3 * k + 1] + this.centre.y, p[3 * k + 2] + this.centre.z);
      const far = Math.hypot(at.x - x, at.y - y);
      if (at.seen && far < least) { least = far; best = k; }
    }
    return best;
  }
}
