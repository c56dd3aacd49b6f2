// Arrays that Python compressed by gzip and wrote in base64; see workbench.reports.replay.packing.

const KINDS = { f4: Float32Array, f8: Float64Array, u2: Uint16Array, u4: Uint32Array };

async function unpacked(data) { // the same data, with arrays of numbers in place of their texts
  if (Array.isArray(data)) return Promise.all(data.map(unpacked));
  if (data === null || typeof data !== "object") return data;
  if (typeof data.gzip === "string" && data.kind in KINDS) {
    const bytes = Uint8Array.from(atob(data.gzip), letter => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new KINDS[data.kind](await new Response(stream).arrayBuffer());
  }
  const values = await Promise.all(Object.values(data).map(unpacked));
  return Object.fromEntries(Object.keys(data).map((name, i) => [name, values[i]]));
}
