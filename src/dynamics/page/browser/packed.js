// What stands in the page as letters: base64 of gzip.
async function unpack(id) {
  const holder = byId(id);
  const letters = atob(holder ? holder.textContent : '');
  const bytes = new Uint8Array(letters.length);
  for (let k = 0; k < letters.length; ++k) bytes[k] = letters.charCodeAt(k);
  if (bytes.length === 0) return bytes;
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Numbers of 16 bits over a range; 65535 stands for none. `block` holds `size` low bytes, then `size` high bytes. */
function widen(block, start, size, from, count, low, high) {
  const out = new Float32Array(count), step = (high - low) / 65534;
  for (let k = 0; k < count; ++k) {
    const number = block[start + from + k] | block[start + size + from + k] << 8;
    out[k] = number === 65535 ? NaN : low + number * step;
  }
  return out;
}

async function loadLibraries() {
  const text = new TextDecoder().decode(await unpack('libraries'));
  if (!text) return false;
  document.head.append(element('script', {}, text));
  return typeof THREE !== 'undefined' && typeof Dygraph !== 'undefined';
}
