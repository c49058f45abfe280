// Joints, and arrows of forces and moments.
const kMarkColours = {joint: 0xe0a100, force: 0xd2362b, contact: 0x8a3ffc, moment: 0x00897b, support: 0x2e9e5b};

class Marks {
  constructor(stage, film, marks) {
    Object.assign(this, {stage, film, marks, scale: 1, joints: true, forces: true, moments: false});
    const crowd = Math.min(1, Math.sqrt(60 / Math.max(1, marks.length)));  // very many are small
    this.size = 0.018 * stage.size * crowd;
    this.reach = 0.22 * stage.size * crowd;
    this.most = this.largest('force');
    this.mostMoment = this.largest('moment');
    const shapes = {ball: new THREE.SphereBufferGeometry(0.7, 14, 10), pin: new THREE.CylinderBufferGeometry(0.55, 0.55, 3, 14),
      block: new THREE.BoxBufferGeometry(1.2, 2.6, 1.2), cube: new THREE.BoxBufferGeometry(1.3, 1.3, 1.3), foot: new THREE.ConeBufferGeometry(1.1, 1.6, 4)};
    this.glyphs = Object.entries(shapes).map(([name, geometry]) => ({name, mesh: this.many(geometry, kMarkColours[name === 'foot' ? 'support' : 'joint'], marks.length)}));
    shapes.foot.translate(0, -0.8, 0);  // the tip is the place
    const shaft = new THREE.CylinderBufferGeometry(0.22, 0.22, 1, 10), head = new THREE.ConeBufferGeometry(0.62, 1.7, 14);
    shaft.translate(0, 0.5, 0);
    head.translate(0, -0.85, 0);  // the tip is the origin
    this.arrows = ['joint', 'force', 'contact', 'moment', 'support'].map(kind => ({kind,
      shaft: this.many(shaft, kMarkColours[kind], marks.length), head: this.many(head, kMarkColours[kind], 2 * marks.length)}));
    this.springs = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({color: kMarkColours.force}));
    this.springs.frustumCulled = false;
    stage.world.add(this.springs);
  }

  many(geometry, color, count) {
    const mesh = new THREE.InstancedMesh(geometry, new THREE.MeshPhongMaterial({color, shininess: 40, depthTest: false, transparent: true, opacity: 0.9}), Math.max(1, count));
    mesh.frustumCulled = false;
    mesh.renderOrder = 2;  // over the bodies, which joints are inside of
    mesh.count = 0;
    this.stage.world.add(mesh);
    return mesh;
  }

  /** Of a section over the run, from the ranges of its numbers. */
  largest(section) {
    const k = this.film.scene.sections.findIndex(([name]) => name === section);
    return this.film.frames.reduce((most, frame) => Math.max(most, Math.abs(frame.ranges[2 * k]), Math.abs(frame.ranges[2 * k + 1])), 0);
  }

  static glyphOf(mark) {
    const kind = mark.kind;
    if (mark.what === 'support') return 'foot';
    if (mark.what !== 'joint') return '';
    if (/revolute|cylindrical|rotation|screw|gear pair|worm/.test(kind)) return 'pin';
    if (/prismatic|translation|planar|in plane|rack pair/.test(kind)) return 'block';
    return /fixed/.test(kind) ? 'cube' : 'ball';
  }

  show(rows) {
    this.rows = rows;
    const counts = new Map(), {stage, size} = this, c = stage.centre;
    for (const {mesh} of this.glyphs) counts.set(mesh, 0);
    for (const {shaft, head} of this.arrows) { counts.set(shaft, 0); counts.set(head, 0); }
    const addMatrix = (mesh, matrix) => { const k = counts.get(mesh); mesh.setMatrixAt(k, matrix); counts.set(mesh, k + 1); };
    const vector = (name, k) => new THREE.Vector3(rows[name][3 * k], rows[name][3 * k + 1], rows[name][3 * k + 2]);
    const upright = new THREE.Vector3(0, 1, 0), springs = [];
    const arrow = (kind, from, v, most, heads) => {
      if (!(v.length() > 1e-4 * most) || !(most > 0) || !Number.isFinite(from.x + v.x)) return;
      const length = this.reach * this.scale * v.length() / most, turn = new THREE.Quaternion().setFromUnitVectors(upright, v.clone().normalize());
      const {shaft, head} = this.arrows.find(a => a.kind === kind), thick = 0.5 * size * Math.min(1, Math.max(0.25, length / (6 * size)));
      const tip = from.clone().addScaledVector(v.clone().normalize(), length);
      addMatrix(shaft, new THREE.Matrix4().compose(from, turn, new THREE.Vector3(thick, Math.max(1e-6 * size, length - 1.7 * thick), thick)));
      for (let k = 0; k < heads; ++k) addMatrix(head, new THREE.Matrix4().compose(tip.clone().addScaledVector(v.clone().normalize(), -1.1 * k * thick), turn, new THREE.Vector3(thick, thick, thick)));
    };
    this.marks.forEach((mark, k) => {
      let at = vector('b', k).sub(c);
      const from = vector('a', k).sub(c), axis = vector('axis', k), force = vector('force', k);
      if (mark.what === 'contact' && force.length() > 0) at.addScaledVector(force.clone().normalize(), -at.dot(force.clone().normalize()));
      const glyph = Marks.glyphOf(mark);
      if (this.joints && glyph && Number.isFinite(at.x)) {
        const turn = new THREE.Quaternion().setFromUnitVectors(upright, axis.length() > 0.5 ? axis.normalize() : glyph === 'foot' ? stage.up : upright);
        addMatrix(this.glyphs.find(g => g.name === glyph).mesh, new THREE.Matrix4().compose(at, turn, new THREE.Vector3(size, size, size)));
      }
      if (this.joints && from.distanceTo(at) > 1e-3 * stage.size && /spring|bushing|distance|link|revolute-spherical|cable/.test(mark.kind))
        springs.push(...(/spring|bushing/.test(mark.kind) ? coil(from, at, size) : [from, at]));
      for (let end = 3; this.joints && mark.path && end < mark.path.length; end += 3)
        for (const i of [end - 3, end]) springs.push(new THREE.Vector3(mark.path[i], mark.path[i + 1], mark.path[i + 2]).sub(c));
      if (this.forces) arrow(mark.what, at, force, this.most, 1);
      if (this.moments) arrow('moment', at, vector('moment', k), this.mostMoment, 2);
    });
    for (const [mesh, count] of counts) { mesh.count = count; mesh.visible = count > 0; mesh.instanceMatrix.needsUpdate = true; }
    this.springs.geometry.dispose();
    this.springs.geometry = new THREE.BufferGeometry().setFromPoints(springs);
    this.springs.visible = springs.length > 0;
    stage.touch();
  }

  /** The mark under a place of the canvas, or null. */
  under(x, y) {
    if (!this.rows || !this.joints) return null;
    let best = null, least = 11;
    this.marks.forEach((mark, k) => {
      const at = this.stage.project(this.rows.b[3 * k], this.rows.b[3 * k + 1], this.rows.b[3 * k + 2]);
      const far = Math.hypot(at.x - x, at.y - y);
      if (at.seen && far < least) { least = far; best = k; }
    });
    return best;
  }
}

/** A zigzag line between two points, as segments. */
function coil(from, to, size) {
  const along = to.clone().sub(from), side = new THREE.Vector3(0, 0, 1).cross(along);
  if (side.length() < 1e-6 * along.length()) side.set(1, 0, 0).cross(along);
  side.normalize().multiplyScalar(0.7 * size);
  const points = [from.clone()];
  for (let k = 1; k < 12; ++k) points.push(from.clone().addScaledVector(along, (k + 1) / 14).addScaledVector(side, k % 2 ? 1 : -1));
  points.push(to.clone());
  return points.flatMap((p, k) => k ? [points[k - 1], p] : []);
}
