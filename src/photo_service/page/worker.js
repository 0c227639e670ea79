// The worker of a page without a server: it holds the module, and makes one photograph at a time.

/** @type {(stage: number, share: number) => void} */
let tell = () => {};
const page = { progress: (/** @type {number} */ stage, /** @type {number} */ share) => tell(stage, share) };

const ready = (async () => {
  const response = await fetch(new URL("noctograph.wasm.gz", import.meta.url));
  if (!response.ok) throw new Error(`noctograph.wasm.gz: ${response.status}`);
  let bytes = await response.arrayBuffer();
  // Compressed, since not every host compresses what it sends; some say so, and it is unpacked.
  if (new Uint8Array(bytes)[0] === 0x1f) {
    const unpacking = new DecompressionStream("gzip");
    const writer = unpacking.writable.getWriter();
    // What goes wrong is told by the reader.
    writer.write(bytes).then(() => writer.close()).catch(() => {});
    bytes = await new Response(unpacking.readable).arrayBuffer();
  }
  const { instance } = await WebAssembly.instantiate(bytes, { page });
  return /** @type {any} */ (instance.exports);
})();

/** Calls a function of the module with a text, and returns how many bytes its answer has. */
async function call(/** @type {string} */ kind, /** @type {string} */ body) {
  const module = await ready;
  const request = new TextEncoder().encode(body);
  // To reserve place may move the memory.
  const place = module.reserve(request.length);
  new Uint8Array(module.memory.buffer, place, request.length).set(request);
  return { module, length: module[kind]() };
}

addEventListener("message", async ({ data: { kind, body } }) => {
  // Where there is no module, the first job says so.
  if (kind === "base") return call(kind, body).catch(() => {});
  try {
    let told = -1;
    tell = (stage, share) => {
      const done = Math.floor(20 * (stage ? 0.7 + 0.3 * share : 0.7 * share)) / 20;
      if (done !== told) postMessage({ done });
      told = done;
    };
    const { module, length } = await call(kind, body);
    const answer = new Uint8Array(module.memory.buffer, module.output(), length);
    postMessage({ answer: JSON.parse(new TextDecoder().decode(answer)), memory: module.memory.buffer.byteLength });
  } catch (error) {
    postMessage({ broken: String(error) });
  }
});
