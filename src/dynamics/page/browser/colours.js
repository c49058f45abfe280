// Colours of fields and bodies, and the picture that the scene takes them from.
const kMap = [[48, 18, 59], [65, 69, 171], [70, 117, 237], [57, 162, 252], [27, 207, 212], [36, 236, 166], [97, 252, 108],
  [164, 252, 60], [209, 232, 52], [243, 198, 58], [254, 155, 45], [243, 99, 21], [217, 56, 6], [177, 25, 1], [122, 4, 2]];  // Turbo
const kSigned = [[33, 102, 172], [103, 169, 207], [209, 229, 240], [247, 247, 247], [253, 219, 199], [239, 138, 98], [178, 24, 43]];
const kBodies = [[126, 148, 173], [196, 144, 92], [118, 164, 120], [176, 122, 152], [160, 152, 98], [104, 160, 172], [186, 118, 108],
  [134, 130, 186], [150, 150, 150], [98, 138, 128], [202, 170, 118], [148, 112, 96]];
const kNoValue = 255;  // place in the row of bodies

function mapped(stops, share) {
  const place = Math.min(1, Math.max(0, share)) * (stops.length - 1), k = Math.min(stops.length - 2, Math.floor(place));
  return stops[k].map((from, i) => Math.round(from + (place - k) * (stops[k + 1][i] - from)));
}
const bodyColour = k => kBodies[k % kBodies.length];
const css = rgb => `rgb(${rgb.join(',')})`;
const gradient = stops => `linear-gradient(to top, ${stops.map(css).join(', ')})`;

/** Rows of 256: the map of a field, the map of a signed one, the bodies. */
function colourTexture() {
  const data = new Uint8Array(4 * 256 * 4);
  for (let k = 0; k < 256; ++k) {
    const rows = [mapped(kMap, k / 255), mapped(kSigned, k / 255), k === kNoValue ? [150, 150, 150] : bodyColour(k), [0, 0, 0]];
    rows.forEach((rgb, row) => data.set([...rgb, 255], 4 * (256 * row + k)));
  }
  const texture = new THREE.DataTexture(data, 256, 4, THREE.RGBAFormat);
  texture.magFilter = texture.minFilter = THREE.LinearFilter;
  texture.needsUpdate = true;
  return texture;
}
const kRows = {plain: 0.125, signed: 0.375, bodies: 0.625};  // middles of the rows
const ofBody = k => ((k % 250) + 0.5) / 256;
